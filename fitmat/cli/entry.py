"""The entry: what holds for every command, and where each is entered.

It knows no command.
"""

import typer

from fitmat.cli.flags.version import VersionFlag

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
