"""Identifiability: which parameters these angles determine, which they do not, and what is determined instead.

It fits no other model and proposes no measurement; `design` does.
"""

import dataclasses
import math
from collections.abc import Sequence

import numpy as np
from jaxtyping import Float

from fitmat import arguments
from fitmat.fitting.ends import AGREE
from fitmat.fitting.information import CONTRACTED, UNDETERMINED, spreads, widest
from fitmat.fitting.priors import natural_sd
from fitmat.fitting.result import Fit
from fitmat.judgement.identifiability.profiles import LEVEL, Profile, profiles
from fitmat.judgement.identifiability.ridge import Ridge, ridge
from fitmat.judgement.identifiability.trade_offs import Group, groups
from fitmat.text import brief, html_table, interval, text_table, with_error
from fitmat.uncertainty.posterior import Posterior

CONTRACTION_DRAWS = 4000
"""Draws behind contractions and intervals."""

WEAK = 0.1
"""Standard deviation in ln p, or relative to a weight, above which a parameter is determined weakly: a tenth."""

WEAK_RANGE = 0.1 * UNDETERMINED["linear"]
"""The same for other linear parameters, angles for one, as a fraction of the range: a tenth of not determined."""

SMALL_WEIGHT = 0.01
"""Weights below this fraction of their range are judged as if they were that large: 0.001 ± 0.0005 is no question."""

STATES = ("determined", "weakly determined", "not determined")

_WORDED = (
    *((state, False, "") for state in STATES[:2]),
    (STATES[2], False, " by these angles"),
    (STATES[2], True, ", because the model misses the data: these angles would do"),
)
# State, whether for the misfit, and how a sentence goes on.


@dataclasses.dataclass(frozen=True, eq=False)
class Verdict:
    """What the data say of one parameter.

    Attributes:
        name: With its channel where there are several.
        symbol: Its letter.
        state: One of `STATES`.
        value: Best fit, physical.
        profile: Its likelihood.
        ci95: 95 % limits of the profile likelihood, physical; a bound where it is open.
        open: Which of them are bounds.
        elsewhere: Values of other optima that are as good, outside of what the curvature at the best fit promises.
        misfit: Whether it is not determined for the misfit of the model alone: these angles would do.
        contraction: 1 − var_post/var_prior in natural coordinates; of a ridge that fills its bounds unevenly, the
            prior's volume may contract it though no datum does, which is why the profile is asked as well.
    """

    name: str
    symbol: str
    state: str
    value: float
    profile: Profile
    ci95: tuple[float, float]
    open: tuple[bool, bool]
    elsewhere: tuple[float, ...]
    misfit: bool
    contraction: float

    __repr__ = brief

    @property
    def narrower(self) -> float:
        """Prior over posterior standard deviation."""
        return 1.0 / math.sqrt(max(1.0 - self.contraction, 1e-300))


@dataclasses.dataclass(frozen=True, eq=False)
class Identifiability:
    """What the angles of a file determine of a model.

    Attributes:
        fit: Of the model.
        verdicts: One per free parameter.
        spectrum: Eigenvalues of the information in units of the priors' standard deviations, rising, (f,): below 1 the
            data say less of that direction than the bounds do.
        groups: Parameters that trade off.
    """

    fit: Fit
    verdicts: tuple[Verdict, ...]
    spectrum: Float[np.ndarray, " f"]
    groups: tuple[Group, ...]

    __repr__ = brief

    def state(self, name: str) -> str:
        """The state of a parameter; of several channels the worst.

        Raises:
            KeyError: no free parameter has the name.
        """
        found = [v.state for v in self.verdicts if v.name == name or v.name.rpartition(" ")[0] == name]
        if not found:
            raise KeyError(name)
        return max(found, key=STATES.index)

    @property
    def undetermined(self) -> tuple[str, ...]:
        """Names of parameters, with their channel where there are several, that are not determined."""
        return tuple(v.name for v in self.verdicts if v.state == STATES[2])

    @property
    def words(self) -> str:
        """Plain sentences: what is determined, what is not, and what of it is known all the same."""
        if not self.verdicts:
            return f"{self.fit.name} has no free parameter to determine."
        parts, ends = [], self._bounded()
        for state, misfit, why in _WORDED:
            names = [v.name for v in self.verdicts if (v.state, v.misfit) == (state, misfit) and v.name not in ends]
            if names:
                parts.append(f"{_listed(names)} {'is' if len(names) == 1 else 'are'} {state}{why}.")
        if ends:
            ends = [f"{_listed(ends)} {'sits on its bound' if len(ends) == 1 else 'sit on their bounds'}."]
        return " ".join([*parts, *ends, *self._several(), *(self._traded(g) for g in self.groups)])

    def _bounded(self) -> list[str]:
        """What would count as determined, and sits on a bound."""
        moved = self.fit.coordinates
        sides = dict(zip(moved.names, moved.side(self.fit.values).tolist(), strict=True))
        return [v.name for v in self.verdicts if v.state != STATES[2] and sides.get(v.name, 0)]

    def _several(self) -> list[str]:
        """Other optima: those of other starts, and one that only a profile came upon."""
        found = [f"{v.name} = {v.elsewhere[0]:.3g}" for v in self.verdicts if v.elsewhere and v.state != STATES[2]]
        words = []
        if found:
            words.append(
                f"Another optimum fits as well, with {_listed(found)}: the data do not tell which is right, and the "
                "intervals hold both."
            )
        if (missed := max(v.profile.missed for v in self.verdicts)) > AGREE:
            name = max(self.verdicts, key=lambda v: v.profile.missed).name
            words.append(
                f"The best fit was missed: with another {name} the data are followed better (by {missed:.2g} in ln L). "
                "Fix what the angles do not determine."
            )
        return words

    def _traded(self, group: Group) -> str:
        names = _listed(list(group.names))
        c = group.combination
        states = [v.state for v in self.verdicts if v.name in group.names]
        lost = all(state == STATES[2] for state in states)
        if c is None:
            known = all(state == STATES[0] for state in states)
            return f"{names} trade off{', yet each is determined' if known else ''}."
        meaning = f" ({c.meaning})" if c.meaning else ""
        verb = "only" if lost else "best known is"
        end = " is determined" if lost else ""
        rows = zip(c.value, c.sd, c.ci95, strict=True)
        numbers = "; ".join(
            f"{with_error(float(v), float(s))} (95 % {interval(float(ci[0]), float(ci[1]), float(s))})"
            for v, s, ci in rows
        )
        return f"{names} trade off: {verb} {c.name}{meaning}{end}: {numbers}."

    def _rows(self) -> list[tuple[str, ...]]:
        return [
            (v.name, v.state, f"{v.value:.4g}", " – ".join(f"{x:.4g}" for x in v.ci95), f"{v.narrower:.3g} ×")
            for v in self.verdicts
        ]

    def __str__(self) -> str:
        """The words, then a line for each parameter."""
        caption = f"{self.fit.name}: {self.words}"
        return text_table(caption, self._rows()) if self.verdicts else caption

    def _repr_html_(self) -> str:
        headings = ("parameter", "state", "value", "95 % (profile)", "narrower than before")
        return html_table(f"{self.fit.name}: {self.words}", headings, self._rows())


def identify(posterior: Posterior) -> Identifiability:
    """Say which parameters the data determine.

    A parameter is not determined where the fit says so, its profile likelihood or its interval as quoted leaves it more
    room than `widest`, or its posterior is not narrower than that; else weakly where it is known to no better than a
    tenth by either, or where starts that ended elsewhere fit as well. Draws are those of the chain where it is usable,
    else those of the `ridge`: Laplace's would leave a bent ridge, and a chain that did not mix has not seen all of it.

    Args:
        posterior: Of the fit.

    Returns:
        An `Identifiability`; without verdicts where nothing is free or the fit is not finite.
    """
    arguments.kind("posterior", posterior, Posterior)
    fit = posterior.fit
    profiled = profiles(fit)
    if not profiled:
        return Identifiability(fit, (), np.zeros(0), ())
    prior = natural_sd(fit.model, fit.data.prior)[fit.free]
    draws = _draws(posterior, ridge(fit, profiled))
    natural = fit.coordinates.natural(draws)
    contraction = 1.0 - natural.var(axis=0) / prior**2
    widths = np.stack([spreads(fit.model, posterior.quoted()[1]), widest(fit.model, fit.data.prior)], axis=1)[
        fit.free
    ].tolist()
    verdicts = tuple(_verdict(fit, p, float(contraction[p.place]), widths[p.place]) for p in profiled)
    known = fit.information[np.ix_(fit.free, fit.free)]
    return Identifiability(fit, verdicts, np.linalg.eigvalsh(known * np.outer(prior, prior)), groups(fit, draws))


def _draws(posterior: Posterior, along: Ridge) -> np.ndarray:
    sampled = posterior.method != "laplace" and posterior.usable
    return posterior.thinned(CONTRACTION_DRAWS)[0] if sampled else along.draws(CONTRACTION_DRAWS, seed=0)


def _verdict(fit: Fit, profile: Profile, contraction: float, widths: Sequence[float]) -> Verdict:
    """Of one parameter; `widths` are the standard deviation that its interval as quoted tells, and the widest."""
    k = int(fit.free[profile.place])
    entry = next(e for e in fit.entries if e.place.start <= k < e.place.stop)
    log, span = entry.param.scale == "log", entry.param.period or entry.param.upper - entry.param.lower
    value = float(fit.values[k])
    elsewhere = fit.elsewhere.get(profile.name, ())
    others = np.log(elsewhere) if log else np.array(elsewhere)
    low, high = min([profile.interval[0], *others]), max([profile.interval[1], *others])
    quoted, most = widths
    sd = float(np.fmax((high - low) / (2.0 * LEVEL), quoted))
    blind = entry.name in fit.undetermined
    lost = blind or sd > most or contraction < CONTRACTED
    misfit = lost and not blind and fit.correlation.found
    misfit = misfit and sd <= most * np.sqrt(fit.correlation.inflation[profile.place])
    if log or entry.param.weight:
        weak = sd / (1.0 if log else max(abs(value), SMALL_WEIGHT * span)) > WEAK
    else:
        weak = sd > WEAK_RANGE * span
    state = STATES[2] if lost else STATES[1] if weak or elsewhere or profile.missed > AGREE else STATES[0]
    ends = (float(np.exp(low)), float(np.exp(high))) if log else (float(low), float(high))
    told = (value, profile, ends, profile.open, elsewhere, bool(misfit), contraction)
    return Verdict(profile.name, entry.param.symbol, state, *told)


def _listed(names: list[str]) -> str:
    return names[0] if len(names) == 1 else f"{', '.join(names[:-1])} and {names[-1]}"
