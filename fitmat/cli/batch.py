"""Batches: many files side by side, and at the end what became of them.

It fits nothing itself.
"""

import logging
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl
from rich.console import Console
from rich.table import Table
from rich.text import Text

from fitmat.batches.atlas import SUFFIXES
from fitmat.batches.batch import PAGE, Batch, batch
from fitmat.batches.maps import determined, shown, smoothed
from fitmat.batches.photographs import TABLE
from fitmat.batches.textures import TILE, Texture, fit_texture
from fitmat.cli import interrupts, process, session
from fitmat.cli.flags.fitting import MODELS
from fitmat.errors import FitmatError
from fitmat.studies import DEFAULT_MODELS
from fitmat.text import visible

TEXTURE = {
    *("files", "lights", "out", "force", "processes", "device", "precision", "smooth"),
    *("models", "loss", "masking", "fix", "seed"),
}
"""Parameters of the command that a texture takes; without draws the seed is of no consequence."""

TEXTURE_ONLY = {
    "device": ("cpu", "a texture (.npz, .zarr)", "files are fitted on the CPU"),
    "precision": ("double", "a texture (.npz, .zarr)", "files are fitted in double precision"),
    "smooth": (None, "a texture (.npz, .zarr) or --lights", "files have no neighbours"),
}
"""Flags for textures alone: their defaults, what they are for, and what is so of files."""

MOST = 20
"""Rows that are shown; the table has all."""


def run(
    sources: Sequence[Path],
    folder: Path,
    jobs: Path | None,
    reading: Mapping[str, Any],
    studying: Mapping[str, Any],
    doing: Mapping[str, Any],
) -> Batch:
    """The batch; Ctrl-C ends it, and what was done is kept.

    Args:
        sources: Files, folders and patterns.
        folder: Where to.
        jobs: Table of what differs from file to file.
        reading: Arguments of `fitmat.read`.
        studying: Arguments of `fitmat.study`, models included.
        doing: How many processes work side by side, or the scheduler of a cluster; the device and the precision; what
            to pool and to smooth; whether each file leaves a run too, and whether to replace results of something else.

    Raises:
        FitmatError: as `batch`, or a flag is for textures.
        SystemExit: it was interrupted.
    """
    told, doing = dict(studying), dict(doing)
    models = told.pop("models")
    for flag, (usual, wanted, why) in TEXTURE_ONLY.items():
        if (given := doing.pop(flag)) != usual:
            raise FitmatError(f"--{flag} {given} for files, expected {wanted}: {why}.")
    if odd := next((source for source in sources if is_texture([source])), None):
        raise FitmatError(f"{odd}: a texture beside other files, expected it alone. Give one texture at a time.")
    if doing["scheduler"] is not None:
        logging.disable(logging.ERROR)  # Dask tells at length what becomes one sentence
    try:
        with session.watch() as watch, interrupts.raised():
            known = {"jobs": jobs, "reading": reading, "studying": told, **doing}
            return batch(sources, folder, models, progress=watch, **known)
    except KeyboardInterrupt:
        process.say(f"fitmat: interrupted; what was done is kept in {folder}: the same command goes on.", err=True)
        raise SystemExit(interrupts.INTERRUPTED) from None


def is_texture(sources: Sequence[Path]) -> bool:
    """Whether what is given is one texture, and not files of measurements."""
    return len(sources) == 1 and sources[0].suffix.lower() in SUFFIXES


def alone(lights: Path | None, sources: Sequence[Path]) -> Path:
    """The table of lights, or the one texture.

    Raises:
        FitmatError: there are files beside the table, or it is no CSV.
    """
    if lights is None:
        return sources[0]
    if sources:
        raise FitmatError(f"{sources[0]} beside --lights {lights}, expected one of them: the table names its pictures.")
    if lights.suffix.lower() != TABLE:
        raise FitmatError(f"--lights {lights}: expected a table of lights whose name ends in {TABLE}.")
    return lights


def texture(
    source: Path,
    folder: Path,
    typed: Mapping[str, str],
    studying: Mapping[str, Any],
    doing: Mapping[str, Any],
) -> None:
    """Fit every point of a texture, and print how the fits ended; Ctrl-C ends it, and what was done is kept.

    Args:
        source: The atlas, or a table of lights.
        folder: Where to.
        typed: Parameters that stand on the command line → their flags; those that are of no use here are refused.
        studying: Arguments of `fitmat.study`, of which a texture takes some.
        doing: How many threads work side by side, on which device and in which precision, what to smooth, and whether
            to replace results of something else.

    Raises:
        FitmatError: as `fit_texture`, a flag is of no use to a texture, or there is no such device.
        SystemExit: it was interrupted.
    """
    if idle := [flag for name, flag in typed.items() if name not in TEXTURE]:
        raise FitmatError(f"{source} is a texture, for which {idle[0]} means nothing: leave it out.")
    models = studying["models"]
    model = DEFAULT_MODELS[-1] if models == MODELS else models
    if "," in model:
        raise FitmatError(f"--models {models} for a texture, expected one: every point has the same model.")
    if doing["device"] == "gpu":
        process.use_gpu()
    told = {name: studying[name] for name in ("loss", "masking", "fixed")}
    told |= {name: doing[name] for name in ("threads", "precision", "smooth", "force")}
    with session.computing() as watch:
        try:
            with interrupts.raised():
                found = fit_texture(source, folder, model, progress=watch, **told)
        except KeyboardInterrupt:
            watch.close()
            kept = f"{watch.most:,} points are kept in {folder}: the same command goes on"
            none = f"this run kept no points, which it does {TILE:,} at a time"
            process.say(f"fitmat: interrupted; {kept if watch.most else none}.", err=True)
            interrupts.leave_threads()
    process.say(f"{found}\n\nArrays: {found.file}{_maps_told(found)}")
    measured = found.fits.result[found.fits.result != "too_few"]
    ended, count = np.count_nonzero(measured != "converged"), found.fits.result.size
    if ended or not measured.size:
        got = f"{ended} of {count} points are not determined or did not converge" if ended else "no point has a fit"
        given = "the irradiance" if source.suffix.lower() == TABLE else "value, sigma"
        process.say(
            f"fitmat: {got}: see outcome there. Are {given} and the model what you mean? "
            "What the angles leave open --fix says, as ks=1 of a bare surface.",
            err=True,
        )
        raise SystemExit(process.NOT_CONVERGED)


def _maps_told(found: Texture) -> str:
    """Which maps there are, and how many points are not in them, as a line."""
    count, others = found.fits.result.size, int(np.count_nonzero(~determined(found.fits)))
    if others == count:
        return "\nNo maps: no point has a fit that is determined."
    if not found.maps:
        return ""
    smooth = smoothed(found.fits)
    drawn = f", of the smoothed {', '.join(smooth)}" if smooth else ""
    rest = [name for name in shown(found.fits) if name not in {*smooth, *found.fits.held}]
    of = f" of {', '.join(rest)}" if smooth else ""
    median = f"; {others} of {count} points, whose fits are not determined, have the others' median{of} in them"
    return f"\nMaps: {', '.join(path.name for path in found.maps)}{drawn}{median if others and rest else ''}"


def show(found: Batch, screen: Console | None = None) -> None:
    """Print what became of the files: the preferred model of each, and why some have none.

    Args:
        found: What to show.
        screen: Where to; stdout if None.
    """
    out = screen or Console()
    plain = not out.is_terminal or out.is_dumb_terminal
    count, *rest = str(found).split("\n")
    lost = rest[len(found.pooled) :]
    if "best" in found.table.columns:
        best = found.table.filter(pl.col("best"))
        table = Table("file", "model", "outcome", "misfit / noise", box=None, pad_edge=False, header_style="dim")
        for file, model, outcome, ratio in best["file", "model", "outcome", "misfit_over_noise"].head(MOST).iter_rows():
            cells = (Path(file).name, model, outcome, "–" if ratio is None else f"{ratio:.2g}")
            table.add_row(*(Text(visible(cell)) for cell in cells))
        out.print(table, soft_wrap=plain)
        if len(best) > MOST:
            out.print(Text(f"and {len(best) - MOST} more", "dim"))
        out.print()
    out.print(Text(count, "bold"), soft_wrap=plain)
    for words in found.pooled:
        out.print(Text(str(words)), soft_wrap=plain)
    for words in lost[:MOST]:
        out.print(Text(visible(words)), soft_wrap=plain)
    if len(lost) > MOST:
        out.print(Text(f"and {len(lost) - MOST} more: outcome and message in the table.", "dim"), soft_wrap=plain)
    process.say(f"\nTable: {found.file}\nPage: {found.file.with_name(PAGE)}")
