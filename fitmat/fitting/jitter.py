"""Jitter: what chance errors of each reading's angles add to its noise, through the slopes of a fitted model.

The law of propagation of uncertainty with its terms of second order (JCGM 100:2008, 5.1.2 and its note), for θ_i and
θ_o of each reading by themselves; with that as its effective variance (J. Orear, Am. J. Phys. 50, 1982) the model is
fitted anew.
"""

import dataclasses

import numpy as np
from jaxtyping import Float

from fitmat.fitting.discrepancy import noise_scale
from fitmat.fitting.likelihood import Data
from fitmat.models.around.instrument import displaced
from fitmat.models.base import AbstractBRDF
from fitmat.models.values import at

AGAIN = 2
"""How often a fit is repeated with the noise that its own slopes make; a third changes no parameter by 0.01 sd."""


def jittered(data: Data, best: AbstractBRDF, angle_error: float, *, signed: bool) -> Data:
    """The samples with the noise of the values and, added to it, that of the angles.

    Args:
        data: The samples with the noise of their values alone.
        best: The model as its instrument shows it.
        angle_error: Standard deviation of each reading's θ_i and θ_o, radians.
        signed: Whether θ_o is signed, as in measurements of one plane.
    """
    added = np.where(np.asarray(data.weight) > 0, _spread(data, best, angle_error, signed=signed), 0.0)
    noise = np.hypot(data.noise, added)
    return dataclasses.replace(data, noise=noise, jitter=added, typical=noise_scale(data.x, noise, data.weight))


def _spread(data: Data, best: AbstractBRDF, angle_error: float, *, signed: bool) -> Float[np.ndarray, "n c"]:
    """Standard deviation of f κ, by differences over ± one standard deviation of each angle."""

    def seen(i: int, o: int) -> Float[np.ndarray, "n c"]:
        wi, wo = displaced(data.wi, data.wo, i * angle_error, o * angle_error, signed=signed)
        return at(best, wi, wo) * np.maximum(wi[:, 2:], 0.0)

    here, mixed = seen(0, 0), (seen(1, 1) - seen(1, -1) - seen(-1, 1) + seen(-1, -1)) / 4.0
    variance = mixed**2
    for more, less in ((seen(1, 0), seen(-1, 0)), (seen(0, 1), seen(0, -1))):
        variance += ((more - less) / 2.0) ** 2 + (more - 2.0 * here + less) ** 2 / 2.0
    return np.sqrt(variance)
