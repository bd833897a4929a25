"""The flag that says which fitmat this is.

It loads nothing that a command would need.
"""

from importlib.metadata import version
from typing import Annotated

import typer


def _say(asked: bool) -> None:
    if asked:
        typer.echo(f"fitmat {version('fitmat')}")
        raise typer.Exit


VersionFlag = Annotated[
    bool, typer.Option("--version", callback=_say, is_eager=True, help="Say which version of fitmat this is.")
]
