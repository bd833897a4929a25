"""Pictures of studies, of runs on disk, of matches and files: `plot.x(thing) -> Figure`, or Axes of what fits in one.

Computes nothing that another room could; draws what `studies.figures` holds.
"""

from collections.abc import Collection, Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from fitmat import arguments
from fitmat.errors import FitmatError
from fitmat.match.appearance.spheres import Perceived
from fitmat.match.discernibility import SEPARATED, Telling
from fitmat.reports.axes import BLACK, BLUE, FIT_COLOURS, MM, NARROW_MM, ORANGE, WIDTH_MM, new_figure, plain
from fitmat.reports.axes import new_axes as new_axes
from fitmat.reports.colour_plot import colours as colours
from fitmat.reports.colour_plot import fresnel as fresnel
from fitmat.reports.design_plot import design as design
from fitmat.reports.drawn import channel_of, drawn_of, draws_of, match_of, sections, values_of
from fitmat.reports.examination_plots import examination as examination
from fitmat.reports.lobe_plots import coverage as coverage
from fitmat.reports.lobe_plots import lobes as lobes
from fitmat.reports.lobe_plots import slices as slices
from fitmat.studies.result import Result
from fitmat.studies.study import Study

MOST_DRAWN = 10.0
"""ΔE2000 from which on the map of a sphere is equally bright."""

DECADES = 1.5
"""A curve that spans more decades than this is drawn on a logarithmic axis."""

LABELS_MM = 18.0
"""What the labels of a corner take, left and below."""


def curves(what: Study | Result, *, channel: str | int = 0, width_mm: float = WIDTH_MM) -> Figure:
    """Measured points with every fit and its band, one panel for each section.

    Args:
        what: A study, or the result of one from `fitmat.load`.
        channel: By its name, or from 0.
        width_mm: Of the figure.
    """
    found = drawn_of(what)
    k, along = channel_of(found, channel), sections(found)
    figure, panels = _grid(len(along), width_mm, 0.6)
    for section, ax in zip(along, panels, strict=True):
        _section(ax, section, k, found.get("inadequate", ()))
    handles, labels = figure.axes[0].get_legend_handles_labels()
    figure.legend(
        handles, labels, loc="outside upper center", ncols=1 if width_mm < NARROW_MM else len(labels), frameon=False
    )
    return figure


def _grid(count: int, width_mm: float, shape: float) -> tuple[Figure, list[Axes]]:
    """As many panels as wanted, one beside the other as far as they fit, of this height to width."""
    columns = 1 if width_mm < NARROW_MM or count == 1 else 2 if count in (2, 4) else min(3, count)
    lines = -(-count // columns)
    figure = new_figure(width_mm, lines * shape / columns)
    return figure, [figure.add_subplot(lines, columns, k + 1) for k in range(count)]


def _section(ax: Axes, section: Mapping[str, Any], k: int, outlined: Collection[str]) -> None:
    """One incidence; of models that miss the data the band is outlined only, for it would flood the picture."""
    measured = np.array(section["measured"][k], float)
    used, angle, top = np.isfinite(measured), np.array(section["theta_o"], float), 0.0
    for (name, one), colour in zip(section["models"].items(), FIT_COLOURS, strict=False):
        low, high, line = (np.array(one[part][k], float) for part in ("low", "high", "value"))
        if name in outlined:
            ax.plot(angle[used], np.stack([low, high], axis=1)[used], color=colour, lw=0.7, ls=(0, (1, 2)))
        else:
            ax.fill_between(angle[used], low[used], high[used], color=colour, alpha=0.18, lw=0)
        top = max(top, float(np.nanmax(line, initial=0.0)))
        ax.plot(one["theta_o"], line, color=colour, lw=1.2, label=name)
    ax.plot(angle[used], measured[used], ".", color=BLACK, ms=3.0, label="measured")
    _set_scale(ax, measured[used], top)
    ax.axvline(section["theta_i"], color="0.75", lw=0.8, ls=":", zorder=0)
    azimuth = f", azimuth {section['phi_i']:.4g}°" if section["phi_i"] else ""
    ax.set_title(f"incidence {section['theta_i']:.4g}°{azimuth}")
    _against_reflection(ax, "BRDF / sr⁻¹")


def _set_scale(ax: Axes, measured: np.ndarray, top: float) -> None:
    """Logarithmic where the data span decades; the fits may go past the data by a factor of 3, not more."""
    positive = measured[measured > 0]
    highest = max(float(measured.max(initial=1e-6)), min(top, 3 * float(measured.max(initial=1e-6))))
    if positive.size and np.log10(positive.max() / positive.min()) > DECADES:
        ax.set_yscale("log")
        ax.set_ylim(positive.min() / 3, highest * 2)
    else:
        ax.set_ylim(min(0.0, 1.2 * measured.min(initial=0.0)), 1.15 * highest)


def residuals(what: Study | Result, *, channel: str | int = 0, width_mm: float = WIDTH_MM) -> Figure:
    """Standardised residuals of a channel against theta_o, a panel for each model, a colour for each incidence.

    Args:
        what: A study, or the result of one from `fitmat.load`.
        channel: By its name, or from 0.
        width_mm: Of the figure.
    """
    found = drawn_of(what)
    k, along = channel_of(found, channel), sections(found)
    figure, panels = _grid(len(found["models"]), width_mm, 0.7)
    for name, ax in zip(found["models"], panels, strict=True):
        ax.axhspan(-2, 2, color="0.9", zorder=0)
        points = [
            (angle, z, section["theta_i"])
            for section in along
            for angle, z in zip(section["theta_o"], section["models"][name]["residual"][k], strict=True)
            if z is not None
        ]
        angle, z, theta_i = np.array(points or np.zeros((0, 3))).T
        ax.scatter(angle, z, c=theta_i, s=5, cmap="cividis", vmin=0, vmax=90)
        ax.set_title(name)
        _against_reflection(ax, "residual / standard deviations")
    figure.colorbar(panels[0].collections[-1], ax=panels, label="θᵢ / °")
    return figure


def _against_reflection(ax: Axes, label: str) -> None:
    ax.set(xlim=(-90, 90), xticks=[-60, -30, 0, 30, 60], xlabel="θₒ / °  (positive = mirror side)", ylabel=label)


def albedo(what: Study | Result, *, width_mm: float = WIDTH_MM) -> Figure:
    """Directional albedo of both models of the match with 95 % bands, channel mean; grey: what was measured.

    Args:
        what: A study, or the result of one from `fitmat.load`.
        width_mm: Of the figure.
    """
    match = match_of(drawn_of(what))
    figure, (ax,) = _grid(1, width_mm, 0.7)
    highest = 1.0
    for (role, band), colour in zip(match["albedo"].items(), FIT_COLOURS, strict=False):
        _band(ax, match["theta_i"], band, colour, match[role])
        highest = max(highest, float(np.nanmax(np.array(band[1], float))))
    ax.axhline(1.0, color="0.5", lw=0.8, ls="--")
    ax.set_ylim(0.0, 1.1 * highest)
    _measured(ax, match)
    _against_incidence(ax, "directional albedo ρ(θᵢ)")
    return figure


def distances(what: Study | Result, *, width_mm: float = WIDTH_MM) -> Figure:
    """Relative distance of the two models at each incidence, with its 95 % band, and what each region adds to it.

    Args:
        what: A study, or the result of one from `fitmat.load`.
        width_mm: Of the figure.
    """
    match = match_of(drawn_of(what))
    figure, (ax,) = _grid(1, width_mm, 0.7)
    for (region, band), colour in zip(match["by_region"].items(), FIT_COLOURS, strict=True):
        ax.plot(match["theta_i"], np.array(band[1], float), color=colour, lw=1.0, ls="--", label=region)
    _band(ax, match["theta_i"], match["distance"], BLACK, "all directions")
    ax.set_ylim(bottom=0.0)
    _measured(ax, match)
    _against_incidence(ax, "relative distance of the models")
    return figure


def _band(ax: Axes, angle: Sequence[float], band: Sequence[Sequence[float]], colour: str, label: str) -> None:
    low, best, high = np.array(band, float)
    ax.fill_between(angle, low, high, color=colour, alpha=0.2, lw=0)
    ax.plot(angle, best, color=colour, label=label)


def _measured(ax: Axes, match: Mapping[str, Any]) -> None:
    ax.axvspan(*match["measured_deg"], color="0.93", zorder=0)


def telling(telling: Telling, ax: Axes | None = None) -> Axes:
    """The difference of the models in standard deviations, of a reading and of all readings at each incidence."""
    arguments.kind("telling", telling, Telling)
    ax = ax or new_axes()
    kinds = (telling.rms, ORANGE, "a single reading", 1.0), (telling.separation, BLUE, "all readings", SEPARATED)
    for band, colour, name, limit in kinds:
        spread = np.abs(band[[0, 2]] - band[1])
        ax.errorbar(telling.theta_i_deg, band[1], spread, fmt="o", ms=4, color=colour, label=name)
        ax.axhline(limit, color=colour, lw=0.8, ls=":")
    ax.set_yscale("log")
    return _against_incidence(ax, "difference / standard deviations")


def _against_incidence(ax: Axes, label: str) -> Axes:
    ax.set(xlim=(0, 90), xlabel="incidence θᵢ / °", ylabel=label)
    ax.legend(fontsize=8)
    return ax


def spheres(perceived: Perceived) -> Figure:
    """Both models' spheres, and below them where an eye sees a difference; one column for each lighting."""
    arguments.kind("perceived", perceived, Perceived)
    drawn = [lighting.pictures for lighting in perceived.lightings]
    if any(pictures is None for pictures in drawn):
        raise FitmatError("there are no pictures of the spheres: ask for them, fitmat.compare(…, pictures=True).")
    rows, count = (*perceived.names, "difference"), len(perceived.lightings)
    figure = Figure(figsize=(1.35 * count + 0.9, 4.3), layout="constrained")
    axes = figure.subplots(3, count, squeeze=False)
    for k, (lighting, pictures) in enumerate(zip(perceived.lightings, drawn, strict=True)):
        assert pictures is not None
        for ax, picture in zip(axes[:, k], (pictures.empirical, pictures.microfacet), strict=False):
            seen = np.isfinite(picture).all(axis=2, keepdims=True)
            ax.imshow(np.concatenate([np.where(seen, picture, 0.0), seen], axis=2))
        axes[2, k].imshow(pictures.difference, cmap="magma", vmin=0.0, vmax=MOST_DRAWN)
        axes[0, k].set_title(lighting.name, fontsize=8)
        axes[2, k].set_xlabel(f"ΔE2000 {lighting.delta_e_2000.mean.value:.1f} on average", fontsize=7)
    for label, ax in zip(rows, axes[:, 0], strict=True):
        ax.set_ylabel(label.replace("+", "+\n"), fontsize=8)
    for ax in axes.flat:
        ax.set(xticks=[], yticks=[])
        ax.spines[:].set_visible(False)
    every, scale = axes.ravel().tolist(), axes[2, 0].images[0]
    bar = figure.colorbar(scale, ax=every, shrink=0.3, anchor=(0.0, 0.03), extend="max", pad=0.02)
    bar.set_ticks([0, 1, 3, MOST_DRAWN])
    bar.set_label("ΔE2000", fontsize=8)
    bar.ax.tick_params(labelsize=7)
    return figure


def corner(what: Study | Result, model: str | None = None, *, width_mm: float = WIDTH_MM) -> Figure:
    """Every free parameter against every other, with the best fit marked; fixed ones are left out.

    Args:
        what: A study, or the result of one from `fitmat.load`.
        model: Which model; None for the last that has draws.
        width_mm: Of the figure.
    """
    from corner import corner as corner_plot  # loads scipy

    _, known = draws_of(drawn_of(what), model)
    draws, best, labels = values_of(known), known["best"], _labels(known)
    arguments.numbers("width_mm", width_mm, 40.0, 500.0, single=True)
    ranges = [
        (low, high) if high > low else (low - 0.5, low + 0.5)
        for low, high in np.quantile(draws, [0.001, 0.999], axis=0).T
    ]
    several, side = len(labels) > 1, width_mm / MM
    figure = corner_plot(
        draws, labels=labels, range=ranges, truths=best if several else None, truth_color=ORANGE,
        color=BLUE, bins=24, quantiles=[0.025, 0.975], plot_datapoints=False, fig=Figure(figsize=(side, side)),
        labelpad=0.7 * LABELS_MM * len(labels) / (width_mm - LABELS_MM) - 0.3, max_n_ticks=3, smooth=0.8,
    )  # fmt: skip
    margin = LABELS_MM / width_mm
    figure.subplots_adjust(margin, margin, 0.98, 0.98, 0.06, 0.06)
    if not several:  # corner cannot mark the best fit of a single parameter
        figure.axes[0].axvline(best[0], color=ORANGE)
    return figure


def _labels(known: Mapping[str, Any]) -> list[str]:
    """Symbols of the parameters, with the channel where each has its own."""
    found = []
    for name, symbol in zip(known["names"], known["symbols"], strict=True):
        _, space, channel = name.partition(" ")
        found.append(symbol.replace("k_d", "$k_d$").replace("k_s", "$k_s$") + space + plain(channel))
    return found
