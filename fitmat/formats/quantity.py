"""Quantity: what a column holds, and the factor from it to f_r in sr⁻¹.

It guesses nothing: π or cos θ_o too much is absorbed by a fit without a trace.
"""

import numpy as np
from jaxtyping import Float

QUANTITIES = {
    "brdf": "brdf read as f_r in sr⁻¹, no factor applied.",
    "brdf_cos": "brdf_cos (the cosine-corrected BRDF, f_r cos θ_o) divided by cos θ_o.",
    "reflectance_factor": "reflectance_factor divided by π.",
}
"""Quantity → what is done to it, as the notes say it."""


def factor(quantity: str, theta_o: Float[np.ndarray, " n"]) -> Float[np.ndarray, " n"]:
    r"""What turns the quantity, and its σ, into f_r in sr⁻¹.

    .. math:: f_r = \mathrm{brdf} = \mathrm{brdf\_cos} / \cos\theta_o = \mathrm{reflectance\_factor} / \pi

    Args:
        quantity: One of `QUANTITIES`.
        theta_o: Zenith angles of reflection in radians, (n,).

    Example:
        >>> factor("reflectance_factor", np.zeros(1)).round(4)
        array([0.3183])
    """
    one = np.ones_like(theta_o)
    return {"brdf": one, "brdf_cos": one / np.cos(theta_o), "reflectance_factor": one / np.pi}[quantity]
