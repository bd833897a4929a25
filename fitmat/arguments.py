"""Arguments: what a public function is given, looked at at its door; one sentence where it is something else.

It knows no class of fitmat but by name, and judges no number beyond its range.
"""

from collections.abc import Callable, Iterable, Mapping
from numbers import Integral, Real
from typing import Any, NoReturn

import numpy as np
from jaxtyping import Float

from fitmat.errors import FitmatError, ModelError

ZENITH, AZIMUTH = (np.pi / 2, "π/2"), (2 * np.pi, "2π")
"""Largest zenith angle and largest azimuth, radians, and how they are written."""

ROUNDING = 1e-6
"""Radians by which a rounded angle may lie beyond its limit."""

UNIT = 1e-6
"""How far the length of a direction may be from 1."""

_WHENCE = {
    "Measurements": "Measurements, from fitmat.read or fitmat.from_arrays",
    "Fit": "a Fit, from fitmat.fit",
    "Posterior": "a Posterior, from fitmat.laplace or fitmat.sample",
    "Match": "a Match, from fitmat.compare",
    "Study": "a Study, from fitmat.study",
    "AbstractBRDF": "a model, from fitmat.model",
    "Surface": "a Surface, from fitmat.Surface",
    "Instrument": "an Instrument, from fitmat.Instrument",
    "AbstractFresnel": "a Fresnel term",
    "Sequence": "a list",
    "Findings": "one of the findings of a Study",
    "Choice": "a Choice, from fitmat.choose",
    "Design": "a Design, from fitmat.next_angles",
    "Examination": "an Examination, from fitmat.examine",
    "Stream": "a large file",
    "str": "a text",
    "Path": "a pathlib.Path",
    "Mapping": "a dict by name",
    "PathLike": "a path",
}
# Class → what it is called, and who makes one.


def kind(name: str, given: object, *classes: type, optional: bool = False) -> None:
    """Stop where an argument is of none of the classes.

    Args:
        name: Of the argument.
        given: What it is.
        *classes: What it may be.
        optional: Whether it may be None.

    Raises:
        FitmatError: names the argument, what it is, what was expected and who makes it.
    """
    if not (isinstance(given, classes) or (optional and given is None)):
        wanted = [_WHENCE.get(one.__name__, f"of the class {one.__name__}") for one in classes]
        refuse(name, given, ", or ".join([*wanted, *(["None"] if optional else [])]))


def function(name: str, given: object) -> None:
    """Stop where an argument is neither None nor something to call; as `kind`."""
    if not (given is None or callable(given)):
        refuse(name, given, "a function, or None")


def flags(**given: object) -> None:
    """Stop where an argument is neither True nor False, as "no" is not; as `kind`."""
    for name, value in given.items():
        if not isinstance(value, bool | np.bool_):
            refuse(name, value, "True or False")


def choice(name: str, given: object, choices: Iterable[str | None]) -> None:
    """Stop where an argument is none of the choices; as `kind`."""
    known = tuple(choices)
    if not (given is None or isinstance(given, str)) or given not in known:
        refuse(name, given, " or ".join(repr(one) for one in known if one is not None))


def whole(name: str, given: object, least: int = 0, *, optional: bool = False) -> None:
    """Stop where an argument is no whole number of at least `least`; as `kind`."""
    if optional and given is None:
        return
    if not isinstance(given, Integral) or isinstance(given, bool | np.bool_) or given < least:
        refuse(name, given, f"a whole number of at least {least}")


def real(name: str, given: object, *, optional: bool = False) -> None:
    """Stop where an argument is no real number; as `kind`."""
    if (given is None and not optional) or not isinstance(given, Real | None) or isinstance(given, bool):
        refuse(name, given, "a number")


def named(**given: object) -> None:
    """Stop where an argument is neither None nor a dict whose keys are texts; as `kind`."""
    for name, values in given.items():
        kind(name, values, Mapping, optional=True)
        for key in values if isinstance(values, Mapping) else ():
            kind(f"a name in {name}", key, str)


def numbers(
    name: str, given: Any, low: float = -np.inf, high: float = np.inf, *, of: str = "", single: bool = False
) -> Float[np.ndarray, "..."]:
    """An argument as real numbers; what a masked array masks is NaN.

    Args:
        name: Of the argument.
        given: A number, or numbers in any nesting.
        low: The smallest allowed; NaN is allowed where there is no limit.
        high: The largest allowed.
        of: Unit and remedy for the message, as " radians".
        single: Whether it is one finite number.

    Raises:
        FitmatError: it holds text, complex numbers or nothing, is ragged, or a number is out of range.
    """
    limited = bool(np.isfinite([low, high]).any())
    span = f" from {low:.4g} to {high:.4g}" if np.isfinite(high) else f" of at least {low:.4g}"
    wanted = f"{'a number' if single else 'numbers'}{span if limited else ''}{of}"
    try:
        found = np.ma.asarray(given)
        if given is None or found.dtype.kind not in "iufO":
            raise TypeError
        found = np.ma.filled(found.astype(float), np.nan)
    except (TypeError, ValueError):
        refuse(name, given, wanted)
    if single and not (found.ndim == 0 and np.isfinite(found)):
        refuse(name, given, wanted)
    for worst in found[~((found >= low) & (found <= high))].flat[: int(limited)]:
        refuse(name, float(worst), wanted)
    return found


def angles(
    name: str, given: Any, limit: tuple[float, str], *, signed: bool = False, missing: bool = False
) -> Float[np.ndarray, "..."]:
    """An argument as angles in radians.

    Args:
        name: Of the argument.
        given: An angle, or angles in any nesting.
        limit: `ZENITH` or `AZIMUTH`.
        signed: Whether they may be negative.
        missing: Whether they may be NaN.

    Raises:
        FitmatError: as `numbers`, or one is out of range; asks whether they are degrees.
    """
    found, (largest, written) = numbers(name, given), limit
    for worst in found[~_within(found, largest, signed) & ~(missing & np.isnan(found))].flat[:1]:
        span = f"{f'−{written}' if signed else '0'} to {written} radians"
        raise FitmatError(f"{name} = {worst:g}: expected {span}. Are the angles in degrees (np.deg2rad)?")
    return found


def _within(found: np.ndarray, largest: float, signed: bool) -> np.ndarray:
    return (np.abs(found) <= largest + ROUNDING) & (signed | (found >= 0))


def unit_vectors(name: str, given: Float[np.ndarray, "n 3"]) -> None:
    """Stop where a row of an argument is not of unit length.

    Raises:
        ModelError: names the argument, the first such row and its length.
    """
    length = np.linalg.norm(given, axis=1)
    for row in np.flatnonzero(~(np.abs(length - 1.0) <= UNIT))[:1]:
        raise ModelError(f"{name} row {row} has length {length[row]:.9g}: expected unit vectors.")


def refuse(name: str, given: object, wanted: str) -> NoReturn:
    """Stop: an argument is not what was wanted.

    Raises:
        FitmatError: always.
    """
    raise FitmatError(f"{name} is {shown(given)}, expected {wanted}.")


def shown(given: object) -> str:
    """What something is, in a few words.

    Example:
        >>> shown(np.zeros((2, 3)))
        'an array of shape (2, 3)'
    """
    if given is None or isinstance(given, bool | int | float | complex):
        return repr(given)
    if isinstance(given, str):
        return f"the text {given if len(given) <= 40 else given[:39] + '…'!r}"
    if isinstance(given, type):
        return f"the class {given.__name__}"
    if isinstance(given, np.ndarray | np.generic):
        return f"an array of shape {np.shape(given)}" if np.ndim(given) else f"{given}"
    if isinstance(given, Callable) and hasattr(given, "__name__"):
        return f"the function {given.__name__}"
    called = type(given).__name__
    return f"{'an' if called[0] in 'aeiouAEIOU' else 'a'} {called}"
