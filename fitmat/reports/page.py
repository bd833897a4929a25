"""The report: one HTML page, one JSON object and the posteriors, written together or not at all.

Formats numbers that other rooms computed; computes none.
"""

import base64
import io
import itertools
import json
import math
from collections.abc import Sequence
from importlib.metadata import version
from pathlib import Path
from typing import Any

import jinja2
import numpy as np
from markupsafe import Markup
from matplotlib.figure import Figure

from fitmat.fitting import priors
from fitmat.fitting.result import RESULTS, Fit
from fitmat.judgement.choice import Choice
from fitmat.judgement.metrics import fit_metrics
from fitmat.judgement.prediction import sections
from fitmat.match.ablation import EXPLAINS, TERMS
from fitmat.match.appearance.colour import WHITE_LUMINANCE
from fitmat.match.appearance.spheres import CLEARLY_VISIBLE, JUST_NOTICEABLE
from fitmat.match.discernibility import SEPARATED
from fitmat.match.distances import METRICS
from fitmat.match.match import Comparison
from fitmat.match.regions import GRAZING_DEG, REGIONS
from fitmat.match.sentences import CLOSE, SIMILAR
from fitmat.measurements.samples import Measurements
from fitmat.models.parameters import space
from fitmat.reports import plot
from fitmat.studies import record
from fitmat.studies.study import Study
from fitmat.text import interval, with_error
from fitmat.uncertainty.posterior import ENOUGH_ESS, ENOUGH_TAU, GOOD_RHAT, VERDICTS, Posterior
from fitmat.uncertainty.quantities import derived, parameters

DPI = 96
CHANNELS_DRAWN = 3
POSTERIOR = "posterior-{}.parquet"


def write(folder: Path, study: Study) -> None:
    """Write `report.html`, `fit.json` and one `posterior-MODEL.parquet` per model into an existing folder."""
    found = record.to_dict(study)
    (folder / "fit.json").write_text(json.dumps(found, indent=1, ensure_ascii=False) + "\n", encoding="utf-8")
    for posterior in study.posteriors:
        posterior.save(folder / POSTERIOR.format(posterior.fit.name))
    (folder / "report.html").write_text(to_html(study), encoding="utf-8")


def rows(posterior: Posterior) -> list[dict[str, str]]:
    """One line per reported number, as text: name, symbol, value, interval, remark, what it means.

    What the data do not determine has its interval, but no standard deviation: the draws fill the range allowed.
    """
    channels = posterior.fit.measurements.channels
    result = []
    for kind, quantities in (("fitted", parameters(posterior)), ("follows", derived(posterior))):
        for q in quantities:
            for k in range(len(q.value)):
                low, high = q.ci95[k]
                channel = f" {channels[k]}" if q.per_channel and len(channels) > 1 else ""
                free = q.remark != "fixed" and np.isfinite(low) and np.isfinite(high)
                sd = math.nan if q.remark.startswith("not determined") else q.sd[k]
                result.append(
                    {
                        "kind": kind,
                        "name": q.name + channel,
                        "symbol": q.symbol,
                        "value": with_error(q.value[k], sd),
                        "interval": interval(low, high, sd) if free else "",
                        "unit": "" if q.unit == "1" else q.unit,
                        "remark": q.remark,
                        "doc": q.doc,
                    }
                )
    return result


def to_html(study: Study) -> str:
    """The page: verdict, pictures, then numbers; pictures are embedded, nothing is fetched."""
    environment = jinja2.Environment(
        loader=jinja2.PackageLoader("fitmat.reports"), autoescape=True, trim_blocks=True, lstrip_blocks=True
    )
    environment.filters |= {"png": _png, "subscripted": _subscripted}
    posteriors = study.posteriors
    return environment.get_template("report.html").render(
        version=version("fitmat"),
        study=study,
        posteriors=posteriors,
        measurements=posteriors[0].fit.measurements,
        loss=posteriors[0].fit.loss,
        doubts=[(p.fit, study.doubts(p)) for p in posteriors],
        left_out=_left_out(posteriors[0].fit),
        rows=rows,
        prior_rows=prior_rows,
        results=RESULTS,
        verdicts=VERDICTS,
        metrics=fit_metrics,
        curves=_curves(posteriors),
        residuals=_residuals(posteriors),
        enough={"tau": ENOUGH_TAU, "ess": ENOUGH_ESS, "rhat": GOOD_RHAT},
        corners=[(p.fit.name, plot.plot_corner(p)) for p in posteriors if _has_posterior(p)],
        **_match_parts(study.match),
        **_choice_parts(study.choice),
        identified=study.identified,
        checks=study.checks,
        opinions=study.opinions,
    )


def _match_parts(match: Comparison | None) -> dict[str, Any]:
    """What the template says of the match, with its pictures."""
    if match is None:
        return {"match": None}
    seen = match.perceived
    return {
        "match": match,
        "albedo": plot.plot_albedo(match).figure,
        "close": CLOSE,
        "similar": SIMILAR,
        "regions": REGIONS,
        "metrics_of_match": METRICS,
        "terms": TERMS,
        "separated": SEPARATED,
        "explains": EXPLAINS,
        "grazing_deg": GRAZING_DEG,
        "distances_figure": plot.plot_distances(match).figure,
        "ablation_figure": None if match.ablation is None else plot.plot_ablation(match.ablation).figure,
        "telling_figure": plot.plot_telling(match.telling).figure if match.telling.known else None,
        "perceived": seen,
        "spheres": None if seen is None else plot.plot_spheres(seen),
        "just_noticeable": JUST_NOTICEABLE,
        "clearly_visible": CLEARLY_VISIBLE,
        "white_luminance": WHITE_LUMINANCE,
    }


def _choice_parts(choice: Choice | None) -> dict[str, Any]:
    """What the template says of the choice, with its pictures."""
    if choice is None:
        return {"choice": None}
    predicted = any(c.left_out is not None for c in choice.candidates)
    return {
        "choice": choice,
        "choice_picture": plot.plot_choice(choice).figure,
        "left_out_picture": plot.plot_left_out(choice).figure if predicted else None,
    }


def prior_rows(posterior: Posterior) -> list[dict[str, str]]:
    """One line per free parameter: its prior, what the data made of it, and how much narrower that is."""
    fit = posterior.fit
    before, prior_sd = priors.words(fit.model, fit.data.prior), priors.natural_sd(fit.model, fit.data.prior)
    after = space(fit.model).natural_array(posterior.values).std(axis=0)
    known = {row["name"]: row for row in rows(posterior) if row["kind"] == "fitted"}
    channels, found = fit.measurements.channels, []
    for entry in (e for e in fit.entries if e.name not in fit.held):
        for k in range(entry.size):
            name = entry.name + (f" {channels[k]}" if entry.shape and len(channels) > 1 else "")
            place = entry.place.start + k
            narrower = prior_sd[place] / max(after[place], 1e-300)
            line = {"name": name, "symbol": entry.param.symbol, "prior": before[entry.name][k]}
            found.append(line | {"posterior": known[name]["interval"], "narrower": f"{narrower:.3g}"})
    return found


def _has_posterior(posterior: Posterior) -> bool:
    fit = posterior.fit
    return fit.finite and fit.loss.posterior and len(fit.free) > 0


def _left_out(fit: Fit) -> str:
    """What the loss could not be applied to, in words."""
    count = fit.measurements.n_valid - fit.n_values
    return f"{count} values left out: {fit.loss.unusable}." if fit.loss.usable is not None and count > 0 else ""


def _curves(posteriors: Sequence[Posterior]) -> list[tuple[str, Figure]]:
    m: Measurements = posteriors[0].fit.measurements
    found = sections(m)
    pages = []
    for channel in _drawn(m) if found else []:
        columns = 2 if len(found) in (2, 4) else min(3, len(found))
        lines = -(-len(found) // columns)
        figure = Figure(figsize=(max(3.6 * columns, 5.0), 2.7 * lines + 0.3), layout="constrained")
        for k, section in enumerate(found):
            ax = figure.add_subplot(lines, columns, k + 1)
            plot.plot_section(posteriors, section, channel=int(channel), ax=ax)
        handles, labels = figure.axes[0].get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside upper center", ncols=len(labels), fontsize=9, frameon=False)
        pages.append((m.channels[channel], figure))
    return pages


def _drawn(m: Measurements) -> list[int]:
    """The channels that are drawn: at most `CHANNELS_DRAWN`, evenly spread."""
    return [int(k) for k in np.unique(np.linspace(0, len(m.channels) - 1, CHANNELS_DRAWN).astype(int))]


def _residuals(posteriors: Sequence[Posterior]) -> Figure:
    """One row for each channel drawn, one column for each model."""
    drawn, columns = _drawn(posteriors[0].fit.measurements), len(posteriors)
    figure = Figure(figsize=(5.0 * columns, 3.0 * len(drawn)), layout="constrained")
    places = itertools.product(drawn, posteriors)
    for k, (channel, posterior) in enumerate(places):
        ax = figure.add_subplot(len(drawn), columns, k + 1)
        plot.plot_residuals(posterior.fit, channel=channel, ax=ax)
    return figure


def _subscripted(symbol: str) -> Markup:
    """`k_d` as people write it, k with a small d below."""
    letter, _, below = symbol.partition("_")
    return Markup("{}<sub>{}</sub>").format(letter, below) if below else Markup("{}").format(symbol)


def _png(figure: Figure) -> str:
    buffer = io.BytesIO()
    figure.savefig(buffer, format="png", dpi=DPI, bbox_inches="tight")
    return "data:image/png;base64," + base64.b64encode(buffer.getvalue()).decode("ascii")
