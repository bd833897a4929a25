"""Angles and wavelengths as flags say them: a list or a range in degrees or nm, as text.

It knows no instrument.
"""

import numpy as np

from fitmat.errors import ModelError
from fitmat.models.dispersion import LONGEST, SHORTEST

MOST_ANGLES = 10_000
"""More angles than this on one axis are a slip of the keyboard."""

MOST_WAVELENGTHS = 1000


def angles(text: str, option: str, *, lowest: float = -90.0, highest: float = 90.0) -> np.ndarray:
    """`FIRST:LAST:STEP` or a comma-separated list, in degrees.

    Args:
        text: What the user gave.
        option: Its name, for messages.
        lowest: Smallest angle allowed, degrees; −90 itself is not.
        highest: The angles stay below it.

    Raises:
        ModelError: the text is neither, there are too many angles, or one is outside `lowest` to `highest`.
    """
    found = _listed(text, option, "10,30,60 or FIRST:LAST:STEP in degrees")
    if found.size > MOST_ANGLES:
        raise ModelError(f"{option} {text!r}: expected at most {MOST_ANGLES} angles; take a larger step.")
    if found.size == 0 or not ((found >= lowest) & (found > -90) & (found < highest)).all():
        raise ModelError(
            f"{option} {text!r}: expected angles from {lowest:g} to below {highest:g} degrees, in rising order."
        )
    return found


def wavelengths(text: str, option: str) -> np.ndarray:
    """`FIRST:LAST:STEP` or a comma-separated list, in nm, no two alike.

    Args:
        text: What the user gave.
        option: Its name, for messages.

    Raises:
        ModelError: the text is neither, or a wavelength is there twice or no light that a surface is measured in.
    """
    found = _listed(text, option, "450,550,650 or FIRST:LAST:STEP in nm, as 400:700:10")
    if not 0 < found.size <= MOST_WAVELENGTHS or not ((found >= SHORTEST) & (found <= LONGEST)).all():
        raise ModelError(
            f"{option} {text!r}: expected 1 to {MOST_WAVELENGTHS} wavelengths from {SHORTEST:g} to {LONGEST:g} nm, in "
            "rising order. Are they in µm?"
        )
    if len(np.unique(found)) != found.size:
        raise ModelError(f"{option} {text!r}: expected each wavelength once. Leave the other out.")
    return found


def _listed(text: str, option: str, expected: str) -> np.ndarray:
    """The numbers of a list or a range, one more than `MOST_ANGLES` at most."""
    try:
        if ":" in text:
            first, last, step = (float(part) for part in text.split(":"))
            count = (last - first) / step + 1.5 if step > 0 else 0.0
            return first + step * np.arange(int(min(max(count, 0.0), MOST_ANGLES + 1)))
        return np.array([float(part) for part in text.split(",")])
    except ValueError as error:
        raise ModelError(f"{option} {text!r}: expected a list {expected}.") from error
