"""Budget: where the uncertainty of every quantity comes from, as metrologists write it.

`propagation` has the law; the expanded uncertainty is U = k u with k = 2. Nothing is drawn here; what is not linear
over one standard uncertainty, the intervals of the draws tell better.
"""

import dataclasses
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from fitmat.fitting.coordinates import channel_names
from fitmat.fitting.linear import Linear, around
from fitmat.fitting.quantities import Quantity
from fitmat.fitting.result import Fit
from fitmat.judgement.propagation import coefficients, propagated
from fitmat.maths.quadrature import lobe_rule
from fitmat.models.values import surfaces, values, widths
from fitmat.text import brief, visible, with_error
from fitmat.uncertainty.derived import following
from fitmat.uncertainty.posterior import Posterior

SOURCES = {
    "readings": "noise of the values",
    "calibration": "error of the scale that all values share",
    "aperture": "error of the half-angles of source and receiver",
    "angle offsets": "error of θ_i and of θ_o that all readings share",
    "angle jitter": "error of θ_i and of θ_o of each reading by itself",
    "priors": "what was stated of a parameter beforehand, and the bounds of its range",
    "misfit": "what the model cannot describe, its correlation included",
    "shape": "what is not linear over the range of the draws",
    "sampling": "the draws are finitely many",
}
"""Where uncertainty comes from, and what that means."""

COVERAGE = 2.0
"""k of the expanded uncertainty: about 95 % of a normal distribution."""

ALBEDO_DEG = 8.0
"""Incidence of the albedo in degrees: the geometry 8°:de of CIE 15:2018, specular component included."""

STEP = 1e-2
"""Of the differences that give the slopes of quantities, in standard deviations."""

TOLD = 1e-3
"""Share of a variance from which on a part is shown."""

ALIKE = 0.5
"""Coefficients of correlation from which on a pair is worth naming."""


@dataclasses.dataclass(frozen=True)
class Line:
    """The budget of one quantity, of one channel.

    Attributes:
        name: With its channel where there are several.
        symbol: The letter of the literature.
        unit: "1" for none.
        value: At the best fit.
        parts: Source → its standard uncertainty; none where `remark` says why.
        remark: "" or why there is no uncertainty: "fixed", "at its lower bound", "not determined".
    """

    name: str
    symbol: str
    unit: str
    value: float
    parts: dict[str, float]
    remark: str = ""

    @property
    def combined(self) -> float:
        """Combined standard uncertainty u, the root of the sum of the parts' squares; NaN where there are none."""
        return float(np.sqrt(sum(u**2 for u in self.parts.values()))) if self.parts else np.nan

    @property
    def expanded(self) -> float:
        """U = k u."""
        return COVERAGE * self.combined

    @property
    def shares(self) -> dict[str, float]:
        """Source → its share of the variance, the largest first."""
        square = max(self.combined**2, 1e-300)
        return {name: u**2 / square for name, u in sorted(self.parts.items(), key=lambda part: -part[1])}

    @property
    def words(self) -> str:
        """Value, expanded uncertainty, and the sources of a hundredth of the variance or more."""
        if not self.parts:
            return f"{self.name}: {self.remark}."
        if not self.combined > 0.0:
            return f"{self.name} is {self.value:.4g}, without an uncertainty that could be stated."
        told = [f"{100 * share:.0f} % from {name}" for name, share in self.shares.items() if share >= 0.01]
        first, *others = told
        sure = f"{with_error(self.value, self.expanded)} (k = {COVERAGE:g}), of whose variance"
        return f"{self.name} is {sure} {first.replace('% from', '% comes from')}{', '.join(['', *others])}."


@dataclasses.dataclass(frozen=True, eq=False)
class Budget:
    """Where the uncertainty of a model's quantities comes from.

    Attributes:
        model: The model's name.
        lines: Of the parameters, of what follows from them, and of the albedo.
        correlation: Coefficients between the lines, (m, m); NaN where one has no uncertainty.
        unstated: What the instrument says nothing of, so that none is counted, as a sentence.
    """

    model: str
    lines: tuple[Line, ...]
    correlation: Float[np.ndarray, "m m"]
    unstated: str

    __repr__ = brief

    @property
    def sources(self) -> tuple[str, ...]:
        """The keys of `SOURCES` that any line has a part of that is shown."""
        return tuple(name for name in SOURCES if any(line.shares.get(name, 0.0) >= TOLD for line in self.lines))

    @property
    def words(self) -> str:
        """Of the albedo, in a sentence or two; "" where it has no uncertainty."""
        line = next((line for line in self.lines if line.name.startswith("albedo") and line.combined > 0.0), None)
        if line is None:
            return ""
        return " ".join(filter(None, [f"For light from {ALBEDO_DEG:g}° the {line.words}", self.unstated]))

    @property
    def pairs(self) -> tuple[tuple[str, str, float], ...]:
        """Names and coefficients of the pairs that are alike, the most alike first."""
        k = [(i, j) for i in range(len(self.lines)) for j in range(i) if abs(self.correlation[i, j]) >= ALIKE]
        found = [(self.lines[j].name, self.lines[i].name, float(self.correlation[i, j])) for i, j in k]
        return tuple(sorted(found, key=lambda pair: -abs(pair[2])))

    def __str__(self) -> str:
        """The budget as a text: each quantity with its parts, then what is correlated."""
        rows = [f"Uncertainty budget of {self.model}", *filter(None, [self.unstated]), ""]
        for line in self.lines:
            unit = "" if line.unit == "1" else f" {line.unit}"
            if not line.parts:
                rows += [f"{line.name} = {line.value:.5g}{unit}   {line.remark}", ""]
                continue
            rows.append(
                f"{line.name} = {line.value:.6g}{unit}   u = {line.combined:.3g}   U = {line.expanded:.3g} "
                f"(k = {COVERAGE:g})"
            )
            shares = line.shares
            each = [(name, line.parts[name], shares[name]) for name in SOURCES if shares.get(name, 0.0) >= TOLD]
            rows += [f"    {name:14} {u:10.3g}   {100 * share:5.1f} %   {SOURCES[name]}" for name, u, share in each]
            rows.append("")
        alike = [f"    {r:+.2f}   {one}, {other}" for one, other, r in self.pairs]
        return "\n".join([*rows, f"Correlation of {ALIKE:g} and more", *(alike or ["    none"])])


def draw_up(posterior: Posterior, fitted: Sequence[Quantity], follows: Sequence[Quantity]) -> Budget | None:
    """The budget of a posterior's quantities; None where there is nothing to propagate, as under an objective.

    Args:
        posterior: Gives the fit, and how many draws there are.
        fitted: The parameters as they are reported.
        follows: What follows from them, as it is reported.
    """
    fit = posterior.fit
    near = fit.linear
    if not fit.finite or near is None:
        return None
    slopes = _slopes(fit, near)
    square = propagated([(fit, near, slopes.along)])
    square["sampling"] = np.sum(list(square.values()), axis=0) / _independent_draws(posterior)
    remarks = {
        name: remark
        for q in (*fitted, *follows)
        for name, remark in zip(_named(q.name, len(q.value), fit), q.remarks, strict=True)
    }
    lines = []
    for k, (name, symbol, unit) in enumerate(slopes.names):
        remark = remarks.get(name, "")
        parts = {} if remark else {source: float(np.sqrt(part[k])) for source, part in square.items()}
        lines.append(Line(name, symbol, unit, float(slopes.value[k]), parts, remark))
    return Budget(fit.name, tuple(lines), coefficients(fit, near, slopes.along), _unstated(fit))


def of_draws(
    name: str, symbol: str, found: Float[np.ndarray, " d"], pairs: Sequence[tuple[Fit, Float[np.ndarray, "d p"]]]
) -> Line | None:
    """The budget of what was computed at draws of one or more fits of the same measurements.

    The fits count as independent of each other but for what their one instrument does not know of itself.
    The slopes are those of least squares over the draws; what these leave over is the part "shape".

    Args:
        name: Of the quantity.
        symbol: The letter of the literature.
        found: At the best fits, then at each draw.
        pairs: Each fit with its parameter vectors, the best first.

    Returns:
        None where a fit has nothing to propagate, or there are too few draws for the slopes.
    """
    nears = [fit.linear for fit, _ in pairs]
    columns = [
        fit.coordinates.natural(draws)[:, near.inside] for (fit, draws), near in zip(pairs, nears, strict=True) if near
    ]
    places = np.concatenate(columns, axis=1)[1:] if len(columns) == len(pairs) else np.zeros((0, 0))
    freedom = len(places) - places.shape[1] - 1
    if freedom < places.shape[1] or not np.isfinite(found).all():
        return None
    centred, scale = places - places.mean(axis=0), np.maximum(places.std(axis=0), 1e-300)
    apart = found[1:] - found[1:].mean()
    slope = np.linalg.lstsq(centred / scale, apart, rcond=1e-8)[0] / scale
    ends = np.cumsum([part.shape[1] for part in columns])[:-1]
    each = [
        (fit, near, along[None])
        for (fit, _), near, along in zip(pairs, nears, np.split(slope, ends), strict=True)
        if near
    ]
    square = {source: float(part[0]) for source, part in propagated(each).items()}
    square["shape"] = float(np.sum((apart - centred @ slope) ** 2) / freedom)
    square["sampling"] = sum(square.values()) / len(places)
    return Line(name, symbol, "1", float(found[0]), {source: float(np.sqrt(part)) for source, part in square.items()})


class _Slopes(NamedTuple):
    """Quantities at the best fit: names, symbols and units, values (m,), slopes along natural coordinates (m, i)."""

    names: list[tuple[str, str, str]]
    value: np.ndarray
    along: np.ndarray


def _slopes(fit: Fit, near: Linear) -> _Slopes:
    """By central differences."""
    k, moved = len(near.inside), fit.coordinates
    points = around(moved, fit.values, near.inside, STEP / np.sqrt(np.diagonal(near.known)))
    draws = moved.filled(fit.values, points)
    names, columns = [], []
    for entry in fit.entries:
        each = channel_names(entry, fit.measurements.channels)
        names += [(name, entry.param.symbol, entry.param.unit) for name in each]
        columns.append(draws[:, entry.place])
    for item in following({e.name: e for e in fit.entries}, draws, fit.held):
        names += [(name, item.symbol, "1") for name in _named(item.name, item.values.shape[1], fit)]
        columns.append(item.values)
    reflected = _albedo(fit, draws)
    names += [(name, f"ρ({ALBEDO_DEG:g}°)", "1") for name in _named("albedo", reflected.shape[1], fit)]
    every = np.concatenate([*columns, reflected], axis=1)
    apart = points[np.arange(k), near.inside] - points[np.arange(k, 2 * k), near.inside]
    return _Slopes(names, every[-1], ((every[:k] - every[k : 2 * k]) / apart[:, None]).T)


def _albedo(fit: Fit, draws: Float[np.ndarray, "m p"]) -> Float[np.ndarray, "m c"]:
    """Fraction of the light from `ALBEDO_DEG` that the surface reflects, in a lobe; of an anisotropic one, along x."""
    material, of_it = surfaces(fit.model, draws)
    width = float(widths(material, of_it[-1:])[0])
    rule = lobe_rule(np.deg2rad(ALBEDO_DEG), width, phi_i=None if material.isotropic else 0.0)
    wi = np.tile(rule.wi, (len(rule.wo), 1))
    return np.einsum("n,mnc->mc", rule.weight, values(material, of_it, wi, rule.wo))


def _named(name: str, count: int, fit: Fit) -> list[str]:
    channels = fit.measurements.channels
    return [name] if count == 1 else [f"{name} {visible(channel)}" for channel in channels]


def _independent_draws(posterior: Posterior) -> float:
    """As many as count for the mean of the parameter that is known worst."""
    return len(posterior.drawn) if posterior.diagnostics is None else float(posterior.diagnostics.ess.min())


def _unstated(fit: Fit) -> str:
    told = fit.measurements.instrument
    silent = {
        "the calibration (--calibration)": not told.calibration,
        "the angles (--angle-error)": not told.angle_error,
        "the half-angles (--aperture-error)": bool(told.source + told.receiver) and not told.aperture_error,
    }
    names = [name for name, none in silent.items() if none]
    listed = " or of ".join(filter(None, [", of ".join(names[:-1]), *names[-1:]]))
    return f"No error of {listed} is stated, so none is counted." if names else ""
