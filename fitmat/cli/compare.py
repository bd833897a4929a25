"""Runs side by side, as a terminal shows them.

It compares nothing itself.
"""

import itertools
from pathlib import Path

from rich.console import Console
from rich.table import Table
from rich.text import Text

from fitmat.reports.comparison import Comparison
from fitmat.reports.terminal import MARKS
from fitmat.text import visible


def show(found: Comparison, page: Path, screen: Console | None = None) -> None:
    """Print the answers of each run, a table of each model's parameters, one of the matches, and where the page is.

    Args:
        found: What to show.
        page: Where it was written.
        screen: Where to; stdout if None.
    """
    out = screen or Console()
    plain = not out.is_terminal or out.is_dumb_terminal
    for name, answers in zip(found.names, found.answers, strict=True):
        out.print(Text(visible(name), "bold"), soft_wrap=plain)
        for card in answers:
            mark, style = MARKS[card.level]
            out.print(Text.assemble((f"{mark} {card.title}", style), f"  {visible(card.sentence)}"), soft_wrap=plain)
    for model, lines in itertools.groupby(found.lines, key=lambda line: line.model):
        table = _table(found, "do they agree?")
        for line in lines:
            values = ("–" if c is None else ", ".join(filter(None, (c["value"], c["remark"]))) for c in line.cells)
            table.add_row(*(Text(visible(text)) for text in (line.name, *values, line.words)))
        out.print(Text(f"\n{visible(model)}", "bold"), soft_wrap=plain)
        out.print(table, soft_wrap=plain)
    table = _table(found)
    for label, words in found.matches.items():
        table.add_row(*(Text(visible(text)) for text in (label, *words)))
    out.print(Text("\nThe match", "bold"))
    out.print(table, soft_wrap=plain)
    out.print(Text(f"\nPage: {visible(str(page))}"), soft_wrap=True)


def _table(found: Comparison, *last: str) -> Table:
    table = Table(box=None, pad_edge=False)
    for heading in ("", *found.names, *last):
        table.add_column(Text(visible(heading)), overflow="fold")
    return table
