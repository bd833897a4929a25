"""Alikeness: whether the errors of neighbouring angles are alike, and how much larger the noise then is than it looks.

Errors that drift along a curve pass for the curve between close neighbours, and show between distant ones. It looks at
the data only, and changes no value.
"""

from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from fitmat.measurements.neighbours import curves, spacing
from fitmat.measurements.samples import Measurements

STRIDES = (2, 3, 4, 6, 8)
"""In which each so-many-th angle is a neighbour."""

FARTHEST = np.deg2rad(8.1)
"""Largest step of a stride: a diffuse base and the tail of a lobe are no cubic over more."""

GENTLE = 1.5
"""Ratio of the values along a stencil up to which what is left over is noise."""

FEWEST = 60
"""Comparisons that a stride must have."""

MOST = 20_000
"""Values that are looked at."""

ASKED = 2.6
"""Standard errors by which more scatter at longer strides is not chance."""

LEAST_STRIDES = 3
"""Strides that must show it: by one alone it is not told from a curve that bends."""

SMALLEST = 0.15
"""Mean of ln(scatter at a stride/scatter of neighbours) below which errors count as independent: ρ of about 0.2."""

SPREAD = 1.0
"""Standard deviation of that mean, of independent errors, times the root of the number of comparisons; simulated at
steps of 1 and 2°: 0.5 to 1.3."""

EVEN = 1.05
"""Ratio of the gaps along a stencil up to which its steps are even."""

NOISY = 6.0
"""Standard deviations by which values of one level may differ."""

_NEAR = np.array([-2, -1, 0, 1, 2])
_RHO = np.linspace(0.0, 0.85, 86)
# Correlations of one step that are tried; beyond, the noise would be a multiple of all that is seen.
_STENCIL = np.array([70.0, -56.0, 28.0, -8.0, 1.0]) / 36.0
# Of y₋₂ − 4y₋₁ + 6y₀ − 4y₁ + y₂ over 6, the error of the cubic between even steps: its own correlation at lags 0 to 4.


class Alike(NamedTuple):
    """What the errors of neighbours have in common.

    Attributes:
        rho: Correlation of one step of a first-order autoregressive process; 0 where none is found.
        larger: Standard deviation of the noise over that which neighbours show.
        judged: Whether the angles are close enough to tell.
    """

    rho: float
    larger: float
    judged: bool = True


INDEPENDENT, NOT_JUDGED = Alike(0.0, 1.0), Alike(0.0, 1.0, judged=False)


def alike(m: Measurements, laws: Float[np.ndarray, "c 2"]) -> Alike:
    """The correlation of errors along the curves.

    The error of the cubic through a value's neighbours has the variance V(ρ) of `stencil_variance` under an AR(1) of
    correlation ρ a step, and V(ρᵏ) where each k-th angle is a neighbour: independent errors scatter alike at all
    strides, and alike ones the more, the longer the stride, up to √2 from one stride to its double.

    Args:
        m: The measurements.
        laws: a (sr⁻¹) and b of each channel as neighbours show them, (c, 2).
    """
    step = spacing(m)
    strides = np.array([k for k in STRIDES if k * step <= FARTHEST], int)
    if not len(strides) or not np.isfinite(laws).all() or m.value.size > MOST:
        return NOT_JUDGED
    rows, curve, angle = curves(m, 0)
    whole = m.valid[rows].all(axis=1)
    rows, curve, angle = rows[whole], curve[whole], angle[whole]
    found = [_ratio(m.value[rows], curve, angle, laws, k) for k in strides]
    ratios, counts = np.array(found).T
    enough = counts >= FEWEST
    return _judged(ratios[enough], counts[enough] / strides[enough], strides[enough])


def _ratio(y: Float[np.ndarray, "n c"], curve: np.ndarray, x: np.ndarray, laws: np.ndarray, k: int) -> tuple:
    """ln of the scatter at a stride over that of neighbours, at the same values, and how many these are."""
    at = np.arange(2 * k, len(x) - 2 * k)
    at = at[curve[at - 2 * k] == curve[at + 2 * k]] if len(at) else at
    gaps = np.diff(x)[at[:, None] + np.arange(-2 * k, 2 * k)] if len(at) else np.ones((0, 1))
    at = at[gaps.max(axis=1) <= EVEN * gaps.min(axis=1)]
    scale = np.maximum(np.median(np.abs(y), axis=0), 1e-300)
    logs = np.arcsinh(y / scale)
    (level, near), (_, far) = (_errors(y, logs, scale, at, stride) for stride in (1, k))
    ends = np.abs(y[at[:, None] + k * _NEAR])
    spread = laws[:, 0] + laws[:, 1] * np.abs(level)
    flat = ends.max(axis=1, initial=0.0) <= GENTLE * ends.min(axis=1, initial=np.inf) + NOISY * spread
    if not flat.any():
        return 0.0, 0
    longer, nearest = (max(float(np.median(np.abs(error / spread)[flat])), 1e-300) for error in (far, near))
    return float(np.log(longer / nearest)), int(np.count_nonzero(flat))


def _errors(
    y: np.ndarray, logs: np.ndarray, scale: np.ndarray, at: np.ndarray, stride: int
) -> tuple[Float[np.ndarray, "k c"], Float[np.ndarray, "k c"]]:
    """What the even cubic through two neighbours on either side predicts, and how far the values are from it."""
    before, after = (logs[at + side * stride] + logs[at - side * stride] for side in (1, 2))
    level = scale * np.sinh((4.0 * before - after) / 6.0)
    return level, y[at] - level


def _judged(ratios: np.ndarray, counts: np.ndarray, strides: np.ndarray) -> Alike:
    if len(ratios) < LEAST_STRIDES:
        return NOT_JUDGED
    weight = counts / counts.sum()
    mean = float(weight @ ratios)
    if mean < max(SMALLEST, ASKED * SPREAD / np.sqrt(counts.max())):
        return INDEPENDENT
    expected = 0.5 * np.log(stencil_variance(_RHO[:, None] ** strides) / stencil_variance(_RHO)[:, None])
    left = ((ratios - expected) ** 2) @ weight
    rho = _RHO[int(np.argmin(left))]
    return Alike(float(rho), float(np.sqrt(stencil_variance(0.0) / stencil_variance(rho))))


def stencil_variance(rho: Float[np.ndarray, "..."] | float) -> Float[np.ndarray, "..."]:
    """V(ρ): variance of the cubic's error over that of the noise, by the correlation of a step."""
    lags = np.stack([np.asarray(rho) ** k for k in range(1, 5)])
    return _STENCIL[0] + 2.0 * np.tensordot(_STENCIL[1:], lags, axes=1)
