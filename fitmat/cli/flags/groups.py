"""Groups: flags that several commands share, given to a command as what they mean.

They read no file and print nothing.
"""

import functools
import inspect
from collections.abc import Callable
from typing import Any


def takes(*groups: Callable[..., Any]) -> Callable[[Callable[..., None]], Callable[..., None]]:
    """Give a command the flags of `groups` beside its own, and what each group makes of them as a parameter.

    On the command line what must be there comes first, that of the groups before its own.
    """
    flags = {group.__name__: inspect.signature(group).parameters for group in groups}

    def decorate(command: Callable[..., None]) -> Callable[..., None]:
        own = [p for p in inspect.signature(command).parameters.values() if p.name not in flags]
        shared = _parameters(flags.values())
        ordered = [p for p in (*shared, *own) if p.default is p.empty] + [
            p for p in (*own, *shared) if p.default is not p.empty
        ]
        every = [p.replace(kind=inspect.Parameter.KEYWORD_ONLY) for p in ordered]

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
