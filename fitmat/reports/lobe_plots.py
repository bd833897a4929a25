"""Pictures of lobes: in the plane of incidence as polar curves, over the half vector as slices, and what was measured.

It draws what `drawn` gives it.
"""

from collections.abc import Mapping
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from fitmat.reports.axes import BLACK, FIT_COLOURS, NARROW_MM, WIDTH_MM, new_figure, plain
from fitmat.reports.drawn import channel_of, coverage_of, drawn_of, sections, slices_of
from fitmat.studies.result import Result
from fitmat.studies.study import Study

RATIO = 4.0
"""Measured over fitted from which on a point has the last colour."""


def lobes(what: Study | Result, *, channel: str | int = 0, width_mm: float = WIDTH_MM) -> Figure:
    """Measured points and fits in the plane of incidence around the normal, the cube root of the BRDF as radius.

    Args:
        what: A study, or the result of one from `fitmat.load`.
        channel: By its name, or from 0.
        width_mm: Of the figure.
    """
    found = drawn_of(what)
    k, along = channel_of(found, channel), sections(found)
    columns = 1 if width_mm < NARROW_MM or len(along) == 1 else 2
    figure = new_figure(width_mm, -(-len(along) // columns) * 0.62 / columns)
    for number, section in enumerate(along):
        ax: Any = figure.add_subplot(-(-len(along) // columns), columns, number + 1, projection="polar")
        _lobe(ax, section, k)
    handles, labels = figure.axes[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside upper center", ncols=1 if columns == 1 else len(labels), frameon=False)
    return figure


def _lobe(ax: Any, section: Mapping[str, Any], k: int) -> None:
    """One incidence; the light comes from the left."""
    measured = np.array(section["measured"][k], float)
    used, most = np.isfinite(measured), float(np.nanmax(measured, initial=1e-9))
    for (name, one), colour in zip(section["models"].items(), FIT_COLOURS, strict=False):
        value = np.array(one["value"][k], float)
        most = max(most, float(np.nanmax(value, initial=0.0)))
        ax.plot(np.deg2rad(one["theta_o"]), np.cbrt(np.maximum(value, 0.0)), color=colour, lw=1.2, label=name)
    angle = np.deg2rad(np.array(section["theta_o"], float)[used])
    ax.plot(angle, np.cbrt(np.maximum(measured[used], 0.0)), ".", color=BLACK, ms=2.5, label="measured")
    ax.plot([-np.deg2rad(section["theta_i"]), 0.0], [np.cbrt(most), 0.0], color="0.5", lw=0.9, ls="--")
    ax.set(thetamin=-90, thetamax=90, rmin=0.0, rmax=np.cbrt(most), theta_offset=np.pi / 2, theta_direction=-1)
    ax.set_rgrids(np.cbrt(most) * np.array([0.5, 1.0]), [f"{most / 8:.2g}", f"{most:.2g} sr⁻¹"], fontsize=6)
    ax.set_thetagrids([-60, -30, 0, 30, 60])
    ax.set_title(f"incidence {section['theta_i']:.4g}°")


def slices(what: Study | Result, *, channel: str | int = 0, width_mm: float = WIDTH_MM) -> Figure:
    """Each model over the angles of half vector and difference in the plane of incidence; points: measured over fitted.

    Args:
        what: A study, or the result of one from `fitmat.load`.
        channel: By its name, or from 0.
        width_mm: Of the figure.
    """
    found = slices_of(what, channel)
    values = np.concatenate([np.log10(one.value[one.value > 0.0]) for one in found])
    low, high = np.quantile(values, [0.005, 0.995]) if values.size else (-1.0, 1.0)
    columns = 1 if width_mm < NARROW_MM else min(len(found), 2)
    lines = -(-len(found) // columns)
    figure = new_figure(width_mm, lines * 0.8 / columns)
    panels: list[Axes] = [figure.add_subplot(lines, columns, k + 1) for k in range(len(found))]
    drawn = []
    for one, ax in zip(found, panels, strict=True):
        with np.errstate(divide="ignore", invalid="ignore"):
            shown = np.log10(np.where(one.value > 0.0, one.value, np.nan))
        image = ax.imshow(shown, origin="lower", extent=(0, 90, 0, 90), cmap="cividis", vmin=low, vmax=high)
        points = ax.scatter(
            one.theta_h, one.theta_d, c=np.log10(one.ratio), s=4, cmap="RdBu_r", lw=0.2, edgecolors="0.2",
            vmin=-np.log10(RATIO), vmax=np.log10(RATIO),
        )  # fmt: skip
        ax.set(xlabel="half vector θₕ / °", ylabel="difference θd / °", title=one.name)
        drawn.append((image, points))
    figure.colorbar(drawn[-1][0], ax=panels, label="log₁₀ BRDF / sr⁻¹", pad=0.02, shrink=0.8)
    bar = figure.colorbar(drawn[-1][1], ax=panels, label="measured / fitted", pad=0.02, shrink=0.8)
    bar.set_ticks([-np.log10(RATIO), 0.0, np.log10(RATIO)], labels=["¼", "1", "4"])
    return figure


def coverage(what: Study | Result, *, width_mm: float = WIDTH_MM) -> Figure:
    """What was measured, over the angles of half vector and difference, a colour for each incidence.

    Args:
        what: A study, or the result of one from `fitmat.load`.
        width_mm: Of the figure.
    """
    found = coverage_of(what)
    figure = new_figure(width_mm, 0.8)
    ax = figure.add_subplot()
    points = ax.scatter(found["theta_h"], found["theta_d"], c=found["theta_i"], s=5, cmap="cividis", vmin=0, vmax=90)
    ax.plot([0, 90], [90, 0], color="0.5", lw=0.8, ls="--")
    ax.set(xlim=(0, 90), ylim=(0, 90), xlabel="half vector θₕ / °", ylabel="difference θd / °", aspect="equal")
    ax.set_title(plain(str(drawn_of(what)["file"])))
    figure.colorbar(points, ax=ax, label="θᵢ / °")
    return figure
