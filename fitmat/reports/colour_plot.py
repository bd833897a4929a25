"""Pictures of colour: what a material reflects by angle and how wrong RGB makes it, and the colours of a run's models.

Nothing is computed here but the colours of the strip.
"""

from collections.abc import Sequence

import numpy as np
from matplotlib.figure import Figure

from fitmat import arguments
from fitmat.colour.differences import JUST_NOTICEABLE
from fitmat.colour.observers import white
from fitmat.colour.spaces import adaptation, to_srgb
from fitmat.errors import FitmatError
from fitmat.models.in_rgb import ANGLES, InRgb
from fitmat.reports.axes import BLACK, FIT_COLOURS, plain
from fitmat.studies.colours import Colour

LINES = {
    "wavelengths": (":", BLACK),
    "indices": ("-.", BLACK),
    "closest": ("--", BLACK),
    "schlick": ("-", FIT_COLOURS[0]),
    "f82": ("-", FIT_COLOURS[2]),
    "belcour": ("-", FIT_COLOURS[1]),
}
"""Way → style and colour; the exact equations are black."""

TURN = np.linspace(0.0, 2.0 * np.pi, 181)


def fresnel(found: InRgb) -> Figure:
    """A strip of the reflected colour over 0 to 89°, clipped as a display does, above ΔE2000 by angle.

    Args:
        found: From `fresnel_in_rgb`.
    """
    arguments.kind("found", found, InRgb)
    figure = Figure(figsize=(5.6, 4.2), layout="constrained")
    strip, below = figure.subplots(2, 1, sharex=True, height_ratios=(1, 6))
    own = adaptation(white(found.illuminant), white("D65"))
    strip.imshow(to_srgb(found.xyz @ own.T)[None], aspect="auto", extent=(-0.5, ANGLES[-1] + 0.5, 0, 1))
    strip.set(
        yticks=[], title=f"{plain(found.material)} under {found.illuminant}: reflected colour, and what RGB makes of it"
    )
    for way, apart in found.delta_e_2000.items():
        below.plot(ANGLES, apart, LINES[way][0], color=LINES[way][1], label=way)
    below.axhline(JUST_NOTICEABLE, color=BLACK, linewidth=0.5)
    below.annotate("just noticeable", (1.0, JUST_NOTICEABLE), va="bottom", fontsize=7)
    below.set(xlabel="angle of incidence (°)", ylabel="ΔE2000 from the spectrum", xlim=(0, 89), ylim=(0, None))
    figure.legend(*below.get_legend_handles_labels(), loc="outside lower center", frameon=False, ncols=6, fontsize=7)
    return figure


def colours(found: Sequence[Colour]) -> Figure:
    """Left a* and b*, right L*; points have the colour that a display shows, ellipses and bars hold 95 % of the draws.

    Args:
        found: From `colour_of`, one for each model, under one light.

    Raises:
        FitmatError: there is none, or it is a grey.
    """
    arguments.kind("found", found, Sequence)
    for one in found:
        arguments.kind("one of found", one, Colour)
    if not found or any(one.grey for one in found):
        got = "a grey, which has a lightness and no a* and b* to draw" if found else "no colour"
        raise FitmatError(f"found is {got}, expected colours of several channels.")
    figure = Figure(figsize=(6.0, 4.2), layout="constrained")
    plane, beside = figure.subplots(1, 2, width_ratios=(4, 1))
    for k, one in enumerate(found):
        line, (lightness, a, b) = FIT_COLOURS[k % len(FIT_COLOURS)], one.lab
        point = {"color": one.srgb, "markeredgecolor": line, "markersize": 8, "marker": "o", "linestyle": "none"}
        plane.plot(one.draws[:, 1], one.draws[:, 2], ".", color=line, markersize=2, alpha=0.25)
        if one.ellipse is not None:
            x, y = one.ellipse.centre[:, None] + one.ellipse.axes.T @ np.stack([np.cos(TURN), np.sin(TURN)])
            plane.plot(x, y, color=line)
        plane.plot(a, b, **point, label=plain(one.name))
        if np.isfinite(one.lab_ci95[0]).all():
            beside.plot([k, k], one.lab_ci95[0], color=line)
        beside.plot(k, lightness, **point)
    plane.set(xlabel="a* (green to red)", ylabel="b* (blue to yellow)", title="95 % of the draws")
    plane.set_aspect("equal", adjustable="datalim")
    beside.set(xlim=(-0.7, len(found) - 0.3), xticks=[], ylabel="L*", title=f"under {found[0].illuminant}")
    figure.legend(*plane.get_legend_handles_labels(), loc="outside lower center", frameon=False, ncols=3, fontsize=7)
    return figure
