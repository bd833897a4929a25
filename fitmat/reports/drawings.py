"""Drawings: small pictures as SVG that need no script: curves, intervals over their priors, bars.

Each takes JSON types of the record or of the figures, and its colours from the page's style; nothing is computed that
another room could.
"""

import math
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

from markupsafe import Markup

Record = Mapping[str, Any]
"""JSON types of the record or of the figures."""

DECADES = 1.5
"""Values that span more decades than this are drawn on a logarithmic axis."""

PANEL, GAP, COLUMNS = (230.0, 150.0), 34.0, 3
"""Width and height of a panel, the space between two, and how many stand in a row."""

DOTS = 150
"""At most so many points of a panel are drawn, evenly spread."""

ABOVE = 3.0
"""A fit may go past the highest measured value by this factor, not more."""


def curves(figures: Record) -> Markup:
    """Every incidence with its points and fits, of the middle channel that is drawn; "" where there is none."""
    drawn, channel = figures["curves"], len(figures["channels"]) // 2
    if not drawn:
        return Markup("")
    rows = -(-len(drawn) // COLUMNS)
    width, height = COLUMNS * (PANEL[0] + GAP) + 2, rows * (PANEL[1] + GAP + 14)
    parts = [_panel(one, figures["models"], channel, k) for k, one in enumerate(drawn)]
    what = f"Measured points with the curves of {' and '.join(figures['models'])}, one panel for each incidence"
    body = Markup("").join(parts)
    return Markup('<svg viewBox="0 0 {:.0f} {:.0f}" role="img" aria-label="{}">{}</svg>').format(
        width, height, what, body
    )


class _Frame(NamedTuple):
    """Where a panel lies, and what its vertical axis holds."""

    left: float
    top: float
    low: float
    high: float
    log: bool

    def at(self, x: float, y: float) -> str:
        """The place of a value at an angle; what lies beyond the axis at its edge."""
        low, high = self.low, self.high
        share = math.log(max(y, low) / low) / math.log(high / low) if self.log else (y - low) / (high - low)
        up = 1.0 - min(max(share, -0.02), 1.02)
        return f"{self.left + (x + 90.0) / 180.0 * PANEL[0]:.1f},{self.top + up * PANEL[1]:.1f}"

    def words(self, title: str) -> Markup:
        """The frame, its title, and the ends of its axes."""
        text = Markup('<text class="{}" text-anchor="{}" x="{:.1f}" y="{:.1f}">{}</text>')
        bottom = self.top + PANEL[1]
        return Markup("").join(
            [
                Markup('<rect class="frame" x="{:.1f}" y="{:.1f}" width="{:.0f}" height="{:.0f}"/>').format(
                    self.left, self.top, *PANEL
                ),
                text.format("", "start", self.left, self.top - 4, title),
                text.format("faint", "start", self.left, bottom + 12, "BRDF / sr⁻¹ over θₒ from −90° to 90°"),
                text.format("faint", "end", self.left - 3, self.top + 8, f"{self.high:.2g}"),
                text.format("faint", "end", self.left - 3, bottom, f"{self.low:.2g}"),
            ]
        )


def _panel(one: Record, models: Sequence[str], channel: int, k: int) -> Markup:
    fits = [one["models"][name] for name in models]
    measured = [y for y in one["measured"][channel] if y is not None]
    positive = [y for y in measured if y > 0]
    log = bool(positive) and math.log10(max(positive) / min(positive)) > DECADES
    highest = max([*measured, 1e-6])
    peak = max([y for fit in fits for y in fit["value"][channel] if y is not None] + [highest])
    frame = _Frame(
        left=(k % COLUMNS) * (PANEL[0] + GAP) + GAP,
        top=(k // COLUMNS) * (PANEL[1] + GAP + 14) + 16,
        low=min(positive) / 3.0 if log else min(0.0, *measured, 0.0),
        high=min(peak, ABOVE * highest) * (2.0 if log else 1.1),
        log=log,
    )
    lines = [
        Markup('<polyline class="line model{}" points="{}"/>').format(
            n, " ".join(frame.at(*point) for point in _known(fit["theta_o"], fit["value"][channel]))
        )
        for n, fit in enumerate(fits)
    ]
    points = _known(one["theta_o"], one["measured"][channel])
    ends = [frame.at(*point).split(",") for point in points[:: 1 + len(points) // DOTS]]
    dots = [Markup('<circle class="dot" cx="{}" cy="{}" r="1.4"/>').format(*end) for end in ends]
    title = f"incidence {one['theta_i']:g}°{', logarithmic' if log else ''}"
    return Markup("").join([frame.words(title), *lines, *dots])


def _known(x: Sequence[float], y: Sequence[float | None]) -> list[tuple[float, float]]:
    return [(a, b) for a, b in zip(x, y, strict=True) if b is not None]


def interval_bar(
    prior: Record | None, place: int, ends: Sequence[float] | None, best: float, width: int = 120
) -> Markup:
    """An interval as a bar over the range that was allowed, and over a stated prior; "" without a range."""
    if prior is None or ends is None or not math.isfinite(best):
        return Markup("")
    low, high = prior["range"]

    def at(x: float) -> float:
        x = min(max(x, low), high)
        share = math.log(x / low) / math.log(high / low) if prior["log"] else (x - low) / (high - low)
        return 2.0 + share * (width - 4.0)

    start, end = at(ends[0]), at(ends[1])
    stated = prior["stated"][place] if place < len(prior["stated"]) else None
    beside = Markup("")
    if stated is not None:
        a, b = at(stated[0]), at(stated[1])
        beside = Markup('<rect class="stated" x="{:.1f}" y="3" width="{:.1f}" height="10"/>').format(a, max(b - a, 1.0))
    scale = "in the logarithm" if prior["log"] else "linear"
    what = f"95 % interval {ends[0]:.3g} to {ends[1]:.3g} within the range {low:g} to {high:g}, {scale}"
    return Markup(
        '<svg class="bar" viewBox="0 0 {w} 16" width="{w}" height="16" role="img" aria-label="{what}"><title>{what}'
        '</title><line class="range" x1="2" x2="{r}" y1="8" y2="8"/>{beside}<rect class="interval" x="{x:.1f}" y="4" '
        'width="{l:.1f}" height="8" rx="2"/><line class="value" x1="{v:.1f}" x2="{v:.1f}" y1="1" y2="15"/></svg>'
    ).format(w=width, r=width - 2, what=what, beside=beside, x=start, l=max(end - start, 2.0), v=at(best))


def next_angle(place: Record | None) -> Markup:
    """Where the light stands for the next curve, and how the sensor moves, from the side; "" without one."""
    if place is None:
        return Markup("")

    def at(angle: float, far: float) -> tuple[float, float]:
        return 60.0 + far * math.sin(math.radians(angle)), 60.0 - far * math.cos(math.radians(angle))

    light, (low, high) = place["theta_i_deg"], place["theta_o_deg"]
    (a, b), (c, d), (e, f) = at(-light, 54.0), at(low, 42.0), at(high, 42.0)
    what = f"Measure next: light at {light:g}°, sensor from {low:g}° to {high:g}°"
    return Markup(
        '<svg class="geometry" viewBox="0 0 120 66" width="132" height="73" role="img" aria-label="{what}">'
        '<title>{what}</title><path class="surface" d="M4,61 H116"/><path class="normal" d="M60,61 V8"/>'
        '<path class="sensor" d="M{c:.1f},{d:.1f} A42,42 0 0 1 {e:.1f},{f:.1f}"/>'
        '<path class="light" d="M{a:.1f},{b:.1f} L60,60"/><circle class="light" cx="{a:.1f}" cy="{b:.1f}" r="4"/></svg>'
    ).format(what=what, a=a, b=b, c=c, d=d, e=e, f=f)


def share_bar(value: float | None, ends: Sequence[float] | None, what: str, width: int = 160) -> Markup:
    """A fraction as a bar to the right of zero, or to its left where it is negative, with its interval as a line."""
    if value is None:
        return Markup("")
    middle = width / 4.0

    def at(x: float) -> float:
        return middle + min(max(x, -0.33), 1.0) * (width - middle - 2.0)

    start, end = sorted((at(0.0), at(value)))
    whisker = Markup("")
    if ends is not None:
        whisker = Markup('<line class="value" x1="{:.1f}" x2="{:.1f}" y1="8" y2="8"/>').format(at(ends[0]), at(ends[1]))
    return Markup(
        '<svg class="bar" viewBox="0 0 {w} 16" width="{w}" height="16" role="img" aria-label="{what}">'
        '<line class="range" x1="{m}" x2="{m}" y1="0" y2="16"/><rect class="interval" x="{x:.1f}" y="3" '
        'width="{l:.1f}" height="10"/>{whisker}</svg>'
    ).format(w=width, what=what, m=middle, x=start, l=max(end - start, 1.0), whisker=whisker)
