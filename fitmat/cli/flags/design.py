"""Flags of a design: what to learn, and how many measurements.

They set no default and check nothing but their type.
"""

from typing import Annotated, Literal

import typer

ForFlag = Annotated[
    str | None,
    typer.Option(
        "--for",
        help="What to learn: a parameter such as eta, or 'match' to tell the two models apart; default all parameters.",
        metavar="NAME",
        show_default=False,
    ),
]

KindFlag = Annotated[
    Literal["sample", "curve"], typer.Option(help="What is measured next: single samples, or whole curves.")
]

CountFlag = Annotated[int, typer.Option(min=1, max=50, help="How many measurements to propose.", metavar="N")]
