"""Pictures of measurements, fits and matches: `plot.x(thing, ax=None) -> Axes`.

Computes nothing that another room could; the only importer of matplotlib.
"""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from fitmat import arguments
from fitmat.errors import FitmatError
from fitmat.match.ablation import Ablation
from fitmat.match.appearance.spheres import Perceived
from fitmat.match.discernibility import SEPARATED, Telling
from fitmat.match.match import Match
from fitmat.match.regions import REGIONS
from fitmat.maths.directions import signed_zenith
from fitmat.reports.axes import BLACK, BLUE, FIT_COLOURS, GREEN, ORANGE, PURPLE, check_channel, plain
from fitmat.reports.axes import new_axes as new_axes
from fitmat.reports.design_plot import design as design
from fitmat.reports.examination_plots import examination as examination
from fitmat.studies.findings import Findings
from fitmat.studies.study import Study
from fitmat.uncertainty.posterior import Posterior

MOST_DRAWN = 10.0
"""ΔE2000 from which on the map of a sphere is equally bright."""

DECADES = 1.5
"""A curve that spans more decades than this is drawn on a logarithmic axis."""


def curves(study: Study, *, channel: int = 0) -> Figure:
    """Measured points with every fit and its band, one panel for each section."""
    arguments.kind("study", study, Study)
    check_channel(channel, study.measurements.channels)
    along = range(len(study.findings[0].curves))
    columns = 2 if len(along) in (2, 4) else min(3, len(along))
    lines = -(-len(along) // columns)
    width, height = max(3.6 * columns, 5.0), 2.7 * lines + 0.3
    figure = Figure(figsize=(width, height))
    # Set by hand: to let Matplotlib find the margins takes twice as long as all the rest.
    figure.subplots_adjust(0.75 / width, 0.5 / height, 1 - 0.15 / width, 1 - 0.6 / height, 0.33, 0.42)
    for k in along:
        section(study, k, channel=channel, ax=figure.add_subplot(lines, columns, k + 1))
    handles, labels = figure.axes[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="upper center", ncols=len(labels), fontsize=9, frameon=False)
    return figure


def section(study: Study, which: int = 0, *, channel: int = 0, ax: Axes | None = None) -> Axes:
    """Measured points of one incidence angle with every fit and its 95 % predictive band.

    Args:
        study: What was found.
        which: Of the sections, in the order of `Findings.curves`.
        channel: Which channel.
        ax: Where to draw; a new figure if None.
    """
    arguments.kind("study", study, Study)
    check_channel(channel, study.measurements.channels)
    ax = ax or new_axes()
    m, drawn = study.measurements, [found.curves[which] for found in study.findings]
    place = drawn[0].section
    used = m.valid[place.rows, channel]
    angle, measured = np.rad2deg(place.theta_o[used]), m.value[place.rows[used], channel]
    top = 0.0
    for curve, colour in zip(drawn, FIT_COLOURS, strict=False):
        low, high = curve.band[:, used, channel]
        ax.fill_between(angle, low, high, color=colour, alpha=0.18, lw=0)
        line = curve.value[:, channel]
        top = max(top, float(line.max()))
        ax.plot(np.rad2deg(curve.theta_o), line, color=colour, lw=1.3, label=curve.name)
    ax.plot(angle, measured, ".", color=BLACK, ms=3.5, label="measured")
    _set_scale(ax, measured, top)
    ax.axvline(np.rad2deg(place.theta_i), color="0.75", lw=0.8, ls=":", zorder=0)
    ax.set(xlim=(-90, 90), xticks=[-60, -30, 0, 30, 60])
    azimuth = f", azimuth {np.rad2deg(place.phi_i):.4g}°" if place.phi_i else ""
    ax.set_title(f"incidence {np.rad2deg(place.theta_i):.4g}°{azimuth}", fontsize=9)
    ax.set_xlabel("θₒ / °  (positive = mirror side)", fontsize=8)
    ax.set_ylabel("BRDF / sr⁻¹", fontsize=8)
    ax.tick_params(labelsize=7)
    return ax


def _set_scale(ax: Axes, measured: np.ndarray, top: float) -> None:
    """Logarithmic where the data span decades; the fits may go past the data by a factor of 3, not more."""
    positive = measured[measured > 0]
    highest = max(float(measured.max(initial=1e-6)), min(top, 3 * float(measured.max(initial=1e-6))))
    if positive.size and np.log10(positive.max() / positive.min()) > DECADES:
        ax.set_yscale("log")
        ax.set_ylim(positive.min() / 3, highest * 2)
    else:
        ax.set_ylim(min(0.0, 1.2 * measured.min(initial=0.0)), 1.15 * highest)


def residuals(found: Findings, *, channel: int = 0, ax: Axes | None = None) -> Axes:
    """Standardised residuals of one channel against theta_o, one colour per incidence angle."""
    arguments.kind("found", found, Findings)
    check_channel(channel, found.fit.measurements.channels)
    ax = ax or new_axes()
    fit, z = found.fit, found.residuals[:, channel]
    used = np.asarray(fit.data.weight)[:, channel] > 0
    wi, wo = np.asarray(fit.data.wi), np.asarray(fit.data.wo)
    theta_i = np.rad2deg(np.arccos(np.clip(wi[:, 2], -1, 1)))
    drawn = ax.scatter(
        np.rad2deg(signed_zenith(wi, wo))[used], z[used], c=theta_i[used], s=6, cmap="cividis", vmin=0, vmax=90
    )
    ax.axhspan(-2, 2, color="0.9", zorder=0)
    ax.set(xlim=(-90, 90), xticks=[-60, -30, 0, 30, 60])
    names = fit.measurements.channels
    ax.set_title(fit.name + (f", channel {plain(names[channel])}" if len(names) > 1 else ""), fontsize=9)
    ax.set_xlabel("θₒ / °  (positive = mirror side)", fontsize=8)
    ax.set_ylabel("residual / standard deviations", fontsize=8)
    ax.tick_params(labelsize=7)
    ax.figure.colorbar(drawn, ax=ax, label="θᵢ / °")
    return ax


def albedo(match: Match, ax: Axes | None = None) -> Axes:
    """Directional albedo of both models with 95 % bands, channel mean."""
    arguments.kind("match", match, Match)
    ax = ax or new_axes()
    angle = np.rad2deg(match.albedo_theta_i)
    pairs = ((match.empirical, match.albedo_empirical), (match.microfacet, match.albedo_microfacet))
    for (posterior, band), colour in zip(pairs, FIT_COLOURS, strict=False):
        ax.fill_between(angle, band[0], band[2], color=colour, alpha=0.2, lw=0)
        ax.plot(angle, band[1], color=colour, label=posterior.fit.name)
    ax.axvline(match.albedo_gap_theta_i_deg, color="0.75", lw=0.8, ls=":", zorder=0)
    ax.axhline(1.0, color="0.5", lw=0.8, ls="--")
    highest = max(float(band[1].max()) for _, band in pairs)
    ax.set(xlim=(0, 90), ylim=(0, max(1.05, 1.1 * highest)))
    ax.set_xlabel("incidence θᵢ / °")
    ax.set_ylabel("directional albedo ρ(θᵢ)")
    ax.legend(fontsize=8)
    return ax


def distances(match: Match, metric: str = "relative", ax: Axes | None = None) -> Axes:
    """Distance of the two models at each incidence, over all directions and in each region, with 95 % bands."""
    arguments.kind("match", match, Match)
    ax = ax or new_axes()
    angle, found = np.rad2deg(match.distances.theta_i), match.distances
    parts = np.moveaxis(found.by_incidence_and_region[metric], 2, 0)
    for band, name, colour in zip(parts, REGIONS, FIT_COLOURS, strict=True):
        ax.plot(angle, band[1], color=colour, lw=1.0, ls="--", label=name)
    whole = found.by_incidence[metric]
    ax.fill_between(angle, whole[0], whole[2], color=BLACK, alpha=0.2, lw=0)
    ax.plot(angle, whole[1], color=BLACK, label="all directions")
    ax.set_ylim(bottom=0.0)
    return _against_incidence(ax, f"{metric} distance")


def ablation(ablation: Ablation, ax: Axes | None = None) -> Axes:
    """By how much the distance falls at each incidence without each term of the microfacet lobe, with 95 % bands."""
    arguments.kind("ablation", ablation, Ablation)
    ax = ax or new_axes()
    angle = np.rad2deg(ablation.theta_i)
    for (term, fall), colour in zip(ablation.fall.items(), (BLUE, GREEN, PURPLE, BLACK), strict=True):
        ax.fill_between(angle, 100 * fall[0], 100 * fall[2], color=colour, alpha=0.2, lw=0)
        ax.plot(angle, 100 * fall[1], color=colour, label="all three" if term == "all" else term)
    ax.axhline(0.0, color="0.5", lw=0.8, ls="--")
    ax.set_ylim(bottom=max(-100.0, ax.get_ylim()[0]))  # twice the distance
    return _against_incidence(ax, "fall of the distance / %")


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


def corner(posterior: Posterior) -> Figure:
    """Every free parameter against every other, with the best fit marked; fixed ones are left out."""
    arguments.kind("posterior", posterior, Posterior)
    from corner import corner as corner_plot  # loads scipy

    fit = posterior.fit
    symbols = [e.param.symbol for e in fit.entries for _ in range(e.size)]
    columns, labels = list(fit.coordinates.places), []
    for name, k in zip(fit.coordinates.names, columns, strict=True):
        channel = name.partition(" ")[1] + name.partition(" ")[2]
        labels.append(symbols[k].replace("k_d", "$k_d$").replace("k_s", "$k_s$") + plain(channel))
    draws = posterior.thinned(4000)[0][:, columns]
    spread = np.ptp(draws, axis=0)
    centre = draws.mean(axis=0)
    ranges = [
        (low, high) if s > 0 else (c - 0.5, c + 0.5)
        for low, high, s, c in zip(*np.quantile(draws, [0.001, 0.999], axis=0), spread, centre, strict=True)
    ]
    side = 1.4 * len(columns) + 0.8
    several = len(columns) > 1
    figure = corner_plot(
        draws, labels=labels, range=ranges, truths=fit.values[columns] if several else None, truth_color=ORANGE,
        color=BLUE, bins=24, quantiles=[0.025, 0.975], plot_datapoints=False, fig=Figure(figsize=(side, side)),
        label_kwargs={"fontsize": 9}, labelpad=0.2, max_n_ticks=3, smooth=0.8,
    )  # fmt: skip
    if not several:  # corner cannot mark the best fit of a single parameter
        figure.axes[0].axvline(fit.values[columns[0]], color=ORANGE)
    return figure
