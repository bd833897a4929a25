"""Commands that begin with a result, a model or nothing: parse, one library call, print.

Those that begin with measurements are in `commands`.
"""

from pathlib import Path

from fitmat.cli import examples, process
from fitmat.cli.entry import app
from fitmat.cli.flags.cache import ClearFlag
from fitmat.cli.flags.colour import ColourPlotFlag, EnergyFlag, IlluminantFlag, MaterialFlag, TableFlag
from fitmat.cli.flags.export import (
    BumpFlag,
    ExportOutFlag,
    MaterialNameFlag,
    NoVerifyFlag,
    OneModelFlag,
    ReplaceExportFlag,
    ResultFlag,
    ResultsFlag,
    StepFlag,
    StrictFlag,
    TableThetaIFlag,
    TargetFlag,
)
from fitmat.cli.flags.files import ComparedPageFlag, ReplacePageFlag
from fitmat.cli.flags.fitting import MaskingFlag
from fitmat.cli.flags.given import Command
from fitmat.cli.flags.models import CheckFlag, NameFlag
from fitmat.cli.flags.plot import (
    CornerModelFlag,
    DrawnChannelFlag,
    PaperFlag,
    ReplacePaperFlag,
    WhatFlag,
    WidthFlag,
)
from fitmat.cli.flags.render import (
    ExposureFlag,
    HdrFlag,
    LightFlag,
    PicturedFlag,
    PictureFlag,
    PictureSetFlag,
    ReplacePictureFlag,
    SizeFlag,
)
from fitmat.text import visible


@app.command(cls=Command)
def report(
    result: ResultFlag,
    force: ReplacePageFlag = False,
) -> None:
    """Make the page of a run again from what it left on disk, as after an update of fitmat."""
    process.set_up()
    from fitmat.reports import page
    from fitmat.studies.result import load

    process.say(visible(str(page.report(load(result), force=force))))


@app.command(cls=Command, epilog=examples.PLOT)
def plot(
    result: ResultFlag,
    what: WhatFlag = "curves",
    out: PaperFlag = Path("figure.pdf"),
    channel: DrawnChannelFlag = None,
    model: CornerModelFlag = None,
    width: WidthFlag = 84.0,
    force: ReplacePaperFlag = False,
) -> None:
    """Draw a picture of a run for a paper, and write its numbers beside it."""
    from fitmat.cli import session

    told = {"channel": 0 if channel is None else channel, "model": model, "width_mm": width, "force": force}
    with session.computing() as watch:
        from fitmat.reports import paper
        from fitmat.studies.result import load

        run = load(result)
        watch(f"drawing {what}", 0, 0)
        written = paper.save(run, out, what, **told)
    process.say("\n".join(visible(str(path)) for path in written))


@app.command(cls=Command, epilog=examples.COMPARE)
def compare(
    results: ResultsFlag,
    out: ComparedPageFlag = Path("compare.html"),
    force: ReplacePageFlag = False,
) -> None:
    """Put runs side by side: their answers, parameters, matches and curves, here and as one page."""
    process.set_up()
    from fitmat.cli import compare
    from fitmat.reports import comparison

    found = comparison.compare_runs(results)
    compare.show(found, comparison.write(found, out, force=force))


@app.command(cls=Command)
def cite(
    result: ResultFlag,
) -> None:
    """Print BibTeX of fitmat and of every model and method that a run used."""
    process.set_up()
    from fitmat.studies.citations import bibtex
    from fitmat.studies.result import load

    process.say(bibtex(load(result).record))


@app.command(cls=Command, epilog=examples.EXPORT)
def export(
    result: ResultFlag,
    to: TargetFlag = "glsl",
    out: ExportOutFlag = None,
    model: OneModelFlag = None,
    name: MaterialNameFlag = None,
    theta_i: TableThetaIFlag = None,
    step: StepFlag = None,
    bump: BumpFlag = False,
    strict: StrictFlag = False,
    no_verify: NoVerifyFlag = False,
    force: ReplaceExportFlag = False,
) -> None:
    """Write the fitted material for a renderer, run it there, and say how far it is from the fit."""
    from fitmat.cli import session

    options = {"bump": bump, "strict": strict, "verify": not no_verify, "force": force, "model": model, "name": name}
    with session.computing() as watch:
        from fitmat.cli import export

        found = export.written(result, to, out, watch, **options, **export.grid(theta_i, step))
    process.say(str(found))


@app.command(cls=Command, epilog=examples.RENDER)
def render(
    what: PicturedFlag,
    out: PictureFlag = Path("ball.png"),
    set_: PictureSetFlag = None,
    masking: MaskingFlag = None,
    model: OneModelFlag = None,
    light: LightFlag = None,
    size: SizeFlag = 256,
    exposure: ExposureFlag = None,
    hdr: HdrFlag = False,
    force: ReplacePictureFlag = False,
) -> None:
    """Draw a material on a ball under lights, from our own values: a fitted one, or a model of given values."""
    from fitmat.cli import session

    with session.computing() as watch:
        from fitmat.cli import render

        render.refuse(out, hdr=hdr, force=force)
        options = {"model": model, "size": size, "exposure": exposure}
        found = render.drawn(what, set_ or [], masking, light or [], watch, **options)
    written = found.save(out, hdr=hdr)
    process.say("\n".join([str(found), *(visible(str(path)) for path in written)]))


@app.command(cls=Command)
def models(
    name: NameFlag = None,
    check: CheckFlag = False,
) -> None:
    """List the models, or print the manual page of one: formula, parameters, limits, reference, laws."""
    from fitmat.cli import manual

    if check:
        process.set_up()
        if surprises := manual.check(only=manual.within(name)):
            process.end(f"{', '.join(surprises)} break a law that their manual pages do not mention.")
    elif name is None:
        manual.list_models()
    else:
        manual.page(name)


@app.command(cls=Command, epilog=examples.COLOUR)
def colour(
    material: MaterialFlag = None,
    table: TableFlag = None,
    illuminant: IlluminantFlag = "D65",
    plot: ColourPlotFlag = None,
    energy: EnergyFlag = False,
    force: ReplacePictureFlag = False,
) -> None:
    """Say what colour a metal, a glass or a fitted material is, and how wrong Fresnel becomes in RGB."""
    from fitmat.cli import colour

    colour.show(material, table, illuminant, plot, force=force, energy=energy)


@app.command(cls=Command)
def losses() -> None:
    """List what a fit can minimise, by name: the default, other likelihoods, and the objectives of the literature."""
    from fitmat.cli import manual

    manual.list_losses()


@app.command(cls=Command)
def cache(
    clear: ClearFlag = False,
) -> None:
    """Say where compiled programs are kept and how many there are; they spare each run the compiling of the first."""
    from fitmat.maths import program_files

    found = program_files.kept()
    if clear and found.folder is not None:
        program_files.remove()
        process.say(f"{found.amount}, were removed from the folder {found.folder}.")
    else:
        process.say(found.words)
