"""The command line: parse, one library call, print. The only room that speaks."""

import atexit
import gc
import os
import sys
import warnings
from pathlib import Path
from typing import Any

import typer

from fitmat.cli import flags, options, process
from fitmat.errors import FitmatError

DEFAULT_MODELS = "lambert+blinn-phong,lambert+ggx"
WRONG_INPUT = 1
NOT_CONVERGED = 3

app = typer.Typer(
    add_completion=False,
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    rich_markup_mode="rich",
    epilog="Examples: [bold]fitmat fit measurements.csv[/bold] writes measurements-fitmat/report.html; "
    "[bold]fitmat models ggx[/bold] explains a model; "
    "[bold]fitmat simulate lambert+ggx --set alpha=0.2[/bold] makes data to try it on.",
    help="Turn measured reflectance into a material you can trust: fitted BRDF models, honest uncertainties, and how "
    "closely the empirical Phong model matches the microfacet model.\n\n"
    "Exit codes: 0 all fits converged; 1 wrong input; 2 wrong usage; 3 a fit ended otherwise (the report is written); "
    "130 stopped with Ctrl-C before there was anything to report.",
)


def _setup() -> None:
    """Turn on 64-bit floats and keep compiled programs between runs."""
    import jax
    import platformdirs

    jax.config.update("jax_enable_x64", True)
    cache = platformdirs.user_cache_path("fitmat") / "compiled"
    jax.config.update("jax_compilation_cache_dir", str(cache))
    jax.config.update("jax_persistent_cache_min_compile_time_secs", 0.0)


@app.command(
    epilog="Columns of a table, by name: theta_i, theta_o and phi (or phi_i and phi_o, or a signed theta_o alone) in "
    "degrees; brdf, brdf_cos, reflectance_factor, radiance, or signal and reference; brdf_r, brdf_g, brdf_b or "
    "brdf_550 for channels; sigma where the noise is known.\n\n"
    "Written to --out: report.html (tables and pictures), fit.json (the same numbers), posterior-MODEL.parquet (draws "
    "of the parameters). Ctrl-C during sampling keeps what is done and still writes them; a killed run goes on "
    "when it is given again.\n\n"
    "Examples:\n\n"
    "  fitmat fit measurements.csv\n\n"
    "  fitmat fit measurements.csv --models lambert+ggx --fix ks=1 --out run1\n\n"
    "  fitmat fit gold.csv --models ggx --ior Au --fix ks=1\n\n"
    "  fitmat fit scan.txt --columns theta_i=AOI,brdf=4 --no-mcmc\n\n"
    "  fitmat fit mirror.csv --receiver-angle 0.5 --calibration 0.03"
)
@flags.takes(flags.reading, flags.instrument)
def fit(
    reading: dict[str, Any],
    instrument: Any,
    file: options.FileFlag,
    models: options.ModelsFlag = DEFAULT_MODELS,
    out: options.OutFlag = None,
    force: options.ForceFlag = False,
    json_: options.JsonFlag = False,
    no_mcmc: options.NoMcmcFlag = False,
    seed: options.SeedFlag = 0,
    fix: options.FixFlag = None,
    masking: options.MaskingFlag = None,
    loss: options.LossFlag = "default",
    prior: options.PriorFlag = None,
    check_posterior: options.CheckPosteriorFlag = False,
    ior: options.IorFlag = None,
    tilt: options.TiltFlag = False,
) -> None:
    """Fit models to a file of measurements and write a report with the Phong–microfacet match."""
    _setup()
    from fitmat import files
    from fitmat.cli import session
    from fitmat.fitting import priors
    from fitmat.models.parameters import assignments
    from fitmat.reports import page, terminal
    from fitmat.studies.study import study

    fixed, believed = assignments(fix or [], "--fix"), priors.assignments(prior or [])
    told = {"loss": loss, "masking": masking, "ior": ior, "tilt": tilt, "seed": seed, "second_opinion": check_posterior}
    target = out or files.default(file)
    with files.new(target, force=force, stale=page.POSTERIOR.format("*")) as draft:
        process.leave_on_interrupt(draft)
        with session.watch() as watch:
            measurements = session.source(file, reading | {"instrument": instrument}, watch)
            found = study(
                measurements,
                models,
                fixed=fixed,
                priors=believed,
                sampling=not no_mcmc,
                resume=files.resumed(target),
                progress=watch,
                **told,
            )
        page.write(draft, found)
    if not no_mcmc:
        files.discard(files.resumed(target))
    if json_:
        sys.stdout.write((target / "fit.json").read_text(encoding="utf-8"))
    else:
        terminal.show(found, target)
    if any(p.fit.result != "converged" or p.interrupted for p in found.posteriors):
        raise typer.Exit(NOT_CONVERGED)


@app.command(
    epilog="Parameters that are not set keep the model's defaults, see fitmat models.\n\n"
    "Example:\n\n"
    "  fitmat simulate lambert+ggx --set kd=0.3 --set alpha=0.2 --out plastic.csv"
)
@flags.takes(flags.instrument)
def simulate(
    instrument: Any,
    model: options.ModelFlag = None,
    out: options.SimulatedOutFlag = Path("simulated.csv"),
    set_: options.SetFlag = None,
    theta_i: options.ThetaIFlag = "10,30,45,60,75",
    theta_o: options.ThetaOFlag = "-80:80:2",
    phi: options.PhiFlag = "180",
    phi_i: options.PhiIFlag = "0",
    noise: options.NoiseFlag = 0.02,
    floor: options.FloorFlag = 1e-3,
    seed: options.SimulatedSeedFlag = 0,
    masking: options.MaskingFlag = None,
    catalogue: options.CatalogueFlag = None,
    force: options.ReplaceFlag = False,
) -> None:
    """Simulate measurements of a known material, to test an instrument's plan or fitmat itself."""
    _setup()
    from fitmat.cli import simulate

    if catalogue is not None:
        written = simulate.write_catalogue(catalogue, force=force)
    else:
        angles = (
            simulate.angles(theta_i, "--theta-i", lowest=0.0),
            simulate.angles(theta_o, "--theta-o"),
            simulate.angles(phi, "--phi", lowest=0.0, highest=360.0),
            simulate.angles(phi_i, "--phi-i", lowest=0.0, highest=360.0),
        )
        truth = simulate.truth(model, set_ or [], masking)
        written = simulate.write_simulation(
            out, truth, angles, noise=(noise, floor, seed), instrument=instrument, force=force
        )
    typer.echo("\n".join(str(path) for path in written))


@app.command(
    epilog="Examples:\n\n  fitmat check measurements.csv --plot coverage.png\n\n  fitmat check gold.binary --json"
)
@flags.takes(flags.reading, flags.instrument)
def check(
    reading: dict[str, Any],
    instrument: Any,
    file: options.FileFlag,
    plot: options.PlotFlag = None,
    force: options.ReplaceFlag = False,
    json_: options.JsonFlag = False,
) -> None:
    """Describe a file before any fit: what was measured where, how consistently, and what can be learnt from it."""
    _setup()
    from fitmat.cli import check
    from fitmat.measurements.reader import read

    found = check.check(read(file, **reading, instrument=instrument), plot, force=force)
    typer.echo(check.as_json(found) if json_ else str(found))
    if plot is None and not json_:
        typer.echo(f"See what was measured where: fitmat check {file} --plot coverage.png")


@app.command(
    epilog="Examples:\n\n"
    "  fitmat convert gold.binary gold.parquet\n\n"
    "  fitmat convert scan.txt scan.bsdf --columns theta_i=AOI,brdf=4"
)
@flags.takes(flags.reading)
def convert(
    reading: dict[str, Any],
    file: options.FileFlag,
    out: options.ConvertedFlag,
    force: options.ReplaceFlag = False,
) -> None:
    """Write measurements in another format; what that cannot hold is said."""
    from fitmat.measurements import writing
    from fitmat.measurements.reader import read

    measurements = read(file, **reading)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        writing.write(measurements, out, force=force)
    typer.echo("\n".join([str(measurements), *writing.losses(measurements, out), str(out)]))


@app.command()
def models(
    name: options.NameFlag = None,
    check: options.CheckFlag = False,
) -> None:
    """List the models, or print the manual page of one: formula, parameters, limits, reference, laws."""
    from fitmat.cli import manual

    if check:
        _setup()
        if surprises := manual.check():
            _end(f"{', '.join(surprises)} break a law that their manual pages do not mention.")
    elif name is None:
        manual.list_models()
    else:
        manual.page(name)


@app.command(
    epilog="Examples:\n\n  fitmat design measurements.csv --for eta\n\n"
    "  fitmat design measurements.csv --for match --kind curve --plot next.png"
)
@flags.takes(flags.reading, flags.instrument)
def design(
    reading: dict[str, Any],
    instrument: Any,
    file: options.FileFlag,
    models: options.ModelsFlag = DEFAULT_MODELS,
    for_: options.ForFlag = None,
    kind: options.KindFlag = "sample",
    count: options.CountFlag = 5,
    plot: options.DesignPlotFlag = None,
    force: options.ReplaceFlag = False,
    json_: options.JsonFlag = False,
    seed: options.SeedFlag = 0,
    fix: options.FixFlag = None,
) -> None:
    """Say which angles to measure next, and by how much they would narrow what is not yet known."""
    _setup()
    from fitmat.cli import design, session
    from fitmat.measurements.reader import read
    from fitmat.models.parameters import assignments
    from fitmat.studies.plan import plan
    from fitmat.studies.study import fit_each

    measurements = read(file, **reading, instrument=instrument)
    jobs = plan(models, measurements, fixed=assignments(fix or [], "--fix"))
    with session.watch() as watch:
        posteriors = fit_each(measurements, jobs, seed=seed, progress=watch)
    found = design.propose(posteriors, for_, kind=kind, count=count, picture=plot, force=force)
    typer.echo(design.as_json(found) if json_ else design.as_text(found))


@app.command()
def losses() -> None:
    """List what a fit can minimise, by name: the default, other likelihoods, and the objectives of the literature."""
    from fitmat.cli import manual

    manual.list_losses()


def main() -> None:
    """Run the command line; wrong input, a full disk and Ctrl-C become one line on stderr and an exit code."""
    process.prepare_streams()
    process.leave_on_interrupt()
    # A run is short and makes few reference cycles; looking for them, at the end above all, takes a fifth of its time.
    gc.disable()
    atexit.register(gc.freeze)
    try:
        try:
            app()
        finally:
            gc.enable()
            sys.stdout.flush()
    except FitmatError as error:
        _end(str(error))
    except OSError as error:
        # What could not be written must not be tried again when Python closes stdout.
        os.dup2(os.open(os.devnull, os.O_WRONLY), 1)
        _end(f"cannot write the output: {error.strerror or error}.")


def _end(message: str) -> None:
    sys.stderr.write(f"fitmat: {message}\n")
    sys.exit(WRONG_INPUT)
