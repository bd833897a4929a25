"""Defects: numbers that a version of JAX gets wrong, and what sets them right before it starts.

It knows released versions only, and changes nothing for any other.
"""

import os
from importlib.metadata import version

FLAGS = {"0.10.2": "--xla_cpu_experimental_ynn_fusion_type="}
"""Version of jaxlib → what XLA is told. A version that does not know a flag ends the process.

0.10.2: on CPUs, rows from 16,385 on of vmapped products with a matrix that are then summed (jax#39103).
"""


def mend() -> None:
    """Tell XLA to compile what its version gets wrong in another way; in vain where JAX has compiled already."""
    flag = FLAGS.get(version("jaxlib"))
    said = os.environ.get("XLA_FLAGS", "")
    if flag is not None and flag.rstrip("=") not in said:
        os.environ["XLA_FLAGS"] = f"{said} {flag}".strip()
