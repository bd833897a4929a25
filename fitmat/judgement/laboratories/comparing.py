"""Comparing: laboratories that measured one sample, each fitted by itself under one model, then all together.

Each counts with what its own instrument states of its errors; of every quantity that two or more determine it is asked
whether they agree, and their scales are compared.
"""

import dataclasses
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from jaxtyping import ArrayLike

from fitmat import arguments
from fitmat.errors import FitmatError
from fitmat.fitting.fitting import fit
from fitmat.fitting.result import Fit
from fitmat.judgement.budget import draw_up
from fitmat.judgement.laboratories.agreement import Agreement, agreement
from fitmat.judgement.laboratories.scales import LEVEL, Scale, scales_of
from fitmat.judgement.multiplicity import adjusted_for_many
from fitmat.judgement.propagation import OF_INSTRUMENT
from fitmat.measurements.inferred import measured_only
from fitmat.measurements.instrument import UNKNOWN_SCALE
from fitmat.measurements.samples import Measurements
from fitmat.models.registry import model
from fitmat.text import FEW, brief, html_table, plain, text_table, visible, with_error
from fitmat.uncertainty.derived import derived
from fitmat.uncertainty.laplace import laplace

MODEL = "lambert+ggx"
"""Of the surface, where none is named."""


@dataclasses.dataclass(frozen=True, eq=False)
class Laboratories:
    """What several laboratories say of one sample.

    Attributes:
        names: Of the laboratories.
        model: Name of the model.
        agreements: Of every quantity that two or more determine.
        scales: Of each laboratory and channel.
        unsettled: Channels in which two laboratories differ, of which nobody can say which is off.
        alone: Quantities that fewer than two determine.
        doubts: What speaks against a laboratory's own fit, as sentences.
    """

    names: tuple[str, ...]
    model: str
    agreements: tuple[Agreement, ...]
    scales: tuple[Scale, ...]
    unsettled: tuple[str, ...]
    alone: tuple[str, ...]
    doubts: tuple[str, ...]

    __repr__ = brief

    @property
    def agree(self) -> bool:
        """Whether no quantity and no scale differs by more than is stated."""
        return all(a.agree for a in self.agreements) and not self.unsettled and not any(s.off for s in self.scales)

    @property
    def words(self) -> str:
        """The verdict in plain sentences."""
        differing = [a.name for a in self.agreements if not a.agree]
        count = f"The {len(self.names)} laboratories"
        if not self.agreements:
            said = [f"{count} determine no quantity of {self.model} in common: only their scales are compared."]
        elif differing:
            said = [f"{count} do not agree on {_listed(differing)} within the uncertainties they state."]
        else:
            said = [f"{count} agree within the uncertainties they state ({self.model})."]
        for one in (scale for scale in self.scales if scale.off):
            said.append(f"{one.laboratory} is off: {_high(one, len(self.channels) > 1)} than the others.")
        for channel in self.unsettled:
            one, other, *_ = [s for s in self.scales if s.channel == channel and not s.off]
            said.append(
                f"{one.laboratory} {_high(one, len(self.channels) > 1)} than {other.laboratory}: with two that differ "
                "nobody can say which is off."
            )
        if not any(scale.off for scale in self.scales) and not self.unsettled:
            said.append("No calibration is seen to be off.")
        return " ".join([*said, *self.doubts])

    @property
    def channels(self) -> tuple[str, ...]:
        """Names of the channels."""
        return tuple(dict.fromkeys(scale.channel for scale in self.scales))

    def rows(self) -> list[tuple[str, ...]]:
        """One row a quantity: name, what each laboratory has, χ² and p, the value of all with u_b, the verdict."""
        found = []
        for a in self.agreements:
            each = [with_error(x, u) if np.isfinite(x) else "–" for x, u in zip(a.values, a.u, strict=True)]
            of_all = f"{with_error(a.value, a.uncertainty)} ({a.ci95[0]:.4g} – {a.ci95[1]:.4g})"
            verdict = "agree" if a.agree else "differ"
            found.append((a.name, *each, of_all, f"{a.between:.2g}", f"{a.chi2:.3g}", f"{a.p:.2g}", verdict))
        return found

    def scale_rows(self) -> list[tuple[str, ...]]:
        """One row a laboratory and channel: factor with its interval, p, the verdict."""
        several = len(self.channels) > 1
        return [
            (
                s.laboratory + (f" {s.channel}" if several else ""),
                f"{s.factor:.4f}",
                f"{s.ci95[0]:.4f} – {s.ci95[1]:.4f}",
                f"{s.p:.2g}",
                "off" if s.off else "differs" if s.channel in self.unsettled else "",
            )
            for s in self.scales
        ]

    @property
    def headings(self) -> tuple[str, ...]:
        """Of `rows`."""
        return ("quantity", *self.names, "all (95 %)", "u between", "χ²", "p", "")

    def __str__(self) -> str:
        """The verdict, then both tables."""
        scales = [("laboratory", "scale", "95 %", "p", ""), *self.scale_rows()]
        parts = [self.words, ""]
        if self.agreements:
            parts += [text_table("Quantities", [self.headings, *self.rows()]), ""]
        return "\n".join([*parts, text_table("Scale of each against the others", scales)])

    def _repr_html_(self) -> str:
        return html_table(self.words, self.headings, self.rows())

    def as_dict(self) -> dict[str, Any]:
        """Everything as JSON types."""
        found = {
            "agree": self.agree,
            "words": self.words,
            "model": self.model,
            "laboratories": list(self.names),
            "quantities": {a.name: {k: v for k, v in vars(a).items() if k != "name"} for a in self.agreements},
            "not_compared": list(self.alone),
            "scales": [vars(scale) for scale in self.scales],
            "unsettled": list(self.unsettled),
        }
        return plain(found)


def _listed(names: Sequence[str]) -> str:
    if len(names) > FEW:
        return f"{len(names)} quantities ({', '.join(names[:FEW])}, …)"
    return " and ".join(filter(None, [", ".join(names[:-1]), names[-1]]))


def _high(scale: Scale, several: bool) -> str:
    low, high = sorted(abs(100.0 * (end - 1.0)) for end in scale.ci95)
    which = "higher" if scale.factor > 1 else "lower"
    where = f" in {scale.channel}" if several else ""
    return f"it reads {abs(100.0 * (scale.factor - 1.0)):.2g} % {which}{where} (95 %: {low:.2g} to {high:.2g} %)"


def compare_laboratories(
    measurements: Sequence[Measurements],
    name: str = MODEL,
    *,
    names: Sequence[str] | None = None,
    fixed: Mapping[str, ArrayLike] | None = None,
) -> Laboratories:
    """Whether laboratories that measured one sample agree, what follows from all, and whose calibration is off.

    Args:
        measurements: One of each laboratory, from `fitmat.read`, with what its instrument states: an `Instrument` with
            a calibration error says how far its scale may be off.
        name: Of the model of the surface.
        names: Of the laboratories; None for the measurements' own sources.
        fixed: Parameters to hold in every fit, by name.

    Returns:
        `Laboratories`. Errors of the angles count in each laboratory's own uncertainties; the comparison of the scales
        leaves them to the misfit.

    Raises:
        FitmatError: fewer than two, other channels, the same readings twice, a scale that nothing is known of, other
            apertures, or as `fitmat.fit`.

    Example:
        >>> compare_laboratories([read("a.csv"), read("b.csv"), read("c.csv")]).words  # doctest: +SKIP
    """
    arguments.kind("measurements", measurements, list, tuple)
    for one in measurements:
        arguments.kind("one of measurements", one, Measurements)
    measurements = [measured_only(one) for one in measurements]
    arguments.kind("name", name, str)
    arguments.kind("names", names, list, tuple, optional=True)
    called = tuple(visible(n) for n in (names or [m.source for m in measurements]))
    _refuse_unlike(measurements, called)
    template = model(name, channels=len(measurements[0].channels))
    fits = [fit(m, name, fixed=fixed) for m in measurements]
    agreements, alone = _agreements(fits)
    scales, unsettled = [], []
    for channel in measurements[0].channels:
        found, open_ = scales_of(measurements, name, channel, called, fixed, len(measurements[0].channels))
        scales += found
        unsettled += [channel] if open_ else []
    doubts = [f"{n}: {f.adequacy}." for n, f in zip(called, fits, strict=True) if f.adequacy.startswith("inadequate")]
    return Laboratories(called, template.name, agreements, tuple(scales), tuple(unsettled), alone, tuple(doubts))


def _refuse_unlike(measurements: Sequence[Measurements], names: tuple[str, ...]) -> None:
    if len(measurements) < 2:
        raise FitmatError(f"{len(measurements)} laboratory, expected at least two that measured the same sample.")
    if len(names) != len(measurements) or len(set(names)) != len(names):
        raise FitmatError(f"names {', '.join(names)} for {len(measurements)} laboratories, expected one each.")
    first = measurements[0]
    for k, (m, name) in enumerate(zip(measurements, names, strict=True)):
        if m.channels != first.channels:
            got = f"{name} has the channels {', '.join(m.channels)}, {names[0]} {', '.join(first.channels)}"
            raise FitmatError(f"{visible(got)}, expected the same of all. Name or choose the columns (--columns).")
        if m.instrument.calibration == UNKNOWN_SCALE:
            got = f"{name}: a scale of which nothing is known"
            raise FitmatError(f"{got} (--unknown-scale), expected one that can be compared. Leave it out.")
        if m.instrument.without_errors() != first.instrument.without_errors():
            got = f"{name} has other apertures or another dark signal than {names[0]}"
            raise FitmatError(f"{got}, expected the same: their scales are compared through one instrument.")
        for other, its in zip(measurements[:k], names, strict=False):
            if m is other or (m.value.shape == other.value.shape and np.array_equal(m.value, other.value)):
                raise FitmatError(f"{its} and {name} hold the same values, expected each laboratory once.")


def _agreements(fits: Sequence[Fit]) -> tuple[tuple[Agreement, ...], tuple[str, ...]]:
    """Of every quantity but the instrument's own; and names of those that fewer than two determine."""
    table: dict[str, list[tuple[float, float]]] = {}
    own = {*OF_INSTRUMENT, "dark"}
    for each in fits:
        posterior = laplace(each, seed=0, corrected=False)
        fitted = posterior.quantities()
        found = draw_up(posterior, fitted, derived(posterior, fitted))
        for line in found.lines if found else ():
            if line.remark != "fixed" and line.name not in own:
                table.setdefault(line.name, []).append((line.value, line.combined))
    several = {n: np.array(pairs) for n, pairs in table.items() if np.isfinite(np.array(pairs)[:, 1]).sum() > 1}
    found = [agreement(n, pairs[:, 0], pairs[:, 1]) for n, pairs in several.items()]
    if not found:
        return (), tuple(table)
    sure = adjusted_for_many(np.array([a.p for a in found])) > LEVEL
    judged = [dataclasses.replace(a, agree=bool(same)) for a, same in zip(found, sure, strict=True)]
    return tuple(judged), tuple(n for n in table if n not in several)
