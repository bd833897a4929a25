"""Pictures of an examination: where a file was measured, and its curves.

Computes nothing that another room could; no fit is drawn.
"""

import math
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import LogNorm, Normalize
from matplotlib.figure import Figure, SubFigure

from fitmat import arguments
from fitmat.judgement.examination.coverage import Incidence
from fitmat.judgement.examination.examining import Examination
from fitmat.judgement.examination.features import in_plane_curve
from fitmat.reports.axes import check_channel, plain

BESIDE = 4
"""So many maps stand in one row; more stand in rows of three."""

MAPS = 6
"""At most so many incidences have a map of the hemisphere."""

# Okabe & Ito's palette, safe for colour-blind readers.
COLOURS = ("#000000", "#D55E00", "#0072B2", "#009E73", "#CC79A7", "#E69F00")
MARKERS = ("o", "s", "^", "D", "v", "P")

DECADES = 1.5
"""Values that span more decades than this are drawn on a logarithmic axis."""

CROWDED = 60
"""Curves of more points than this are drawn without markers."""


def examination(found: Examination, *, channel: int | None = None) -> Figure:
    """Maps of the hemisphere for up to `MAPS` incidences, and the in-plane curves where there are any.

    Args:
        found: From `examine`.
        channel: Which channel; the one with most valid samples if None.
    """
    arguments.kind("found", found, Examination)
    m = found.measurements
    if channel is not None:
        check_channel(channel, m.channels)
    chosen = drawn(found)
    k = int(m.valid.sum(axis=0).argmax()) if channel is None else channel
    curves = [i for i in chosen if len(in_plane_curve(m, i, k)[0]) >= 3] if not found.coverage.scattered else []
    columns = len(chosen) if len(chosen) <= BESIDE else 3
    lines = max(math.ceil(len(chosen) / max(columns, 1)), 1)
    above, below = _parts(len(chosen), (5.4 / max(columns, 1) + 0.45) * lines + 0.5, bool(curves))
    sheet = above.figure if isinstance(above, SubFigure) else above
    _maps(above, found, chosen, k, (lines, columns))
    if below is not None:
        plot_curves(found, curves, k, below.add_subplot())
    name = f", channel {m.channels[k]}" if len(m.channels) > 1 else ""
    sheet.suptitle(plain(f"{m.source}{name}"), fontsize=10)
    return sheet


def _parts(count: int, height: float, curves: bool) -> tuple[Figure | SubFigure, SubFigure | None]:
    """Where the maps go and where the curves: beside a single map, else below."""
    beside = count == 1 and curves
    if beside:
        height = 3.2
    total = height + (3.2 if curves and not beside else 0.0)
    sheet = Figure(figsize=(7.0, total + 0.3), layout="constrained")
    if not curves:
        return sheet, None
    shape: dict[str, Any] = {"width_ratios": [1.0, 1.3]} if beside else {"height_ratios": [height, 3.2]}
    first, second = sheet.subfigures(1 if beside else 2, 2 if beside else 1, squeeze=False, **shape).ravel()
    return first, second


def drawn(examination: Examination) -> list[Incidence]:
    """The incidences that are drawn, evenly chosen."""
    every = examination.coverage.incidences
    if len(every) <= MAPS:
        return list(every)
    return [every[k] for k in np.unique(np.linspace(0, len(every) - 1, MAPS).round().astype(int))]


def _maps(
    sheet: Figure | SubFigure,
    examination: Examination,
    chosen: list[Incidence],
    channel: int,
    shape: tuple[int, int],
) -> None:
    """One map for each incidence, with one scale of colours for all."""
    m = examination.measurements
    used = [m.value[i.rows[m.valid[i.rows, channel]], channel] for i in chosen]
    norm = _norm(np.concatenate(used) if used else np.zeros(0))
    axes = []
    for k, incidence in enumerate(chosen):
        ax = sheet.add_subplot(*shape, k + 1, projection="polar")
        axes.append(plot_hemisphere(examination, incidence, channel, norm, ax))
    if axes:
        handles, labels = axes[0].get_legend_handles_labels()
        sheet.legend(handles[1:], labels[1:], loc="outside lower center", ncols=2, fontsize=7, frameon=False,
                     title="radius θₒ, rings at 30° and 60°", title_fontsize=7)  # fmt: skip
        bar = sheet.colorbar(ScalarMappable(norm, "cividis"), ax=axes, shrink=0.8, pad=0.03, aspect=15)
        bar.set_label("BRDF / sr⁻¹", fontsize=8)
        bar.ax.tick_params(labelsize=7)


def _norm(values: np.ndarray) -> Normalize:
    """Colours over the bulk of the values; logarithmic where they span decades."""
    positive = values[values > 0]
    if positive.size == 0:
        return Normalize(0.0, 1.0)
    low, high = np.quantile(positive, [0.02, 1.0])
    if np.log10(high / low) > DECADES:
        return LogNorm(low, high)
    return Normalize(0.0, high)


def plot_hemisphere(examination: Examination, incidence: Incidence, channel: int, norm: Normalize, ax: Axes) -> Axes:
    """Every sample of one incidence, seen from above: radius θ_o, the mirror side to the right.

    Args:
        examination: Of the file.
        incidence: One of its incidences.
        channel: Which channel.
        norm: Scale of the colours.
        ax: Polar axes to draw on.
    """
    m = examination.measurements
    usable = m.valid[incidence.rows, channel]
    local, value = incidence.wo[usable], m.value[incidence.rows[usable], channel]
    radius = np.rad2deg(np.arctan2(np.hypot(local[:, 0], local[:, 1]), local[:, 2]))
    size = float(np.clip(4000 / max(len(value), 1), 3, 14))
    order = np.argsort(value)
    azimuth = np.arctan2(local[:, 1], local[:, 0])
    floor = norm.vmin if norm.vmin is not None and isinstance(norm, LogNorm) else -np.inf
    ax.scatter(
        azimuth[order], radius[order], c=np.maximum(value[order], floor), s=size, norm=norm, cmap="cividis", lw=0,
        label="samples",
    )  # fmt: skip
    light = np.rad2deg(incidence.theta_i)
    ax.plot([0.0], [light], "o", ms=9, mfc="none", mec="#D55E00", mew=1.4, label="mirror direction", zorder=5)
    ax.plot([np.pi], [light], "*", ms=9, mfc="#E69F00", mec="#000000", mew=0.5, label="light", zorder=5)
    ax.set(ylim=(0, 90), yticks=[30, 60, 90], xticks=np.deg2rad([0, 90, 180, 270]))
    ax.set_yticklabels([])
    ax.set_xticklabels([])
    ax.grid(color="0.85", lw=0.6)
    ax.set_axisbelow(True)
    ax.set_title(f"θᵢ = {light:.3g}°\n{len(value)} samples", fontsize=8)
    return ax


def plot_curves(examination: Examination, incidences: list[Incidence], channel: int, ax: Axes) -> Axes:
    """In-plane curves of several incidences, the mirror directions dotted; logarithmic where they span decades."""
    m = examination.measurements
    seen = []
    for k, incidence in enumerate(incidences):
        angle, f, _ = in_plane_curve(m, incidence, channel)
        colour, marker = COLOURS[k % len(COLOURS)], MARKERS[k % len(MARKERS)]
        every = max(1, len(f) // CROWDED)
        ax.plot(
            np.rad2deg(angle), f, "-", color=colour, lw=0.9, marker=marker, ms=2.8, markevery=every,
            label=f"{np.rad2deg(incidence.theta_i):.4g}°",
        )  # fmt: skip
        ax.axvline(np.rad2deg(incidence.theta_i), color=colour, lw=0.8, ls=":", zorder=0)
        seen.append(f[f > 0])
    positive = np.concatenate(seen)
    if positive.size and np.log10(positive.max() / positive.min()) > DECADES:
        ax.set_yscale("log")
        ax.set_ylim(positive.min() / 2, positive.max() * 2)
    elif positive.size:
        ax.set_ylim(bottom=min(0.0, ax.get_ylim()[0]))
    ax.set(xlim=(-90, 90), xticks=np.arange(-90, 91, 30))
    ax.set_xlabel("θₒ / °  (positive = mirror side; dotted: mirror direction)", fontsize=8)
    ax.set_ylabel("BRDF / sr⁻¹", fontsize=8)
    ax.tick_params(labelsize=7)
    ax.legend(title="incidence θᵢ", fontsize=7, title_fontsize=7, loc="upper left", frameon=False)
    return ax
