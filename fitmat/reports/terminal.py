"""What a person at a terminal sees when a study is done: the answer, the parameters, the doubts, the place.

It computes nothing, says what the page says, and writes to stdout only.
"""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.table import Table
from rich.text import Text

from fitmat.reports.rows import parameter_rows
from fitmat.studies.cards import BAD, CAUTION, GOOD, UNKNOWN, cards, ordered, wider
from fitmat.text import visible, visible_in

Record = Mapping[str, Any]
"""JSON types of `studies.record.to_dict`, or a part of it."""

MARKS = {GOOD: ("✔", "green"), CAUTION: ("▲", "yellow"), BAD: ("✖", "red"), UNKNOWN: ("?", "cyan")}
"""Level of a card → its mark, and its colour on a terminal."""

SHOWN = 4
"""Of more models than this, only the first of the choice have their parameters shown."""


def show(record: Record, report: Path, screen: Console | None = None) -> None:
    """Print the three answers, the parameters of every model, what speaks against them and where the report is.

    Args:
        record: What was found.
        report: The page, or the record where there is no page.
        screen: Where to; stdout if None.
    """
    out, record = screen or Console(), visible_in(record)
    channels = f", channels {', '.join(record['channels'])}" if len(record["channels"]) > 1 else ""
    _say(out, f"{record['file']}: {record['n_samples']} samples{channels}\n")
    for card in cards(record):
        mark, style = MARKS[card.level]
        _say(out, (f"{mark} {card.title}", f"bold {style}"), f"  {card.sentence}")
    shown = _shown(record)
    for fit in shown:
        _say(out, (f"\n{_title(fit)}", "bold"))
        out.print(_table(fit, record["channels"]))
        if fit["identifiability"] is not None:
            _say(out, fit["identifiability"]["words"])
    _say(out, ("→ follows from the parameters above it", "dim"))
    if len(shown) < len(record["fits"]):
        _say(out, (f"{len(record['fits']) - len(shown)} more models: see the report.", "dim"))
        if record["choice"] is not None:
            _say(out, f"\n{record['choice']['verdict']}")
    _doubts(out, record, shown)
    if command := wider(record):
        _say(out, f"\nEvery model: {command}")
    out.print(Text(f"\nReport: {visible(str(report))}"), soft_wrap=True)


def _say(out: Console, *parts: str | tuple[str, str]) -> None:
    """Print words, some with a style, wrapped at the edge of a terminal, and not at all where there is none."""
    styled = (part if isinstance(part, tuple) else (part, "") for part in parts)
    text = Text.assemble(*((visible(words, keep="\n"), style) for words, style in styled))
    out.print(text, soft_wrap=not out.is_terminal or out.is_dumb_terminal)


def _shown(record: Record) -> list[Record]:
    """The models whose parameters are printed: all of a few, else those of the match, then the best."""
    fits = {fit["model"]: fit for fit in record["fits"]}
    match, choice = record["match"], record["choice"]
    first = [match["empirical"], match["microfacet"]] if match else []
    ranked = [candidate["model"] for candidate in choice["candidates"]] if choice else []
    chosen = list(dict.fromkeys((*first, *ranked, *fits)))[:SHOWN]
    return [fit for fit in ordered(record) if fit["model"] in chosen]


def _doubts(out: Console, record: Record, shown: Sequence[Record]) -> None:
    """What speaks against the data and the fits, then how the file was read."""
    out.print()
    for warning in record["warnings"]:
        _say(out, ("WARNING", "yellow"), f": {warning}")
    for fit in shown:
        if fit["result"] != "converged":
            _say(out, (fit["result"], "yellow"), f": {fit['result_means']}")
        if fit["posterior"]["interrupted"]:
            _say(out, ("interrupted", "yellow"), ": sampling was stopped; what was done is kept.")
        if fit["doubts"]:
            words = ("in doubt" if fit["inadequate"] else "note", "yellow")
            _say(out, words, f": {' '.join(fit['doubts'])}")
        if (opinion := fit["posterior"]["second_sampler"]) is not None:
            _say(out, opinion["words"])
    if not record["loss"]["posterior"]:
        _say(out, f"The loss {record['loss']['name']} is an objective: single fits, without a posterior.")
    masked = [f"{count} masked: {reason}." for reason, count in record["masked"].items()]
    for words in (*masked, *record["notes"], record["noise"]):
        _say(out, (words, "dim"))


def _title(fit: Record) -> str:
    agreeing = f"{fit['n_starts_agreeing']} of {fit['n_starts']} starts agree"
    verdict = fit["posterior"]["verdict"]
    ending = verdict if verdict == "no posterior" else f"posterior {verdict}"
    against = "" if fit["intervals_hold"] else ", intervals in doubt"
    return f"{fit['model']}: {fit['result']}, {agreeing}, {ending}{against}"


def _table(fit: Record, channels: Sequence[str]) -> Table:
    table = Table(box=None, pad_edge=False)
    for heading in ("parameter", "", "value ± sd", "95 % interval", ""):
        table.add_column(heading, no_wrap=True)
    for row in parameter_rows(fit, channels):
        name = f"→ {row['name']}" if row["kind"] == "follows" else row["name"]
        remark = " ".join(part for part in (row["unit"], row["remark"]) if part)
        table.add_row(*(Text(visible(cell)) for cell in (name, row["symbol"], row["value"], row["interval"], remark)))
    return table
