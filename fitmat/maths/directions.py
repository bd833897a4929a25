"""Directions: angles ↔ unit vectors, the half vector, and what counts as above the surface.

Conventions, the same everywhere in fitmat:

====================  =====================================================================================
frame                 local, surface normal n = +z
wi, wo                unit vectors, both pointing **away** from the surface: to the light, to the sensor
BRDF value            f_r in sr⁻¹, **without** the cosine
theta                 zenith angle from the normal, 0 to π/2 (radians inside, degrees in files and flags)
phi                   relative azimuth φ_o − φ_i; the mirror direction of theta_i is theta_o = theta_i, φ = π
signed theta_o        in-plane files: positive = forward, the mirror side (φ = π); negative = backward (φ = 0)
eta                   index of refraction, transmitted over incident
alpha                 slope parameter of the microfacet distribution (never "roughness")
wavelength            nm
numbers               float64
====================  =====================================================================================

Nothing here knows about reflectance.
"""

from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Bool, Float
from numpy.typing import ArrayLike

from fitmat import arguments
from fitmat._types import Array, Scalar, Vec3
from fitmat.errors import FitmatError
from fitmat.maths.arrays import library

COS_MIN = 1e-7
"""Cosines are floored here where a formula divides by them; an angle of 6·10⁻⁶ degrees from grazing."""

_TINY = 1e-300


def from_angles(theta: np.ndarray, phi: np.ndarray) -> Float[np.ndarray, "n 3"]:
    """Zenith and azimuth angles in radians, shape (n,), to unit vectors (n, 3)."""
    sin = np.sin(theta)
    return np.stack([sin * np.cos(phi), sin * np.sin(phi), np.cos(theta)], axis=-1)


def directions(theta: ArrayLike, phi: ArrayLike = 0.0, *, degrees: bool = False) -> Float[np.ndarray, "n 3"]:
    """Unit vectors (sinθ cosφ, sinθ sinφ, cosθ), as `fitmat.evaluate` takes them.

    Args:
        theta: Zenith angles, (n,) or one; below 0 on the side opposite to phi.
        phi: Azimuths, (n,) or one; of light from azimuth 0 the mirror side is at half a turn.
        degrees: Whether both are in degrees instead of radians.

    Raises:
        FitmatError: something is no number, or out of range, as degrees are for radians; or the lengths differ.

    Example:
        >>> import fitmat as fm
        >>> wi, wo = fm.directions(30, degrees=True), fm.directions([0, 30, 60], 180, degrees=True)
        >>> fm.evaluate(fm.model("lambert", kd=0.5), wi, wo).shape
        (3, 1)
    """
    arguments.flags(degrees=degrees)
    if degrees:
        angle = np.deg2rad(arguments.numbers("theta", theta, -90.0, 90.0, of=" degrees"))
        turn = np.deg2rad(arguments.numbers("phi", phi, -360.0, 360.0, of=" degrees"))
    else:
        angle = arguments.angles("theta", theta, arguments.ZENITH, signed=True)
        turn = arguments.angles("phi", phi, arguments.AZIMUTH, signed=True)
    try:
        angle, turn = np.broadcast_arrays(np.atleast_1d(angle), turn)
    except ValueError:
        angle = turn = np.zeros((0, 0))
    if angle.ndim != 1:
        shapes = f"theta and phi have shapes {np.shape(theta)} and {np.shape(phi)}"
        raise FitmatError(f"{shapes}, expected (n,) or one number each.")
    return from_angles(angle, turn)


def zenith(directions: np.ndarray) -> Float[np.ndarray, " n"]:
    """Zenith angles in radians of unit vectors (n, 3), exact near the normal as well."""
    return np.arctan2(np.hypot(directions[..., 0], directions[..., 1]), directions[..., 2])


def relative_azimuth(wi: np.ndarray, wo: np.ndarray) -> Float[np.ndarray, " n"]:
    """φ_o − φ_i in radians, folded to [0, π] (isotropic surfaces look the same on both sides)."""
    return np.abs(signed_azimuth(wi, wo))


def signed_azimuth(wi: np.ndarray, wo: np.ndarray) -> Float[np.ndarray, " n"]:
    """φ_o − φ_i in radians, [−π, π)."""
    difference = np.arctan2(wo[:, 1], wo[:, 0]) - np.arctan2(wi[:, 1], wi[:, 0])
    return (difference + np.pi) % (2 * np.pi) - np.pi


def signed_zenith(wi: np.ndarray, wo: np.ndarray) -> Float[np.ndarray, " n"]:
    """theta_o in radians, positive on the mirror side of the normal, for plots of in-plane curves."""
    forward = relative_azimuth(wi, wo) > np.pi / 2
    return np.where(forward, 1.0, -1.0) * zenith(wo)


def _dot(a: Vec3, b: Vec3) -> Scalar:
    """a·b, written out: XLA fuses sums of components, but not small matrix products."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def half_vector(wi: Vec3, wo: Vec3) -> Vec3:
    """h = (ω_i + ω_o)/|ω_i + ω_o|; the normal where the sum vanishes (ω_i = −ω_o)."""
    total = wi + wo
    square = _dot(total, total)
    usable = square > 1e-24
    xp = library(square)
    safe = xp.where(usable, square, 1.0)
    return xp.where(usable, total / xp.sqrt(safe), np.array([0.0, 0.0, 1.0], total.dtype))


def cos_difference(wi: Vec3, wo: Vec3) -> Scalar:
    """c_d = ω_i·h = √((1 + ω_i·ω_o)/2), in [0, 1]."""
    xp = library(wi, wo)
    return xp.sqrt(xp.clip((1.0 + _dot(wi, wo)) / 2.0, _TINY, 1.0))


class Pair(NamedTuple):
    """Two directions and what lies halfway between them.

    Attributes:
        wi: Unit vector to the light.
        wo: Unit vector to the sensor.
        h: Half vector.
        cos_d: ω_i·h.
    """

    wi: Vec3
    wo: Vec3
    h: Vec3
    cos_d: Scalar


def pair(wi: Vec3, wo: Vec3) -> Pair:
    """The directions with their half vector and cos_d; see `half_vector` and `cos_difference`."""
    return Pair(wi, wo, half_vector(wi, wo), cos_difference(wi, wo))


def rotated(w: Float[Any, "3"], angle: Float[Any, ""]) -> Float[Any, "3"]:
    """A direction turned by `angle` (radians, counter-clockwise seen from above) about the normal."""
    xp = library(w, angle)
    sin, cos = xp.sin(angle), xp.cos(angle)
    return xp.stack([cos * w[0] - sin * w[1], sin * w[0] + cos * w[1], w[2]])


def forward(wi: Float[Any, "*n 3"], wo: Float[Any, "*n 3"]) -> Float[Any, "*n 3"]:
    """The horizontal unit vector towards the mirror side, away from the light, of one pair or of many.

    For light along the normal, towards +x or −x (else ±y) as `from_angles` has azimuth π for the mirror side: along the
    sensor's own azimuth where it has one.
    """
    xp = library(wi, wo)
    light, sensor = (w * np.array([1.0, 1.0, 0.0]) for w in (wi, wo))
    side = sensor[..., :1] + 1e-3 * sensor[..., 1:2]
    along = xp.where(side > 0.0, -1.0, 1.0) * sensor
    fallback = xp.where(_length(sensor) > _LEAST, along, np.array([-1.0, 0.0, 0.0]))
    chosen = xp.where(_length(light) > _LEAST, -light, fallback)
    return chosen / _length(chosen)


def turned(w: Float[Any, "*n 3"], towards: Float[Any, "*n 3"], angle: Any) -> Float[Any, "*n 3"]:
    """Directions turned by `angle` (radians) from the normal towards a horizontal unit vector: Rodrigues' rotation.

    A direction in the plane of the two changes its zenith angle by it.
    """
    xp = library(w, towards, angle)
    up = np.array([0.0, 0.0, 1.0])
    axis = xp.stack([-towards[..., 1], towards[..., 0], 0.0 * towards[..., 0]], axis=-1)
    across = xp.sum(axis * w, axis=-1, keepdims=True) * axis
    tangent = towards * w[..., 2:] - up * xp.sum(towards * w, axis=-1, keepdims=True)
    return w * xp.cos(angle) + tangent * xp.sin(angle) + across * (1.0 - xp.cos(angle))


def _length(w: Any) -> Any:
    return library(w).linalg.norm(w, axis=-1, keepdims=True)


_LEAST = 1e-9
# Sine of the zenith angle below which a direction is the normal.


def mirror(directions: Float[Any, "*n 3"]) -> Float[Any, "*n 3"]:
    """The mirror directions 2(n·ω)n − ω, of one direction or of many."""
    return directions * np.array([-1.0, -1.0, 1.0], directions.dtype)


def above(wi: Vec3, wo: Vec3) -> Bool[Array, ""]:
    """True where both directions are above the surface; every BRDF is 0 elsewhere."""
    return (wi[2] > 0.0) & (wo[2] > 0.0)
