"""Checking: an examination as the command line shows it, with its picture.

It finds nothing itself.
"""

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from fitmat._types import Progress
from fitmat.judgement.examination.examining import Examination, examine
from fitmat.measurements.reader import read
from fitmat.reports.pictures import refuse_picture, write_picture
from fitmat.text import for_shell

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def examined(
    sources: Sequence[Path], reading: Mapping[str, Any], picture: Path | None, say: Progress, *, force: bool
) -> Examination:
    """What files tell as one measurement; nothing is read where the picture could not be written.

    Args:
        sources: Files to read.
        reading: Arguments of `fitmat.read`.
        picture: That will be drawn.
        say: Is told what is done.
        force: Whether to replace it.

    Raises:
        FitmatError: as `fitmat.read`, and of a picture that cannot be written.
    """
    refuse_picture(picture, force=force)
    measurements = read(sources, **reading)
    say(f"examining {', '.join(path.name for path in sources)}", 0, 0)
    return examine(measurements)


def draw(found: Examination, picture: Path) -> None:
    """Draw what was found.

    Raises:
        OutputError: as `write_picture`.
    """

    def drawn() -> "Figure":
        from fitmat.reports.examination_plots import examination

        return examination(found)

    write_picture(drawn, picture)


def hint(sources: Sequence[Path]) -> str:
    """How to see what was measured where, as one line for a shell."""
    given = " ".join([*map(for_shell, sources), *(["--join"] if len(sources) > 1 else [])])
    return f"See what was measured where: fitmat check {given} --plot coverage.png"


def as_json(found: Examination) -> str:
    """Everything that was found, as one JSON object."""
    return json.dumps(found.as_dict(), indent=2, ensure_ascii=False, allow_nan=False)
