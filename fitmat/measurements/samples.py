"""Measurements: BRDF samples with their directions, channels, noise and mask; the one noun that every reader makes.

It converts no quantity and reads no file.
"""

import dataclasses
import html
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float
from numpy.typing import ArrayLike

from fitmat import arguments
from fitmat.errors import ReadError
from fitmat.maths.directions import from_angles, relative_azimuth, signed_azimuth, signed_zenith, zenith
from fitmat.measurements.instrument import IDEAL, Instrument
from fitmat.text import brief, visible

IN_PLANE = np.deg2rad(0.5)
"""A sample whose azimuth is within this angle of the plane of incidence counts as in-plane."""

DIGITS = 6
"""Decimals of an angle in radians that tell one rotation of the sample from another."""

SCANNED = 5
"""Rows that a rotation of the sample has where it was turned between scans."""


class StatedAlbedo(NamedTuple):
    """What a file says that the values of one incidence add up to, as the TIS of a Zemax file; angles in radians.

    Attributes:
        theta_i: Zenith angle of incidence.
        phi_i: Its azimuth.
        channel: Name of the channel.
        value: ∫ f_r cosθ_o dω_o as the file has it.
    """

    theta_i: float
    phi_i: float
    channel: str
    value: float


def in_plane(wi: Float[np.ndarray, "n 3"], wo: Float[np.ndarray, "n 3"]) -> Bool[np.ndarray, " n"]:
    """Which pairs of directions lie in the plane of incidence (all do where ω_i or ω_o is the normal)."""
    phi = relative_azimuth(wi, wo)
    aside = np.minimum(phi, np.pi - phi)
    return (aside < IN_PLANE) | (zenith(wi) < IN_PLANE) | (zenith(wo) < IN_PLANE)


@dataclasses.dataclass(frozen=True, eq=False)
class Measurements:
    """n samples of a BRDF in c channels.

    Attributes:
        wi: Unit vectors to the light, (n, 3), local frame (n = +z).
        wo: Unit vectors to the sensor, (n, 3).
        value: f_r in sr⁻¹ without cosine, (n, c); what is masked holds 0.
        sigma: Standard deviation of the measurement noise in sr⁻¹, (n, c); None where unknown.
        valid: False where a value must not be used, (n, c).
        channels: c names, in column order.
        source: Where it came from, for messages and titles.
        masked: Reason → number of rows masked for it.
        notes: Plain sentences: factors applied, conventions assumed, oddities kept.
        instrument: What the values owe to the instrument that took them.
        warnings: Plain sentences: what may have been read otherwise than it was meant.
        stated: What the file says that its values add up to.
        horizontal: Masked values at θ_o = 90°, sr⁻¹, NaN elsewhere, (n, c); None where there are none.
        inferred: Values that were not measured but inferred from the others, (n, c); None where there are none. Their
            sigma is the standard deviation of the surface's own value; that of the others is NaN where it is unknown.
    """

    wi: Float[np.ndarray, "n 3"]
    wo: Float[np.ndarray, "n 3"]
    value: Float[np.ndarray, "n c"]
    sigma: Float[np.ndarray, "n c"] | None
    valid: Bool[np.ndarray, "n c"]
    channels: tuple[str, ...]
    source: str = "array"
    masked: dict[str, int] = dataclasses.field(default_factory=dict)
    notes: tuple[str, ...] = ()
    instrument: Instrument = IDEAL
    warnings: tuple[str, ...] = ()
    stated: tuple[StatedAlbedo, ...] = ()
    horizontal: Float[np.ndarray, "n c"] | None = None
    inferred: Bool[np.ndarray, "n c"] | None = None

    __repr__ = brief

    def __post_init__(self) -> None:
        arguments.kind("channels", self.channels, tuple, list)
        arguments.kind("instrument", self.instrument, Instrument)
        arguments.kind("stated", self.stated, tuple)
        for stated in self.stated:
            arguments.kind("one of stated", stated, StatedAlbedo)
        count, columns = len(self.wi) if isinstance(self.wi, np.ndarray) else 0, len(self.channels)
        shapes = {"wi": (count, 3), "wo": (count, 3), "value": (count, columns), "valid": (count, columns)}
        beside = ("sigma", "horizontal", "inferred")
        for name, shape in (shapes | {n: shapes["value"] for n in beside if getattr(self, n) is not None}).items():
            arguments.kind(name, given := getattr(self, name), np.ndarray)
            if given.shape != shape:
                got, columns = f"{name} of shape {given.shape}", f", {shape[1]} columns" if shape[1:] else ""
                expected = f"expected {shape}: a row for each of wi{columns}"
                raise ReadError(f"{got}, {expected}. fitmat.from_arrays makes them.")

    @property
    def n_samples(self) -> int:
        """Rows, masked ones included."""
        return len(self.wi)

    @property
    def n_masked(self) -> int:
        """Rows in which at least one channel is masked."""
        return int(np.count_nonzero(~self.valid.all(axis=1)))

    @property
    def n_valid(self) -> int:
        """Values (rows × channels) that can be fitted."""
        return int(np.count_nonzero(self.valid))

    @property
    def sigma_given(self) -> bool:
        """Whether the noise of what was measured is known."""
        return self.sigma is not None and (self.inferred is None or bool(np.isfinite(self.sigma[~self.inferred]).any()))

    @property
    def theta_i(self) -> Float[np.ndarray, " n"]:
        """Zenith angle of incidence in radians."""
        return zenith(self.wi)

    @property
    def phi_i(self) -> Float[np.ndarray, " n"]:
        """Azimuth of incidence in radians, [0, 2π); 0 for light along the normal."""
        return np.where(self.theta_i < IN_PLANE, 0.0, np.arctan2(self.wi[:, 1], self.wi[:, 0]) % (2 * np.pi))

    @property
    def theta_o(self) -> Float[np.ndarray, " n"]:
        """Zenith angle of reflection in radians, 0 to π/2."""
        return zenith(self.wo)

    @property
    def phi(self) -> Float[np.ndarray, " n"]:
        """Relative azimuth in radians, [0, π]; π is the mirror side."""
        return relative_azimuth(self.wi, self.wo)

    @property
    def signed_phi(self) -> Float[np.ndarray, " n"]:
        """Relative azimuth φ_o − φ_i in radians, [−π, π); the sign is the side of the plane of incidence."""
        return signed_azimuth(self.wi, self.wo)

    @property
    def rotation(self) -> Float[np.ndarray, " n"]:
        """`phi_i` where the sample was turned between scans; 0 where it was not, or each row has its own azimuth."""
        turned = np.round(self.phi_i, DIGITS) % np.round(2 * np.pi, DIGITS)
        _, count = np.unique(turned, return_counts=True)
        return turned if len(count) > 1 and np.median(count) >= SCANNED else np.zeros_like(turned)

    @property
    def signed_theta_o(self) -> Float[np.ndarray, " n"]:
        """theta_o in radians, positive on the mirror side."""
        return signed_zenith(self.wi, self.wo)

    @property
    def in_plane(self) -> Bool[np.ndarray, " n"]:
        """Which rows lie in the plane of incidence (all azimuths do where ω_i or ω_o is the normal)."""
        return in_plane(self.wi, self.wo)

    def rows(self, keep: np.ndarray) -> "Measurements":
        """The rows selected by a mask or by indices; counts of what was masked stay those of the source."""
        names = ("wi", "wo", "value", "sigma", "valid", "horizontal", "inferred")
        parts = {name: part[keep] for name in names if (part := getattr(self, name)) is not None}
        return dataclasses.replace(self, **parts)

    def _repr_html_(self) -> str:
        return "<br>".join(html.escape(line) for line in str(self).splitlines())

    def __str__(self) -> str:
        """A few plain lines: how much, which channels, which angles, what was masked, what was assumed."""
        angles = np.unique(np.round(np.rad2deg(self.theta_i), 1))
        listed = ", ".join(f"{a:g}°" for a in angles[:8]) + (" …" if len(angles) > 8 else "")
        names = self.channels if len(self.channels) <= 12 else (*self.channels[:3], "…", self.channels[-1])
        count = "" if len(names) == len(self.channels) else f" ({len(self.channels)})"
        lines = [
            f"{self.source}: {self.n_samples} samples, channels {', '.join(map(visible, names))}{count}",
            f"incidence {listed}; sigma {'given' if self.sigma_given else 'not given'}",
        ]
        lines += [f"{count} masked: {reason}" for reason, count in self.masked.items()]
        if self.inferred is not None:
            lines += [f"{np.count_nonzero(self.inferred.any(axis=1))} inferred, not measured"]
        lines += [f"WARNING: {warning}" for warning in self.warnings]
        return "\n".join([*lines, *self.notes, *filter(None, [str(self.instrument)])])


def from_arrays(
    theta_i: ArrayLike,
    theta_o: ArrayLike,
    value: ArrayLike,
    *,
    phi: ArrayLike = np.pi,
    phi_i: ArrayLike = 0.0,
    sigma: ArrayLike | None = None,
    channels: Sequence[str] | None = None,
    source: str = "array",
    instrument: Instrument = IDEAL,
) -> Measurements:
    """Measurements from angles in **radians** and BRDF values in sr⁻¹, for use in a notebook or a simulation.

    Args:
        theta_i: Zenith angles of incidence, (n,), 0 to π/2.
        theta_o: Zenith angles of reflection, (n,), −π/2 to π/2; with the default phi, positive = mirror side.
        value: BRDF, (n,) or (n, c).
        phi: Relative azimuth φ_o − φ_i, (n,) or one number; π is the mirror side.
        phi_i: Azimuth of incidence, (n,) or one number; of consequence for anisotropic and tilted samples only.
        sigma: Standard deviation of the noise, shape of `value`.
        channels: Names of the c columns.
        source: Title for messages.
        instrument: What took them.

    Raises:
        FitmatError: something is not numbers, an angle is out of range, as in degrees, or lengths differ.

    Example:
        >>> from_arrays([0.5, 0.5], [-0.5, 0.5], [0.1, 0.3]).n_samples
        2
    """
    arguments.kind("source", source, str)
    arguments.kind("instrument", instrument, Instrument)
    theta_i, theta_o, phi, phi_i = _angles(source, theta_i, theta_o, phi, phi_i)
    value = np.atleast_2d(arguments.numbers("value", value).T).T
    if value.ndim != 2 or theta_i.ndim != 1 or len(value) != len(theta_i):
        got = f"{source}: values of shape {value.shape} for angles of shape {theta_i.shape}"
        raise ReadError(f"{got}, expected (n,) or (n, c) for (n,).")
    if sigma is not None:
        sigma = _sigma(source, sigma, value.shape)
    channels = _names(source, channels, value.shape[1])
    placed = np.isfinite(theta_i) & np.isfinite(theta_o) & np.isfinite(phi) & np.isfinite(phi_i)
    theta_i, theta_o, phi, phi_i = (np.where(placed, angle, 0.0) for angle in (theta_i, theta_o, phi, phi_i))
    phi_o = phi_i + phi + np.where(theta_o < 0, np.pi, 0.0)
    wi, wo = from_angles(theta_i, phi_i), from_angles(np.abs(theta_o), phi_o)
    valid = np.isfinite(value) & (placed & (wi[:, 2] > 0) & (wo[:, 2] > 0))[:, None]
    if sigma is not None:
        valid = valid & np.isfinite(sigma) & (sigma > 0)
    masked = {"not finite, no positive sigma, or below the horizon": int((~valid.all(1)).sum())}
    return Measurements(
        wi=wi,
        wo=wo,
        value=np.where(valid, value, 0.0),
        sigma=sigma,
        valid=valid,
        channels=channels,
        source=source,
        masked={reason: count for reason, count in masked.items() if count},
        instrument=instrument,
    )


def _angles(
    source: str, theta_i: ArrayLike, theta_o: ArrayLike, phi: ArrayLike, phi_i: ArrayLike
) -> tuple[np.ndarray, ...]:
    """The four in radians, as long as one another."""
    given = (
        arguments.angles("theta_i", theta_i, arguments.ZENITH, missing=True),
        arguments.angles("theta_o", theta_o, arguments.ZENITH, signed=True, missing=True),
        arguments.angles("phi", phi, arguments.AZIMUTH, signed=True, missing=True),
        arguments.angles("phi_i", phi_i, arguments.AZIMUTH, signed=True, missing=True),
    )
    try:
        return np.broadcast_arrays(*given)
    except ValueError:
        shapes = ", ".join(str(angle.shape) for angle in given)
        raise ReadError(f"{source}: theta_i, theta_o, phi, phi_i of shapes {shapes}, expected (n,) or one.") from None


def _sigma(source: str, given: ArrayLike, shape: tuple[int, ...]) -> np.ndarray:
    sigma = np.atleast_2d(arguments.numbers("sigma", given).T).T
    if sigma.ndim > 2 or any(found not in (1, wanted) for found, wanted in zip(sigma.shape, shape, strict=True)):
        raise ReadError(f"{source}: sigma of shape {sigma.shape} for values of shape {shape}, expected the same.")
    return np.broadcast_to(sigma, shape)


def _names(source: str, given: Sequence[str] | None, count: int) -> tuple[str, ...]:
    if given is None:
        return default_channels(count)
    arguments.kind("channels", given, tuple, list)
    for name in given:
        arguments.kind("a name in channels", name, str)
    if len(given) != count or len(set(given)) != count:
        got = f"channels {', '.join(map(visible, given))} for {count} columns of values"
        raise ReadError(f"{source}: {got}, expected one name each, all different. Name them (channels=).")
    return tuple(given)


def default_channels(count: int) -> tuple[str, ...]:
    """Names for unnamed channels: "value", or r, g, b, or 1 … c."""
    known = {1: ("value",), 3: ("r", "g", "b")}
    return known.get(count, tuple(str(k + 1) for k in range(count)))
