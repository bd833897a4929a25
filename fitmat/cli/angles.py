"""Angles as flags say them: a list or a range in degrees, as text.

It knows no instrument.
"""

import numpy as np

from fitmat.errors import ModelError

MOST_ANGLES = 10_000
"""More angles than this on one axis are a slip of the keyboard."""


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
    try:
        if ":" in text:
            first, last, step = (float(part) for part in text.split(":"))
            count = (last - first) / step + 1.5 if step > 0 else 0.0
            found = first + step * np.arange(int(min(max(count, 0.0), MOST_ANGLES + 1)))
        else:
            found = np.array([float(part) for part in text.split(",")])
    except ValueError as error:
        raise ModelError(f"{option} {text!r}: expected a list 10,30,60 or FIRST:LAST:STEP in degrees.") from error
    if found.size > MOST_ANGLES:
        raise ModelError(f"{option} {text!r}: expected at most {MOST_ANGLES} angles; take a larger step.")
    if found.size == 0 or not ((found >= lowest) & (found > -90) & (found < highest)).all():
        raise ModelError(
            f"{option} {text!r}: expected angles from {lowest:g} to below {highest:g} degrees, in rising order."
        )
    return found
