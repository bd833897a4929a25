"""Rendering: the material of a run, or a model of given values, as a picture.

It computes no light itself.
"""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from fitmat._types import Progress
from fitmat.cli.simulate import truth
from fitmat.errors import ModelError
from fitmat.reports.portrait import Light, Portrait, picture_files, render
from fitmat.studies.result import load


def drawn(
    what: str, settings: Sequence[str], masking: str | None, lights: Sequence[str], say: Progress, **options: Any
) -> Portrait:
    """Picture of what is named: a run where there is a file or a folder of that name, else a model.

    Args:
        what: A run's folder, its record, or the name of a model.
        settings: Parameters of a model, NAME=VALUE.
        masking: Of a model.
        lights: Names of lights, or two angles as "60,150"; none for those of `fitmat.render`.
        say: Is told what is done.
        **options: model, size and exposure, as `fitmat.render`.

    Raises:
        FitmatError: as `fitmat.load`, `fitmat.model` and `fitmat.render`; or what describes a model beside a run.
    """
    lit: dict[str, Any] = {"light": [_light(text) for text in lights]} if lights else {}
    if not Path(what).exists():
        if options["model"] is not None:
            raise ModelError(f"--model beside {what}, which is no run's folder, expected it with a run. Leave it out.")
        named = truth(what, settings, masking)[0]
        say(f"drawing {what}", 0, 0)
        return render(named, **lit, **options)
    for flag, given in (("--set", settings), ("--masking", masking)):
        if given:
            raise ModelError(f"{flag} beside the run {what}, which has its own values. Leave it out, or name a model.")
    run = load(what)
    say(f"drawing {what}", 0, 0)
    return render(run, **lit, **options)


def refuse(path: Path, *, hdr: bool, force: bool) -> None:
    """Refuse, before any work, a picture that could not be written.

    Raises:
        OutputError: it exists and `force` is off, or has another ending.
    """
    picture_files(path, hdr=hdr, force=force)


def _light(text: str) -> Light:
    """A light's name, or its two angles; what is neither is refused where it is used."""
    try:
        angle, direction = map(float, text.split(","))
    except ValueError:
        return text
    return angle, direction
