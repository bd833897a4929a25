"""Known defects of JAX: the numbers are right where fitmat starts it, and those of fitmat do not depend on blocks."""

import os
import subprocess
import sys
from importlib.metadata import version

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import fitmat as fm
from fitmat.maths import defects
from fitmat.maths.defects import FLAGS, mend
from fitmat.models.base import evaluate_pairs
from fitmat.models.registry import LOBES

ROWS = 20_000
"""More than 16,384, from which the known defect shows, and no multiple of any block."""

REPRODUCER = """
import jax, jax.numpy as jnp
jax.config.update("jax_enable_x64", True)
i = jnp.arange(40_000.0)
x = jnp.stack((i, jnp.zeros_like(i), jnp.zeros_like(i)), axis=1)
found = jax.jit(jax.vmap(lambda row: jnp.sum((jnp.eye(3) @ row) ** 2)))(x)
print(int((found != i**2).sum()))
"""
"""The squares of 0 … 39,999 by a product with the identity (jax#39103)."""


def wrong(first: str, monkeypatch: pytest.MonkeyPatch) -> int:
    """How many squares are wrong in a process of its own that begins with a line."""
    monkeypatch.delenv("XLA_FLAGS", raising=False)
    ended = subprocess.run([sys.executable, "-c", first + REPRODUCER], capture_output=True, text=True, check=True)
    return int(ended.stdout)


def test_the_known_defect_is_mended_where_fitmat_starts_jax(monkeypatch: pytest.MonkeyPatch) -> None:
    assert wrong("import fitmat.maths.programs", monkeypatch) == 0


def test_the_known_defect_is_in_the_versions_that_are_named(monkeypatch: pytest.MonkeyPatch) -> None:
    assert (wrong("", monkeypatch) > 0) == (version("jaxlib") in FLAGS)


@pytest.mark.parametrize("said", ["", "--xla_cpu_multi_thread_eigen=false"])
def test_flags_of_the_user_stay(said: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(defects, "version", lambda name: "0.10.2")
    monkeypatch.setenv("XLA_FLAGS", said)
    mend()
    mend()
    assert os.environ["XLA_FLAGS"] == f"{said} {FLAGS['0.10.2']}".strip()


def test_a_version_that_may_not_know_the_flag_is_not_told_it(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(defects, "version", lambda name: "0.10.1")
    monkeypatch.setenv("XLA_FLAGS", "")
    mend()
    assert os.environ["XLA_FLAGS"] == ""


@pytest.mark.study
@pytest.mark.parametrize("lobe", LOBES)
def test_values_of_many_rows_are_those_of_few(lobe: str, hemisphere) -> None:
    """Values and gradients of 20,000 rows in one program, beside blocks of 4,000."""
    wi, wo = (jnp.asarray(hemisphere(ROWS, seed)) for seed in (1, 2))
    model = fm.model(f"{lobe}-over-lambert" if LOBES[lobe].kind == "cover" else lobe)
    whole = np.asarray(jax.jit(evaluate_pairs)(model, wi, wo))
    few = jax.jit(evaluate_pairs)
    parts = [np.asarray(few(model, wi[k : k + 4_000], wo[k : k + 4_000])) for k in range(0, ROWS, 4_000)]
    np.testing.assert_allclose(whole, np.concatenate(parts), rtol=1e-12, atol=1e-14)  # another order of sums
