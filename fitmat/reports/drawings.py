"""Drawings: small pictures as SVG that need no script: curves, intervals over their priors, bars.

Each takes JSON types of the record or of the figures, and its colours from the page's style; nothing is computed that
another room could.
"""

import math
from collections.abc import Mapping, Sequence
from typing import Any

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
    width, height = COLUMNS * (PANEL[0] + GAP), rows * (PANEL[1] + GAP + 14)
    parts = [_panel(one, figures["models"], channel, k) for k, one in enumerate(drawn)]
    what = f"Measured points with the curves of {' and '.join(figures['models'])}, one panel for each incidence"
    body = Markup("").join(parts)
    return Markup('<svg viewBox="0 0 {:.0f} {:.0f}" role="img" aria-label="{}">{}</svg>').format(
        width, height, what, body
    )


def _panel(one: Record, models: Sequence[str], channel: int, k: int) -> Markup:
    left, top = (k % COLUMNS) * (PANEL[0] + GAP) + GAP, (k // COLUMNS) * (PANEL[1] + GAP + 14) + 16
    measured = [y for y in one["measured"][channel] if y is not None]
    positive = [y for y in measured if y > 0]
    log = bool(positive) and math.log10(max(positive) / min(positive)) > DECADES
    fits = [one["models"][name] for name in models]
    highest = max([*measured, 1e-6])
    peak = max([y for fit in fits for y in fit["value"][channel] if y is not None] + [highest])
    high = min(peak, ABOVE * highest) * (2.0 if log else 1.1)
    low = min(positive) / 3.0 if log else min(0.0, *measured, 0.0)

    def at(x: float, y: float) -> str:
        share = math.log(max(y, low) / low) / math.log(high / low) if log else (y - low) / (high - low)
        share = min(max(share, -0.02), 1.02)
        return f"{left + (x + 90.0) / 180.0 * PANEL[0]:.1f},{top + (1.0 - share) * PANEL[1]:.1f}"

    lines = [
        Markup('<polyline class="line model{}" points="{}"/>').format(
            n, " ".join(at(x, y) for x, y in zip(fit["theta_o"], fit["value"][channel], strict=True) if y is not None)
        )
        for n, fit in enumerate(fits)
    ]
    points = [(x, y) for x, y in zip(one["theta_o"], one["measured"][channel], strict=True) if y is not None]
    ends = [at(*point).split(",") for point in points[:: 1 + len(points) // DOTS]]
    dots = Markup("").join(Markup('<circle class="dot" cx="{}" cy="{}" r="1.4"/>').format(*end) for end in ends)
    frame = Markup('<rect class="frame" x="{:.1f}" y="{:.1f}" width="{:.0f}" height="{:.0f}"/>').format(
        left, top, *PANEL
    )
    said = f"incidence {one['theta_i']:g}°{' (log)' if log else ''}, up to {highest:.3g} sr⁻¹"
    text = Markup('<text x="{:.1f}" y="{:.1f}">{}</text>').format(left, top - 4, said)
    axis = Markup('<text class="faint" x="{:.1f}" y="{:.1f}">θₒ −90° … 90°</text>').format(left, top + PANEL[1] + 12)
    return Markup("").join([frame, text, axis, *lines, dots])


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
