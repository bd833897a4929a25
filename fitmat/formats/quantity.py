"""Quantity: what a column holds, and the factor from it to f_r in sr⁻¹.

It guesses nothing: π or cos θ_o too much is absorbed by a fit without a trace.
"""

import numpy as np
from jaxtyping import Float

from fitmat.errors import ReadError
from fitmat.lighting import PointSource

QUANTITIES = {
    "brdf": "brdf read as f_r in sr⁻¹, no factor applied.",
    "brdf_cos": "brdf_cos (the cosine-corrected BRDF, f_r cos θ_o) divided by cos θ_o.",
    "reflectance_factor": "reflectance_factor divided by π.",
    "radiance": "radiance divided by the irradiance I cos θ_i/d² of the source",
}
"""Quantity → what is done to it, as the notes say it."""


def note(quantity: str, source: PointSource | None) -> str:
    """What is done to the quantity, in a sentence."""
    if quantity != "radiance" or source is None:
        return QUANTITIES[quantity]
    return f"{QUANTITIES[quantity]}, I = {source.intensity:g} W/sr at d = {source.distance:g} m."


def factor(
    quantity: str,
    theta_i: Float[np.ndarray, " n"],
    theta_o: Float[np.ndarray, " n"],
    source: PointSource | None = None,
) -> Float[np.ndarray, " n"]:
    r"""What turns the quantity, and its σ, into f_r in sr⁻¹.

    .. math:: f_r = \mathrm{brdf} = \mathrm{brdf\_cos} / \cos\theta_o = \mathrm{reflectance\_factor} / \pi
        = \mathrm{radiance} \, d^2 / (I \cos\theta_i)

    Args:
        quantity: One of `QUANTITIES`.
        theta_i: Zenith angles of incidence in radians, (n,).
        theta_o: Zenith angles of reflection in radians, (n,).
        source: What lights the sample, for radiances.

    Raises:
        ReadError: a radiance without its source.

    Example:
        >>> factor("reflectance_factor", np.zeros(1), np.zeros(1)).round(4)
        array([0.3183])
    """
    if quantity == "radiance":
        if source is None:
            expected = "expected the source beside them: intensity= in W/sr and distance= in m"
            raise ReadError(f"radiances without the light that caused them, {expected} (--intensity, --distance).")
        return 1.0 / source.irradiance(theta_i)
    one = np.ones_like(theta_o)
    return {"brdf": one, "brdf_cos": one / np.cos(theta_o), "reflectance_factor": one / np.pi}[quantity]
