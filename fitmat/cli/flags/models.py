"""Flags of the manual: which page, and whether laws are measured.

They set no default and check nothing but their type.
"""

from typing import Annotated

import typer

NameFlag = Annotated[
    str | None,
    typer.Argument(help="A lobe or model, e.g. ggx or lambert+ggx; or 'fresnel', 'transmission', 'heitz'."),
]

CheckFlag = Annotated[
    bool, typer.Option("--check", help="Measure which laws of reflection NAME keeps, or every lobe (some minutes).")
]
