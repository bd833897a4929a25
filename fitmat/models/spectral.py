"""Fresnel over the spectrum: what a material reflects at each wavelength, and what the channels of a file see of it.

Indices are those of `refractive_index`; beyond a dataset the value at its end is held, and refused where too much of a
channel lies there. No colour is computed here.
"""

import functools

import numpy as np
from jaxtyping import Complex, Float

from fitmat.colour import observers
from fitmat.colour.channels import sensitivities
from fitmat.errors import ModelError
from fitmat.models.refractive_index import channel_wavelengths, index, span
from fitmat.models.terms.fresnel import angle_nodes, conductor, eta_from_f0

HELD = 0.25
"""Share of a channel's response that may lie beyond the dataset: plastics are measured from 437 nm, of blue 24 %."""

RGB = ("r", "g", "b")
"""Channels that respond to a band of light, and not to a line."""

ABSORBING = 0.01
"""κ from which a material counts as a metal."""

TRANSPARENT = 1e-4
"""Mean κ below which a channel's curve is a dielectric's: F changes by less than 1e-8."""


@functools.lru_cache(maxsize=64)
def indices(material: str) -> Complex[np.ndarray, " n"]:
    """η + iκ at the wavelengths of the observers; beyond the dataset that of its end.

    Args:
        material: As in `refractive_index.index`.

    Raises:
        ModelError: it is not known, or more than `HELD` of what a primary responds to lies beyond the dataset.
    """
    nm, (low, high) = observers.wavelengths(), span(material)
    response = np.abs(sensitivities())
    beyond = response[:, (nm < low) | (nm > high)].sum(axis=1) / response.sum(axis=1)
    if beyond.max() > HELD:
        raise ModelError(
            f"material {material!r} is known from {low:g} to {high:g} nm, and {100 * beyond.max():.0f} % of what "
            f"channel {RGB[beyond.argmax()]} responds to lies beyond; name another dataset as shelf/book/page."
        )
    return index(material, np.clip(nm, low, high))


def reflectance(material: str, cos: Float[np.ndarray, " a"]) -> Float[np.ndarray, "a n"]:
    """Exact Fresnel reflectance of unpolarised light, at the wavelengths of the observers.

    Args:
        material: As in `refractive_index.index`.
        cos: Cosines of the angles of incidence, 0 to 1.
    """
    found = indices(material)
    return conductor(cos[:, None], np.real(found), np.imag(found))


def seen_by(channels: tuple[str, ...], material: str, cos: Float[np.ndarray, " a"]) -> Float[np.ndarray, "a c"]:
    """Reflectance in each channel: integrated over what r, g and b respond to, else that of its wavelength.

    Args:
        channels: Names as in `Measurements.channels`.
        material: As in `refractive_index.index`.
        cos: Cosines of the angles of incidence, 0 to 1.

    Raises:
        ModelError: as `indices` and `refractive_index.channel_wavelengths`.
    """
    lines = channel_wavelengths(channels)
    columns = []
    for name, nm in zip(channels, lines, strict=True):
        if (band := _band(name)) is None:
            n = index(material, nm)
            columns.append(conductor(cos, np.real(n), np.imag(n)))
        else:
            columns.append(reflectance(material, cos) @ sensitivities()[band])
    return np.stack(columns, axis=1)


@functools.lru_cache(maxsize=64)
def channel_indices(material: str, channels: tuple[str, ...]) -> Complex[np.ndarray, " c"]:
    """One η + iκ a channel, whose exact curve is what the channel sees of the material, as closely as one can be.

    A channel that is a line has the index of its wavelength. For r, g and b it is the least squares fit, over the
    angles of incidence, of `conductor` to `seen_by`; without absorption it is the η of that F0. No index reflects more
    than it receives: where the curve does (red of gold: 1.04), it comes as close as bounds of 50 let it.

    Args:
        material: As in `refractive_index.index`.
        channels: Names as in `Measurements.channels`.

    Raises:
        ModelError: as `seen_by`.
    """
    cos, lines = angle_nodes(24)[0], channel_wavelengths(channels)
    curves = seen_by(channels, material, np.append(cos, 1.0))
    found = np.array([_nearest(material, *given, cos) for given in zip(channels, lines, curves.T, strict=True)])
    found.flags.writeable = False  # the next who asks gets the same
    return found


def _nearest(material: str, channel: str, line: float, curve: Float[np.ndarray, " b"], cos: np.ndarray) -> complex:
    """The index of one channel; its curve at `cos` and, last, at normal incidence."""
    if (band := _band(channel)) is None:
        return complex(index(material, line))
    if abs(np.imag(indices(material)) @ sensitivities()[band]) < TRANSPARENT:
        return complex(eta_from_f0(curve[-1]))
    near = indices(material)[np.searchsorted(observers.wavelengths(), line)]
    return _closest(cos, curve[:-1], complex(near))


def _closest(cos: Float[np.ndarray, " a"], curve: Float[np.ndarray, " a"], start: complex) -> complex:
    """The η + iκ of the curve of unpolarised light that is nearest, from an index that is near."""
    from scipy.optimize import least_squares

    def apart(logs: np.ndarray) -> np.ndarray:
        eta, kappa = np.exp(logs)
        return conductor(cos, eta, kappa) - curve

    bounds = np.log([[0.01, 0.01], [50.0, 50.0]])
    first = np.log(np.clip([start.real, start.imag], 0.02, 49.0))
    eta, kappa = np.exp(least_squares(apart, first, bounds=tuple(bounds), xtol=1e-12, ftol=1e-12, gtol=1e-12).x)
    return complex(eta, kappa)


def _band(channel: str) -> int | None:
    """Which primary a channel is; None for a line."""
    name = channel.strip().lower()
    return RGB.index(name) if name in RGB else None


def absorbs(material: str) -> bool:
    """Whether it is a metal or a semiconductor: κ is above `ABSORBING` at the wavelength an eye sees best, 555 nm."""
    return float(np.imag(index(material, 555.0))) > ABSORBING
