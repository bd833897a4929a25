"""Plausible values: whether the numbers of a file can be what they are said to be; if not, the user is asked.

It converts nothing: logarithms and percent are doubted, never assumed.
"""

import dataclasses

import numpy as np

from fitmat.errors import ReadError
from fitmat.maths.directions import mirror
from fitmat.measurements.blocked import SEVERAL
from fitmat.measurements.options import Options
from fitmat.measurements.samples import Measurements
from fitmat.text import visible

MOST_NEGATIVE = 0.6
"""Noise about zero makes half of the values negative; from this share on, and three standard deviations of a fair coin
beyond the half, it does not."""

DEEP = 0.1
"""Logarithms go this far below zero, as a fraction of the largest value; a floor that was subtracted twice does not."""

LEVEL, SHALLOW, SOME = 0.8, 0.02, 0.25
"""Of negative values that are a level, not noise about zero: the upper quartile is so near the median (0.47 for noise),
which lies so far below zero as a fraction of the largest value; and they are this share of all."""

AWAY, BACK, UPRIGHT = np.deg2rad(30.0), np.deg2rad(15.0), np.deg2rad(75.0)
"""Reflectance factors are judged this far from the mirror direction and from the light, up to this zenith angle."""

BRIGHTEST = 2.0
"""A reflectance factor that no surface has there: it would reflect twice what falls on it."""

LOUD = 2.0
"""Times its value that a σ is, in the middle one, where the file does not hold noise alone, or σ in percent."""

GAP = 10.0
"""Times a smallest value that occurs several times, within which there is no other: it is a limit, not the darkest."""

COMPARED = ("reflectance_factor", "panel_ratio")
"""Quantities that are 1 for a perfect white surface."""


def refuse_implausible(m: Measurements, quantity: str, options: Options) -> None:
    """Stop where values look like logarithms, or like percent, and the user has not said how they are written.

    Raises:
        ReadError: they do; the flags that mend or confirm it are named.
    """
    if options.scale is not None:
        return
    for name, value, valid in zip(m.channels, m.value.T, m.valid.T, strict=True):
        where = m.source if len(m.channels) == 1 else f"{m.source}, channel {name}"
        _refuse_logarithms(value[valid], where)
        if quantity in COMPARED and not options.unknown_scale:
            _refuse_percent(np.pi * value[valid & _diffuse(m)], where)


def with_doubts(m: Measurements) -> Measurements:
    """The measurements, with warnings where σ can hardly be that of the values, and where a limit cut them off."""
    return _with_limit(_with_percent(m))


def _with_limit(m: Measurements) -> Measurements:
    for k, name in enumerate(m.channels):
        value = m.value[m.valid[:, k], k]
        smallest = float(value.min(initial=np.inf))
        count = int(np.count_nonzero(value == smallest))
        if SEVERAL <= count <= len(value) // 2 and 0 < smallest < value[value > smallest].min() / GAP:
            of = f" of channel {visible(name)}" if len(m.channels) > 1 else ""
            warning = (
                f"The smallest value{of}, {smallest:.3g} sr⁻¹, "
                f"occurs exactly {count} times, and nothing else is below {GAP:g} times it. If the light was blocked "
                "there, or the instrument at its limit, leave those rows out."
            )
            m = dataclasses.replace(m, warnings=(*m.warnings, warning))
    return m


def _with_percent(m: Measurements) -> Measurements:
    if m.sigma is None or not m.valid.any():
        return m
    typical = float(np.median(m.sigma[m.valid] / np.maximum(np.abs(m.value[m.valid]), np.finfo(float).tiny)))
    if typical <= LOUD:
        return m
    warning = (
        f"sigma is {typical:.3g} times its value in the middle one of the rows: is it in percent? It is read as the "
        "standard deviation in the unit of the value."
    )
    return dataclasses.replace(m, warnings=(*m.warnings, warning))


def _refuse_logarithms(value: np.ndarray, where: str) -> None:
    share = np.count_nonzero(value < 0) / max(len(value), 1)
    mostly = share >= max(MOST_NEGATIVE, 0.5 + 1.5 / np.sqrt(len(value) or 1))
    deep = mostly and -np.quantile(value, 0.05) >= DEEP * value.max()
    if len(value) < 3 or not (deep or _is_level(value, share)):
        return
    got = f"{share:.0%} of the values are negative, expected reflected light"
    remedy = (
        "If they are logarithms, say which: --scale db, --scale log10 or --scale ln; if they are noise, --scale linear"
    )
    raise ReadError(f"{where}: {got}. {remedy} (scale=).")


def _is_level(value: np.ndarray, share: float) -> bool:
    """Whether the negative values, if there are many, stand about a level below zero, as a dull surface in dB does."""
    if share < SOME or np.count_nonzero(value < 0) < 3:
        return False
    upper, middle = np.quantile(value[value < 0], [0.75, 0.5])
    return bool(upper / middle >= LEVEL and -middle >= SHALLOW * value.max())


def _diffuse(m: Measurements) -> np.ndarray:
    """Which samples stand away from the mirror direction, from the light and from grazing angles, (n,)."""
    beside_mirror = np.sum(mirror(m.wi) * m.wo, axis=1) > np.cos(AWAY)
    beside_light = np.sum(m.wi * m.wo, axis=1) > np.cos(BACK)
    return ~beside_mirror & ~beside_light & (np.minimum(m.wi[:, 2], m.wo[:, 2]) > np.cos(UPRIGHT))


def _refuse_percent(factor: np.ndarray, where: str) -> None:
    if not len(factor) or (typical := float(np.quantile(factor, 0.25))) <= BRIGHTEST:
        return
    got = f"reflectance factors of {typical:.3g} and more far from the mirror direction, expected at most about 1"
    remedy = "If they are percent, pass --scale percent; if only relative, --unknown-scale; if right, --scale linear"
    raise ReadError(f"{where}: {got}. {remedy} (scale=).")
