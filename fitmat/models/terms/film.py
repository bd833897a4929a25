"""Fresnel reflectance of one thin film on a substrate: the light from its two faces interferes, at every wavelength.

Film and substrate are smooth and uniform over the width of a facet. Each channel is a line, one wavelength: what a band
of light, or light of short coherence, makes of the fringes is not known here, and no second film.
"""

import dataclasses
from typing import Any, ClassVar, TypeVar

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import ArrayLike

from fitmat import arguments
from fitmat._types import Scalar, Spectrum
from fitmat.errors import ModelError
from fitmat.maths.arrays import library
from fitmat.models.base import AbstractBRDF
from fitmat.models.dispersion import LONGEST, SHORTEST, cauchy
from fitmat.models.parameters import AbstractOfChannels, param
from fitmat.models.terms.fresnel import AbstractFresnel

M = TypeVar("M", bound=AbstractBRDF)

ALONE = (0.55,)
"""Wavelength in µm of a model of one channel that was given none: where an eye sees best."""

_TINY = 1e-30


class Film(AbstractFresnel, AbstractOfChannels):
    """A film of an index that follows Cauchy's law, and of a constant κ, on a substrate of η + iκ: Airy's sum, exact.

    Priors: as likely anywhere are the thickness from 0 to 1000 nm, film_eta from 1 to 5, film_b from 0 to 0.3 µm²,
    film_kappa from 0 to 10, and the logarithms of the substrate's η and κ.

    Attributes:
        um: Wavelength of each channel in vacuum, µm; one for all where there is one.
    """

    suffix: ClassVar[str] = "-film"
    thickness: Scalar = param(
        0.0, 1000.0, symbol="d", unit="nm", starts=tuple(np.arange(10.0, 1000.0, 20.0).tolist()), default=100.0,
        doc="thickness of the film; oxide of air 2–5, anodised titanium 20–200",
    )  # fmt: skip
    film_eta: Scalar = param(
        1.0, 5.0, symbol="η_f", starts=(1.45, 1.8, 2.3), default=1.5,
        doc="the film's index of long waves, η_f + B/λ²; SiO2 1.45, Al2O3 1.6, TiO2 2.2–2.5",
    )  # fmt: skip
    film_b: Scalar = param(
        0.0, 0.3, symbol="B", unit="µm²", starts=(0.01,), default=0.0,
        doc="the film's dispersion, η_f + B/λ²; SiO2 0.004, TiO2 0.05–0.1",
    )  # fmt: skip
    film_kappa: Scalar = param(
        0.0, 10.0, symbol="κ_f", starts=(0.01,), default=0.0,
        doc="imaginary part of the film's index at all wavelengths; 0 of a transparent film",
    )  # fmt: skip
    substrate_eta: Spectrum = param(
        0.01, 50.0, symbol="η_s", scale="log", per_channel=True, starts=(0.2, 1.0, 2.5), default=2.0,
        doc="real part of the substrate's index; titanium 1.9, silicon 4, glass 1.5",
    )  # fmt: skip
    substrate_kappa: Spectrum = param(
        1e-4, 50.0, symbol="κ_s", scale="log", per_channel=True, starts=(0.01, 3.0), default=3.0,
        doc="imaginary part of the substrate's index; metals 2–8, glass 0 (give 0.0001)",
    )  # fmt: skip
    um: tuple[float, ...] = eqx.field(static=True, default=ALONE, kw_only=True)

    def __call__(self, cos_d: Scalar) -> Spectrum:
        """See `film`."""
        lines = len(self.um)
        if others := {np.size(leaf) for leaf in jax.tree.leaves(self)} - {1, lines}:
            raise ModelError(
                f"a film at {lines} wavelength{'s' * (lines > 1)} in a model of {max(others)} channels, expected one "
                "wavelength for each channel. Give model(…, wavelengths=[450, 550, …]), in nm."
            )
        um: Any = np.array(self.um) if lines > 1 else np.float64(self.um[0])
        inner = cauchy(um, self.film_eta, [(self.film_b, -2)]) + 1j * self.film_kappa
        return film(cos_d, um, self.thickness, inner, self.substrate_eta + 1j * self.substrate_kappa)

    def of_channels(self, which: np.ndarray) -> "Film":
        """The same film at some of the wavelengths."""
        several = {f.name: getattr(self, f.name) for f in dataclasses.fields(self) if "param" in f.metadata}
        chosen = {name: value[which] for name, value in several.items() if np.shape(value) == (len(self.um),)}
        return dataclasses.replace(self, **chosen, um=tuple(self.um[k] for k in which))

    def glsl(self) -> str:
        """None: a shader has three colours, which are bands.

        Raises:
            ModelError: always.
        """
        raise ModelError(
            "a thin film is not translated into GLSL: its reflectance is that of single wavelengths, and a shader has "
            "three colours. Export a model with -f82 or -schlick fitted to the same measurements."
        )

    def normal_reflectance(self) -> Spectrum:
        """The reflectance itself at normal incidence."""
        return self(jnp.ones(()))


def film(cos_d: Any, um: Any, thickness: Any, inner: Any, base: Any) -> Any:
    """Unpolarised reflectance of a film in vacuum, (|r_s|² + |r_p|²)/2, r = (r₁ + r₂ e^{2iβ})/(1 + r₁ r₂ e^{2iβ}).

    G. B. Airy 1833, as M. Born & E. Wolf, Principles of Optics, sec. 1.6.4 and 14.4: r₁ and r₂ are Fresnel's amplitudes
    at the upper and the lower face, β = 2π d n cosθ/λ the phase across the film, n² cos²θ = n² − sin²θ_d, for waves
    e^{−iωt} and indices η + iκ.

    Args:
        cos_d: Cosine of the angle of incidence, 0 to 1; arrays, of JAX or NumPy, broadcast.
        um: Wavelength in vacuum, µm.
        thickness: Of the film, nm.
        inner: Index η + iκ of the film, complex.
        base: Index η + iκ of the substrate, complex.
    """
    xp = library(cos_d, thickness, inner, base)
    q1, q2 = _root(xp, cos_d, inner), _root(xp, cos_d, base)
    turned = xp.exp(4j * np.pi * 1e-3 * thickness / um * q1)
    upper, lower = inner**2, base**2
    amplitudes = (
        ((cos_d - q1) / (cos_d + q1), (q1 - q2) / (q1 + q2)),
        ((upper * cos_d - q1) / (upper * cos_d + q1), (lower * q1 - upper * q2) / (lower * q1 + upper * q2)),
    )
    every = [(first + second * turned) / (1.0 + first * second * turned) for first, second in amplitudes]
    return sum(0.5 * (xp.real(r) ** 2 + xp.imag(r) ** 2) for r in every)


def _root(xp: Any, cos_d: Any, index: Any) -> Any:
    """The index times cosθ inside, √(n² − 1 + cos²θ_d); not quite 0, where the root's slope is infinite."""
    square = (index - 1.0) * (index + 1.0) + cos_d**2
    nothing = xp.abs(square) < _TINY
    return xp.sqrt(xp.where(nothing, _TINY, square))


def placed(model: M, wavelengths: ArrayLike, channels: int | None = None) -> M:
    """The model with its films at the wavelengths of its channels.

    Args:
        model: With a film.
        wavelengths: Of each channel in vacuum, (c,), nm.
        channels: How many the model has; None where that is not told.

    Raises:
        FitmatError: a wavelength is none, there are not as many as channels, or the model has no film.
    """
    nm = np.atleast_1d(arguments.numbers("wavelengths", wavelengths))
    if nm.ndim != 1 or not nm.size or not ((nm >= SHORTEST) & (nm <= LONGEST)).all():
        arguments.refuse("wavelengths", wavelengths, f"a list of numbers from {SHORTEST:g} to {LONGEST:g}, nm")
    if len(nm) != (channels or len(nm)):
        raise ModelError(f"{len(nm)} wavelengths and channels = {channels}, expected one wavelength for each channel.")
    if not has_film(model):
        raise ModelError(f"wavelengths beside {model.name}, expected a model with a film, as ggx-film. Leave them out.")
    um = tuple((1e-3 * nm).tolist())
    leaves, structure = jax.tree.flatten(model, is_leaf=_is_film)
    leaves = [dataclasses.replace(part, um=um) if _is_film(part) else part for part in leaves]
    return jax.tree.unflatten(structure, leaves)


def has_film(model: AbstractBRDF) -> bool:
    """Whether one of its lobes has a film."""
    return any(map(_is_film, jax.tree.leaves(model, is_leaf=_is_film)))


def _is_film(part: object) -> bool:
    return isinstance(part, Film)
