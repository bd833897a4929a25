"""Names: what a header calls its columns → what they hold, and of which channel.

They look at no other column and at no number.
"""

import re
from collections.abc import Sequence
from typing import NamedTuple

from fitmat.measurements.parsing import units
from fitmat.measurements.parsing.scales import stated
from fitmat.measurements.parsing.wavelengths import wavelength
from fitmat.measurements.quantity import QUANTITIES

ALIASES = {
    "theta_i": (
        *("theta_in", "aoi", "incidence_angle", "sza", "incident_angle", "angle_of_incidence", "theta_inc", "theta_s"),
        *("incidence", "lamp_angle", "source_angle", "einfallswinkel"),
        *("in_theta", "zenith_i", "solar_zenith", "sun_zenith", "source_zenith", "illumination_zenith"),
    ),
    "theta_o": (
        *("theta_out", "theta_r", "detector_angle", "vza", "measure_angle", "measurement_angle", "scatter_angle"),
        *("emission", "camera_angle", "sensor_angle", "ausfallswinkel", "beobachtungswinkel"),
        *("reflection_angle", "viewing_angle", "view_angle", "theta_v", "out_theta", "zenith_o", "zenith_r"),
        *("view_zenith", "viewing_zenith", "sensor_zenith", "detector_zenith"),
    ),
    "phi": ("dphi", "delta_phi", "phi_rel", "relative_azimuth", "rel_azimuth", "azimuth_difference", "raa"),
    "phi_i": ("phi_in", "phi_inc", "phi_s", "in_phi", "azimuth_i", "saa", "solar_azimuth", "sun_azimuth"),
    "phi_o": ("phi_out", "phi_r", "phi_v", "out_phi", "azimuth_o", "vaa", "view_azimuth", "sensor_azimuth"),
    "elevation_i": ("elevation_in", "elevation_inc", "solar_elevation", "sun_elevation", "source_elevation"),
    "elevation_o": ("elevation_out", "elevation_r", "view_elevation", "viewing_elevation", "sensor_elevation"),
    "brdf": ("f_r", "bsdf"),
    "brdf_cos": ("ccbrdf", "ccbsdf"),
    "reflectance_factor": ("brf",),
    "radiance": (),
    "panel_ratio": ("ratio",),
    "signal": ("reading", "counts"),
    "reference": ("reference_signal", "white", "panel"),
    "value": (),
    "sigma": ("std", "stdev", "std_dev", "standard_deviation", "brdf_sigma", "brdf_std"),
    "sigma_reference": (),
    "wavelength": ("wavelength_nm", "lambda", "lambda_nm", "wl", "nm"),
    "channel": ("band",),
    "valid": (),
    "invalid": ("flag",),
    "inferred": (),
    "inferred_sd": (),
}
"""Our name → its aliases; letter case, separators, Greek letters, a final "angle" and units do not matter."""

VALUES = (*QUANTITIES, "signal", "value")
BESIDE = ("sigma", "reference", "sigma_reference", "inferred", "inferred_sd")
_KINDS = {alias.replace("_", ""): kind for kind, others in ALIASES.items() for alias in (kind, *others)}
_GREEK = str.maketrans({"θ": "theta", "ϑ": "theta", "φ": "phi", "ϕ": "phi", "λ": "lambda", "σ": "sigma"})
_CHANNELS = {"red": "r", "green": "g", "blue": "b"} | {name: name for name in "rgbxyz"}


class Role(NamedTuple):
    """What a column holds: one of `ALIASES`, and the channel of a value or sigma ("" where it has none)."""

    kind: str
    channel: str = ""

    def __str__(self) -> str:
        return "_".join(filter(None, self))


def role(name: str, *, any_channel: bool = False) -> Role | None:
    """What a header name stands for, None where it is foreign; channels: r, g, b, x, y, z or a number (nm).

    Example:
        >>> role("BRDF_550nm")
        Role(kind='brdf', channel='550')
    """
    if len(name) > units.LONGEST:
        return None
    plain = units.split(" ".join(name.split()))[0].lower().translate(_GREEK).strip()
    plain = re.sub(r"[\s\-_]+", "_", plain)
    if (kind := _kind(plain)) is not None:
        return Role(kind)
    stem, _, channel = plain.rpartition("_")
    kind = _kind(stem)
    if kind not in (*VALUES, *BESIDE):
        return None
    number = re.fullmatch(r"(\d+(?:\.\d+)?)(nm)?", channel)
    known = number[1] if number else _CHANNELS.get(channel, channel if any_channel else "")
    return Role(kind, known) if known else None


def _kind(plain: str) -> str | None:
    """One of `ALIASES`, whatever separates the words of its name."""
    squeezed = plain.replace("_", "")
    return _KINDS.get(re.sub("(?<=zenith)angle$|(?<=azimuth)angle$|(?<=elevation)angle$", "", squeezed))


def roles_of(names: Sequence[str], *, valued: bool) -> list[Role | None]:
    """What each name stands for; logarithms and wavelengths count where nothing else is a value."""
    found = [role(name) for name in names]
    bands = [Role("value", band) if (band := wavelength(name)) else None for name in names]
    for others in ([role(stated(name)[0]) for name in names], bands):
        if not valued and not any(mine is not None and mine.kind in VALUES for mine in found):
            found = [mine or other for mine, other in zip(found, others, strict=True)]
    return found
