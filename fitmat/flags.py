"""Flags: groups of options that several commands share, and what they make of them.

They read no file and print nothing.
"""

import functools
import inspect
from collections.abc import Callable
from math import radians
from typing import Any

from fitmat import options
from fitmat.errors import ReadError


def reading(
    columns: options.Columns = None,
    quantity: options.Quantity = None,
    angle_unit: options.AngleUnit = None,
    forward: options.Forward = "positive",
    specular_azimuth: options.SpecularAzimuth = 180,
    intensity: options.Intensity = None,
    distance: options.Distance = None,
    where: options.Where = None,
    panel: options.Panel = None,
    unknown_scale: options.UnknownScale = False,
) -> dict[str, Any]:
    """What the flags say of a file, as arguments of `fitmat.read`."""
    return dict(locals())


def instrument(
    calibration: options.Calibration = 0.0,
    source_angle: options.SourceAngle = 0.0,
    receiver_angle: options.ReceiverAngle = 0.0,
    dark: options.Dark = "0",
) -> Any:
    """The `fitmat.instrument.Instrument` that the flags describe.

    Raises:
        ReadError: --dark is neither a number nor "fit", or a number is out of range.
    """
    from fitmat.instrument import Instrument

    try:
        level = None if dark == "fit" else float(dark)
    except ValueError:
        raise ReadError(f"--dark {dark}: expected a number in sr⁻¹, or fit.") from None
    return Instrument(radians(source_angle), radians(receiver_angle), calibration, level)


def takes(*groups: Callable[..., Any]) -> Callable[[Callable[..., None]], Callable[..., None]]:
    """Give a command the flags of `groups` beside its own, and what each group makes of them as a parameter."""
    flags = {group.__name__: inspect.signature(group).parameters for group in groups}

    def decorate(command: Callable[..., None]) -> Callable[..., None]:
        own = [p for p in inspect.signature(command).parameters.values() if p.name not in flags]
        every = [p.replace(kind=inspect.Parameter.KEYWORD_ONLY) for p in (*own, *_parameters(flags.values()))]

        @functools.wraps(command)
        def wrapped(**given: Any) -> None:
            made = {group.__name__: group(**{n: given.pop(n) for n in flags[group.__name__]}) for group in groups}
            command(**given, **made)

        wrapped.__signature__ = inspect.Signature(every)  # pyright: ignore[reportAttributeAccessIssue]
        wrapped.__annotations__ = {p.name: p.annotation for p in every}
        return wrapped

    return decorate


def _parameters(groups: Any) -> list[inspect.Parameter]:
    return [parameter for group in groups for parameter in group.values()]
