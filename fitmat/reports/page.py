"""The report: one HTML page, one JSON object and the posteriors, written together or not at all.

Formats numbers that other rooms computed; computes none. The numbers are on disk before anything is drawn.
"""

import base64
import contextlib
import functools
import io
import json
import os
import threading
import warnings
from collections.abc import Callable
from importlib.metadata import version
from pathlib import Path
from typing import TYPE_CHECKING, Any

import jinja2
import numpy as np
from markupsafe import Markup

from fitmat import arguments, files
from fitmat.errors import OutputError
from fitmat.fitting.concluding import RESULTS
from fitmat.fitting.result import Fit
from fitmat.judgement import budget
from fitmat.judgement.choice import Choice
from fitmat.match.ablation import EXPLAINS, TERMS
from fitmat.match.appearance.colour import WHITE_LUMINANCE
from fitmat.match.appearance.spheres import CLEARLY_VISIBLE, JUST_NOTICEABLE
from fitmat.match.discernibility import SEPARATED
from fitmat.match.match import Match
from fitmat.match.regions import GRAZING_DEG, REGIONS
from fitmat.match.sentences import CLOSE, SIMILAR
from fitmat.measurements.parsing.contents import shown
from fitmat.models.metrics import METRICS
from fitmat.reports.pictures import reason
from fitmat.reports.rows import parameter_rows, prior_rows
from fitmat.studies import record
from fitmat.studies.result import POSTERIOR, RECORD
from fitmat.studies.study import Study
from fitmat.text import visible
from fitmat.uncertainty.posterior import ENOUGH_ESS, ENOUGH_TAIL_ESS, ENOUGH_TAU, GOOD_RHAT, VERDICTS, Posterior

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Draw = Callable[[], "Figure"]
"""Draws a picture when it is called."""

DPI = 96
CHANNELS_DRAWN = 3
PAGE, BUDGET = "report.html", "budget.txt"


def write(folder: Path, study: Study) -> str:
    """Write `fit.json`, `budget.txt`, one `posterior-MODEL.parquet` per model, then `report.html` into a folder.

    Returns:
        What is missing because it could not be drawn or written, in one sentence; "" where nothing is.
    """
    found = record.to_dict(study)
    (folder / RECORD).write_text(json.dumps(found, indent=1, ensure_ascii=False) + "\n", encoding="utf-8")
    budgets = [str(found.budget) for found in study.findings if found.budget is not None]
    (folder / BUDGET).write_text("\n\n\n".join(budgets) + "\n", encoding="utf-8")
    for posterior in study.posteriors:
        posterior.save(folder / POSTERIOR.format(posterior.fit.name))
    pictures = _Pictures()
    try:
        files.write_text(folder / PAGE, _rendered(study, pictures))
    except Exception as error:  # the numbers stand, whatever a page or a library of pictures comes upon
        return f"{PAGE} could not be made ({reason(error)}); the numbers are saved in {RECORD}."
    return pictures.words


def own(folder: Path) -> list[str]:
    """Names of the files that a run wrote into a folder, last the record, which names the models of the others.

    Raises:
        OutputError: the folder has a file of such a name, and no record that says it is a run's.
    """
    try:
        found = json.loads((folder / RECORD).read_text(encoding="utf-8"))
        models = [str(fit["model"]) for fit in found["fits"] if found["fitmat"]]
    except (OSError, ValueError, LookupError, TypeError):
        for name in (PAGE, RECORD, BUDGET):
            if os.path.lexists(folder / name):
                why = f"{folder / name} is not known to be of an earlier run, and is not replaced"
                raise OutputError(f"{why}; move it, or give another --out DIR.") from None
        return []
    names = [*(POSTERIOR.format(model) for model in models), PAGE, BUDGET, RECORD]
    return [name for name in names if Path(name).name == name and os.path.lexists(folder / name)]


def report(study: Study, folder: str | Path, *, force: bool = False) -> Path:
    """Write the report of a study: one HTML page, one JSON object, and the draws of every posterior.

    Args:
        study: From `fitmat.study`.
        folder: Where to; it appears complete or not at all.
        force: Replace the report of an earlier run in it.

    Returns:
        The page.

    Raises:
        OutputError: the folder holds something and `force` is off, or it cannot be written.
    """
    arguments.kind("study", study, Study)
    arguments.kind("folder", folder, str, os.PathLike)
    arguments.flags(force=force)
    target = Path(folder)
    with files.new(target, own=own, force=force) as draft:
        missing = write(draft, study)
    if missing:
        warnings.warn(f"{target}: {missing}", stacklevel=2)
    return target / PAGE


def to_html(study: Study) -> str:
    """The page: verdict, pictures, then numbers; pictures are embedded, nothing is fetched."""
    return _rendered(study, _Pictures())


@functools.cache
def _environment() -> jinja2.Environment:
    environment = jinja2.Environment(
        loader=jinja2.PackageLoader("fitmat.reports"),
        autoescape=True,
        trim_blocks=True,
        lstrip_blocks=True,
        finalize=_visible,
    )
    environment.filters |= {"picture": _picture, "subscripted": _subscripted}
    return environment


@jinja2.pass_context
def _picture(context: jinja2.runtime.Context, draw: "Draw", what: str) -> Markup:
    return context["pictures"].embedded(draw, what)


def _rendered(study: Study, pictures: "_Pictures") -> str:
    findings = study.findings
    template = _environment().get_template("report.html")
    return template.render(
        pictures=pictures,
        version=version("fitmat"),
        study=study,
        findings=findings,
        sampled=any(found.posterior.diagnostics is not None for found in findings),
        measurements=study.measurements,
        loss=findings[0].fit.loss,
        left_out=_left_out(findings[0].fit),
        rows=parameter_rows,
        prior_rows=prior_rows,
        results=RESULTS,
        verdicts=VERDICTS,
        curves=_curve_pictures(study),
        residuals=(lambda: _plot().residual_figure(study, _drawn(study))) if study.full else None,
        enough={"tau": ENOUGH_TAU, "ess": ENOUGH_ESS, "tail_ess": ENOUGH_TAIL_ESS, "rhat": GOOD_RHAT},
        corners=[(p.fit.name, _corner(p)) for p in study.posteriors if study.full and _has_posterior(p)],
        **_match_parts(study.match, study.full),
        **_choice_parts(study.choice, study.full),
        identified=[found.identifiability for found in findings if found.identifiability is not None],
        distance=study.distance,
        of=budget,
        checks=[found.check for found in findings if found.check is not None],
        opinions=[found.second_opinion for found in findings if found.second_opinion is not None],
    )


def _match_parts(match: Match | None, full: bool) -> dict[str, Any]:
    """What the template says of the match, and how its pictures are drawn."""
    if match is None:
        return {"match": None}
    seen, causes = match.perceived, match.ablation
    drawn = seen is not None and all(lighting.pictures is not None for lighting in seen.lightings)
    return {
        "match": match,
        "albedo": lambda: _plot().albedo(match).figure,
        "close": CLOSE,
        "similar": SIMILAR,
        "regions": REGIONS,
        "metrics_of_match": METRICS,
        "terms": TERMS,
        "separated": SEPARATED,
        "explains": EXPLAINS,
        "grazing_deg": GRAZING_DEG,
        "distances_figure": (lambda: _plot().distances(match).figure) if full else None,
        "ablation_figure": (lambda: _plot().ablation(causes).figure) if full and causes is not None else None,
        "telling_figure": (lambda: _plot().telling(match.telling).figure) if full and match.telling.known else None,
        "perceived": seen,
        "spheres": (lambda: _plot().spheres(seen)) if drawn else None,
        "just_noticeable": JUST_NOTICEABLE,
        "clearly_visible": CLEARLY_VISIBLE,
        "white_luminance": WHITE_LUMINANCE,
    }


def _choice_parts(choice: Choice | None, full: bool) -> dict[str, Any]:
    """What the template says of the choice, and how its pictures are drawn."""
    if choice is None or not full:
        return {"choice": choice}
    predicted = any(c.left_out is not None for c in choice.candidates)
    return {
        "choice": choice,
        "choice_picture": lambda: _plot().choice(choice).figure,
        "left_out_picture": (lambda: _plot().left_out(choice).figure) if predicted else None,
    }


def _has_posterior(posterior: Posterior) -> bool:
    fit = posterior.fit
    return fit.finite and fit.loss.posterior and len(fit.free) > 0


def _left_out(fit: Fit) -> str:
    """What the loss could not be applied to, in words."""
    count = fit.measurements.n_valid - fit.n_values
    return f"{count} values left out: {fit.loss.unusable}." if fit.loss.usable is not None and count > 0 else ""


def _curve_pictures(study: Study) -> list[tuple[str, Draw]]:
    """How the curves of every channel that is drawn are drawn, by its name; none without a section."""

    def curves(channel: int) -> Draw:
        return lambda: _plot().curves(study, channel=channel)

    drawn = _drawn(study) if study.findings[0].curves else []
    return [(study.measurements.channels[channel], curves(channel)) for channel in drawn]


def _corner(posterior: Posterior) -> Draw:
    return lambda: _plot().corner(posterior)


def _drawn(study: Study) -> list[int]:
    """The channels that are drawn: at most `CHANNELS_DRAWN`, evenly spread, or only the middle one."""
    last = len(study.measurements.channels) - 1
    if not study.full:
        return [last // 2]
    return [int(k) for k in np.unique(np.linspace(0, last, CHANNELS_DRAWN).astype(int))]


def _visible(value: Any) -> Any:
    """Text as the page shows it, without marks that would turn or hide what follows."""
    return visible(value, keep="\n") if isinstance(value, str) and not isinstance(value, Markup) else value


def _subscripted(symbol: str) -> Markup:
    """`k_d` as people write it, k with a small d below."""
    letter, _, below = symbol.partition("_")
    return Markup("{}<sub>{}</sub>").format(letter, below) if below else Markup("{}").format(symbol)


def load_ahead() -> None:
    """Load, in a thread, what pages are made with, while there are other things to do."""
    threading.Thread(target=_load, daemon=True).start()


def _load() -> None:
    with contextlib.suppress(Exception):  # what cannot be loaded is said where it is used
        _plot()
        for name in _environment().list_templates():
            _environment().get_template(name)


def _plot() -> Any:
    """The room of pictures, which loads Matplotlib."""
    from fitmat.reports import plot

    return plot


class _Pictures:
    """Pictures as a page holds them; one that cannot be drawn is a sentence there, and remembered."""

    def __init__(self) -> None:
        self._lost: dict[str, list[str]] = {}

    def embedded(self, draw: Draw, what: str) -> Markup:
        """The picture that `draw` draws, or why there is none."""
        what = visible(what)
        buffer = io.BytesIO()
        try:
            draw().savefig(buffer, format="png", dpi=DPI)
        except Exception as error:  # a picture is not worth the report
            self._lost.setdefault(reason(error), []).append(shown(what, 80))
            return Markup('<p class="warn">{} could not be drawn ({}).</p>').format(what, reason(error))
        content = base64.b64encode(buffer.getvalue()).decode("ascii")
        return Markup('<img src="data:image/png;base64,{}" alt="{}">').format(content, what)

    @property
    def words(self) -> str:
        """What is missing, and why; "" where nothing is."""
        lost = [f"{', '.join(pictures)} ({why})" for why, pictures in self._lost.items()]
        return f"{PAGE} lacks what could not be drawn: {'; '.join(lost)}; all numbers are saved." if lost else ""
