"""Given: what may stand on one command line; a flag that counts once, needs another, or excludes the rest.

It knows no value of a flag: what is out of range is refused where it is used.
"""

from collections import Counter
from typing import Any

from typer.core import TyperCommand

NEEDS = {"fit": {"force": "out"}, "check": {"force": "plot"}, "design": {"force": "plot"}, "export": {"force": "out"}}
"""Command → parameter → the one without which it would do nothing."""

MOST = 4
"""Files that a message names."""

ALONE = {"simulate": {"catalogue": ("force",)}}
"""Command → parameter → what may stand beside it; whatever else is given would do nothing."""


class Command(TyperCommand):
    """A command that refuses what it would pass over."""

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """Parse, then stop where something given would do nothing."""
        if ctx.resilient_parsing:  # as for completion, where a line is not finished
            return TyperCommand.parse_args(self, ctx, args)
        _refuse_repeated(ctx, self.make_parser(ctx).parse_args(args=list(args))[-1])
        left = TyperCommand.parse_args(self, ctx, args)
        flags, given = _flags(ctx), typed(ctx)
        _refuse_unjoined(ctx)
        for name, other in NEEDS.get(self.name or "", {}).items():
            if name in given and other not in given:
                ctx.fail(f"{flags[name]} would replace nothing without {flags[other]}. Give both, or neither.")
        for name, beside in ALONE.get(self.name or "", {}).items():
            others = [flags[key] for key in given if key not in (name, *beside)]
            if name in given and others:
                ctx.fail(f"{', '.join(others)} would change nothing beside {flags[name]}. Leave one or the other out.")
        return left


def typed(ctx: Any) -> dict[str, str]:
    """What stands on the command line: names of parameters → their flags."""
    return {name: flag for name, flag in _flags(ctx).items() if ctx.get_parameter_source(name).name == "COMMANDLINE"}


def _flags(ctx: Any) -> dict[str, str]:
    return {p.name: p.opts[0] if p.param_type_name == "option" else p.opts[0].upper() for p in ctx.command.params}


def _refuse_unjoined(ctx: Any) -> None:
    """Stop at several files that nobody calls one measurement, and at one that is joined to nothing."""
    files, join = ctx.params.get("file") or [], ctx.params.get("join", False)
    if len(files) > 1 and not join:
        named = ", ".join(path.name for path in files[:MOST]) + (", …" if len(files) > MOST else "")
        ctx.fail(
            f"{len(files)} files are given ({named}), expected one. If they are one measurement of one sample, as one "
            "for each incidence, add --join; to fit each by itself: fitmat batch."
        )
    if len(files) == 1 and join:
        ctx.fail("--join would change nothing for one file. Give the others too, or leave it out.")


def _refuse_repeated(ctx: Any, order: list[Any]) -> None:
    """Stop at an option of one value that is there twice: the first would go unread."""
    for param, count in Counter(order).items():
        if count > 1 and param.param_type_name == "option" and not (param.multiple or param.is_flag):
            ctx.fail(f"{param.opts[0]} is given {count} times, expected one value of it. Leave the others out.")
