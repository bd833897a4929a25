"""Scaled weights: the coordinates in which a posterior with a shared scale is sampled.

Where all values share an error g of the scale, the data determine g k_d and g k_s, and hardly g: in k_d and ln g the
posterior is a thin, bent ridge, in the products it is straight. The priors of the weights are flat in the products,
so that g keeps its own prior where the data say nothing of it; a weight with a stated prior is no such coordinate.
Nothing here knows the data.
"""

import dataclasses

import numpy as np

from fitmat.fitting.coordinates import Coordinates
from fitmat.fitting.result import Fit


def sampled(fit: Fit) -> Coordinates:
    """The coordinates that suit a fit's posterior: those that were fitted, weights scaled where a scale is."""
    places = {place: k for k, place in enumerate(fit.coordinates.places)}
    scale = [e.place.start for e in fit.entries if e.name == "scale" and e.place.start in places]
    if not scale:
        return fit.coordinates
    weights = [k for e in fit.entries if e.param.weight for k in range(e.place.start, e.place.stop)]
    prior = fit.data.prior
    stated = set() if prior is None else set(np.flatnonzero(np.asarray(prior.precision) > 0).tolist())
    chosen = tuple(places[k] for k in weights if k in places and k not in stated)
    return dataclasses.replace(fit.coordinates, weights=chosen, scale=places[scale[0]])


def scaled_gaussian(moved: Coordinates, centre: np.ndarray, covariance: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Mean and covariance in natural coordinates as those in the scaled ones, to first order."""
    if not moved.weights:
        return centre, covariance
    slope, which, g = np.eye(len(centre)), np.array(moved.weights, int), np.exp(centre[moved.scale])
    slope[which, which] = g
    slope[which, moved.scale] = g * centre[which]
    return moved.scaled(centre), slope @ covariance @ slope.T
