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

from fitmat import plots
from fitmat.comparison import CLOSE, SIMILAR, Comparison, Estimate
from fitmat.display import interval, plain, with_error
from fitmat.measurement import Measurements
from fitmat.metrics import fit_metrics
from fitmat.outcome import RESULTS
from fitmat.posterior import ENOUGH_ESS, ENOUGH_TAU, GOOD_RHAT, Posterior
from fitmat.prediction import sections
from fitmat.summary import Quantity, derived, parameters

DPI = 96
CHANNELS_DRAWN = 3
POSTERIOR = "posterior-{}.nc"


def write(folder: Path, posteriors: Sequence[Posterior], match: Comparison | None) -> None:
    """Write `report.html`, `fit.json` and one `posterior-MODEL.nc` per model into an existing folder."""
    found = to_dict(posteriors, match)
    (folder / "fit.json").write_text(json.dumps(found, indent=1, ensure_ascii=False) + "\n", encoding="utf-8")
    for posterior in posteriors:
        posterior.save(folder / POSTERIOR.format(posterior.fit.name))
    (folder / "report.html").write_text(to_html(posteriors, match), encoding="utf-8")


def to_dict(posteriors: Sequence[Posterior], match: Comparison | None) -> dict[str, Any]:
    """What the report holds, as JSON types; numbers that are not finite become null."""
    m = posteriors[0].fit.measurements
    return plain(
        {
            "fitmat": version("fitmat"),
            "file": m.source,
            "n_samples": m.n_samples,
            "n_masked": m.n_masked,
            "masked": m.masked,
            "notes": [*m.notes, *filter(None, [str(m.instrument)])],
            "noise": posteriors[0].fit.noise.words,
            "channels": list(m.channels),
            "fits": [_fit_dict(p, len(m.channels)) for p in posteriors],
            "match": None if match is None else _match_dict(match),
        }
    )


def _fit_dict(posterior: Posterior, channels: int) -> dict[str, Any]:
    fit, d = posterior.fit, posterior.diagnostics
    diagnosed = {"ess_min": None, "rhat_max": None, "tau_max": None}
    if d is not None:
        diagnosed = {"ess_min": d.ess.min(), "rhat_max": d.rhat.max(), "tau_max": d.tau.max()}
        diagnosed |= {"acceptance": d.acceptance, "steps": d.steps, "burn_in": d.burn_in, "walkers": d.walkers}
        diagnosed |= {"seed": d.seed}
    return {
        "model": fit.name,
        "result": fit.result,
        "result_means": RESULTS[fit.result],
        "adequacy": fit.adequacy,
        "not_determined": list(fit.undetermined),
        "n_starts": fit.n_starts,
        "n_starts_agreeing": fit.n_starts_agreeing,
        "steps": fit.steps,
        "parameters": {q.name: _quantity_dict(q, channels) for q in parameters(posterior)},
        "derived": {q.name: _quantity_dict(q, channels) for q in derived(posterior)},
        "posterior": {"verdict": posterior.verdict, "interrupted": posterior.interrupted, **diagnosed},
        "metrics": fit_metrics(fit),
        "log_likelihood": fit.log_likelihood,
        "aicc": fit.aicc,
        "bic": fit.bic,
    }


def _quantity_dict(q: Quantity, channels: int) -> dict[str, Any]:
    """Scalars for shared quantities and single-channel files, else lists in channel order."""
    scalar = not q.per_channel or channels == 1
    value, sd, ci95 = ((a[0] if scalar else a) for a in (q.value, q.sd, q.ci95))
    return {"value": value, "sd": sd, "ci95": ci95, "unit": q.unit, "symbol": q.symbol, "remark": q.remark}


def _match_dict(match: Comparison) -> dict[str, Any]:
    def estimate(e: Estimate | None) -> dict[str, Any] | None:
        return None if e is None else {"value": e.value, "ci95": list(e.ci95)}

    return {
        "empirical": match.empirical.fit.name,
        "microfacet": match.microfacet.fit.name,
        "hemisphere_distance": estimate(match.hemisphere_distance),
        "measured_distance": estimate(match.measured_distance),
        "cube_root_distance": estimate(match.cube_root_distance),
        "albedo_gap_max": {
            **(estimate(match.albedo_gap_max) or {}),
            "theta_i_deg": match.albedo_gap_theta_i_deg,
            "sign": match.albedo_gap_sign,
        },
        "implied_exponent": estimate(match.implied_exponent),
        "fitted_exponent": estimate(match.fitted_exponent),
        "delta_aicc": match.delta_aicc,
        "delta_bic": match.delta_bic,
        "verdict": match.verdict,
    }


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


def to_html(posteriors: Sequence[Posterior], match: Comparison | None) -> str:
    """The page: verdict, pictures, then numbers; pictures are embedded, nothing is fetched."""
    environment = jinja2.Environment(
        loader=jinja2.PackageLoader("fitmat"), autoescape=True, trim_blocks=True, lstrip_blocks=True
    )
    environment.filters |= {"png": _png, "subscripted": _subscripted}
    return environment.get_template("report.html").render(
        version=version("fitmat"),
        posteriors=posteriors,
        measurements=posteriors[0].fit.measurements,
        match=match,
        close=CLOSE,
        similar=SIMILAR,
        rows=rows,
        results=RESULTS,
        metrics=fit_metrics,
        curves=_curves(posteriors),
        residuals=_residuals(posteriors),
        enough={"tau": ENOUGH_TAU, "ess": ENOUGH_ESS, "rhat": GOOD_RHAT},
        albedo=None if match is None else plots.plot_albedo(match).figure,
        corners=[(p.fit.name, plots.plot_corner(p)) for p in posteriors if p.fit.finite and len(p.fit.free)],
    )


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
            plots.plot_section(posteriors, section, channel=int(channel), ax=ax)
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
        plots.plot_residuals(posterior.fit, channel=channel, ax=ax)
    return figure


def _subscripted(symbol: str) -> Markup:
    """`k_d` as people write it, k with a small d below."""
    letter, _, below = symbol.partition("_")
    return Markup("{}<sub>{}</sub>").format(letter, below) if below else Markup("{}").format(symbol)


def _png(figure: Figure) -> str:
    buffer = io.BytesIO()
    figure.savefig(buffer, format="png", dpi=DPI, bbox_inches="tight")
    return "data:image/png;base64," + base64.b64encode(buffer.getvalue()).decode("ascii")
