"""The picture of a design: what each next measurement would tell, and the proposals in order.

It chooses nothing.
"""

import numpy as np
from matplotlib.axes import Axes

from fitmat import arguments
from fitmat.judgement.design.design import Design
from fitmat.reports.axes import BLACK, BLUE, GREEN, ORANGE, new_axes


def design(design: Design, ax: Axes | None = None) -> Axes:
    """Expected gain of a first measurement over the plane of incidence, the file's samples, and the proposals in order.

    Args:
        design: From `next_angles`; of curves the gain is drawn over the incidence.
        ax: Where to draw; a new figure if None.
    """
    arguments.kind("design", design, Design)
    ax = ax or new_axes(5.6, 4.4)
    c, flat = design.candidates, np.abs(design.candidates.phi - np.pi) < 1e-6
    flat &= c.phi_i == c.phi_i[0]
    what = "models apart / sd" if design.rival else "sd shrinks by a factor"
    if design.kind == "curve":
        ax.plot(np.rad2deg(c.theta_i[flat]), design.gains[flat], ".-", color=BLUE, label="in the plane of incidence")
        across = ~flat & (c.phi_i == c.phi_i[0])
        ax.plot(np.rad2deg(c.theta_i[across]), design.gains[across], ".--", color=GREEN, label="across it")
        for k, p in enumerate(design.proposals):
            ax.axvline(np.rad2deg(p.theta_i), color=ORANGE, lw=0.8, ls=":")
            ax.annotate(str(k + 1), (np.rad2deg(p.theta_i), 1.0 - 0.06 * (k + 1)), xycoords=("data", "axes fraction"))
        ax.set(xlabel="incidence θᵢ / °", ylabel=what, xlim=(0, 90))
        ax.legend(fontsize=8)
        return ax
    x, y = np.rad2deg(c.theta_o[flat, 0]), np.rad2deg(c.theta_i[flat])
    drawn = ax.tricontourf(x, y, np.log10(np.maximum(design.gains[flat], 1e-3)), levels=16, cmap="cividis")
    bar = ax.figure.colorbar(drawn, ax=ax, format=lambda v, _: f"{10**v:.3g}")
    bar.set_label(what)
    m = design.fit.measurements
    rows = m.in_plane & m.valid.any(axis=1)
    signed, light = np.rad2deg(m.signed_theta_o[rows]), np.rad2deg(m.theta_i[rows])
    ax.plot(signed, light, ".", color="white", ms=2.5, mec=BLACK, mew=0.2, label="measured")
    for k, p in enumerate(design.proposals):
        inside = abs(p.phi - np.pi) < 1e-6
        at = float(np.rad2deg(p.theta_o[0])), float(np.rad2deg(p.theta_i))
        ax.plot(*at, "o" if inside else "s", color=ORANGE, ms=9, mec="white")
        beside = "" if inside else f" φ {np.rad2deg(p.phi):.0f}°"
        ax.annotate(f"{k + 1}{beside}", at, ha="center", va="center", fontsize=7, color="white")
    ax.set(xlim=(-90, 90), ylim=(-2, 90), xticks=[-60, -30, 0, 30, 60])
    ax.set_xlabel("θₒ / °  (positive = mirror side)")
    ax.set_ylabel("incidence θᵢ / °")
    ax.legend(fontsize=8, loc="lower left")
    return ax
