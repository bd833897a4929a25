"""Comparison: several runs side by side, their answers, parameters, curves and matches, as a page without a script.

It fits nothing and computes nothing but how far two values are apart in their standard deviations.
"""

import dataclasses
import itertools
import math
import os
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from markupsafe import Markup

from fitmat import arguments, files
from fitmat.errors import OutputError, ReadError
from fitmat.fitting.priors import DISCREPANCY
from fitmat.measurements.joining import tails
from fitmat.reports.rendering import POLICY, environment, static
from fitmat.reports.rows import parameter_rows
from fitmat.studies.cards import Card, best, cards, title
from fitmat.studies.result import Result, drawn, load
from fitmat.text import brief, visible_in

STYLES = ("page.css", "summary.css")

APART = 2.0
"""Standard deviations between two values from which they are said to differ."""

Record = Mapping[str, Any]
"""JSON types of `studies.record.to_dict`, or a part of it."""


@dataclasses.dataclass(frozen=True)
class Line:
    """One parameter of one model in every run.

    Attributes:
        model: Whose it is.
        name: With its channel where there are several.
        symbol: Its letter.
        cells: Its row of `parameter_rows` in each run, None where the run has none.
        scale: From the least to the largest end of the intervals.
        apart: Largest difference of two runs, in standard deviations of both together; NaN where none is known, and
            of the discrepancy, which is no property of a material.
    """

    model: str
    name: str
    symbol: str
    cells: tuple[Record | None, ...]
    scale: tuple[float, float]
    apart: float

    @property
    def words(self) -> str:
        """Whether the runs agree; "" where that cannot be said."""
        if math.isnan(self.apart):
            return ""
        return f"{'differ' if self.apart >= APART else 'agree'}: {self.apart:.2g} sd"


@dataclasses.dataclass(frozen=True, eq=False)
class Comparison:
    """Runs side by side.

    Attributes:
        names: Of the runs, as short as tells them apart.
        records: What each found.
        figures: What is drawn of each.
        lines: The parameters, model by model.
        matches: What is said of the match → the words in each run.
    """

    names: tuple[str, ...]
    records: tuple[Record, ...]
    figures: tuple[Record, ...]
    lines: tuple[Line, ...]
    matches: Mapping[str, tuple[str, ...]]

    __repr__ = brief

    @property
    def answers(self) -> tuple[tuple[Card, Card, Card], ...]:
        """The three cards of each run."""
        return tuple(cards(record) for record in self.records)


def compare_runs(folders: Sequence[str | os.PathLike[str]]) -> Comparison:
    """Read runs and put them side by side.

    Args:
        folders: Of two runs or more, or the `fit.json` in each.

    Raises:
        ReadError: fewer than two are given, one twice, or one is no run, older than this version, or damaged.
    """
    if len(folders) < 2:
        raise ReadError(f"{len(folders)} run is given, expected two or more that `fitmat fit` wrote. Name another one.")
    runs = [load(folder) for folder in folders]
    places = [run.file.parent.absolute() for run in runs]
    if twice := next((one for k, one in enumerate(places) if one.resolve() in [p.resolve() for p in places[:k]]), None):
        raise ReadError(f"{twice} is given twice, expected different runs. Name each once.")
    names = [tail or place.name for tail, place in zip(tails(places), places, strict=True)]
    records = tuple(visible_in(dict(run.record)) for run in runs)
    try:
        matches = {label: tuple(_told(one, label) for one in records) for label in _MATCH}
        return Comparison(tuple(names), records, tuple(map(_drawn, runs)), tuple(_lines(records)), matches)
    except (LookupError, TypeError, ValueError, AttributeError) as error:
        raise ReadError(f"a run lacks what is compared ({error}): it is older, or damaged. Fit again.") from error


def write(found: Comparison, page: Path, *, force: bool = False) -> Path:
    """Write the page.

    Raises:
        OutputError: it exists and `force` is off, or cannot be written.
    """
    arguments.kind("found", found, Comparison)
    if os.path.lexists(page) and not force:
        raise OutputError(f"{page}: already exists; choose another name, or --force to replace it.")
    return files.write_text(page, to_html(found))


def to_html(found: Comparison) -> str:
    """The page."""
    first = [best(record) for record in found.records]
    swatches = [
        None if one is None else figures["swatches"].get(one["model"])
        for one, figures in zip(first, found.figures, strict=True)
    ]
    return (
        environment()
        .get_template("compare.html")
        .render(
            runs=list(zip(found.names, found.records, found.figures, found.answers, swatches, strict=True)),
            names=found.names,
            lines=[(model, list(of)) for model, of in itertools.groupby(found.lines, key=lambda line: line.model)],
            matches=found.matches,
            apart=APART,
            policy=POLICY.format("'none'"),
            styles=[Markup(static(name)) for name in STYLES],
        )
    )


def _drawn(run: Result) -> Record:
    return visible_in(drawn(run))


def _lines(records: Sequence[Record]) -> Iterator[Line]:
    """Each parameter that any run has, models and parameters in the order in which they first come."""
    every = [{fit["model"]: fit for fit in record["fits"]} for record in records]
    for model in dict.fromkeys(name for fits in every for name in fits):
        tables = [
            {row["name"]: row for row in parameter_rows(fits[model], record["channels"])} if model in fits else {}
            for fits, record in zip(every, records, strict=True)
        ]
        for name in dict.fromkeys(name for table in tables for name in table):
            cells = tuple(table.get(name) for table in tables)
            known = [cell for cell in cells if cell is not None]
            ends = [end for cell in known if cell["ends"] for end in cell["ends"]]
            scale = (min(ends), max(ends)) if ends else (math.nan, math.nan)
            yield Line(
                model, name, known[0]["symbol"], cells, scale, math.nan if name == DISCREPANCY else _apart(known)
            )


def _apart(cells: Sequence[Record]) -> float:
    """NaN where less than two have an error."""
    known = [cell for cell in cells if cell["sd"] > 0.0]
    pairs = itertools.combinations(known, 2)
    return max((abs(a["best"] - b["best"]) / math.hypot(a["sd"], b["sd"]) for a, b in pairs), default=math.nan)


def _told(record: Record, label: str) -> str:
    return "–" if record["match"] is None else _MATCH[label](record["match"])


def _estimate(found: Record | None, form: str, factor: float = 1.0, unit: str = "") -> str:
    if found is None or found["value"] is None:
        return "–"
    ends = "" if not found.get("ci95") else " (" + " – ".join(format(factor * e, form) for e in found["ci95"]) + ")"
    return f"{factor * found['value']:{form}}{unit}{ends}"


_MATCH = {
    "compared": lambda match: f"{title(match['empirical'])} with {title(match['microfacet'])}",
    "serves up to": lambda match: "–" if match["serves_up_to_deg"] is None else f"{match['serves_up_to_deg']:.0f}°",
    "ΔE2000 on average": lambda match: (
        "–" if match["perceived"] is None else _estimate(match["perceived"]["delta_e_2000"]["mean"], ".1f")
    ),
    "distance where measured": lambda match: _estimate(match["measured_distance"], ".2g"),
    "distance over all directions": lambda match: _estimate(match["hemisphere_distance"], ".2g"),
    "largest gap of the albedo": lambda match: _estimate(match["albedo_gap_max"], ".1f", 100.0, " %"),
    "ΔBIC, positive for microfacet": lambda match: "–" if match["delta_bic"] is None else f"{match['delta_bic']:.0f}",
}
# What is said of a match → its words.
