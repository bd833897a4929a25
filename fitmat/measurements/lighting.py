"""Lighting: what a source sends onto the sample, and the BRDF that a radiance reading then means.

Photometry of one point source; it knows no instrument and no file.
"""

import dataclasses

import numpy as np
from jaxtyping import Float
from numpy.typing import ArrayLike

from fitmat.errors import ReadError

LARGEST = 1e30
"""Intensities and distances beyond, in any unit, are a slip of the keyboard; their squares leave the floats' range."""


@dataclasses.dataclass(frozen=True)
class PointSource:
    """A source so small and far that its light arrives from one direction.

    Attributes:
        intensity: I, radiant intensity towards the sample in W/sr (or lm/sr beside cd/m² readings), > 0.
        distance: d from the sample in m, > 0; at ten times the source's size the inverse square is off by 0.25 %.

    Raises:
        ReadError: a number is not positive, or beyond `LARGEST`, or its inverse is.
    """

    intensity: float
    distance: float

    def __post_init__(self) -> None:
        for name in ("intensity", "distance"):
            value = getattr(self, name)
            if not 1 / LARGEST <= value <= LARGEST:
                expected = f"expected a positive number, at most {LARGEST:g}"
                raise ReadError(f"{name} = {value:g} (--{name}), {expected}. Correct it.")

    def irradiance(self, theta_i: ArrayLike) -> Float[np.ndarray, "..."]:
        """E = I cosθ_i/d² on the sample in W/m² (inverse square and cosine law, Lambert 1760); theta_i in radians."""
        return self.intensity * np.cos(np.asarray(theta_i, float)) / self.distance**2


def brdf_from_radiance(radiance: ArrayLike, theta_i: ArrayLike, source: PointSource) -> Float[np.ndarray, "..."]:
    """f_r = L_r/E in sr⁻¹ (Nicodemus et al. 1977).

    Args:
        radiance: L_r towards the sensor in W/(m² sr).
        theta_i: Zenith angle of the source in radians, below π/2, shape of `radiance` or one number.
        source: What lights the sample.

    Example:
        >>> brdf_from_radiance(0.5, 0.0, PointSource(intensity=2.0, distance=2.0)).round(3)
        np.float64(1.0)
    """
    return np.asarray(radiance, float) / source.irradiance(theta_i)
