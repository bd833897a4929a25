"""Instrument: what lies between a surface and the numbers of a file, apart from its noise.

A description only; `models.around.instrument` is the model that follows from it, `measurements.noise` the scatter.
"""

import dataclasses

import numpy as np

from fitmat import arguments
from fitmat.errors import ReadError

WIDEST = np.deg2rad(30.0)
"""Largest half-angle of an aperture, radians; beyond it the average over a cone is no small correction."""

LARGEST_ERROR = np.deg2rad(2.0)
"""Largest standard uncertainty of an angle, radians; beyond it a slope says little of what lies so far away."""

UNKNOWN_SCALE = 1.0
"""Standard deviation of the logarithm of a scale of which nothing is known: a factor of e either way."""


@dataclasses.dataclass(frozen=True)
class Instrument:
    """A goniophotometer, as far as the values of a file depend on it.

    Attributes:
        source: Half-angle of the cone in which light reaches the sample, radians; 0 for a collimated beam.
        receiver: Half-angle of the cone that the detector collects, radians; 0 for a distant small one.
        calibration: Relative standard deviation of an error that all values share, such as that of the reference.
        dark: Dark signal or stray light in units of f_r cosθ_o, sr⁻¹; None where it is to be fitted.
        angle_error: Standard uncertainty of θ_i and of θ_o, radians: of an offset of each that all values share, and of
            what each reading adds to it by chance.
        aperture_error: Relative standard uncertainty of the half-angles, which source and receiver share.

    Raises:
        FitmatError: something is not a number, out of range, or about an aperture that there is not.
    """

    source: float = 0.0
    receiver: float = 0.0
    calibration: float = 0.0
    dark: float | None = 0.0
    angle_error: float = 0.0
    aperture_error: float = 0.0

    def __post_init__(self) -> None:
        half, degrees = " radians (half-angle)", "; is it in degrees (np.deg2rad)?"
        limits = {
            "source": (WIDEST, half + degrees),
            "receiver": (WIDEST, half + degrees),
            "calibration": (UNKNOWN_SCALE, ". Correct it."),
            "dark": (1.0, ". Correct it."),
            "angle_error": (LARGEST_ERROR, f" radians{degrees}"),
            "aperture_error": (0.5, ", a fraction of the half-angle. Correct it."),
        }
        for name, (upper, remedy) in limits.items():
            value = getattr(self, name)
            if name == "dark" and self.dark is None:
                continue
            arguments.real(f"{name} of the instrument", value)
            if not (np.isfinite(value) and 0 <= value <= upper):
                raise ReadError(f"{name} = {value:g} of the instrument, expected 0 to {upper:.4g}{remedy}")
        if self.aperture_error and not self.source + self.receiver:
            got = f"aperture_error = {self.aperture_error:g} of an instrument without apertures (--aperture-error)"
            raise ReadError(
                f"{got}, expected a half-angle that it is about. Give --source-angle or --receiver-angle too, or leave "
                "it out."
            )

    @property
    def ideal(self) -> bool:
        """Whether it shows the surface as it is."""
        return self == IDEAL

    def without_errors(self) -> "Instrument":
        """What it does to the values, without what it does not know of itself."""
        return dataclasses.replace(self, calibration=0.0, angle_error=0.0, aperture_error=0.0)

    def __str__(self) -> str:
        """What is taken into account, in a sentence; empty for an ideal instrument."""
        parts = []
        for name, angle in (("source", self.source), ("receiver", self.receiver)):
            if angle:
                parts.append(f"{name} of {np.rad2deg(angle):g}° half-angle")
        if self.calibration == UNKNOWN_SCALE:
            parts.append("scale unknown")
        elif self.calibration:
            parts.append(f"calibration good to {100 * self.calibration:g} %, shared by all values")
        if self.aperture_error:
            parts.append(f"half-angles good to {100 * self.aperture_error:g} %")
        if self.angle_error:
            parts.append(f"angles good to {np.rad2deg(self.angle_error):g}°, as an offset and from reading to reading")
        if self.dark is None:
            parts.append("dark signal fitted")
        elif self.dark:
            parts.append(f"dark signal {self.dark:g} sr⁻¹")
        return f"Instrument: {'; '.join(parts)}." if parts else ""


IDEAL = Instrument()
"""One that shows the surface as it is."""
