"""Rendering: a run's record and its figures as one HTML page that fetches nothing and runs no script but its own.

It computes nothing: all that is said and drawn is in what it is given.
"""

import base64
import functools
import hashlib
import json
import re
from collections.abc import Mapping
from importlib.resources import files
from typing import Any

import jinja2
from markupsafe import Markup

from fitmat.colour.differences import SEEN, WHITE_LUMINANCE
from fitmat.fitting.concluding import RESULTS
from fitmat.judgement import budget
from fitmat.match.ablation import EXPLAINS
from fitmat.match.discernibility import SEPARATED
from fitmat.match.regions import REGIONS
from fitmat.match.sentences import CLOSE, SIMILAR
from fitmat.models.metrics import METRICS
from fitmat.reports import ball, drawings
from fitmat.reports.rows import brief_rows, parameter_rows, prior_rows
from fitmat.reports.snippets import snippets
from fitmat.studies.cards import best, cards, ordered, title, wider
from fitmat.studies.citations import bibtex
from fitmat.text import visible_in
from fitmat.uncertainty.diagnostics import ENOUGH_ESS, ENOUGH_TAIL_ESS, ENOUGH_TAU, GOOD_RHAT, VERDICTS

CHARTS, CHART_STYLES = "uplot/uPlot.iife.min.js", "uplot/uPlot.min.css"
"""The chart library."""

SCRIPTS = (
    CHARTS,
    "core.js",
    "charts.js",
    "curves.js",
    "maps.js",
    "match.js",
    "corner.js",
    "page.js",
)
"""What a page runs, in this order: the chart library, then ours."""

STYLES = (CHART_STYLES, "page.css", "ball.css")

LICENCE = "uplot/LICENSE"
"""Of the chart library, which each page holds."""

POLICY = (
    "default-src 'none'; script-src {}; style-src 'unsafe-inline'; img-src data:; base-uri 'none'; form-action 'none'"
)
"""What a browser lets the page do: run the scripts of these hashes, and show pictures that it holds itself."""

TOLD = {"budget", "predictive_check", "learnt", "identifiability", "priors", "metrics"}
"""Parts of a fit that are told in tables, and that no script asks for."""

DIGITS = 7
"""Significant digits of the record's numbers in a page: more than is shown, fewer than a file keeps."""


def to_html(record: Mapping[str, Any], figures: Mapping[str, Any]) -> str:
    """The page of a run.

    Args:
        record: JSON types, as `studies.record.to_dict` makes them.
        figures: The same, of `studies.figures.to_dict`, with the ball's data.
    """
    told, drawn = visible_in(record, keep="\n"), visible_in(figures, keep="\n")
    scripts = [*map(static, SCRIPTS), _stage()]
    hashes = " ".join(f"'sha256-{digest(script)}'" for script in scripts)
    return (
        environment()
        .get_template("report.html")
        .render(
            record=told,
            figures=drawn,
            cards=cards(told),
            best=best(told),
            wider=wider(told),
            cite=bibtex(told),
            fits=ordered(told),
            policy=POLICY.format(hashes),
            scripts=[Markup(script) for script in scripts],
            styles=[Markup(static(name)) for name in STYLES],
            licence=Markup(static(LICENCE)),
            data=Markup(embedded({"record": _rounded(_used(told)), "figures": drawn})),
            swatch=figures["swatches"],
            **_WORDS,
        )
    )


_WORDS = {
    "of": budget,
    "results": RESULTS,
    "verdicts": VERDICTS,
    "regions": REGIONS,
    "metrics": METRICS,
    "close": CLOSE,
    "similar": SIMILAR,
    "separated": SEPARATED,
    "explains": EXPLAINS,
    "seen_words": SEEN,
    "white_luminance": WHITE_LUMINANCE,
    "enough": {"tau": ENOUGH_TAU, "ess": ENOUGH_ESS, "tail_ess": ENOUGH_TAIL_ESS, "rhat": GOOD_RHAT},
}
# What words and thresholds of the page mean, where they are defined.


@functools.cache
def environment() -> jinja2.Environment:
    """What renders templates: autoescaped, strict, with the words and drawings of all pages."""
    environment = jinja2.Environment(
        loader=jinja2.PackageLoader("fitmat.reports"),
        autoescape=True,
        trim_blocks=True,
        lstrip_blocks=True,
        undefined=jinja2.StrictUndefined,
    )
    environment.filters |= {
        "subscripted": _subscripted,
        "digits": _digits,
        "percent": _percent,
        "title": title,
        "held": _held,
        "typeset": _typeset,
    }
    environment.globals |= {
        "rows": parameter_rows,
        "brief_rows": brief_rows,
        "prior_rows": prior_rows,
        "snippets": snippets,
        "static_curves": drawings.curves,
        "interval_bar": drawings.interval_bar,
        "share_bar": drawings.share_bar,
        "next_angle": drawings.next_angle,
    }
    return environment


def load() -> None:
    """Load what pages are made with."""
    for name in environment().list_templates():
        environment().get_template(name)
    for name in (*SCRIPTS, *STYLES, LICENCE):
        static(name)
    _stage()


@functools.cache
def static(name: str) -> str:
    """A script or a style that comes with fitmat."""
    return files("fitmat.reports").joinpath("static", name).read_text(encoding="utf-8")


@functools.cache
def _stage() -> str:
    """What draws the ball and the lobes, in a scope of its own."""
    return f"(() => {{\n{ball.script()}\n{static('stage.js')}}})();\n"


def digest(script: str) -> str:
    """SHA-256 as a policy names the scripts that may run."""
    return base64.b64encode(hashlib.sha256(script.encode("utf-8")).digest()).decode("ascii")


def embedded(thing: Any) -> str:
    """JSON that ends no script and begins no tag."""
    text = json.dumps(thing, ensure_ascii=False, separators=(",", ":"), allow_nan=False)
    return text.replace("&", "\\u0026").replace("<", "\\u003c").replace(">", "\\u003e")


def _used(record: Mapping[str, Any]) -> dict[str, Any]:
    """What scripts may ask of a record; the rest stands in the page's tables and in the file."""
    fits = [{key: value for key, value in fit.items() if key not in TOLD} for fit in record["fits"]]
    return {key: value for key, value in record.items() if key != "choice"} | {"fits": fits}


def _rounded(thing: Any) -> Any:
    if isinstance(thing, float):
        return float(f"{thing:.{DIGITS}g}")
    if isinstance(thing, dict):
        return {key: _rounded(value) for key, value in thing.items()}
    return [_rounded(part) for part in thing] if isinstance(thing, list) else thing


def _subscripted(symbol: str) -> Markup:
    """`k_d` as people write it, k with a small d below."""
    letter, _, rest = symbol.partition("_")
    below, dot, after = rest.partition("·")
    return Markup("{}<sub>{}</sub>{}").format(letter, below, dot + after) if below else Markup("{}").format(symbol)


def _typeset(text: str) -> Markup:
    """Words with indices below the line and powers above it: `cosθ_i`, `sr^(-1/3)`."""
    found = re.sub(r"(?<=[θφωc])_([a-z])\b", r"<sub>\1</sub>", str(Markup.escape(text)))
    return Markup(re.sub(r"\^\(([^)]*)\)", lambda power: f"<sup>{power[1].replace('-', '−')}</sup>", found))


_TOGETHER = re.compile(r"(?:(?<=F0)|(?<=α)|(?<=ΔE2000)|(?<=±)) | (?=[%±×])")
# Spaces between a symbol, its value and its unit.


def _held(text: str) -> Markup:
    """A sentence whose numbers keep to their symbols and units where a line ends, and flags in one piece."""
    held = re.sub(_TOGETHER, "&nbsp;", str(Markup.escape(text)))
    return Markup(re.sub(r"(?<!\S)(--?[a-z][a-z-]*)", r'<span class="flag">\1</span>', held))


def _digits(value: float | None, form: str = ".3g") -> str:
    return "–" if value is None else format(value, form)


def _percent(value: float | None, form: str = ".0f") -> str:
    return "–" if value is None else f"{100 * value:{form}} %"
