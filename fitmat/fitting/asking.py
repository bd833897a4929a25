"""Asking: parameters that are named because all surfaces together tell more of them, and names that ask for nothing.

It shares nothing itself.
"""

import itertools
from collections.abc import Collection, Iterable, Mapping
from typing import NoReturn

from fitmat import arguments
from fitmat.errors import ModelError
from fitmat.maths.hierarchy import FEWEST


def asked(option: str, given: object) -> tuple[str, ...]:
    """The names that an argument holds.

    Args:
        option: "pool", or another argument of that form.
        given: A name, or several with commas between them or in a list; None for none.

    Raises:
        FitmatError: it is something else, or names nothing.
    """
    arguments.kind(option, given, str, list, tuple, optional=True)
    if given is None:
        return ()
    each = given.split(",") if isinstance(given, str) else list(given) if isinstance(given, list | tuple) else []
    for one in each:
        arguments.kind(f"a name in {option}", one, str)
    names = tuple(dict.fromkeys(one.strip() for one in each if one.strip()))
    if not names:
        arguments.refuse(option, given, "the name of a parameter")
    return names


def refuse_idle(
    option: str,
    names: Iterable[str],
    count: int,
    what: str,
    held: Collection[str],
    priors: Collection[str] = (),
) -> None:
    """Stop before anything is fitted where nothing could be shared.

    Args:
        option: What asks for it.
        names: Of the parameters.
        count: How many surfaces there are.
        what: Each is called, in the singular.
        held: Parameters that are held.
        priors: Those that have a prior.

    Raises:
        ModelError: a parameter is known beforehand, or there are too few surfaces.
    """
    for name in names:
        begun = _begun(option, name)
        if name in held:
            raise ModelError(f"{begun}: it is held, expected a parameter that is fitted. Leave one out.")
        if name in priors:
            got = "it has a prior (--prior), expected none: the others are its prior"
            raise ModelError(f"{begun}: {got}. Leave one out.")
        if count < FEWEST:
            got = f"{count} {what}{'s' if count > 1 else ''}"
            raise ModelError(f"{begun}: {got}, expected at least {FEWEST}, of which some can differ.")


def refuse_foreign(option: str, names: Iterable[str], parameters: Mapping[str, Iterable[str]]) -> None:
    """Stop where no model has what is asked for.

    Args:
        option: What asks for it.
        names: Of the parameters.
        parameters: Of each model, by its name.

    Raises:
        ModelError: names the parameter, the models, and what they have.
    """
    having = list(dict.fromkeys(itertools.chain(*parameters.values())))
    for name in names:
        if name not in having:
            got = f"no model of {', '.join(parameters)} has it"
            raise ModelError(f"{_begun(option, name)}: {got}, expected one of {', '.join(having)}.")


def refuse_other(option: str, name: str, got: str, expected: str) -> NoReturn:
    """Stop for another reason.

    Raises:
        ModelError: says it.
    """
    raise ModelError(f"{_begun(option, name)}: {got}, expected {expected}.")


def _begun(option: str, name: str) -> str:
    return f"{option} {name} (--{option})"
