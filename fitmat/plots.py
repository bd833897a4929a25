"""Pictures of measurements, fits and matches: `plot_x(thing, ax=None) -> Axes`.

Computes nothing that another room could; the only importer of matplotlib.
"""

from collections.abc import Sequence

import corner
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from fitmat.comparison import Comparison
from fitmat.geometry import signed_zenith
from fitmat.outcome import Fit
from fitmat.posterior import Posterior
from fitmat.prediction import Section, curve, predictive_band, standardised_residuals

# Okabe & Ito's palette, safe for colour-blind readers.
BLACK, ORANGE, BLUE, GREEN, PURPLE = "#000000", "#D55E00", "#0072B2", "#009E73", "#CC79A7"
FIT_COLOURS = (ORANGE, BLUE, GREEN, PURPLE)

DECADES = 1.5
"""A curve that spans more decades than this is drawn on a logarithmic axis."""


def new_axes(width: float = 5.0, height: float = 3.6) -> Axes:
    """An empty figure's only axes, without pyplot's global state."""
    return Figure(figsize=(width, height), layout="constrained").add_subplot()


def plot_section(
    posteriors: Sequence[Posterior], section: Section, *, channel: int = 0, ax: Axes | None = None
) -> Axes:
    """Measured points of one incidence angle with every fit and its 95 % predictive band.

    Args:
        posteriors: Of fits to the same measurements.
        section: From `prediction.sections`.
        channel: Which channel.
        ax: Where to draw; a new figure if None.
    """
    ax = ax or new_axes()
    m = posteriors[0].fit.measurements
    rows = section.rows[m.valid[section.rows, channel]]
    angle = np.rad2deg(signed_zenith(m.wi[rows], m.wo[rows]))
    measured = m.value[rows, channel]
    fine = np.sort(np.r_[np.linspace(-89, 89, 357), np.rad2deg(section.theta_i) + np.linspace(-3, 3, 121)])
    fine = np.clip(fine, -89.0, 89.0)
    top = 0.0
    for posterior, colour in zip(posteriors, FIT_COLOURS, strict=False):
        low, high = predictive_band(posterior, rows)[:, :, channel]
        ax.fill_between(angle, low, high, color=colour, alpha=0.18, lw=0)
        line = curve(posterior.fit, section, np.deg2rad(fine))[:, channel]
        top = max(top, float(line.max()))
        ax.plot(fine, line, color=colour, lw=1.3, label=posterior.fit.name)
    ax.plot(angle, measured, ".", color=BLACK, ms=3.5, label="measured")
    _set_scale(ax, measured, top)
    ax.axvline(np.rad2deg(section.theta_i), color="0.75", lw=0.8, ls=":", zorder=0)
    ax.set(xlim=(-90, 90), xticks=[-60, -30, 0, 30, 60])
    azimuth = f", azimuth {np.rad2deg(section.phi_i):.4g}°" if section.phi_i else ""
    ax.set_title(f"incidence {np.rad2deg(section.theta_i):.4g}°{azimuth}", fontsize=9)
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


def plot_residuals(fit: Fit, *, channel: int = 0, ax: Axes | None = None) -> Axes:
    """Standardised residuals of one channel against theta_o, one colour per incidence angle."""
    ax = ax or new_axes()
    z = standardised_residuals(fit)[:, channel]
    used = np.asarray(fit.data.weight)[:, channel] > 0
    wi, wo = np.asarray(fit.data.wi), np.asarray(fit.data.wo)
    theta_i = np.rad2deg(np.arccos(np.clip(wi[:, 2], -1, 1)))
    drawn = ax.scatter(
        np.rad2deg(signed_zenith(wi, wo))[used], z[used], c=theta_i[used], s=6, cmap="cividis", vmin=0, vmax=90
    )
    ax.axhspan(-2, 2, color="0.9", zorder=0)
    ax.set(xlim=(-90, 90), xticks=[-60, -30, 0, 30, 60])
    names = fit.measurements.channels
    ax.set_title(fit.name + (f", channel {names[channel]}" if len(names) > 1 else ""), fontsize=9)
    ax.set_xlabel("θₒ / °  (positive = mirror side)", fontsize=8)
    ax.set_ylabel("residual / standard deviations", fontsize=8)
    ax.tick_params(labelsize=7)
    ax.figure.colorbar(drawn, ax=ax, label="θᵢ / °")
    return ax


def plot_albedo(match: Comparison, ax: Axes | None = None) -> Axes:
    """Directional albedo of both models with 95 % bands, channel mean."""
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


def plot_corner(posterior: Posterior) -> Figure:
    """Every free parameter against every other, with the best fit marked; fixed ones are left out."""
    fit = posterior.fit
    m = fit.measurements
    labels, columns = [], []
    for entry in (e for e in fit.entries if e.name not in fit.held):
        for k in range(entry.size):
            channel = f" {m.channels[k]}" if entry.shape and len(m.channels) > 1 else ""
            labels.append(entry.param.symbol.replace("k_d", "$k_d$").replace("k_s", "$k_s$") + channel)
            columns.append(entry.place.start + k)
    draws = posterior.thinned(4000)[0][:, columns]
    spread = np.ptp(draws, axis=0)
    centre = draws.mean(axis=0)
    ranges = [
        (low, high) if s > 0 else (c - 0.5, c + 0.5)
        for low, high, s, c in zip(*np.quantile(draws, [0.001, 0.999], axis=0), spread, centre, strict=True)
    ]
    side = 1.4 * len(columns) + 0.8
    several = len(columns) > 1
    figure = corner.corner(
        draws, labels=labels, range=ranges, truths=fit.values[columns] if several else None, truth_color=ORANGE,
        color=BLUE, bins=24, quantiles=[0.025, 0.975], plot_datapoints=False, fig=Figure(figsize=(side, side)),
        label_kwargs={"fontsize": 9}, labelpad=0.2, max_n_ticks=3, smooth=0.8,
    )  # fmt: skip
    if not several:  # corner cannot mark the best fit of a single parameter
        figure.axes[0].axvline(fit.values[columns[0]], color=ORANGE)
    return figure
