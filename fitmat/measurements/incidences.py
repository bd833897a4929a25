"""Incidences: which samples were lit from the same angle, for whatever is told angle by angle.

Only directions count here; values, noise and models do not.
"""

import dataclasses

import numpy as np
from jaxtyping import Bool, Float

from fitmat.maths.directions import zenith
from fitmat.text import brief

MOST = 12
"""More angles than this are taken together, neighbours first, to so many groups."""

SAME_DEG = 0.1
"""Angles that agree to this are one."""


@dataclasses.dataclass(frozen=True, eq=False)
class Incidence:
    """Samples lit from one angle, or from a few neighbouring ones.

    Attributes:
        name: "60°", or "10–20°" where angles are taken together.
        theta_i_deg: Their mean angle in degrees.
        rows: Which samples, (k,).
    """

    name: str
    theta_i_deg: float
    rows: np.ndarray

    __repr__ = brief


def incidences(
    wi: Float[np.ndarray, "n 3"], used: Bool[np.ndarray, " n"], most: int | None = MOST
) -> tuple[Incidence, ...]:
    """The samples by angle of incidence, rising.

    Args:
        wi: Unit vectors to the light, (n, 3).
        used: Which samples count, (n,).
        most: At most so many groups; None for as many as there are angles.

    Example:
        >>> import numpy as np
        >>> [i.name for i in incidences(np.array([[0.0, 0, 1], [0.6, 0, 0.8]]), np.array([True, True]))]
        ['0°', '36.9°']
    """
    rows = np.flatnonzero(used)
    degrees = np.rad2deg(zenith(wi[rows]))
    step = np.round(degrees / SAME_DEG).astype(int)
    order = np.argsort(step, kind="stable")
    angles, first = np.unique(step[order], return_index=True)
    count = len(angles) if most is None else min(most, len(angles))
    found = []
    for group in np.array_split(np.arange(len(angles)), count) if count else []:
        ends = SAME_DEG * angles[group[0]], SAME_DEG * angles[group[-1]]
        name = f"{ends[0]:.4g}°" if len(group) == 1 else f"{ends[0]:.4g}–{ends[1]:.4g}°"
        inside = order[first[group[0]] : np.append(first, len(order))[group[-1] + 1]]
        found.append(Incidence(name, float(np.round(degrees[inside].mean(), 6)), rows[np.sort(inside)]))
    return tuple(found)


def incidence_range(wi: Float[np.ndarray, "n 3"], used: Bool[np.ndarray, " n"]) -> tuple[float, float]:
    """Smallest and largest angle of incidence of the samples that count, radians; not both 0 only if there are any."""
    angles = zenith(wi[used])
    return float(angles.min(initial=np.pi / 2)), float(angles.max(initial=0.0))
