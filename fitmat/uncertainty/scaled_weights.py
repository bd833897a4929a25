"""Apparent weights: the coordinates in which a posterior with a shared scale is sampled.

Where all values share an error g of the scale, the data determine g k_d and g k_s, and hardly g: in k_d and ln g the
posterior is a thin, bent ridge, in the products it is straight. The priors of the weights are flat in the products,
so that g keeps its own prior where the data say nothing of it; a weight with a stated prior is no such coordinate.
Nothing here knows the data.
"""

import dataclasses

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from fitmat.fitting.result import Fit


@dataclasses.dataclass(frozen=True)
class Apparent:
    """Places, among the sampled coordinates (free natural ones, then s), of what the scale multiplies.

    Attributes:
        weights: Of the weights, in which the BRDF is linear; empty where no scale is fitted.
        scale: Of ln g; 0 where there is none.
    """

    weights: tuple[int, ...] = ()
    scale: int = 0

    @property
    def _which(self) -> np.ndarray:
        return np.array(self.weights, int)

    def natural(self, x: Float[Array, " d"]) -> Float[Array, " d"]:
        """Sampled → natural coordinates."""
        return x.at[self._which].multiply(jnp.exp(-x[self.scale])) if self.weights else x

    def natural_array(self, x: Float[np.ndarray, "m d"]) -> Float[np.ndarray, "m d"]:
        """`natural` for many draws in NumPy."""
        return self._times(x, -1.0)

    def sampled(self, t: Float[np.ndarray, "m d"]) -> Float[np.ndarray, "m d"]:
        """Natural → sampled coordinates, the inverse."""
        return self._times(t, 1.0)

    def _times(self, x: np.ndarray, sign: float) -> np.ndarray:
        changed = np.array(x)
        changed[:, self._which] *= np.exp(sign * x[:, [self.scale]])
        return changed

    def gaussian(self, centre: np.ndarray, covariance: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Mean and covariance in natural coordinates as those in the sampled ones, to first order."""
        slope = np.eye(len(centre))
        g = np.exp(centre[self.scale])
        slope[self._which, self._which] = g
        slope[self._which, self.scale] = g * centre[self._which]
        return self.sampled(centre[None])[0], slope @ covariance @ slope.T


def apparent(fit: Fit) -> Apparent:
    """The coordinates that suit a fit."""
    places = {place: k for k, place in enumerate(fit.free)}
    scale = [e.place.start for e in fit.entries if e.name == "scale" and e.place.start in places]
    if not scale:
        return Apparent()
    weights = [k for e in fit.entries if e.param.weight for k in range(e.place.start, e.place.stop)]
    prior = fit.data.prior
    stated = set() if prior is None else set(np.flatnonzero(np.asarray(prior.precision) > 0).tolist())
    return Apparent(tuple(places[k] for k in weights if k in places and k not in stated), places[scale[0]])
