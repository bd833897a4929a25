"""Units: what a header says of a unit behind a name, as in theta_i [rad], theta_o (deg) or reflectance / %.

It knows no name and converts nothing.
"""

import re

LONGEST = 200
"""A name of more characters says neither a unit nor a scale nor a wavelength."""

_SPELLINGS = {
    "deg": ("deg", "degs", "degree", "degrees", "°"),
    "rad": ("rad", "rads", "radian", "radians"),
    "gon": ("gon",),
    "%": ("%", "percent", "pct"),
    "µm": ("um", "µm", "μm", "micron", "microns"),
    "": ("nm", "1/sr", "sr-1", "sr^-1", "sr^{-1}", "sr⁻¹", "1", "w/m2/sr", "w/m^2/sr", "w/m²/sr", "w/(m2 sr)"),
}
"""Unit → how people write it, in lower case; "" where there is nothing to convert."""

_UNITS = {spelling: unit for unit, spellings in _SPELLINGS.items() for spelling in spellings}
_ANY = "|".join(sorted(map(re.escape, _UNITS), key=len, reverse=True))
_WORDS = "deg|degrees|rad|radians|gon|percent"
_BEHIND = re.compile(rf"(?i)^(.*?\S)\s*(?:[\[(]\s*({_ANY})\s*[\])]|/\s*({_ANY})|_({_WORDS}))$")
_BRACKET = re.compile(r"^(.*?\S)\s*[\[(]([^\[\]()]*)[\])]$")


def split(name: str) -> tuple[str, str]:
    """A name without its unit, and the unit: "deg", "rad", "gon", "%", "µm", or "" for any other.

    Example:
        >>> split("theta_i [Rad]")
        ('theta_i', 'rad')
    """
    name = " ".join(name.split())
    found = _BEHIND.match(name) if len(name) <= LONGEST else None
    if found is None:
        return name, ""
    return found[1], _UNITS[(found[2] or found[3] or found[4]).lower()]


def bracket(name: str) -> tuple[str, str] | None:
    """A name and whatever stands in brackets behind it, None where nothing does."""
    found = _BRACKET.match(name.strip()) if len(name) <= LONGEST else None
    return (found[1], found[2]) if found else None


def is_row(cells: tuple[str, ...]) -> bool:
    """Whether the cells are units, one of them that of an angle."""
    return any(_UNITS.get(cell.strip("[]() ").lower()) in ("deg", "rad", "gon") for cell in cells)


def named(name: str, cell: str) -> str:
    """A name with the unit that stands below it."""
    unit = cell.strip("[]() ")
    return f"{name} [{unit}]" if unit.strip("-–") else name
