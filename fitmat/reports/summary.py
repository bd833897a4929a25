"""Summary: the page of a batch, a line for each file with its best model, sorted and cut down in the browser.

It computes nothing: its rows are those of the table.
"""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from markupsafe import Markup

from fitmat.reports.rendering import CHART_STYLES, CHARTS, LICENCE, POLICY, digest, embedded, environment, static
from fitmat.studies.numbers import short
from fitmat.text import visible_in

SCRIPTS = (CHARTS, "summary.js", "scatter.js")
"""What the page runs, in this order: the chart library, then ours."""

STYLES = (CHART_STYLES, "page.css", "summary.css")

DIGITS = 5
"""Significant digits of what is drawn."""

FIRST = (("alpha", "exponent"), ("match_delta_e_2000", "misfit_over_noise"))
"""Columns that are drawn at first, across and up: of each the first that the files have."""


def to_html(
    files: Sequence[Mapping[str, Any]], refused: Sequence[Mapping[str, Any]], pooled: Sequence[str] = ()
) -> str:
    """The page.

    Args:
        files: Of each file that was fitted: its name, swatch, the link to its own page or "", the sentences and
            levels of its three cards, the numbers delta_e, distance and misfit, None where there is none, and all
            numbers of its row as `columns`.
        refused: Of each that was not: its message.
        pooled: What the files tell together, in sentences.
    """
    scripts = [static(name) for name in SCRIPTS]
    drawn = _drawn(files)
    return (
        environment()
        .get_template("batch.html")
        .render(
            files=visible_in(list(files)),
            refused=visible_in(list(refused)),
            pooled=visible_in(list(pooled)),
            count=len(files) + len(refused),
            policy=POLICY.format(" ".join(f"'sha256-{digest(script)}'" for script in scripts)),
            drawn=drawn,
            data=Markup(embedded(drawn)),
            scripts=[Markup(script) for script in scripts],
            styles=[Markup(static(name)) for name in STYLES],
            licence=Markup(static(LICENCE)),
        )
    )


def _drawn(files: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """Columns that can be drawn, their numbers file by file, the names of the files, and what is drawn at first."""
    names = list(dict.fromkeys(name for one in files for name in one["columns"]))
    whole = {name: short([one["columns"].get(name, np.nan) for one in files], DIGITS) for name in names}
    ends = {f"{name}{end}" for name in whole for end in ("_low", "_high")}
    offered = [name for name, cells in whole.items() if name not in ends and len(set(cells) - {None}) > 1]
    columns = {name: cells for name, cells in whole.items() if name in ends or name in offered}
    first = [next((name for name in (*some, *offered[k:]) if name in offered), "") for k, some in enumerate(FIRST)]
    names = [one["name"] for one in files]
    return visible_in({"names": names, "columns": columns, "offered": offered, "first": first})
