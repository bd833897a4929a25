"""Checking: an examination as the command line shows it, with its picture.

It finds nothing itself.
"""

import json
from pathlib import Path
from typing import TYPE_CHECKING

from fitmat.judgement.examination.examining import Examination
from fitmat.reports.pictures import write_picture

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def draw(found: Examination, picture: Path) -> None:
    """Draw what was found.

    Raises:
        OutputError: as `write_picture`.
    """

    def drawn() -> "Figure":
        from fitmat.reports.examination_plots import examination

        return examination(found)

    write_picture(drawn, picture)


def as_json(found: Examination) -> str:
    """Everything that was found, as one JSON object."""
    return json.dumps(found.as_dict(), indent=2, ensure_ascii=False, allow_nan=False)
