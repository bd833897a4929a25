"""Fresnel in RGB against the spectrum: how wrong a colour becomes when three numbers stand for all wavelengths.

It knows named materials and white light from one direction; it looks at no fit and draws nothing. A renderer in RGB is
one that multiplies linear sRGB of the light by linear sRGB of the reflectance; the truth is integrated over the
wavelengths. Colours are not clipped: a highlight may be brighter and more saturated than a display.
"""

import dataclasses
from collections.abc import Callable

import numpy as np
from jaxtyping import Complex, Float

from fitmat import arguments
from fitmat.colour.channels import sensitivities
from fitmat.colour.differences import JUST_NOTICEABLE, delta_e_2000
from fitmat.colour.observers import ILLUMINANTS, seen, wavelengths, white
from fitmat.colour.spaces import FROM_SRGB, linear
from fitmat.errors import ModelError
from fitmat.models import spectral
from fitmat.models.refractive_index import alternatives, channel_wavelengths
from fitmat.models.spectral import RGB
from fitmat.models.terms import belcour
from fitmat.models.terms.fresnel import COS_82, angle_nodes, conductor, hoffman, schlick
from fitmat.text import brief

ANGLES = np.arange(0.0, 90.0)
"""Degrees of incidence at which colours are compared."""

WAYS = {
    "wavelengths": "the exact equations at one wavelength a channel (642, 543, 441 nm)",
    "indices": "the exact equations with η and κ averaged over what each channel responds to",
    "closest": "the exact equations with the η and κ whose curve comes closest in each channel",
    "schlick": "Schlick's curve from F0 in RGB",
    "f82": "Hoffman's curve from F0 and F82 in RGB, cut at 1",
    "belcour": "Belcour's terms, integrated in each channel",
}
"""How renderers compute Fresnel's reflectance with three numbers a term; name → in words."""


_SHORT = {"wavelengths": "exact at three wavelengths", "schlick": "Schlick", "f82": "F82", "belcour": "Belcour"}


def _listed(ways: list[str]) -> str:
    return f"{', '.join(ways[:-1])} or {ways[-1]}" if len(ways) > 1 else ways[0]


@dataclasses.dataclass(frozen=True, eq=False)
class InRgb:
    """What Fresnel's reflectance of a material looks like, and what becomes of it in RGB.

    Attributes:
        material: As asked for.
        illuminant: Of the light.
        xyz: Of the reflected light, white Y = 1, at `ANGLES`, (a, 3).
        f0: Linear sRGB at normal incidence under D65, (3,); may be above 1.
        f82: The same at cos θ = 1/7, 81.8°.
        indices: η + iκ of each channel whose curve comes closest (`spectral.channel_indices`), (3,).
        delta_e_2000: `WAYS` → colour difference from the spectral truth at `ANGLES`, (a,).
        diffuse: `WAYS` → the same under uniform light from everywhere, ∫ F 2 cos θ sin θ dθ.
    """

    material: str
    illuminant: str
    xyz: Float[np.ndarray, "a 3"]
    f0: Float[np.ndarray, "3"]
    f82: Float[np.ndarray, "3"]
    indices: Complex[np.ndarray, "3"]
    delta_e_2000: dict[str, Float[np.ndarray, " a"]]
    diffuse: dict[str, float]

    __repr__ = brief

    def worst(self, way: str) -> tuple[float, float]:
        """The largest colour difference of one of `WAYS`, and the angle of incidence in degrees where it is."""
        apart = self.delta_e_2000[way]
        return float(apart.max()), float(ANGLES[apart.argmax()])

    @property
    def sentence(self) -> str:
        """Whether an eye would notice, in the ways that renderers choose most."""
        said = [f"{words} {self.worst(way)[0]:.1f} (at {self.worst(way)[1]:.0f}°)" for way, words in _SHORT.items()]
        close = [way for way in WAYS if self.worst(way)[0] < JUST_NOTICEABLE]
        verdict = f"nobody notices the difference with {_listed(close)}" if close else "every way is off visibly"
        return f"Fresnel in RGB: {verdict}. ΔE2000 at most: {', '.join(said)}; 1 is just noticeable."

    @property
    def tint(self) -> Float[np.ndarray, "3"]:
        """F82 over what Schlick's curve has there: the "specular edge colour" of OpenPBR and MaterialX."""
        return self.f82 / schlick(COS_82, self.f0)


def fresnel_in_rgb(material: str, illuminant: str = "D65") -> InRgb:
    """The colour error of computing Fresnel's reflectance in RGB instead of wavelength by wavelength.

    Args:
        material: As `--ior`: "Au", "gold", "N-BK7", or shelf/book/page of refractiveindex.info.
        illuminant: D65, D50, A, FL2, FL11, LED-B3 or E. A renderer in RGB has the light's own linear sRGB, and what is
            seen is compared with that light as white.

    Raises:
        FitmatError: the material or the illuminant is not known.

    Example:
        >>> import fitmat as fm
        >>> fm.fresnel_in_rgb("Au").f0.round(2)
        array([1.04, 0.73, 0.36])
    """
    arguments.kind("material", material, str)
    arguments.choice("illuminant", illuminant, ILLUMINANTS)
    lit = seen(illuminant)
    nodes, weights = angle_nodes(48)
    cos = np.concatenate([np.cos(np.deg2rad(ANGLES)), [COS_82], nodes])
    diffuse = 2.0 * weights * nodes * np.sqrt(1.0 - nodes**2)
    spectrum = spectral.reflectance(material, cos)
    in_rgb = spectrum @ sensitivities().T
    f0, f82 = in_rgb[0], in_rgb[len(ANGLES)]
    truth = spectrum @ lit
    to_xyz = linear(white(illuminant)) * FROM_SRGB
    count = len(ANGLES)
    apart, uniform = {}, {}
    closest = spectral.channel_indices(material, RGB)
    for way, curve in _curves(material, f0, f82, closest).items():
        made = curve(cos[:, None]) @ to_xyz.T
        apart[way] = delta_e_2000(made[:count], truth[:count], white(illuminant))
        means = [diffuse @ colours[count + 1 :] for colours in (made, truth)]
        uniform[way] = float(delta_e_2000(means[0], means[1], white(illuminant)))
    return InRgb(material, illuminant, truth[:count], f0, f82, closest, apart, uniform)


def _curves(
    material: str, f0: Float[np.ndarray, "3"], f82: Float[np.ndarray, "3"], closest: Complex[np.ndarray, "3"]
) -> dict[str, Callable[[np.ndarray], np.ndarray]]:
    """Each of `WAYS` as a function of the cosine, (a, 1) → (a, 3)."""
    rows, every = sensitivities(), spectral.indices(material)
    lines = every[np.searchsorted(wavelengths(), channel_wavelengths(RGB))]
    averaged = rows @ every
    terms = belcour.weights(np.real(every), np.imag(every)) @ rows.T

    def exact(n: np.ndarray) -> Callable[[np.ndarray], np.ndarray]:
        return lambda cos: conductor(cos, np.real(n), np.maximum(np.imag(n), 0.0))

    def projected(cos: np.ndarray) -> np.ndarray:
        first, second = belcour.basis(cos)
        return schlick(cos, f0) + terms[0] * first + terms[1] * second

    return {
        "wavelengths": exact(lines),
        "indices": exact(averaged),
        "closest": exact(closest),
        "schlick": lambda cos: schlick(cos, f0),
        "f82": lambda cos: hoffman(cos, f0, f82),
        "belcour": projected,
    }


@dataclasses.dataclass(frozen=True, eq=False)
class Published:
    """How far apart F0 of a material is by what others measured.

    Attributes:
        datasets: How many cover what an eye sees, its own included.
        furthest: The dataset that is furthest from its own; its own where there is no other.
        delta_e_2000: How far, in the colour of F0 under D65.
    """

    datasets: int
    furthest: str
    delta_e_2000: float

    __repr__ = brief


def published(material: str) -> Published:
    """The spread of F0 between the datasets of the database.

    Args:
        material: As in `fresnel_in_rgb`.

    Raises:
        FitmatError: the material is not known, or the database is not installed.
    """
    own, *others = alternatives(material)
    found = {own: f0_in_rgb(own)}
    for dataset in others:
        try:
            found[dataset] = f0_in_rgb(dataset)
        except ModelError:  # n alone, or another part of the spectrum
            continue
    apart = delta_e_2000(*(rgb @ FROM_SRGB.T for rgb in (np.stack(list(found.values())), found[own])))
    return Published(len(found), list(found)[int(apart.argmax())], float(apart.max()))


def f0_in_rgb(material: str) -> Float[np.ndarray, "3"]:
    """Reflectance at normal incidence in linear sRGB under D65; not clipped."""
    return spectral.seen_by(RGB, material, np.ones(1))[0]
