"""Side of the peak: whether the curves of a file peak in the mirror direction, or where another convention puts it.

It turns nothing round: a retro-reflector and a mirror whose azimuth is counted from the other side look the same.
"""

import dataclasses
from collections.abc import Callable, Iterator, Sequence

import numpy as np
from jaxtyping import Float

from fitmat.measurements.incidences import incidences
from fitmat.measurements.samples import Measurements

NEAR = np.deg2rad(15.0)
"""A peak within this angle of a direction lies there, if it is not as near to the opposite one."""

ASIDE = np.deg2rad(15.0)
"""Azimuth from the plane of incidence up to which a sample belongs to the curve in it."""

TILTED = (np.deg2rad(8.0), np.deg2rad(70.0))
"""Incidences that are judged: the two directions are apart, and a curve has room beyond them."""

STANDS_OUT = 1.5
"""A peak is this many times the curve's median over the angle."""

FALLS = 0.75
"""Beside a peak, on both sides, a curve falls below this fraction of it; what grows towards grazing does not."""

SEVERAL = 2
"""Curves that peak elsewhere by so many incidences do not do so by chance."""

BESIDE, TOP = np.deg2rad(45.0), np.deg2rad(8.0)
"""Angle within which it falls so far, and within which nothing is higher."""

NORMAL, BESIDE_NORMAL, LEAST_TOP = np.deg2rad(8.0), 1.5, np.deg2rad(84.0)
"""A scan of zenith angles comes within so much, or so many steps, of the normal, or does not go so far from it."""

LOWEST = np.deg2rad(45.0)
"""Of a scan of elevations: where a scan of the zenith angle ends that goes at least as far as its complement."""

HORIZONTAL = np.deg2rad(89.99)
"""Zenith angle of a direction along the surface."""

SAME = 0.2
"""Relative difference up to which both sides of a curve agree, as they do about the normal."""

CLEAR = 6.0
"""A peak exceeds the median, and what lies beside it, by so many standard deviations of the noise."""


def with_peak_side(m: Measurements, unsaid_side: Sequence[str]) -> Measurements:
    """The measurements, with a warning where their curves peak elsewhere than in the mirror direction.

    Args:
        m: From a file whose mirror side may be the other one.
        unsaid_side: The flag that exchanges the two sides, and the one that confirms them; empty where it is settled.
    """
    if not unsaid_side:
        return m
    exchange, confirm = unsaid_side
    back = towards_light(m)
    if len(found := upside_down(m)) > len(back):
        warning = (
            f"The values peak at 90° less the mirror angle (at {_listed(found)} incidence): theta_o, or theta_i, looks "
            "like an elevation above the surface. If it is, say so by its name, --columns elevation_o=theta_o; if not, "
            f"confirm with {confirm}."
        )
        return dataclasses.replace(m, warnings=(*m.warnings, warning))
    if not back:
        return _with_plane(m, confirm) or _with_elevations(m, confirm) or _with_origin(m)
    warning = (
        f"The values peak back towards the light, not in the mirror direction (at {_listed(back)} incidence). Either "
        f"the file counts its angles from the other side: pass {exchange}; or the sample is a retro-reflector: confirm "
        f"it with {confirm}."
    )
    return dataclasses.replace(m, warnings=(*m.warnings, warning))


def _with_plane(m: Measurements, confirm: str) -> Measurements | None:
    """With a warning where the curves peak at the mirror angle a quarter of a turn beside the plane of incidence."""
    for azimuth in (90, 270):
        if found := beside(m, azimuth):
            warning = (
                f"The values peak at the azimuth {azimuth}°, not in the mirror direction (at {_listed(found)} "
                f"incidence). If the file counts its azimuth so, pass --specular-azimuth {azimuth}; if not, confirm it "
                f"with {confirm}."
            )
            return dataclasses.replace(m, warnings=(*m.warnings, warning))
    return None


def _with_elevations(m: Measurements, confirm: str) -> Measurements | None:
    """With a warning where both angles look counted from the horizon, which leaves the peak in the mirror direction."""
    if not upside_down_both(m):
        return None
    places = np.rad2deg(_placed(m).theta_o)
    reach = f"{places.min():.3g}° to {places.max():.3g}°"
    warning = (
        f"theta_o goes from {reach}, to the horizon and not to the normal: it and theta_i look like elevations above "
        "the surface. If they are, say so by their names, --columns elevation_i=theta_i,elevation_o=theta_o; if not, "
        f"confirm with {confirm}."
    )
    return dataclasses.replace(m, warnings=(*m.warnings, warning))


def _with_origin(m: Measurements) -> Measurements:
    """With a warning where every judged curve peaks at the normal, or twice as far from it as the mirror direction."""
    for where, origin, mended in (
        (lambda theta_i: 0.0, "the mirror direction", "theta_o + theta_i"),
        (lambda theta_i: 2.0 * theta_i, "the direction of the light", "theta_o − theta_i"),
    ):
        if len(found := _peaking(m, where)) >= SEVERAL:
            warning = (
                f"The values peak at {'twice the mirror angle' if where(1.0) else 'the normal'} (at {_listed(found)} "
                f"incidence): theta_o looks counted from {origin}. If it is, write {mended} in its place."
            )
            return dataclasses.replace(m, warnings=(*m.warnings, warning))
    return m


def towards_light(m: Measurements) -> tuple[float, ...]:
    """Incidences in degrees whose curves peak back towards the light; none if any has a peak in the mirror direction.

    Judged is the channel with most valid values, in the plane of incidence.
    """
    return _peaking(m, lambda theta_i: -theta_i)


def upside_down(m: Measurements) -> tuple[float, ...]:
    """The same where they peak at 90° less the mirror angle, on either side, far from the mirror direction."""
    found = [_peaking(m, lambda theta_i, side=side: side * (np.pi / 2 - theta_i)) for side in (1.0, -1.0)]
    return max(found, key=len)


def upside_down_both(m: Measurements) -> bool:
    """Whether the sensor reaches the horizon, where nothing can be read, or both sides agree there as at the normal.

    A scan of the zenith angle begins at the normal, or half a step beside it; of the elevation it ends there.
    """
    placed = _placed(m)
    places = np.unique(np.round(placed.theta_o, 4))
    if len(places) < 5 or placed.theta_i.min() < NORMAL:
        return False
    step, low, top = float(np.median(np.diff(places))), places[0], places[-1]
    if not max(NORMAL, BESIDE_NORMAL * step) <= low <= LOWEST or top < max(LEAST_TOP, np.pi / 2 - 0.75 * step):
        return False
    return bool(top > HORIZONTAL) or _same_at(m, top)


def _placed(m: Measurements) -> Measurements:
    """The rows that are used, and those at the horizon."""
    return m.rows(np.flatnonzero(m.valid.any(axis=1) | (np.maximum(m.theta_i, m.theta_o) > HORIZONTAL)))


def _same_at(m: Measurements, top: float) -> bool:
    """Whether the values of both sides agree at one zenith angle of the sensor, at every incidence."""
    ends = [(value[np.abs(angle - top) < 1e-3], value[np.abs(angle + top) < 1e-3]) for _, angle, value in _in_plane(m)]
    return bool(ends) and all(
        one.size and other.size and abs(one[0] - other[0]) < SAME * max(abs(one[0]), abs(other[0]))
        for one, other in ends
    )


def beside(m: Measurements, azimuth: float) -> tuple[float, ...]:
    """The same where they peak at the mirror angle, but at another relative azimuth, in degrees."""
    if any(_mirrored(m)):
        return ()
    turn = np.deg2rad(180.0 - azimuth)
    c, s = np.cos(turn), np.sin(turn)
    return tuple(_mirrored(dataclasses.replace(m, wo=m.wo @ np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]]))))


def _mirrored(m: Measurements) -> Iterator[float]:
    """Incidences in degrees whose curves peak in the mirror direction."""
    return (np.rad2deg(at) for at, angle, value in _in_plane(m) if _peaks(angle, value, at, min(NEAR, 0.75 * at)))


def _peaking(m: Measurements, where: Callable[[float], float]) -> tuple[float, ...]:
    """Incidences in degrees whose curves peak at an angle; none if any has a peak in the mirror direction."""
    back = []
    for at, angle, value in _in_plane(m):
        if abs(where(at) - at) < 2 * NEAR and where(at) > 0:
            continue
        if _peaks(angle, value, at, min(NEAR, 0.75 * at)):
            return ()
        apart = 0.5 * abs(where(at) - at)
        if _peaks(angle, value, where(at), min(NEAR, apart, 0.75 * abs(where(at)) or apart)):
            back.append(np.rad2deg(at))
    return tuple(back)


def _in_plane(m: Measurements) -> Iterator[tuple[float, np.ndarray, np.ndarray]]:
    """Incidence, signed angles and values of the curves in the plane of incidence that are judged, in radians."""
    channel = int(m.valid.sum(axis=0).argmax())
    phi, signed = m.phi, m.signed_theta_o
    used = m.valid[:, channel] & (np.minimum(phi, np.pi - phi) < ASIDE)
    for lit in incidences(m.wi, used):
        at = np.deg2rad(lit.theta_i_deg)
        if TILTED[0] <= at <= TILTED[1]:
            yield float(at), *_curve(signed[lit.rows], m.value[lit.rows, channel])


def _listed(angles: Sequence[float]) -> str:
    return ", ".join(f"{angle:.3g}°" for angle in angles)


def _curve(angle: np.ndarray, value: np.ndarray) -> tuple[Float[np.ndarray, " k"], Float[np.ndarray, " k"]]:
    """The mean value at each angle, sorted."""
    angles, group = np.unique(np.round(angle, 4), return_inverse=True)
    return angles, np.bincount(group, value) / np.bincount(group)


def _peaks(angle: np.ndarray, value: np.ndarray, at: float, within: float) -> bool:
    """Whether the curve has a peak so near to an angle."""
    near = np.flatnonzero(np.abs(angle - at) < within)
    if len(near) == 0 or len(value) < 5:
        return False
    top = near[value[near].argmax()]
    apart, height = angle - angle[top], value[top]
    if height < value[np.abs(apart) < TOP].max():
        return False
    sides = [value[(side * apart > 0) & (side * apart < BESIDE)] for side in (-1.0, 1.0)]
    middle = float(np.median(np.interp(np.linspace(angle[0], angle[-1], 181), angle, value)))
    # Of three neighbours f, g, h the scatter of f − 2g + h is √6 times the noise.
    noise, inner = np.abs(np.diff(value, 2)) / (0.6745 * np.sqrt(6.0)), value[1:-1]
    floor = np.median(noise[inner <= middle]) if (inner <= middle).any() else 0.0
    relative = np.median(noise / np.maximum(np.abs(inner), max(middle, 1e-300)))
    low = height * min(FALLS, 1.0 / (1.0 + CLEAR * relative))
    return bool(
        all(side.size and np.quantile(side, 0.25) < low for side in sides)
        and height > max(STANDS_OUT * middle, middle + CLEAR * floor)
    )
