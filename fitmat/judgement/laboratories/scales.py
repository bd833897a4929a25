"""Scales: the factor between laboratories that measured one sample, at whatever angles each has measured.

One surface is fitted to all readings with a factor g_l for each laboratory, channel by channel. The one that differs
most from the mean of the others, beyond what calibrations state, is named; then the next, as long as three or more are
left. Of two that differ nobody can say which is off.
"""

import dataclasses
from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
from jaxtyping import ArrayLike, Float

from fitmat.fitting.fitting import fit
from fitmat.maths.normal import Z95
from fitmat.measurements.noise import measured_noise
from fitmat.measurements.samples import Measurements
from fitmat.models.around.pooled import Pooled
from fitmat.models.parameters import as_parameter
from fitmat.models.registry import model
from fitmat.text import brief, visible

LEVEL = 0.05
"""Probability of a false alarm."""

LOOSE = 0.7
"""Standard deviation of ln g_l beforehand, so wide that only the readings and what is stated tell of it."""


@dataclasses.dataclass(frozen=True, eq=False)
class Scale:
    """The scale of one laboratory against the others, of one channel.

    Attributes:
        laboratory: Its name.
        channel: Name of the channel.
        factor: g_l over the geometric mean of the others that are not off.
        ci95: 95 % interval of it, from readings and misfit.
        p: Probability of a larger difference if only readings and stated calibrations made it.
        off: Whether it is named as off.
    """

    laboratory: str
    channel: str
    factor: float
    ci95: tuple[float, float]
    p: float
    off: bool

    __repr__ = brief


class _Factors(NamedTuple):
    """ln g_l, its covariance by readings and misfit, and what each calibration states beside it."""

    logs: np.ndarray
    covariance: np.ndarray
    stated: np.ndarray


def scales_of(
    measurements: Sequence[Measurements],
    name: str,
    channel: str,
    names: tuple[str, ...],
    fixed: Mapping[str, ArrayLike] | None,
    channels: int,
) -> tuple[list[Scale], bool]:
    """The scales of one channel, and whether two that differ are left."""
    place = measurements[0].channels.index(channel)
    held = {k: np.atleast_1d(v)[place] if np.size(v) == channels else v for k, v in (fixed or {}).items()}
    found = _factors([_of_channel(m, place) for m in measurements], name, held)
    off, unsettled = named_off(found.logs, found.covariance + np.diag(found.stated**2))
    scales = []
    for k, laboratory in enumerate(names):
        others = [j for j in range(len(names)) if j != k and j not in off] or [j for j in range(len(names)) if j != k]
        apart, sd = _against(k, others, found.logs, found.covariance)
        ends = float(np.exp(apart - Z95 * sd)), float(np.exp(apart + Z95 * sd))
        z = apart / _against(k, others, found.logs, found.covariance + np.diag(found.stated**2))[1]
        scales.append(Scale(laboratory, visible(channel), float(np.exp(apart)), ends, _two_sided(z), k in off))
    return scales, unsettled


def _two_sided(z: float) -> float:
    from scipy.special import ndtr

    return float(2.0 * ndtr(-abs(z)))


def _against(k: int, others: Sequence[int], logs: np.ndarray, covariance: np.ndarray) -> tuple[float, float]:
    """ln g of one against the mean of others, and its standard deviation."""
    contrast = np.zeros(len(logs))
    contrast[k], contrast[list(others)] = 1.0, -1.0 / len(others)
    return float(contrast @ logs), float(np.sqrt(contrast @ covariance @ contrast))


def named_off(logs: Float[np.ndarray, " L"], covariance: Float[np.ndarray, "L L"]) -> tuple[list[int], bool]:
    """Which laboratories are off, and whether two that differ are left.

    The one that is farthest from the mean of the others, in standard deviations, while that is more than chance makes
    of so many at `LEVEL` (Bonferroni).

    Args:
        logs: ln g of each.
        covariance: Of these, what calibrations state included.
    """
    left, off = list(range(len(logs))), []
    while len(left) > 1:
        z = []
        for k in left:
            apart, sd = _against(k, [j for j in left if j != k], logs, covariance)
            z.append(abs(apart) / sd)
        worst = int(np.argmax(z))
        tests = len(left) if len(left) > 2 else 1
        if _two_sided(z[worst]) * tests >= LEVEL:
            return off, False
        if len(left) == 2:
            return off, True
        off.append(left.pop(worst))
    return off, False


def _of_channel(m: Measurements, place: int) -> Measurements:
    """One channel, with the noise that is known of it, or that its readings show."""
    sigma = measured_noise(m).sigma
    one = dataclasses.replace(
        m, value=m.value[:, [place]], sigma=sigma[:, [place]], valid=m.valid[:, [place]], channels=("value",)
    )
    return one.rows(one.valid[:, 0])


def _factors(measurements: Sequence[Measurements], name: str, held: Mapping[str, ArrayLike]) -> _Factors:
    """One surface fitted to all readings, with a factor for each laboratory."""
    count = len(measurements)
    rows = [m.n_samples for m in measurements]
    own = np.repeat(np.eye(count, dtype=bool), rows, axis=0)
    parts = {key: np.concatenate([getattr(m, key) for m in measurements]) for key in ("wi", "wo", "value", "sigma")}
    pooled = Measurements(
        wi=parts["wi"],
        wo=parts["wo"],
        value=np.where(own, parts["value"], 0.0),
        sigma=np.broadcast_to(parts["sigma"], own.shape).copy(),
        valid=own,
        channels=tuple(str(k + 1) for k in range(count)),
        source="all laboratories",
        instrument=measurements[0].instrument.without_errors(),
    )
    best = fit(
        pooled,
        Pooled(model(name), factor=as_parameter(np.ones(count))),
        fixed=held,
        priors={"factor": (np.ones(count), np.full(count, LOOSE))},
    )
    place = next(e.place for e in best.entries if e.name == "factor")
    factors = best.values[place]
    return _Factors(
        np.log(factors),
        best.covariance[place, place] / np.outer(factors, factors),
        np.array([m.instrument.calibration for m in measurements]),
    )
