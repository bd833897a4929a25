"""Conversion: one convention's parameter from another's: exponent and slope, roughness, specular, metallic.

It fits nothing; `imitation` finds the best parameters of a model for another. The closed form compares the peaks of two
distributions of normals; what a fit finds differs from it by a smooth curve in the width, which `fitted_exponent` and
`fitted_alpha` add.
"""

from typing import TypeVar, cast

import numpy as np
from jaxtyping import Array, ArrayLike

Numbers = TypeVar("Numbers", float, np.ndarray, Array)
"""Floats, or JAX or NumPy arrays; what goes in comes out."""

VALID = 0.02, 0.8
"""Widths (α, or √(2/(n+2))) between which the corrections were fitted; beyond, that of the nearer end is taken."""

EXPONENT_CORRECTION = (-1.1755, -1.3282, -0.4963, -0.0643)
"""ln of √(2/(n+2)) over α of Blinn–Phong fitted to GGX: coefficients of 1, x, x², x³, x = ln α.

Least squares over 14 widths and 5 settings of simulated GGX on Lambert (incidences 10–70°, 10–50° and 30–80°, kd 0.3
and 0.02, η 1.5 and 3; noise 2 % + 1e-3 sr⁻¹), `benchmarks/conversion.py`. Its rms error over the settings is 0.04 to
0.11 up to α = 0.26 and rises to 0.27 at 0.8; that of the closed form is 0.02 to 0.24, rising to 1.0.
"""

ALPHA_CORRECTION = (-0.7574, -1.3919, -0.6188, -0.0778)
"""ln of α over √(2/(n+2)) of GGX fitted to Blinn–Phong, the same way.

Its rms error is 0.02 to 0.22, that of the closed form 0.11 to 0.47: what GGX finds in a lobe without Fresnel term
depends on the incidences measured more than on n.
"""


def exponent_from_alpha(alpha: Numbers) -> Numbers:
    """n = 2/α² − 2: the exponent of the cosine power with the peak of a microfacet distribution, for α in (0, 1].

    Exact for the peak, (n+2)/(2π) = 1/(πα²), and close around it for Beckmann's; GGX has a longer tail. B. Walter
    et al., Microfacet models for refraction through rough surfaces, EGSR 2007, sec. 5.2.

    Example:
        >>> round(exponent_from_alpha(0.1), 9)
        198.0
    """
    return 2.0 / alpha**2 - 2.0


def alpha_from_exponent(exponent: Numbers) -> Numbers:
    """α = √(2/(n+2)): the inverse of `exponent_from_alpha`, for n ≥ 0.

    Example:
        >>> round(alpha_from_exponent(198.0), 9)
        0.1
    """
    return cast(Numbers, (2.0 / (exponent + 2.0)) ** 0.5)


def fitted_exponent(alpha: ArrayLike) -> np.ndarray:
    """The exponent to expect where lambert+blinn-phong is fitted to GGX of a slope in `VALID`.

    The closed form for the width α exp(c₀ + c₁x + c₂x² + c₃x³), x = ln α; `EXPONENT_CORRECTION` has c and the error. A
    smooth lobe comes out wider than its peak, because the cosine power has to reach into the tail; a rough one
    narrower, because Blinn–Phong lacks what lifts GGX towards grazing.

    Example:
        >>> float(fitted_exponent(0.05).round(-1))
        680.0
    """
    return exponent_from_alpha(_corrected(np.asarray(alpha, float), EXPONENT_CORRECTION))


def fitted_alpha(exponent: ArrayLike) -> np.ndarray:
    """The slope to expect where lambert+ggx is fitted to Blinn–Phong of an exponent from 1.1 to 5,000.

    √(2/(n+2)) times its correction, as in `fitted_exponent`, with `ALPHA_CORRECTION`, which has its error.

    Example:
        >>> float(fitted_alpha(798.0).round(3))
        0.048
    """
    return _corrected(alpha_from_exponent(np.asarray(exponent, float)), ALPHA_CORRECTION)


def alpha_from_roughness(roughness: Numbers) -> Numbers:
    """α = roughness²: the artists' roughness, of Disney, glTF, OpenPBR, Blender, Unreal.

    B. Burley, Physically based shading at Disney, 2012, section 5.4.

    Example:
        >>> alpha_from_roughness(0.5)
        0.25
    """
    return roughness**2


def alpha_from_glossiness(glossiness: Numbers) -> Numbers:
    """α = (1 − glossiness)²: glossiness is 1 − roughness (KHR_materials_pbrSpecularGlossiness, appendix).

    Example:
        >>> alpha_from_glossiness(0.5)
        0.25
    """
    return alpha_from_roughness(1.0 - glossiness)


def f0_from_specular(specular: Numbers) -> Numbers:
    """F0 = 0.08 specular: 0.5 is 4 %, an index of 1.5 (Burley 2012, section 5.5; Blender, Unreal).

    Example:
        >>> f0_from_specular(0.5)
        0.04
    """
    return 0.08 * specular


def diffuse_from_metallic(base_color: Numbers, metallic: Numbers) -> Numbers:
    """kd = (1 − metallic) base_color (glTF 2.0, appendix B)."""
    return (1.0 - metallic) * base_color


def f0_from_metallic(base_color: Numbers, metallic: Numbers) -> Numbers:
    """F0 = 0.04 + metallic (base_color − 0.04) (glTF 2.0, appendix B).

    Example:
        >>> f0_from_metallic(0.9, 1.0)
        0.9
    """
    return 0.04 + metallic * (base_color - 0.04)


def _corrected(width: np.ndarray, coefficients: tuple[float, ...]) -> np.ndarray:
    return width * np.exp(np.polynomial.polynomial.polyval(np.log(np.clip(width, *VALID)), coefficients))
