"""Quantity: what a column holds, and the factor from it to f_r in sr⁻¹.

It guesses nothing: π or cos θ_o too much is absorbed by a fit without a trace.
"""

import numpy as np
from jaxtyping import Float

from fitmat.errors import ReadError
from fitmat.measurements.options import Options

QUANTITIES = {
    "brdf": "brdf read as f_r in sr⁻¹, no factor applied.",
    "brdf_cos": "brdf_cos (the cosine-corrected BRDF, f_r cos θ_o) divided by cos θ_o.",
    "reflectance_factor": "reflectance_factor divided by π.",
    "radiance": "radiance divided by the irradiance I cos θ_i/d² of the source",
    "panel_ratio": "ratio to a white panel in the same geometry multiplied by R/π",
}
"""Quantity → what is done to it, as the notes say it."""


def note(quantity: str, options: Options) -> str:
    """What is done to the quantity, in a sentence."""
    if quantity == "panel_ratio" and options.panel is not None:
        return f"{QUANTITIES[quantity]}, R = {options.panel:g} the panel's reflectance factor."
    if quantity == "radiance" and options.source is not None:
        return f"{QUANTITIES[quantity]}, I = {options.source.intensity:g} W/sr at d = {options.source.distance:g} m."
    if quantity == "panel_ratio":
        return "ratio to a white panel in the same geometry, to which the BRDF is proportional."
    if quantity == "radiance":
        return "radiance divided by cos θ_i, to which the irradiance of a fixed source is proportional."
    return QUANTITIES[quantity]


def factor(
    quantity: str,
    wi: Float[np.ndarray, "n 3"],
    wo: Float[np.ndarray, "n 3"],
    options: Options,
) -> Float[np.ndarray, "n 1"]:
    r"""What turns the quantity, and its σ, into f_r in sr⁻¹.

    .. math:: f_r = \mathrm{brdf} = \mathrm{brdf\_cos} / \cos\theta_o = \mathrm{reflectance\_factor} / \pi
        = \mathrm{radiance} \, d^2 / (I \cos\theta_i) = \mathrm{panel\_ratio} \, R / \pi

    Args:
        quantity: One of `QUANTITIES`.
        wi: Unit vectors to the light, (n, 3).
        wo: Unit vectors to the sensor, (n, 3).
        options: Source of the light, for radiances; the panel's R, for ratios; neither where the scale is unknown.

    Raises:
        ReadError: a radiance without its source, a ratio without its panel, or one of these beside another quantity.

    Example:
        >>> up = np.array([[0.0, 0.0, 1.0]])
        >>> factor("reflectance_factor", up, up, Options()).round(4)
        array([[0.3183]])
    """
    _refuse_needless(quantity, options)
    if quantity == "radiance":
        if options.source is None and options.unknown_scale:
            return 1.0 / _cosine(wi)
        if options.source is None:
            expected = "expected the source beside them: intensity= in W/sr and distance= in m"
            remedy = "Give them (--intensity, --distance), or fit the scale (--unknown-scale)."
            raise ReadError(f"radiances without the light that caused them, {expected}. {remedy}")
        return 1.0 / options.source.irradiance(np.arccos(_cosine(wi)))
    if quantity == "panel_ratio" and options.panel is None and not options.unknown_scale:
        expected = "expected its reflectance factor, for example panel=0.99"
        raise ReadError(f"ratios to a white panel of unknown reflectance, {expected}. Give it (--panel).")
    one = np.ones((len(wo), 1))
    return {
        "brdf": one,
        "brdf_cos": one / _cosine(wo),
        "reflectance_factor": one / np.pi,
        "panel_ratio": one * (options.panel or 1.0) / np.pi,
    }[quantity]


def _refuse_needless(quantity: str, options: Options) -> None:
    """Stop where the user describes a light or a panel that the quantity has nothing to do with."""
    if options.source is not None and quantity != "radiance":
        got = "intensity and distance of a source (--intensity, --distance)"
        raise ReadError(f"{got}, expected none: the values are {quantity}, not radiance. Leave them out.")
    if options.panel is not None and quantity != "panel_ratio":
        expected = f"expected none: the values are {quantity}, neither signal and reference nor their ratio"
        raise ReadError(f"panel = {options.panel:g} (--panel), {expected}. Leave it out.")


def _cosine(w: Float[np.ndarray, "n 3"]) -> Float[np.ndarray, "n 1"]:
    """Of the zenith angle; 1 at and below the horizon, where no value is used."""
    return np.where(w[:, 2:] > 0, w[:, 2:], 1.0)
