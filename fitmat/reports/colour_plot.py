"""Picture of Fresnel in RGB: the colour that a material reflects by angle, and how wrong each way in RGB is.

Nothing is computed here but the colours of the strip.
"""

from matplotlib.figure import Figure

from fitmat import arguments
from fitmat.colour.differences import JUST_NOTICEABLE
from fitmat.colour.observers import white
from fitmat.colour.spaces import adaptation, to_srgb
from fitmat.models.in_rgb import ANGLES, InRgb
from fitmat.reports.axes import BLACK, FIT_COLOURS, plain

LINES = {
    "wavelengths": (":", BLACK),
    "indices": ("-.", BLACK),
    "closest": ("--", BLACK),
    "schlick": ("-", FIT_COLOURS[0]),
    "f82": ("-", FIT_COLOURS[2]),
    "belcour": ("-", FIT_COLOURS[1]),
}
"""Way → style and colour; the exact equations are black."""


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
