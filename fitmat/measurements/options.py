"""Options: what a file does not say about itself, said by its reader.

They hold no default that would change a value in silence.
"""

import dataclasses

from fitmat import arguments
from fitmat.errors import ReadError
from fitmat.measurements.lighting import PointSource

ALLOWED: dict[str, tuple[str | int | None, ...]] = {
    "quantity": (None, "brdf", "brdf_cos", "reflectance_factor", "radiance", "panel_ratio", "signal"),
    "angle_unit": (None, "degrees", "radians"),
    "forward": ("positive", "negative"),
    "specular_azimuth": (180, 0),
}
"""Option → its choices, the default first; the command line offers the same."""


@dataclasses.dataclass(frozen=True)
class Options:
    """How to read the numbers of a table.

    Attributes:
        quantity: What a plain `value` column holds; None where the column's name says it.
        angle_unit: "degrees" or "radians"; None for degrees, refused where the range looks like radians.
        forward: Sign of theta_o on the mirror side, for files without azimuth.
        specular_azimuth: Relative azimuth of the mirror side in the file, 180 or 0 degrees.
        intensity: Of the point source that caused radiances, W/sr.
        distance: Of that source, m.
        where: NAME=VALUE of the rows of a table to read; None for all.
        panel: Reflectance factor of the white panel to which readings were compared, 0 to 2.
        unknown_scale: Whether the values are known but for a factor that all of them share.
        doubtful: Whether angles that look like radians are asked about; a part of a file cannot tell.
    """

    quantity: str | None = None
    angle_unit: str | None = None
    forward: str = "positive"
    specular_azimuth: int = 180
    intensity: float | None = None
    distance: float | None = None
    where: str | None = None
    panel: float | None = None
    unknown_scale: bool = False
    doubtful: bool = True

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

    def _refuse_kinds(self) -> None:
        for name in ("quantity", "angle_unit", "forward", "where"):
            arguments.kind(name, getattr(self, name), str, optional=name != "forward")
        for name in ("intensity", "distance", "panel"):
            arguments.real(name, getattr(self, name), optional=True)
        arguments.whole("specular_azimuth", self.specular_azimuth)
        arguments.flags(unknown_scale=self.unknown_scale)

    @property
    def source(self) -> PointSource | None:
        """The point source, where it is described."""
        if self.intensity is None or self.distance is None:
            return None
        return PointSource(self.intensity, self.distance)
