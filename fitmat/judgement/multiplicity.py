"""Multiplicity: what a p-value is worth where many are looked at.

It tests nothing itself.
"""

import numpy as np
from jaxtyping import Float


def adjusted_for_many(p: Float[np.ndarray, " q"]) -> Float[np.ndarray, " q"]:
    """p-values of which, if all were chance, any is at most α with probability at most α (Holm 1979).

    Example:
        >>> import numpy as np
        >>> adjusted_for_many(np.array([0.03, 0.01])).tolist()
        [0.03, 0.02]
    """
    order = np.argsort(p)
    raised = np.maximum.accumulate(p[order] * (len(p) - np.arange(len(p))))
    adjusted = np.empty_like(p)
    adjusted[order] = np.minimum(raised, 1.0)
    return adjusted
