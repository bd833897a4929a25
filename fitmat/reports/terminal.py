"""What a person at a terminal sees when a study is done.

It computes nothing and writes to stdout only.
"""

from pathlib import Path

from rich.console import Console
from rich.table import Table
from rich.text import Text

from fitmat.fitting.concluding import RESULTS
from fitmat.reports.rows import parameter_rows
from fitmat.studies.findings import Findings
from fitmat.studies.study import MOST_SAMPLED, Study
from fitmat.text import visible


def _say(out: Console, *parts: str | tuple[str, str]) -> None:
    """Print words, some with a style, wrapped at the edge of a terminal, and not at all where there is none."""
    styled = (part if isinstance(part, tuple) else (part, "") for part in parts)
    text = Text.assemble(*((visible(words, keep="\n"), style) for words, style in styled))
    out.print(text, soft_wrap=not out.is_terminal or out.is_dumb_terminal)


def show(found: Study, report: Path, screen: Console | None = None) -> None:
    """Print the parameters of every model, what speaks against them, the verdict and where the report is.

    Args:
        found: What to show.
        report: The page, or the record where there is no page.
        screen: Where to; stdout if None.
    """
    out = screen or Console()
    first = found.findings[0].fit
    _say(out, str(first.measurements))
    _say(out, first.noise.words)
    for warning in found.warnings:
        if warning not in first.measurements.warnings:  # which the measurements have said
            _say(out, f"WARNING: {warning}")
    if first.n_values > MOST_SAMPLED:
        words = f"More than {MOST_SAMPLED:,} values: intervals from Laplace's approximation, nothing is sampled."
        _say(out, words)
    if not first.loss.posterior:
        _say(out, f"The loss {first.loss.name} is an objective: single fits, without a posterior.")
    shown = found.detailed
    for one in shown:
        _say(out, (f"\n{_title(one)}", "bold"))
        out.print(_table(one))
        _remark(out, one)
    _say(out, ("\n→ follows from the parameters above it", "dim"))
    if len(shown) < len(found.findings):
        _say(out, (f"{len(found.findings) - len(shown)} more models: see the report.", "dim"))
    verdicts = [] if found.choice is None or len(found.findings) == len(shown) else [found.choice.verdict]
    adequate = " ".join(f"{one.name} {one.fit.adequacy}." for one in found.findings)
    for words in (*verdicts, found.match.verdict if found.match else adequate):
        _say(out, (f"\n{words}", "bold"))
    out.print(Text(f"\nReport: {visible(str(report))}"), soft_wrap=True)


def _remark(out: Console, found: Findings) -> None:
    """How a fit ended, what speaks against it, and what the angles determine."""
    result, against = found.fit.result, found.doubts
    if result != "converged":
        _say(out, (result, "yellow"), f": {RESULTS[result]}")
    if found.posterior.interrupted:
        _say(out, ("interrupted", "yellow"), ": sampling was stopped; what was done is kept.")
    if against.words:
        _say(out, ("in doubt" if against.inadequate else "note", "yellow"), f": {against}")
    for words in filter(None, (found.scope, found.several_facets)):
        _say(out, words)
    for said in (found.identifiability, found.second_opinion, found.budget):
        if said is not None and said.words:
            _say(out, said.words)


def _title(found: Findings) -> str:
    posterior, fit = found.posterior, found.fit
    agreeing = f"{fit.n_starts_agreeing} of {fit.n_starts} starts agree"
    ending = f"posterior {posterior.verdict}" if fit.loss.posterior else f"loss {fit.loss.name}, no posterior"
    against = "" if found.doubts.intervals_hold else ", intervals in doubt"
    return f"{fit.name}: {fit.result}, {agreeing}, {ending}{against}"


def _table(found: Findings) -> Table:
    table = Table(box=None, pad_edge=False)
    for heading in ("parameter", "", "value ± sd", "95 % interval", ""):
        table.add_column(heading, no_wrap=True)
    for row in parameter_rows(found):
        name = f"→ {row['name']}" if row["kind"] == "follows" else row["name"]
        remark = " ".join(part for part in (row["unit"], row["remark"]) if part)
        table.add_row(*(Text(visible(cell)) for cell in (name, row["symbol"], row["value"], row["interval"], remark)))
    return table
