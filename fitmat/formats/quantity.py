"""Quantity: what a column holds, and the factor from it to f_r in sr⁻¹.

It guesses nothing: π or cos θ_o too much is absorbed by a fit without a trace.
"""

import numpy as np
from jaxtyping import Float

from fitmat.errors import ReadError
from fitmat.geometry import zenith
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
    wi: Float[np.ndarray, "n 3"],
    wo: Float[np.ndarray, "n 3"],
    source: PointSource | None = None,
) -> Float[np.ndarray, "n 1"]:
    r"""What turns the quantity, and its σ, into f_r in sr⁻¹.

    .. math:: f_r = \mathrm{brdf} = \mathrm{brdf\_cos} / \cos\theta_o = \mathrm{reflectance\_factor} / \pi
        = \mathrm{radiance} \, d^2 / (I \cos\theta_i)

    Args:
        quantity: One of `QUANTITIES`.
        wi: Unit vectors to the light, (n, 3).
        wo: Unit vectors to the sensor, (n, 3).
        source: What lights the sample, for radiances.

    Raises:
        ReadError: a radiance without its source.

    Example:
        >>> up = np.array([[0.0, 0.0, 1.0]])
        >>> factor("reflectance_factor", up, up).round(4)
        array([[0.3183]])
    """
    if quantity == "radiance":
        if source is None:
            expected = "expected the source beside them: intensity= in W/sr and distance= in m"
            raise ReadError(f"radiances without the light that caused them, {expected} (--intensity, --distance).")
        return 1.0 / source.irradiance(zenith(wi))[:, None]
    one = np.ones((len(wo), 1))
    return {"brdf": one, "brdf_cos": one / wo[:, 2:], "reflectance_factor": one / np.pi}[quantity]
