"""Commands that begin with measurements of one sample or make some: parse, one library call, print.

Those over several samples or laboratories are in `several`, those that begin with a result, a model or nothing in
`afterwards`.
"""

from pathlib import Path
from typing import Any

import typer

from fitmat.cli import examples, process
from fitmat.cli.entry import app
from fitmat.cli.flags.design import CountFlag, ForFlag, KindFlag
from fitmat.cli.flags.files import (
    CompleteFlag,
    ConvertedFlag,
    DesignPlotFlag,
    FillingFlag,
    ForceFlag,
    JsonFlag,
    OpenFlag,
    OutFlag,
    PlotFlag,
    ReplaceFlag,
    ReplacePlotFlag,
    files,
)
from fitmat.cli.flags.fitting import (
    MODELS,
    CheckPosteriorFlag,
    DispersionFlag,
    FilmFlag,
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
from fitmat.cli.flags.reading import reading
from fitmat.cli.flags.simulate import (
    CatalogueFlag,
    FloorFlag,
    ModelFlag,
    NoiseFlag,
    PhiFlag,
    PhiIFlag,
    SamplesFlag,
    SetFlag,
    SimulatedFilmFlag,
    SimulatedIorFlag,
    SimulatedLawFlag,
    SimulatedOutFlag,
    SimulatedSeedFlag,
    ThetaIFlag,
    ThetaOFlag,
    WavelengthsFlag,
)
from fitmat.text import visible


@app.command(
    cls=Command,
    epilog=examples.FIT,
)
@takes(files, reading, instrument)
def fit(
    files: list[Path],
    reading: dict[str, Any],
    instrument: Any,
    models: ModelsFlag = MODELS,
    out: OutFlag = None,
    force: ForceFlag = False,
    json_: JsonFlag = False,
    open_: OpenFlag = False,
    no_mcmc: NoMcmcFlag = False,
    seed: SeedFlag = 0,
    fix: FixFlag = None,
    masking: MaskingFlag = None,
    loss: LossFlag = "default",
    prior: PriorFlag = None,
    check_posterior: CheckPosteriorFlag = False,
    ior: IorFlag = None,
    tilt: TiltFlag = False,
    dispersion: DispersionFlag = None,
    film: FilmFlag = None,
    full: FullFlag = False,
) -> None:
    """Fit models to a file of measurements and write a report with the Phong–microfacet match."""
    from fitmat.cli import session

    with session.computing() as watch:
        from fitmat.maths import programs

        with programs.ahead("fit"):
            from fitmat.cli import fit

            told = {"models": models, "loss": loss, "masking": masking, "ior": ior, "tilt": tilt, "seed": seed}
            told |= fit.known(fix or [], prior or []) | {"dispersion": dispersion, "film": film}
            told |= {"sampling": not no_mcmc, "second_opinion": check_posterior, "full": full}
            done = fit.write_report(files, out, reading | {"instrument": instrument}, told, watch, force=force)
    done.tell(as_json=json_)
    if open_:
        done.open()
    if not done.converged:
        raise typer.Exit(process.NOT_CONVERGED)


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
    wavelengths: WavelengthsFlag = None,
    ior: SimulatedIorFlag = None,
    film: SimulatedFilmFlag = None,
    dispersion: SimulatedLawFlag = None,
    catalogue: CatalogueFlag = None,
    force: ReplaceFlag = False,
) -> None:
    """Simulate measurements of a known material, to test an instrument's plan or fitmat itself."""
    from fitmat.cli import session

    with session.computing() as watch:
        from fitmat.cli import simulate

        if catalogue is not None:
            watch("simulating the catalogue", 0, 0)
            written = simulate.write_catalogue(catalogue, force=force)
        else:
            angles = simulate.grid(theta_i, theta_o, phi, phi_i)
            known = {"ior": ior, "film": film, "dispersion": dispersion}
            truth, channels = simulate.truth(model, set_ or [], masking, wavelengths, **known)
            measuring = {"noise": (noise, floor, seed), "samples": samples, "instrument": instrument}
            watch(f"simulating {truth.name}", 0, 0)
            written = simulate.write_simulation(out, truth, angles, channels, **measuring, force=force)
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
    from fitmat.cli import session

    with session.computing() as watch:
        from fitmat.maths import programs

        with programs.ahead("check"):
            from fitmat.cli import check

            found = check.examined(files, reading | {"instrument": instrument}, plot, watch, force=force)
    process.say(check.as_json(found) if json_ else str(found))
    if plot is not None:
        with session.watch() as watch:
            watch(f"drawing {plot.name}", 0, 0)
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
    complete: CompleteFlag = False,
    model: FillingFlag = None,
    force: ReplaceFlag = False,
) -> None:
    """Write measurements in another format; what that cannot hold is said."""
    process.refuse_little_memory()
    from fitmat.cli import convert, session

    with (session.computing if complete else session.watch)() as watch:
        told = convert.written(files, reading, out, watch, force=force, complete=complete, model=model)
    process.say("\n".join([*told, visible(str(out))]))


@app.command(
    cls=Command,
    epilog=examples.DESIGN,
)
@takes(files, reading, instrument)
def design(
    files: list[Path],
    reading: dict[str, Any],
    instrument: Any,
    models: ModelsFlag = MODELS,
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

    with session.computing() as watch:
        from fitmat.maths import programs

        with programs.ahead("design"):
            from fitmat.cli import design
            from fitmat.reports.pictures import refuse_picture

            refuse_picture(plot, force=force)
            posteriors = design.fitted(files, reading | {"instrument": instrument}, models, fix or [], seed, watch)
            watch("looking for the next angles", 0, 0)
            found = design.propose(posteriors, for_, kind=kind, count=count)
    process.say(design.as_json(found) if json_ else design.as_text(found))
    if plot is not None:
        design.draw(found, plot)
