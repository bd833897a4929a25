"""Noise of the measurements, estimated from the scatter of repeats and of neighbouring angles.

The estimate looks at the data only, never at a model.
"""

import dataclasses

import numpy as np
from jaxtyping import Float

from fitmat.measurements.alikeness import Alike, alike
from fitmat.measurements.neighbours import leave_one_out
from fitmat.measurements.samples import Measurements
from fitmat.text import brief, visible

MIN_RESIDUALS = 12
"""Fewer neighbour comparisons than this say nothing about the noise."""

NEIGHBOURED = 0.05
"""Fraction of the samples that must have neighbours; where fewer meet on a curve, they do so by chance."""

UNKNOWN_RELATIVE = 1e-3
"""Placeholder noise where none can be estimated: small, so that the inferred discrepancy takes its place."""

UNKNOWN = (
    "Noise unknown: too few repeats or neighbouring angles, or exact copies; all scatter is counted as model misfit."
)
"""What is said where no noise can be estimated."""

COPIED = 1e-12
"""A scatter below this fraction of the maximum is that of copied rows, not of repeated measurements."""

TRACE = 1e-6
"""Of the median: no instrument's floor lies so far below what it reads."""

LEAST_SAID = 1e-5
"""Relative noise below which a law is said to have none."""

LEAST_SIGMA = 1e-9
"""Of the largest σ: what is smaller counts as this where a law of the noise is sought."""

FREEDOM = 0.38
"""Degrees of freedom of σ² for each comparison with neighbours: 70²/Σ acf² of fourth differences, 4900/12870."""

_DIGITS = 8
# So many digits behind the point are looked at; rounding to more is no noise that counts.
_EXACT = 2.0**53
# From here on every double is a whole number.
_WHOLE = 1e-12
# Rounding of a double when a decimal number is scaled.
_T_DOF = 4.0
# Scale of a t distribution with 4 degrees of freedom that fits Gaussian data best: the root s of
# E[5 x²/(4 s² + x²)] = 1 for x ~ N(0, 1).
_T_SCALE = 0.8310


@dataclasses.dataclass(frozen=True)
class Noise:
    """Measurement noise σ² = a² + (b f)².

    Attributes:
        sigma: Standard deviation per sample and channel in sr⁻¹, (n, c).
        known: False where nothing could be said and `sigma` is a placeholder.
        words: One sentence for the report.
        laws: a (sr⁻¹) and b per channel, where they were estimated, (c, 2).
        rho: Correlation of the errors of neighbouring angles, where it was found.
    """

    sigma: Float[np.ndarray, "n c"]
    known: bool
    words: str
    laws: Float[np.ndarray, "c 2"] | None = None
    rho: float = 0.0

    __repr__ = brief


def measured_noise(m: Measurements) -> Noise:
    """The given σ, or an estimate per channel from repeats and neighbouring angles.

    The errors of predictions from repeats and neighbours (`leave_one_out`) give a and b by a Student-t likelihood, so
    that a few badly predicted peak samples do not count. σ is evaluated at the prediction, not at the sample itself:
    weights that depend on the sample's own noise bias every fit. Errors that are alike along a curve (`alikeness`) make
    the noise larger than neighbours show.
    """
    if m.sigma is not None:
        return Noise(np.where(m.valid, m.sigma, 1.0), True, "Measurement noise as given in the file.")
    compared = leave_one_out(m)
    smooth, tops = seen_levels(m, compared[0]), np.max(np.abs(m.value), axis=0, where=m.valid, initial=0.0)
    laws = np.stack([law(compared[:, :, k], m.value[m.valid[:, k], k]) for k in range(len(m.channels))])
    together = alike(m, laws)
    found = of_laws(laws * together.larger, smooth, tops, m.channels)
    return dataclasses.replace(
        found, words=" ".join([found.words, *_reservations(found, together, compared)]), rho=together.rho
    )


def _reservations(found: Noise, together: Alike, compared: np.ndarray) -> list[str]:
    """How well an estimate is known, and on what it rests."""
    if not found.known:
        return []
    if together.rho:
        return [
            f"Errors of neighbouring angles are alike (correlation {together.rho:.1f} from one to the next), which "
            f"hides a part of them: the noise is about {together.larger:.1f} times what neighbours show."
        ]
    fewest = np.count_nonzero(np.isfinite(compared[1]), axis=0).min()
    known = f"It is known to about {100.0 / np.sqrt(2.0 * FREEDOM * fewest):.0f} %"
    return [f"{known}{'' if together.judged else ', if errors of neighbouring angles are independent'}."]


def of_laws(laws: Float[np.ndarray, "c 2"], level: np.ndarray, tops: np.ndarray, channels: tuple[str, ...]) -> Noise:
    """The noise of values at some level, (n, c), by the law of each channel; NaN is one that was not found."""
    known = bool(np.isfinite(laws).all())
    return Noise(at_level(laws, level, tops), known, law_words(laws, channels), laws if known else None)


def law(compared: Float[np.ndarray, "3 n"], values: Float[np.ndarray, " m"]) -> Float[np.ndarray, " 2"]:
    """a and b of one channel; NaN where too few values have neighbours or they are copies.

    Args:
        compared: Of the channel by `leave_one_out`.
        values: All that are valid, sr⁻¹.
    """
    level, error, factor = compared[:, np.isfinite(compared[1])]
    few = len(error) < max(MIN_RESIDUALS, NEIGHBOURED * len(values))
    if few or np.median(np.abs(error)) <= COPIED * np.max(np.abs(values)):
        return np.full(2, np.nan)
    a, b = components(error, np.abs(level), factor)
    return np.array([max(a, least_floor(values)), b])


def least_floor(values: Float[np.ndarray, " n"]) -> float:
    """What an estimated a cannot be below, sr⁻¹: the rounding to the last digit of a file, or a trace of the median."""
    return max(last_digit(values) / np.sqrt(12.0), TRACE * float(np.median(np.abs(values))))


def last_digit(values: Float[np.ndarray, " n"]) -> float:
    """The power of ten of which all values, or all values times π, are whole multiples; 0 where there is none."""
    for factor in (1.0, np.pi):
        for digit in 10.0 ** -np.arange(_DIGITS):
            with np.errstate(over="ignore"):
                whole = np.abs(values * (factor / digit))
            if (whole < _EXACT).all() and (np.abs(whole - np.round(whole)) <= _WHOLE * np.maximum(whole, 1.0)).all():
                return float(digit / factor)
    return 0.0


def at_level(
    laws: Float[np.ndarray, "c 2"], level: Float[np.ndarray, "n c"], tops: Float[np.ndarray, " c"]
) -> Float[np.ndarray, "n c"]:
    """σ of each value by its channel's law; a small placeholder where there is none."""
    a, b = laws.T
    little = UNKNOWN_RELATIVE * np.maximum(level, UNKNOWN_RELATIVE * np.maximum(tops, 1e-12))
    return np.where(np.isfinite(a), np.hypot(np.nan_to_num(a), np.nan_to_num(b) * level), little)


def law_words(laws: Float[np.ndarray, "c 2"], channels: tuple[str, ...]) -> str:
    """The laws of all channels in one sentence."""
    if not np.isfinite(laws).all():
        return UNKNOWN
    named = [f" ({visible(channel)})" if len(channels) > 1 else "" for channel in channels]
    relative = [f"{100 * b:.2g}" if b > LEAST_SAID else "0" for b in laws[:, 1]]
    parts = (f"{b} % + {a:.2g} sr⁻¹{name}" for a, b, name in zip(laws[:, 0], relative, named, strict=True))
    return f"Noise estimated from neighbouring angles: {'; '.join(parts)}."


def levels(m: Measurements) -> Float[np.ndarray, "n c"]:
    """|f| as the neighbours of each value show it, in sr⁻¹; its own size where it has none."""
    return seen_levels(m, leave_one_out(m)[0])


def seen_levels(m: Measurements, found: Float[np.ndarray, "n c"]) -> Float[np.ndarray, "n c"]:
    """`levels` from what `leave_one_out` found."""
    return np.abs(np.where(np.isfinite(found), found, m.value))


def channel_laws(m: Measurements, noise: Noise) -> list[tuple[float, float] | None]:
    """a (sr⁻¹) and b per channel: as estimated, else as σ has them; None for a channel without values."""
    if noise.laws is not None:
        return [(float(a), float(b)) for a, b in noise.laws]
    used = [(m.value[rows, k], noise.sigma[rows, k]) for k, rows in enumerate(m.valid.T)]
    return [noise_law(value, sigma) if len(value) else None for value, sigma in used]


def noise_law(value: Float[np.ndarray, " n"], sigma: Float[np.ndarray, " n"]) -> tuple[float, float]:
    """a (sr⁻¹) and b of σ² = a² + (b f)² by non-negative least squares on relative residuals; a is never 0."""
    unit = float(sigma.max())
    value, sigma = value / unit, np.maximum(sigma / unit, LEAST_SIGMA)
    squares = np.stack([np.ones_like(value), value**2], axis=1) / sigma[:, None] ** 2
    scale = np.abs(squares).max(axis=0) + 1e-300
    a2, b2 = _adding_to_one(squares / scale) if len(value) > 1 else (sigma[0] ** 2 * scale[0], 0.0)
    lowest = 1e-3 * float(sigma.min())
    return unit * float(max(np.sqrt(a2 / scale[0]), lowest)), float(np.sqrt(b2 / scale[1]))


def _adding_to_one(columns: Float[np.ndarray, "n 2"]) -> Float[np.ndarray, "2"]:
    """x ≥ 0 with the least |columns x − 1|², columns ≥ 0: the free solution, else the better of either column alone."""
    free = np.linalg.lstsq(columns, np.ones(len(columns)), rcond=None)[0]
    if free.min() >= 0.0:
        return free
    alone = np.diag(columns.sum(axis=0) / np.maximum((columns**2).sum(axis=0), 1e-300))
    return min(alone, key=lambda x: float(np.sum((columns @ x - 1.0) ** 2)))


def components(error: np.ndarray, level: np.ndarray, factor: np.ndarray) -> tuple[float, float]:
    """a (sr⁻¹) and b (relative) of σ² = a² + (b f)² by maximum likelihood under a t distribution."""
    from scipy.optimize import minimize

    typical = np.median(np.abs(error)) / 0.6745 + 1e-300
    relative = np.median(np.abs(error) / np.maximum(level, 1e-300)) / 0.6745 + 1e-12

    def cost(logs: np.ndarray) -> float:
        a, b = np.exp(logs)
        scale = _T_SCALE * np.sqrt(factor) * np.hypot(a, b * level)
        t = (_T_DOF + 1.0) / 2.0 * np.log1p((error / scale) ** 2 / _T_DOF)
        return float(np.sum(t + np.log(scale)))

    starts = [np.log([typical * p, relative * q]) for p, q in ((0.7, 0.7), (0.02, 1.0), (1.0, 0.02))]
    best = min((minimize(cost, s, method="Nelder-Mead") for s in starts), key=lambda result: result.fun)
    a, b = np.exp(best.x)
    return float(a), float(b)
