"""The ridge: a posterior as Gaussians strung along the parameter that the data determine least.

One Gaussian at the best fit is blind where only a combination is determined: the ridge that such a combination leaves
is long and bent. Here each Gaussian holds at one point of that parameter's profile. It samples no chain; a second
parameter that is not determined counts as Gaussian, no wider than its range.
"""

import dataclasses

import numpy as np
from jaxtyping import Float

from fitmat.fitting.priors import natural_sd
from fitmat.fitting.result import Fit
from fitmat.fitting.settling import STEPS
from fitmat.judgement.identifiability.profiles import Profile, along
from fitmat.text import brief

NODES = 4 * STEPS
"""Gaussians on the ridge, fewer only for a single parameter."""

NEGLECTED = 8.0
"""Fall of ln L from which a point is left out: the ends of ±4 standard deviations."""

FILLS = 0.5
"""A parameter whose profile is this much of its prior's standard deviation lies along the ridge."""


@dataclasses.dataclass(frozen=True, eq=False)
class Ridge:
    """A mixture of e Gaussians in the natural coordinates of the f free parameters, s held.

    Attributes:
        fit: Whose posterior it is.
        place: Of the parameter along which they are strung, among the free ones.
        weight: Of each, (e,), summing to 1.
        centre: (e, f), in rising order of that parameter.
        across: Covariance of the other parameters with that one held, (e, f, f).
        along: How the parameters change over one standard deviation of a Gaussian's share of the ridge, (e, f).
    """

    fit: Fit
    place: int
    weight: Float[np.ndarray, " e"]
    centre: Float[np.ndarray, "e f"]
    across: Float[np.ndarray, "e f f"]
    along: Float[np.ndarray, "e f"]

    __repr__ = brief

    @property
    def covariance(self) -> Float[np.ndarray, "e f f"]:
        """Of each Gaussian, as if the ridge were straight over its share."""
        return self.across + self.along[:, :, None] * self.along[:, None, :]

    def total(self) -> tuple[Float[np.ndarray, " f"], Float[np.ndarray, "f f"]]:
        """Mean and covariance of the whole mixture."""
        mean = self.weight @ self.centre
        apart = self.centre - mean
        between = np.einsum("e,ei,ej->ij", self.weight, apart, apart)
        return mean, np.einsum("e,eij->ij", self.weight, self.covariance) + between

    def draws(self, count: int, seed: int) -> Float[np.ndarray, "m p"]:
        """Physical parameter vectors along the bent ridge, kept within the bounds, fixed ones included."""
        from scipy.interpolate import PchipInterpolator

        rng, moved = np.random.default_rng(seed), self.fit.coordinates
        which = rng.choice(len(self.weight), count, p=self.weight)
        at = self.centre[:, self.place]
        held = at[which] + np.sqrt(12.0) * self.along[which, self.place] * (rng.random(count) - 0.5)
        apart = np.r_[True, np.diff(at) > 0]
        curve = self.centre[which]
        if np.count_nonzero(apart) > 1:
            curve = PchipInterpolator(at[apart], self.centre[apart])(np.clip(held, at[0], at[-1]))
        values, vectors = np.linalg.eigh(self.across)
        roots = vectors * np.sqrt(np.maximum(values, 0.0))[:, None, :]
        natural = curve + np.einsum("mij,mj->mi", roots[which], rng.normal(size=(count, moved.count)))
        return moved.filled(self.fit.values, np.clip(natural, moved.low, moved.high))


def ridge(fit: Fit, profiled: tuple[Profile, ...], *, widened: bool = True) -> Ridge:
    """The posterior along its least determined parameter, with flat priors where the fit has no others.

    The weight of a point is Laplace's approximation of the marginal density there (Tierney & Kadane 1986, eq. 4.1):
    exp(−Δ) |H|^(−1/2), H the information on the other parameters; its Gaussian is that of the others, and as wide
    along the ridge as its share of it.

    Args:
        fit: Of at least one free parameter.
        profiled: From `profiles`.
        widened: As there.
    """
    prior = natural_sd(fit.model, fit.data.prior)[fit.free]
    filling = np.array([p.sd for p in profiled]) / prior
    place = int(np.argmax(filling))
    held, guess = _spaced(profiled, filling, place, prior)
    points, information = along(fit, place, held, guess, widened=widened)
    others = np.delete(np.arange(len(prior)), place)
    stiff = information[:, others][:, :, others] + np.diag(prior[others] ** -2.0)
    width = np.gradient(held) if len(held) > 1 else np.ones(1)
    logs = -points.rise - 0.5 * np.linalg.slogdet(stiff)[1] + np.log(np.maximum(width, 1e-300))
    weight = np.exp(logs - logs.max())
    across, free = np.zeros_like(information), np.linalg.inv(stiff)
    across[:, others[:, None], others] = free
    slopes = np.ones((len(held), len(prior)))
    slopes[:, others] = -np.einsum("eij,ej->ei", free, information[:, others, place])
    along_it = slopes * width[:, None] / np.sqrt(12.0)
    return Ridge(fit, place, weight / weight.sum(), points.coordinates, across, along_it)


def _spaced(
    profiled: tuple[Profile, ...], filling: np.ndarray, place: int, prior: np.ndarray
) -> tuple[Float[np.ndarray, " e"], Float[np.ndarray, "e f"]]:
    """Values of the parameter, evenly spaced along the ridge's length in prior standard deviations, and guesses there.

    The profiles of all parameters that fill their priors follow the same ridge, each finely where it moves fast.
    """
    same = [p for p in profiled if p.place == place or filling[p.place] > FILLS]
    path = np.concatenate([p.points.coordinates for p in same])
    path = path[np.concatenate([p.points.rise for p in same]) < NEGLECTED]
    path = path[np.argsort(path[:, place])]
    path = path[np.r_[True, np.diff(path[:, place]) > 1e-9 * prior[place]]]
    length = np.r_[0.0, np.cumsum(np.linalg.norm(np.diff(path, axis=0) / prior, axis=1))]
    even = np.linspace(0.0, length[-1], min(NODES, 2 * len(prior) * STEPS))
    guess = np.stack([np.interp(even, length, column) for column in path.T], axis=1)
    return guess[:, place], guess
