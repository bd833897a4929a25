"""What a person at a terminal sees when a study is done.

It computes nothing and writes to stdout only.
"""

from pathlib import Path

from rich.console import Console
from rich.table import Table
from rich.text import Text

from fitmat.fitting.result import RESULTS
from fitmat.reports.rows import parameter_rows
from fitmat.studies.findings import Findings
from fitmat.studies.study import MOST_SAMPLED, Study
from fitmat.uncertainty.posterior import Posterior


def show(found: Study, folder: Path) -> None:
    """Print the parameters of every model, what speaks against them, the verdict and where the report is."""
    out = Console()
    first = found.findings[0].fit
    out.print(str(first.measurements), markup=False, highlight=False)
    out.print(first.noise.words, markup=False, highlight=False)
    if first.n_values > MOST_SAMPLED:
        words = f"More than {MOST_SAMPLED:,} values: intervals from Laplace's approximation, nothing is sampled."
        out.print(words, highlight=False)
    if not first.loss.posterior:
        out.print(f"The loss {first.loss.name} is an objective: single fits, without a posterior.", highlight=False)
    shown = found.detailed
    for one in shown:
        out.print(f"\n[bold]{_title(one.posterior)}[/bold]", highlight=False)
        out.print(_table(one))
        _remark(out, one)
    out.print("\n→ follows from the parameters above it", highlight=False, style="dim")
    if len(shown) < len(found.findings):
        out.print(f"{len(found.findings) - len(shown)} more models: see the report.", highlight=False, style="dim")
    verdicts = [] if found.choice is None or len(found.findings) == len(shown) else [found.choice.verdict]
    adequate = " ".join(f"{one.name} {one.fit.adequacy}." for one in found.findings)
    for words in (*verdicts, found.match.verdict if found.match else adequate):
        out.print(f"\n[bold]{words}[/bold]", highlight=False)
    out.print(f"\nReport: {folder / 'report.html'}", markup=False, highlight=False, soft_wrap=True)


def _remark(out: Console, found: Findings) -> None:
    """How a fit ended, what speaks against it, and what the angles determine."""
    result, against = found.fit.result, found.doubts
    if result != "converged":
        words = f"[yellow]{result}[/yellow]: {RESULTS[result]}"
        out.print(words, highlight=False)
    if found.posterior.interrupted:
        out.print("[yellow]interrupted[/yellow]: sampling was stopped; what was done is kept.", highlight=False)
    if against.words:
        out.print(f"[yellow]{'inadequate' if against.inadequate else 'note'}[/yellow]: {against}", highlight=False)
    for said in (found.identifiability, found.second_opinion):
        if said is not None:
            out.print(said.words, markup=False, highlight=False)


def _title(posterior: Posterior) -> str:
    fit = posterior.fit
    agreeing = f"{fit.n_starts_agreeing} of {fit.n_starts} starts agree"
    ending = f"posterior {posterior.verdict}" if fit.loss.posterior else f"loss {fit.loss.name}, no posterior"
    return f"{fit.name}: {fit.result}, {agreeing}, {ending}"


def _table(found: Findings) -> Table:
    table = Table(box=None, pad_edge=False)
    for heading in ("parameter", "", "value ± sd", "95 % interval", ""):
        table.add_column(heading, no_wrap=True)
    for row in parameter_rows(found):
        name = f"→ {row['name']}" if row["kind"] == "follows" else row["name"]
        remark = " ".join(part for part in (row["unit"], row["remark"].removesuffix(" by these angles")) if part)
        table.add_row(*(Text(cell) for cell in (name, row["symbol"], row["value"], row["interval"], remark)))
    return table
