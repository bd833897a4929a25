"""Options: what a file does not say about itself, said by its reader.

They hold no default that would change a value in silence.
"""

import dataclasses
import math
from collections.abc import Mapping

from fitmat import arguments
from fitmat.errors import ReadError
from fitmat.measurements.lighting import PointSource

ALLOWED: dict[str, tuple[str | int | None, ...]] = {
    "quantity": (None, "brdf", "brdf_cos", "reflectance_factor", "radiance", "panel_ratio", "signal"),
    "forward": (None, "positive", "negative"),
    "specular_azimuth": (None, 180, 0, 90, 270),
    "scale": (None, "linear", "percent", "db", "log10", "ln"),
}
"""Option → its choices, the default first; the command line offers the same."""


TURNS = {"degrees": 360.0, "radians": 2 * math.pi, "gon": 400.0}
"""Unit of an angle → how many of it are a full turn."""

ELEVATIONS = {"theta_i": "elevation_i", "theta_o": "elevation_o"}
"""Zenith angle → the angle from the horizon that may stand in its place."""

ANGLES = ("theta_i", "theta_o", "phi", "phi_i", "phi_o", *ELEVATIONS.values())
"""Columns that hold angles."""


@dataclasses.dataclass(frozen=True)
class Options:
    """How to read the numbers of a table.

    Attributes:
        quantity: What a plain `value` column holds; None where the column's name says it.
        angle_unit: One of `TURNS`, or units of single columns, "phi=radians,theta_o=gon"; None, and for other columns,
            degrees, refused where the range looks like radians.
        forward: Sign of theta_o on the mirror side of a positive theta_i, for files without azimuth; None for positive,
            asked for where theta_i is negative, doubted where the values peak on the other side.
        specular_azimuth: Relative azimuth of the mirror side in the file, 180, 0, 90 or 270 degrees; None for 180,
            doubted where the values peak on another side.
        intensity: Of the point source that caused radiances, W/sr.
        distance: Of that source, m.
        where: NAME=VALUE of the rows of a table to read; None for all.
        panel: Reflectance factor of the white panel to which readings were compared, 0 to 2.
        unknown_scale: Whether the values are known but for a factor that all of them share.
        scale: How the values are written: "linear", "percent", "db", "log10" or "ln"; None for linear, refused where
            they look like one of the others.
        constants: What is the same in every row and has no column: name → number, in the file's own unit.
    """

    quantity: str | None = None
    angle_unit: str | None = None
    forward: str | None = None
    specular_azimuth: int | None = None
    intensity: float | None = None
    distance: float | None = None
    where: str | None = None
    panel: float | None = None
    unknown_scale: bool = False
    scale: str | None = None
    constants: Mapping[str, float] = dataclasses.field(default_factory=dict)

    def __post_init__(self) -> None:
        self._refuse_kinds()
        for name, choices in ALLOWED.items():
            given = getattr(self, name)
            if given not in choices:
                expected = " or ".join(repr(choice) for choice in choices if choice is not None)
                flag = "--" + name.replace("_", "-")
                raise ReadError(f"{name} = {given!r} ({flag}), expected {expected}. Choose one of these.")
        if (self.intensity is None) != (self.distance is None):
            got = "intensity" if self.distance is None else "distance"
            raise ReadError(f"{got} alone, expected intensity and distance (--intensity, --distance). Give both.")
        if self.unknown_scale and (self.panel is not None or self.source is not None):
            got = "panel (--panel)" if self.panel is not None else "intensity and distance (--intensity, --distance)"
            expected = "expected one of the two: a scale that is fitted takes the place of a known one"
            raise ReadError(f"{got} beside unknown_scale (--unknown-scale), {expected}. Leave one out.")
        if self.panel is not None and not 0 < self.panel <= 2:
            expected = "expected its reflectance factor, 0 to 2 (Spectralon: 0.99)"
            raise ReadError(f"panel = {self.panel:g} (--panel), {expected}. Correct it.")

        self._units()

    def _refuse_kinds(self) -> None:
        for name in ("quantity", "angle_unit", "forward", "where", "scale"):
            arguments.kind(name, getattr(self, name), str, optional=True)
        for name in ("intensity", "distance", "panel"):
            arguments.real(name, getattr(self, name), optional=True)
        arguments.whole("specular_azimuth", self.specular_azimuth, optional=True)
        arguments.flags(unknown_scale=self.unknown_scale)
        arguments.kind("constants", self.constants, Mapping)
        for name, number in self.constants.items():
            arguments.real(f"constants[{name!r}]", number)

    def unit(self, angle: str) -> str | None:
        """The unit that was said for one of `ANGLES`; None where nothing was."""
        return self._units().get(angle)

    @property
    def said_units(self) -> dict[str, str]:
        """The units of single columns, where they were said one by one."""
        return {} if self.angle_unit in (None, *TURNS) else self._units()

    def with_units(self, units: Mapping[str, str]) -> "Options":
        """The same with the unit of each of some `ANGLES`."""
        told = ",".join(f"{angle}={unit}" for angle, unit in (self.said_units | dict(units)).items())
        return dataclasses.replace(self, angle_unit=told) if told else self

    def _units(self) -> dict[str, str]:
        if self.angle_unit is None or self.angle_unit in TURNS:
            return dict.fromkeys(ANGLES, self.angle_unit) if self.angle_unit else {}
        pairs = [[part.strip() for part in pair.split("=")] for pair in self.angle_unit.split(",")]
        if all(len(pair) == 2 and pair[0] in ANGLES and pair[1] in TURNS for pair in pairs):
            return {pair[0]: pair[1] for pair in pairs}
        expected = "expected 'degrees', 'radians' or 'gon', or units of columns, 'phi=radians,theta_o=degrees'"
        raise ReadError(f"angle_unit = {self.angle_unit!r} (--angle-unit), {expected}. Choose one of these.")

    @property
    def source(self) -> PointSource | None:
        """The point source, where it is described."""
        if self.intensity is None or self.distance is None:
            return None
        return PointSource(self.intensity, self.distance)
