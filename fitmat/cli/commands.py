"""The command line: parse, one library call, print. The only room that speaks."""

from pathlib import Path
from typing import Any

import typer

from fitmat.cli import examples, process
from fitmat.cli.flags.batch import BatchOutFlag, JobsFlag, McmcFlag, ProcessesFlag, SourcesFlag
from fitmat.cli.flags.cache import ClearFlag
from fitmat.cli.flags.design import CountFlag, ForFlag, KindFlag
from fitmat.cli.flags.export import (
    ExportOutFlag,
    MaterialNameFlag,
    NoVerifyFlag,
    OneModelFlag,
    ReplaceExportFlag,
    ResultFlag,
    StepFlag,
    StrictFlag,
    TableThetaIFlag,
    TargetFlag,
)
from fitmat.cli.flags.files import (
    ConvertedFlag,
    DesignPlotFlag,
    ForceFlag,
    JsonFlag,
    OutFlag,
    PlotFlag,
    ReplaceFlag,
    ReplacePageFlag,
    ReplacePlotFlag,
    files,
)
from fitmat.cli.flags.fitting import (
    CheckPosteriorFlag,
    FixFlag,
    FullFlag,
    IorFlag,
    LossFlag,
    MaskingFlag,
    ModelsFlag,
    NoMcmcFlag,
    PriorFlag,
    SeedFlag,
    TiltFlag,
)
from fitmat.cli.flags.given import Command
from fitmat.cli.flags.groups import takes
from fitmat.cli.flags.instrument import instrument
from fitmat.cli.flags.labs import LaboratoriesFlag, SurfaceFlag
from fitmat.cli.flags.models import CheckFlag, NameFlag
from fitmat.cli.flags.reading import reading
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
from fitmat.cli.flags.simulate import (
    CatalogueFlag,
    FloorFlag,
    ModelFlag,
    NoiseFlag,
    PhiFlag,
    PhiIFlag,
    SamplesFlag,
    SetFlag,
    SimulatedOutFlag,
    SimulatedSeedFlag,
    ThetaIFlag,
    ThetaOFlag,
)
from fitmat.cli.flags.version import VersionFlag
from fitmat.text import visible

DEFAULT_MODELS = "lambert+blinn-phong,lambert+ggx"
NOT_CONVERGED = 3

app = typer.Typer(
    no_args_is_help=True,
    context_settings={"help_option_names": ["--help", "-h"]},
    pretty_exceptions_enable=False,
    rich_markup_mode="rich",
    epilog="Examples: [bold]fitmat fit measurements.csv[/bold] writes measurements-fitmat/report.html; "
    "[bold]fitmat models ggx[/bold] explains a model; "
    "[bold]fitmat simulate lambert+ggx --set alpha=0.2[/bold] makes data to try it on.",
    help="Turn measured reflectance into a material you can trust: fitted BRDF models, honest uncertainties, and how "
    "closely the empirical Phong model matches the microfacet model.\n\n"
    "Exit codes: 0 all fits converged; 1 wrong input; 2 wrong usage; 3 a fit ended otherwise (the report is written); "
    "130 stopped with Ctrl-C before there was anything to report. A page that cannot be "
    "made is said and changes none of these: the numbers are saved first.",
)


@app.callback()
def about(version: VersionFlag = False) -> None:
    """What holds for every command."""


@app.command(
    cls=Command,
    epilog=examples.FIT,
)
@takes(files, reading, instrument)
def fit(
    files: list[Path],
    reading: dict[str, Any],
    instrument: Any,
    models: ModelsFlag = DEFAULT_MODELS,
    out: OutFlag = None,
    force: ForceFlag = False,
    json_: JsonFlag = False,
    no_mcmc: NoMcmcFlag = False,
    seed: SeedFlag = 0,
    fix: FixFlag = None,
    masking: MaskingFlag = None,
    loss: LossFlag = "default",
    prior: PriorFlag = None,
    check_posterior: CheckPosteriorFlag = False,
    ior: IorFlag = None,
    tilt: TiltFlag = False,
    full: FullFlag = False,
) -> None:
    """Fit models to a file of measurements and write a report with the Phong–microfacet match."""
    from fitmat.cli import session

    with session.watch() as watch:
        process.set_up()
        from fitmat.maths import programs

        with programs.ahead("fit"):
            from fitmat.cli import fit

            told = {"models": models, "loss": loss, "masking": masking, "ior": ior, "tilt": tilt, "seed": seed}
            told |= fit.known(fix or [], prior or [])
            told |= {"sampling": not no_mcmc, "second_opinion": check_posterior, "full": full}
            done = fit.write_report(files, out, reading | {"instrument": instrument}, told, watch, force=force)
    done.tell(as_json=json_)
    if not done.converged:
        raise typer.Exit(NOT_CONVERGED)


@app.command(
    cls=Command,
    epilog=examples.SIMULATE,
)
@takes(instrument)
def simulate(
    instrument: Any,
    model: ModelFlag = None,
    out: SimulatedOutFlag = Path("simulated.csv"),
    set_: SetFlag = None,
    theta_i: ThetaIFlag = "10,30,45,60,75",
    theta_o: ThetaOFlag = "-80:80:2",
    phi: PhiFlag = "180",
    phi_i: PhiIFlag = "0",
    noise: NoiseFlag = 0.02,
    floor: FloorFlag = 1e-3,
    seed: SimulatedSeedFlag = 0,
    samples: SamplesFlag = None,
    masking: MaskingFlag = None,
    catalogue: CatalogueFlag = None,
    force: ReplaceFlag = False,
) -> None:
    """Simulate measurements of a known material, to test an instrument's plan or fitmat itself."""
    process.set_up()
    from fitmat.cli import simulate

    if catalogue is not None:
        written = simulate.write_catalogue(catalogue, force=force)
    else:
        angles, truth = simulate.grid(theta_i, theta_o, phi, phi_i), simulate.truth(model, set_ or [], masking)
        written = simulate.write_simulation(
            out, truth, angles, noise=(noise, floor, seed), samples=samples, instrument=instrument, force=force
        )
    process.say("\n".join(visible(str(path)) for path in written))


@app.command(
    cls=Command,
    epilog=examples.CHECK,
)
@takes(files, reading, instrument)
def check(
    files: list[Path],
    reading: dict[str, Any],
    instrument: Any,
    plot: PlotFlag = None,
    force: ReplacePlotFlag = False,
    json_: JsonFlag = False,
) -> None:
    """Describe a file before any fit: what was measured where, how consistently, and what can be learnt from it."""
    process.set_up()
    from fitmat.maths import programs

    with programs.ahead("check"):
        from fitmat.cli import check

        found = check.examined(files, reading | {"instrument": instrument}, plot, force=force)
    process.say(check.as_json(found) if json_ else str(found))
    if plot is not None:
        check.draw(found, plot)
    elif not json_:
        process.say(check.hint(files))


@app.command(
    cls=Command,
    epilog=examples.CONVERT,
)
@takes(files, reading)
def convert(
    files: list[Path],
    reading: dict[str, Any],
    out: ConvertedFlag,
    force: ReplaceFlag = False,
) -> None:
    """Write measurements in another format; what that cannot hold is said."""
    process.refuse_little_memory()
    from fitmat.cli import convert

    process.say("\n".join([*convert.written(files, reading, out, force=force), visible(str(out))]))


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


@app.command(cls=Command, epilog=examples.EXPORT)
def export(
    result: ResultFlag,
    to: TargetFlag = "glsl",
    out: ExportOutFlag = None,
    model: OneModelFlag = None,
    name: MaterialNameFlag = None,
    theta_i: TableThetaIFlag = None,
    step: StepFlag = None,
    strict: StrictFlag = False,
    no_verify: NoVerifyFlag = False,
    force: ReplaceExportFlag = False,
) -> None:
    """Write the fitted material for a renderer, run it there, and say how far it is from the fit."""
    process.set_up()
    from fitmat.cli import export

    options = {"strict": strict, "verify": not no_verify, "force": force}
    options |= {"model": model, "name": name} | export.grid(theta_i, step)
    process.say(str(export.written(result, to, out, **options)))


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
    process.set_up()
    from fitmat.cli import render

    render.refuse(out, hdr=hdr, force=force)
    found = render.drawn(what, set_ or [], masking, light or [], model=model, size=size, exposure=exposure)
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


@app.command(
    cls=Command,
    epilog=examples.DESIGN,
)
@takes(files, reading, instrument)
def design(
    files: list[Path],
    reading: dict[str, Any],
    instrument: Any,
    models: ModelsFlag = DEFAULT_MODELS,
    for_: ForFlag = None,
    kind: KindFlag = "sample",
    count: CountFlag = 5,
    plot: DesignPlotFlag = None,
    force: ReplacePlotFlag = False,
    json_: JsonFlag = False,
    seed: SeedFlag = 0,
    fix: FixFlag = None,
) -> None:
    """Say which angles to measure next, and by how much they would narrow what is not yet known."""
    from fitmat.cli import session

    with session.watch() as watch:
        process.set_up()
        from fitmat.maths import programs

        with programs.ahead("design"), programs.announced(watch.compiling):
            from fitmat.cli import design
            from fitmat.reports.pictures import refuse_picture

            refuse_picture(plot, force=force)
            posteriors = design.fitted(files, reading | {"instrument": instrument}, models, fix or [], seed, watch)
            watch("looking for the next angles", 0, 0)
            found = design.propose(posteriors, for_, kind=kind, count=count)
    process.say(design.as_json(found) if json_ else design.as_text(found))
    if plot is not None:
        design.draw(found, plot)


@app.command(
    cls=Command,
    epilog=examples.LABS,
)
@takes(reading, instrument)
def labs(
    reading: dict[str, Any],
    instrument: Any,
    laboratories: LaboratoriesFlag,
    model: SurfaceFlag = "lambert+ggx",
    json_: JsonFlag = False,
    fix: FixFlag = None,
) -> None:
    """Say whether laboratories that measured one sample agree, what follows from all, and whose calibration is off."""
    process.set_up()
    from fitmat.cli import labs
    from fitmat.models.parameters import assignments

    found = labs.compared(laboratories, reading | {"instrument": instrument}, model, assignments(fix or [], "--fix"))
    if json_:
        process.say(labs.as_json(found))
    else:
        labs.show(found)


@app.command(
    cls=Command,
    epilog=examples.BATCH,
)
@takes(reading, instrument)
def batch(
    reading: dict[str, Any],
    instrument: Any,
    files: SourcesFlag = None,
    out: BatchOutFlag = Path("fitmat-batch"),
    jobs: JobsFlag = None,
    models: ModelsFlag = DEFAULT_MODELS,
    processes: ProcessesFlag = None,
    mcmc: McmcFlag = False,
    seed: SeedFlag = 0,
    fix: FixFlag = None,
    masking: MaskingFlag = None,
    loss: LossFlag = "default",
    prior: PriorFlag = None,
    ior: IorFlag = None,
    tilt: TiltFlag = False,
) -> None:
    """Fit every file of a folder or a list, and write one table of all."""
    process.set_up()
    from fitmat.cli import batch, fit

    told = {"models": models, "loss": loss, "masking": masking, "ior": ior, "tilt": tilt, "seed": seed}
    told |= {"sampling": mcmc} | fit.known(fix or [], prior or [])
    found = batch.run(files or [], out, jobs, reading | {"instrument": instrument}, told, processes)
    batch.show(found)
    if found.counts["refused"]:
        raise typer.Exit(NOT_CONVERGED)


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
