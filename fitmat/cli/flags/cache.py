"""Flags of what is kept between runs.

They set no default and check nothing but their type.
"""

from typing import Annotated

import typer

ClearFlag = Annotated[bool, typer.Option("--clear", help="Remove them; the next run of each kind compiles anew.")]
