"""Trade-offs: which parameters act alike in a fit, and which combination of them is determined all the same.

It sees information and draws only; whether a parameter is determined, `verdicts` says.
"""

import dataclasses
from collections.abc import Callable, Mapping
from fractions import Fraction

import numpy as np
from jaxtyping import Float

from fitmat.fitting.priors import natural_sd
from fitmat.fitting.result import Fit
from fitmat.models.terms.fresnel import f0_from_eta, f0_from_ior
from fitmat.text import brief

CONDITION = 30.0
"""Condition index from which columns of a Jacobian act alike: "moderate to strong" of Belsley, Kuh & Welsch (1980,
sec. 3.2); one of a pair is then known 20 times worse than on its own."""

LOADING = 0.1
"""Least part in a dependency, as a component of its unit vector: less only carries rounding over."""

SHARE = 0.5
"""Share of a parameter's variance that a dependency causes where the parameter is part of it (ibid.)."""

KNOWN = 0.1
"""Relative standard deviation up to which a combination is determined."""

CLEARER = 3.0
"""A combination is named where it is known so many times better than the parameters."""

SIMPLER = 1.5
"""A combination with a name is preferred to a product of powers that is known up to so many times better."""

Values = Mapping[str, Float[np.ndarray, "m c"]]


@dataclasses.dataclass(frozen=True, eq=False)
class Combination:
    """A combination of parameters that the data determine; arrays hold one entry per channel, or one.

    Attributes:
        name: "ks·F0".
        meaning: In plain words; "" for a product of powers.
        value: At the best fit, (k,).
        sd: Over the draws, (k,).
        ci95: 95 % interval over the draws, (k, 2).
    """

    name: str
    meaning: str
    value: Float[np.ndarray, " k"]
    sd: Float[np.ndarray, " k"]
    ci95: Float[np.ndarray, "k 2"]

    __repr__ = brief

    @property
    def relative(self) -> float:
        """The largest relative standard deviation over the channels."""
        return float(np.max(self.sd / np.maximum(np.abs(self.value), 1e-300)))


@dataclasses.dataclass(frozen=True, eq=False)
class Group:
    """Parameters that trade off.

    Attributes:
        names: At least two.
        index: Condition index of the dependency.
        combination: What of them is determined; None where nothing simple is.
    """

    names: tuple[str, ...]
    index: float
    combination: Combination | None

    __repr__ = brief


def _f0(v: Values) -> np.ndarray:
    if "f0" in v:
        return v["f0"]
    return f0_from_ior(v["eta"], v["kappa"]) if "kappa" in v else f0_from_eta(v["eta"])


Combined = tuple[str, str, frozenset[str], Callable[[Values], np.ndarray]]
NAMED: tuple[Combined, ...] = (
    ("ks·F0", "the strength of the highlight seen head on", frozenset({"ks", "eta"}), lambda v: v["ks"] * _f0(v)),
    ("ks·F0", "the strength of the highlight seen head on", frozenset({"ks", "f0"}), lambda v: v["ks"] * _f0(v)),
    ("ks·F0/α²", "the height of the highlight", frozenset({"ks", "eta", "alpha"}),
        lambda v: v["ks"] * _f0(v) / v["alpha"] ** 2),
    ("ks·F0/α²", "the height of the highlight", frozenset({"ks", "f0", "alpha"}),
        lambda v: v["ks"] * _f0(v) / v["alpha"] ** 2),
    ("F0", "the reflectance head on", frozenset({"eta", "kappa"}), _f0),
    ("ks·(n+8)", "the height of the highlight", frozenset({"ks", "exponent"}), lambda v: v["ks"] * (v["exponent"] + 8)),
    ("ks/α²", "the height of the highlight", frozenset({"ks", "alpha"}), lambda v: v["ks"] / v["alpha"] ** 2),
    ("kd+ks", "the albedo of both lobes together", frozenset({"kd", "ks"}), lambda v: v["kd"] + v["ks"]),
    ("kd·g", "the diffuse part as the instrument shows it", frozenset({"kd", "scale"}), lambda v: v["kd"] * v["scale"]),
    ("ks·g", "the highlight as the instrument shows it", frozenset({"ks", "scale"}), lambda v: v["ks"] * v["scale"]),
    ("ks·F0·g", "the highlight as the instrument shows it", frozenset({"ks", "eta", "scale"}),
        lambda v: v["ks"] * _f0(v) * v["scale"]),
)  # fmt: skip
"""Combinations with a meaning: name, meaning, the parameters it is made of, formula. eta may come with kappa."""


def groups(fit: Fit, draws: Float[np.ndarray, "m p"]) -> tuple[Group, ...]:
    """Parameters that act alike, and the combination of them that is known best.

    From the eigenvalues of the information with columns of equal length: an eigenvalue far below the largest is a
    dependency, and the parameters that owe it more than half of their variance take part (Belsley, Kuh & Welsch,
    Regression Diagnostics, 1980, ch. 3). A parameter of which the data would say nothing even on its own takes part in
    none.

    Args:
        fit: Gives the information.
        draws: Of the posterior, physical vectors.
    """
    known = fit.information[np.ix_(fit.free, fit.free)]
    names, diagonal = fit.coordinates.names, np.diagonal(known)
    prior = natural_sd(fit.model, fit.data.prior)[fit.free]
    telling = np.flatnonzero(diagonal * prior**2 > 1.0)
    if len(telling) < 2:
        return ()
    released = known[np.ix_(telling, telling)] + np.diag(prior[telling] ** -2.0)
    size = np.sqrt(np.diagonal(released))
    values, vectors = np.linalg.eigh(released / np.outer(size, size))
    values = np.maximum(values, values[-1] * 1e-15)
    variance = vectors**2 / values
    share = variance / variance.sum(axis=1, keepdims=True)
    found = []
    for k in range(len(values)):
        index = float(np.sqrt(values[-1] / values[k]))
        members = telling[(share[:, k] > SHARE) & (np.abs(vectors[:, k]) > LOADING)]
        if index > CONDITION and len(members) > 1:
            found.append(Group(tuple(names[m] for m in members), index, _best(fit, members, draws)))
    return tuple(found)


def _best(fit: Fit, members: np.ndarray, draws: np.ndarray) -> Combination | None:
    """The combination of the members that is known best, if it is known well and better than they are."""
    places = set(fit.free[members].tolist())
    inside = [e for e in fit.entries if places & set(range(e.place.start, e.place.stop))]
    short = {e.name.split(".")[-1] for e in inside}
    every = np.vstack([fit.values, draws])
    values = {e.name.split(".")[-1]: every[:, e.place] for e in fit.entries}
    named = [
        _judged(n, m, rule(values)) for n, m, needed, rule in NAMED if needed == short - {"kappa"} or needed == short
    ]
    powers = _powers(fit, members, every)
    named.sort(key=lambda c: c.relative)
    best = named[0] if named and (powers is None or named[0].relative < SIMPLER * powers.relative) else powers
    if best is None or not best.relative <= KNOWN:
        return None
    own = every[1:, fit.free[members]]
    worst = np.max(own.std(axis=0) / np.maximum(np.abs(np.median(own, axis=0)), 1e-300))
    return best if worst > CLEARER * best.relative else None


def _judged(name: str, meaning: str, values: np.ndarray) -> Combination:
    return Combination(
        name, meaning, values[0], values[1:].std(axis=0), np.quantile(values[1:], [0.025, 0.975], axis=0).T
    )


def _powers(fit: Fit, members: np.ndarray, every: np.ndarray) -> Combination | None:
    """The product of powers along the stiffest direction of the draws' logarithms, exponents rounded to quarters."""
    columns = every[:, fit.free[members]]
    if not (columns[0] > 0).all() or np.quantile(columns, 0.01) <= 0:
        return None
    logs = np.log(np.maximum(columns, 1e-300))
    stiff = np.linalg.eigh(np.cov(logs[1:].T))[1][:, 0]
    stiff = stiff / stiff[np.argmax(np.abs(stiff))]
    exponents = [Fraction(round(4 * float(p)), 4) for p in stiff]
    names = [fit.coordinates.names[m] for m in members]
    used = [(n, p) for n, p in zip(names, exponents, strict=True) if p]
    if len(used) < 2:
        return None
    text = "·".join(n if p == 1 else f"{n}^({p})" for n, p in used)
    return _judged(text, "", np.exp(logs @ np.array([float(p) for p in exponents]))[:, None])
