"""Belcour's decomposition of the Fresnel curve: Schlick's two terms and two functions found from real materials.

Approximates the exact curves of `terms.fresnel` and measures by how much; it has no exact formula of its own, and does
not integrate against a lobe (its terms c(1−c)ʲ are what makes that possible in closed form).
"""

import dataclasses
from typing import ClassVar

import numpy as np
from jaxtyping import Complex, Float

from fitmat._types import Scalar, Spectrum
from fitmat.models.glsl import number, spectrum
from fitmat.models.parameters import param
from fitmat.models.refractive_index import index
from fitmat.models.terms.fresnel import (
    AbstractFresnel,
    Numbers,
    angle_nodes,
    conductor,
    f0_f82_from_ior,
    f0_from_ior,
    fresnel_glsl,
    hoffman,
    library,
    schlick,
)

TRAINING: tuple[str, ...] = (
    "Au", "Ag", "Cu", "Al", "Cr", "Fe", "Ni", "Co", "Ti", "W", "Pt", "Mo", "Zn", "brass", "steel", "Si", "Ge",
    "N-BK7", "SF11", "fused-silica", "soda-lime", "sapphire", "diamond", "PET", "water", "ice",
)  # fmt: skip
"""The materials whose curves, 400 to 700 nm in steps of 10, the basis was found from; names of `refractive_index`."""

POWERS = np.array([2, 3, 6, 12])
"""The exponents j of the terms c(1−c)ʲ, all 0 at normal incidence and at grazing."""

COEFFICIENTS = np.array(
    [
        [0.4836156685, 1.5168396489, 23.6836574089, 24.0074090609],
        [-3.8491925889, -18.6912615253, 34.5008967849, 43.0657438381],
    ]
)
"""b_k = Σ_j COEFFICIENTS[k, j] c(1−c)^POWERS[j], orthonormal in the angle; made by `fit_basis(spectra())`.

Of refractiveindex.info, release v2026-05-24. To remake them, print that after a change of `TRAINING` or `POWERS`.
"""

NODES = 24
"""Gauss–Legendre nodes in the angle of the projection; exact to 1e-9 for `TRAINING`."""


class Belcour(AbstractFresnel):
    """Belcour, Bati & Barla's decomposition of the exact curve of η + iκ; dielectrics (κ → 0) as well as metals.

    See `belcour` for the formula and its error.
    """

    suffix: ClassVar[str] = "-belcour"
    numbers: ClassVar[tuple[str, ...]] = ("eta", "kappa")
    eta: Spectrum = param(
        0.01, 50.0, symbol="η", scale="log", per_channel=True, starts=(0.2, 1.0, 2.5), default=1.0,
        doc="real part of the index of refraction; gold 0.2 (red), aluminium 1, iron 2.9, glass 1.5",
    )  # fmt: skip
    kappa: Spectrum = param(
        0.001, 50.0, symbol="κ", scale="log", per_channel=True, starts=(0.01, 1.0, 3.0, 7.0), default=3.0,
        doc="imaginary part of the index of refraction; metals 2–8, glass and plastics 0 (give 0.001)",
    )  # fmt: skip

    def __call__(self, cos_d: Scalar) -> Spectrum:
        """See `belcour`."""
        return belcour(cos_d, self.eta, self.kappa)

    def glsl(self) -> str:
        """See `belcour`; its weights are numbers, as the indices are."""
        w, eta, kappa = (
            weights(*map(np.atleast_1d, (self.eta, self.kappa))),
            np.asarray(self.eta),
            np.asarray(self.kappa),
        )
        (first, second), powers = COEFFICIENTS.tolist(), POWERS.tolist()
        sums = (
            " + ".join(f"{number(k)} * pow(1.0 - c, {number(j)})" for k, j in zip(row, powers, strict=True))
            for row in (first, second)
        )
        constants = spectrum("f0", f0_from_ior(eta, kappa)) + spectrum("w0", w[0]) + spectrum("w1", w[1])
        return constants + fresnel_glsl("clamp(schlick(c, f0) + c * ({}) * w0 + c * ({}) * w1, 0.0, 1.0)".format(*sums))

    def normal_reflectance(self) -> Spectrum:
        """((η−1)² + κ²)/((η+1)² + κ²), exact."""
        return f0_from_ior(self.eta, self.kappa)


def basis(cos_d: Numbers | float) -> tuple[Numbers, Numbers]:
    """The two functions b_k(c) at the cosines `cos_d`, any shape."""
    terms = [cos_d * (1.0 - cos_d) ** int(power) for power in POWERS]
    first, second = (sum(float(c) * term for c, term in zip(row, terms, strict=True)) for row in COEFFICIENTS)
    return first, second  # pyright: ignore[reportReturnType]


def weights(eta: Numbers, kappa: Numbers) -> Numbers:
    """w_k = ∫ b_k(cos θ)(F − Schlick)(cos θ) dθ, shape (2, ...) for indices of shape (...); a fixed rule of `NODES`."""
    xp = library(eta, kappa)
    cos = _COSINES.reshape((-1,) + (1,) * max(np.ndim(eta), np.ndim(kappa)))
    return xp.tensordot(_PROJECTION, _residual(xp.asarray(cos), eta, kappa), 1)


def belcour(cos_d: Numbers | float, eta: Numbers, kappa: Numbers) -> Numbers:
    """F0 + (1−F0)(1−c)⁵ + w₀b₀(c) + w₁b₁(c), clipped to [0, 1].

    L. Belcour, M. Bati & P. Barla, "Bringing an accurate Fresnel to real-time rendering: a preintegrable
    decomposition", SIGGRAPH 2020 talks and course: 1 and (1−c)⁵ with weights F0 and 1−F0, and two functions from an
    SVD, which act near grazing only. Theirs are tables made of Gulbrandsen's curves; these are the two leading
    components of what Schlick leaves of measured spectra (`TRAINING`), restricted to four terms c(1−c)ʲ.

    Off by at most 0.01 for metals, 0.006 for glasses and plastics, 0.03 for silicon and germanium (Schlick: 0.20, 0.06,
    0.30). Not for total reflection: with η < 1 and little absorption it is a poor fit, and is cut at 1.
    """
    xp = library(cos_d, eta, kappa)
    w = weights(eta, kappa)
    first, second = basis(cos_d)
    return xp.clip(schlick(cos_d, f0_from_ior(eta, kappa)) + w[0] * first + w[1] * second, 0.0, 1.0)


def spectra(names: tuple[str, ...] = TRAINING) -> Complex[np.ndarray, " n"]:
    """The indices η + iκ of the named materials, 400 to 700 nm in steps of 10, one after another."""
    return np.concatenate([index(name, _VISIBLE) for name in names])


def fit_basis(indices: Complex[np.ndarray, " n"]) -> Float[np.ndarray, "2 4"]:
    """`COEFFICIENTS` from the indices of real materials.

    The residuals F − Schlick at 64 Gauss nodes in the angle, projected on the terms c(1−c)ʲ; of that, the two leading
    right singular vectors, each positive where it is largest.
    """
    cos, angles = angle_nodes(64)
    root = np.sqrt(angles)
    q, r = np.linalg.qr(_terms(cos) * root[:, None])
    residual = _residual(cos, np.real(indices)[:, None], np.imag(indices)[:, None])
    leading = np.linalg.svd(residual * root @ q, full_matrices=False)[2][:2]
    curves = leading @ q.T / root
    sign = np.sign(np.take_along_axis(curves, np.argmax(np.abs(curves), axis=1)[:, None], axis=1))
    return sign * np.linalg.solve(r, leading.T).T


@dataclasses.dataclass(frozen=True)
class ErrorRow:
    """|F − exact| of one approximation for one material, over 0–89.9° and 400–700 nm."""

    material: str
    approximation: str
    worst: float
    mean: float


def error_table() -> list[ErrorRow]:
    """How far Schlick, F82 and Belcour are from the exact equations, for six metals and three glasses.

    Each gets its best parameters from η + iκ at each wavelength: F0; F0 and F82; both. The mean is over equal steps of
    angle and of wavelength.
    """
    cos = np.cos(np.deg2rad(np.linspace(0.0, 89.9, 181)))[:, None]
    rows = []
    for material in ("Au", "Ag", "Cu", "Al", "Cr", "Fe", "N-BK7", "fused-silica", "SF11"):
        value = index(material, _VISIBLE)
        eta, kappa = np.real(value), np.imag(value)
        exact = conductor(cos, eta, kappa)
        f0, f82 = f0_f82_from_ior(eta, kappa)
        curves = {"Schlick": schlick(cos, f0), "F82": hoffman(cos, f0, f82), "Belcour": belcour(cos, eta, kappa)}
        for name, curve in curves.items():
            error = np.abs(curve - exact)
            rows.append(ErrorRow(material, name, float(error.max()), float(error.mean())))
    return rows


def _residual(cos: Numbers, eta: Numbers, kappa: Numbers) -> Numbers:
    """What Schlick leaves of the exact curve."""
    return conductor(cos, eta, kappa) - schlick(cos, f0_from_ior(eta, kappa))


def _terms(cos: np.ndarray) -> Float[np.ndarray, "n 4"]:
    return cos[:, None] * (1.0 - cos[:, None]) ** POWERS


_VISIBLE = np.arange(400.0, 701.0, 10.0)
_COSINES, _ANGLES = angle_nodes(NODES)
_PROJECTION = (COEFFICIENTS @ _terms(_COSINES).T) * _ANGLES
