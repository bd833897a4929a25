"""The command line: parse, one library call, print. The only room that speaks."""

import sys
from pathlib import Path
from typing import Annotated, Any

import typer

from fitmat.errors import FitmatError

DEFAULT_MODELS = "lambert+blinn-phong,lambert+ggx"
NOT_CONVERGED = 3
INTERRUPTED = 130

app = typer.Typer(
    add_completion=False,
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    rich_markup_mode="rich",
    help="Turn measured reflectance into a material you can trust: fitted BRDF models, honest uncertainties, and how "
    "closely the empirical Phong model matches the microfacet model.\n\n"
    "Start with [bold]fitmat fit measurements.csv[/bold].\n\n"
    "Exit codes: 0 all fits converged; 1 wrong input; 2 wrong usage; 3 a fit ended otherwise (the report is written).",
)


def _setup() -> None:
    """Turn on 64-bit floats and keep compiled programs between runs."""
    import jax
    import platformdirs

    jax.config.update("jax_enable_x64", True)
    cache = platformdirs.user_cache_path("fitmat") / "compiled"
    jax.config.update("jax_compilation_cache_dir", str(cache))
    jax.config.update("jax_persistent_cache_min_compile_time_secs", 0.1)


@app.command()
def fit(
    file: Annotated[Path, typer.Argument(help="Measurements: CSV or any text table, one row per pair of directions.")],
    models: Annotated[
        str, typer.Option(help="Models to fit, separated by commas; see [bold]fitmat models[/bold].")
    ] = DEFAULT_MODELS,
    out: Annotated[
        Path | None,
        typer.Option(help="Folder for the report; default NAME-fitmat beside the input.", show_default=False),
    ] = None,
    force: Annotated[bool, typer.Option("--force", help="Replace the files of an earlier run in --out.")] = False,
    json_: Annotated[bool, typer.Option("--json", help="Print one JSON object on stdout and nothing else.")] = False,
    no_mcmc: Annotated[
        bool, typer.Option("--no-mcmc", help="Skip sampling; intervals from Laplace's approximation, in seconds.")
    ] = False,
    seed: Annotated[int, typer.Option(min=0, help="Seed of the sampling; the same seed gives the same report.")] = 0,
    fix: Annotated[
        list[str] | None, typer.Option(help="Hold a parameter, e.g. ks=1; repeat for more.", show_default=False)
    ] = None,
    masking: Annotated[
        str | None,
        typer.Option(help="Masking of microfacet lobes: correlated, separable, v-cavity.", show_default=False),
    ] = None,
    columns: Annotated[
        str | None,
        typer.Option(
            help="Foreign headers: theta_i=Zenith,theta_o=3,brdf=BSDF (a header name, or a 1-based column number).",
            show_default=False,
        ),
    ] = None,
    quantity: Annotated[
        str | None,
        typer.Option(
            help="What a column called 'value' holds: brdf (sr⁻¹), brdf_cos, reflectance_factor.", show_default=False
        ),
    ] = None,
    angle_unit: Annotated[
        str | None, typer.Option(help="degrees or radians; default degrees.", show_default=False)
    ] = None,
    forward: Annotated[
        str,
        typer.Option(help="Which sign of theta_o is the mirror side in files without azimuth: positive or negative."),
    ] = "positive",
    specular_azimuth: Annotated[
        int, typer.Option(help="Relative azimuth phi of the mirror direction in the file: 180 or 0.")
    ] = 180,
) -> None:
    """Fit models to a file of measurements and write a report with the Phong–microfacet match.

    Columns, by name: theta_i, theta_o and phi (or phi_i, phi_o; or a signed theta_o alone) in degrees; brdf,
    brdf_cos or reflectance_factor; brdf_r, brdf_g, brdf_b or brdf_550 for channels; sigma where the noise is known.

    Example: fitmat fit measurements.csv --models lambert+ggx --fix ks=1 --seed 1
    """
    _setup()
    from fitmat import console, report
    from fitmat.formats import read
    from fitmat.params import assignments

    reading: dict[str, Any] = {"columns": columns, "quantity": quantity, "angle_unit": angle_unit}
    names, fixed = console.model_names(models), assignments(fix or [], "--fix")
    measurements = read(file, **reading, forward=forward, specular_azimuth=specular_azimuth)
    target = out or report.default_folder(file)
    with report.new_folder(target, force=force) as folder:
        posteriors, match = console.study(
            measurements, names, fixed=fixed, masking=masking, sampling=not no_mcmc, seed=seed
        )
        report.write(folder, posteriors, match)
    if json_:
        sys.stdout.write((target / "fit.json").read_text(encoding="utf-8"))
    else:
        console.show(posteriors, match, target)
    if any(p.fit.result != "converged" or p.interrupted for p in posteriors):
        raise typer.Exit(NOT_CONVERGED)


@app.command()
def simulate(
    model: Annotated[str | None, typer.Argument(help="True model, e.g. lambert+ggx.", show_default=False)] = None,
    out: Annotated[Path, typer.Option(help="CSV file to write.")] = Path("simulated.csv"),
    set_: Annotated[
        list[str] | None,
        typer.Option("--set", help="A true parameter, e.g. alpha=0.2 or kd=0.4,0.1,0.1; repeat.", show_default=False),
    ] = None,
    theta_i: Annotated[str, typer.Option(help="Incidence angles in degrees.")] = "10,30,45,60,75",
    theta_o: Annotated[
        str, typer.Option(help="Outgoing angles in degrees, FIRST:LAST:STEP or a list; positive = mirror side.")
    ] = "-80:80:2",
    noise: Annotated[float, typer.Option(min=0, help="Relative noise, as a fraction of the true value.")] = 0.02,
    floor: Annotated[float, typer.Option(min=0, help="Absolute noise in sr⁻¹.")] = 1e-3,
    seed: Annotated[int, typer.Option(min=0, help="Seed of the noise.")] = 0,
    masking: Annotated[
        str | None, typer.Option(help="Masking: correlated, separable, v-cavity.", show_default=False)
    ] = None,
    catalogue: Annotated[
        Path | None,
        typer.Option(help="Write the catalogue of synthetic materials into this folder instead.", show_default=False),
    ] = None,
    force: Annotated[bool, typer.Option("--force", help="Replace files that exist.")] = False,
) -> None:
    """Simulate measurements of a known material, to test an instrument's plan or fitmat itself.

    Example: fitmat simulate lambert+ggx --set kd=0.3 --set alpha=0.2 --noise 0.03 --out plastic.csv
    """
    _setup()
    from fitmat import simulation

    if catalogue is not None:
        written = simulation.write_catalogue(catalogue, force=force)
    else:
        angles = simulation.angles(theta_i, "--theta-i"), simulation.angles(theta_o, "--theta-o")
        truth = simulation.truth(model, set_ or [], masking)
        written = simulation.write_simulation(out, truth, angles, noise=(noise, floor, seed), force=force)
    typer.echo("\n".join(str(path) for path in written))


@app.command()
def models(
    name: Annotated[str | None, typer.Argument(help="A lobe or model, e.g. ggx or lambert+ggx.")] = None,
) -> None:
    """List the models, or print the manual page of one: formula, parameters, limits, reference."""
    from fitmat import console

    if name is None:
        console.list_models()
    else:
        console.manual(name)


def main() -> None:
    """Run the command line; wrong input becomes one line on stderr and exit code 1."""
    try:
        app()
    except FitmatError as error:
        sys.stderr.write(f"fitmat: {error}\n")
        sys.exit(1)
