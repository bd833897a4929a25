"""Wavelengths: which names of columns are wavelengths, as 450nm, R_450 or a bare 450, and which cannot all be.

It does not know what is measured at them.
"""

import re
from collections.abc import Sequence

import numpy as np
from jaxtyping import Bool, Float

from fitmat.errors import ReadError
from fitmat.measurements.parsing import units

RANGE = (300.0, 2500.0)
"""In nm, from the ultraviolet to the short-wave infrared; a bare number outside it is none."""

SHORTEST = 100.0
"""Number from which a wavelength is one in nm; smaller ones are in µm, or in another unit."""

_NAME = re.compile(r"(?:r|refl|reflectance|lambda|wl)?[ _]*(\d+(?:\.\d+)?)[ _]*(?:nm|[\[(]nm[\])])?", re.IGNORECASE)


def wavelength(name: str) -> str:
    """The wavelength in nm that a column is named by; "" for another name.

    Example:
        >>> wavelength("450 nm"), wavelength("R_850.5"), wavelength("12"), wavelength("row 450")
        ('450', '850.5', '', '')
    """
    found = _NAME.fullmatch(name.strip()) if len(name) <= units.LONGEST else None
    return found[1] if found and RANGE[0] <= float(found[1]) <= RANGE[1] else ""


def in_nanometres(
    given: Float[np.ndarray, " n"], unit: str
) -> tuple[Float[np.ndarray, " n"], Bool[np.ndarray, " n"], str]:
    """The wavelengths of a column in nm, which of its cells cannot be meant so, and what is expected of them.

    Args:
        given: As the column has them.
        unit: What its name says: "µm", or "" for nm.
    """
    micrometres = unit == "µm"
    small, lengths = given < SHORTEST, np.round(1000 * given, 6) if micrometres else given
    if (wrong := ~(np.isfinite(given) & (given > 0))).any():
        return lengths, wrong, "a wavelength in nm"
    if (wrong := small != micrometres).any() and not wrong.all():
        return lengths, wrong, "all wavelengths of the column in one unit, nm or µm"
    if micrometres:
        return lengths, wrong, f"less than {SHORTEST:g} µm; if it is in nm, name the column wavelength [nm]"
    return lengths, wrong, f"{SHORTEST:g} nm and more; if it is in µm, name the column wavelength [µm]"


def refuse_unlike(source: str, channels: Sequence[str]) -> None:
    """Stop at channels named by numbers that cannot all be wavelengths in nm.

    Args:
        source: For messages.
        channels: Names; those that are no numbers do not count.

    Raises:
        ReadError: one wavelength is there twice, or some or all of them are in µm.
    """
    known = [(float(name), name) for name in channels if re.fullmatch(r"\d+(\.\d+)?", name)]
    for (number, name), (following, other) in zip(sorted(known)[:-1], sorted(known)[1:], strict=True):
        if number == following:
            raise ReadError(f"{source}: channels {name} and {other} are one wavelength, expected it once. Remove one.")
    small = [name for number, name in known if 0.1 < number < SHORTEST and not number.is_integer()]
    if small and len(small) < len(known):
        large = next(name for number, name in known if number >= SHORTEST or number.is_integer())
        raise ReadError(
            f"{source}: channels {small[0]} and {large} are wavelengths in two units, expected nm. Rename the columns."
        )
    if small:
        renamed = ", ".join(f"{1e3 * float(name):g}" for name in small[:3])
        raise ReadError(
            f"{source}: channels {', '.join(small[:3])} look like wavelengths in µm, expected nm: {renamed}. "
            "Rename the columns."
        )
