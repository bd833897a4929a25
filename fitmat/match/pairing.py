"""Pairing: draws of two posteriors side by side, as far as one value of theirs is the same.

It compares nothing.
"""

import numpy as np

from fitmat.match.distances import PairedDraws
from fitmat.uncertainty.posterior import Posterior

MATCH_DRAWS = 100
"""Posterior draws behind every interval of the match."""


def paired_draws(empirical: Posterior, microfacet: Posterior) -> PairedDraws:
    """Parameter vectors of both: the best fits, then draws in pairs, in no particular order."""
    one, other = _by_scale(empirical), _by_scale(microfacet)
    mixed = np.random.default_rng(0).permutation(min(len(one), len(other)))
    return np.vstack([empirical.fit.values, one[mixed]]), np.vstack([microfacet.fit.values, other[mixed]])


def _by_scale(posterior: Posterior) -> np.ndarray:
    """Draws in the order of the shared scale, which has one true value for both models; else as they come."""
    values = posterior.thinned(MATCH_DRAWS)[0]
    place = next((e.place for e in posterior.fit.entries if e.name == "scale"), None)
    return values if place is None else values[np.argsort(values[:, place.start])]
