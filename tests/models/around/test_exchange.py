"""Coats over bases that mirror, against photons followed one by one, and what must hold at the ends of everything."""

import functools
from types import ModuleType
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from oracles import coat_photons, mitsuba_slab
from selection import always

import fitmat as fm
from fitmat._types import Scalar, Spectrum, Vec3
from fitmat.maths.directions import from_angles
from fitmat.maths.programs import UNFUSED
from fitmat.models.albedo import albedo
from fitmat.models.around.coat import RoughCoat, SmoothCoat
from fitmat.models.around.varnish import Varnish
from fitmat.models.base import AbstractBRDF, AbstractSpecular, evaluate_pairs
from fitmat.models.laws import singular
from fitmat.models.lobes.lambert import Lambert
from fitmat.models.lobes.microfacet import Microfacet
from fitmat.models.parameters import entries, vector, with_vector
from fitmat.models.terms.distributions import GGX, Isotropic
from fitmat.models.terms.fresnel import AbstractFresnel, Schlick, White

BIAS = 0.005
"""Absolute, of an albedo beside three standard errors: 10 + 5 cosines, 8 azimuths and 16 distances."""

SHARE = 0.01
"""Relative, where three standard errors are less: what the issue of coats asks for."""

PHOTONS = 3000
SEED = 20261129


def facets(alpha: float, f0: float) -> Microfacet:
    fresnel: AbstractFresnel = White() if f0 == 1.0 else Schlick(jnp.array(f0))
    return Microfacet(jnp.ones(()), Isotropic(jnp.array(alpha)), fresnel, GGX())


def separable(alpha: float, share: float) -> Microfacet:
    """Facets that all reflect the same share, with Mitsuba's masking."""
    return Microfacet(jnp.array(share), Isotropic(jnp.array(alpha)), White(), GGX(), "separable")


def varnished(base: AbstractBRDF, eta: float = 1.5, depth: float = 0.0) -> Varnish:
    return Varnish(SmoothCoat(jnp.array(eta), jnp.array(depth)), base)


def rough(base: AbstractBRDF, eta: float, alpha: float, depth: float = 0.0) -> Varnish:
    return Varnish(RoughCoat(jnp.array(eta), jnp.array(alpha), jnp.array(depth)), base)


def reflected(model: AbstractBRDF, degrees: list[float]) -> np.ndarray:
    """Albedo with the mirror image."""
    theta = np.deg2rad(degrees)
    image = [np.ravel(model.mirror(jnp.array(w)))[0] for w in from_angles(theta, 0 * theta)]
    return albedo(model, theta).value[:, 0] + np.array(image)


PUBLISHED = {(0.05, 60.0): 0.977, (0.2, 60.0): 0.824, (0.5, 0.0): 0.519}
"""(alpha, degrees) → albedo of white GGX under varnish, eta 1.5, by a photon program of another author."""


@pytest.mark.parametrize("at", always({(0.2, 60.0)}, PUBLISHED))
def test_what_is_totally_reflected_comes_back(at: tuple[float, float]) -> None:
    alpha, degrees = at
    assert reflected(varnished(facets(alpha, 1.0)), [degrees])[0] == pytest.approx(PUBLISHED[at], abs=BIAS)


@pytest.mark.parametrize("f0", always(set(), [1.0, 0.5, 0.04]))
@pytest.mark.parametrize("alpha", [0.05, 0.2, 0.5])
def test_coats_over_metals_keep_the_energy_that_photons_keep(f0: float, alpha: float) -> None:
    """Four angles of incidence; a coat that absorbs as well."""
    degrees, base = [0.0, 30.0, 60.0, 80.0], coat_photons.Facets(alpha, coat_photons.schlick(f0))
    for depth in (0.0, 0.2):
        ours = reflected(varnished(facets(alpha, f0), depth=depth), degrees)
        for angle, value in zip(np.deg2rad(degrees), ours, strict=True):
            mean, error = coat_photons.albedo(base, angle, 1.5, depth=depth, count=PHOTONS, seed=SEED)
            assert abs(value - mean) < BIAS + 3 * error, np.rad2deg(angle)


UNDER = {
    "grey": (Lambert(jnp.array(0.5)), coat_photons.Lambert(0.5)),
    "metal": (facets(0.2, 0.73), coat_photons.Facets(0.2, coat_photons.schlick(0.73))),
    "white": (facets(0.2, 1.0), coat_photons.Facets(0.2, coat_photons.schlick(1.0))),
}

FACES = [(0.1, 1.5, 0.0), (0.3, 1.5, 0.0), (1.0, 1.5, 0.0), (0.2, 1.42, 0.0), (0.65, 1.25, 0.1), (0.4, 1.8, 0.3)]
"""(alpha, eta, depth): three of the table, and three between the points that were tabulated."""


@pytest.mark.parametrize("base", always({"grey"}, UNDER))
@pytest.mark.parametrize("face", always({(0.3, 1.5, 0.0)}, FACES))
def test_rough_coats_keep_the_energy_that_photons_keep(base: str, face: tuple[float, float, float]) -> None:
    """Every order of reflection and refraction at the rough face, over a grey body, a metal and white facets."""
    degrees, (ours, theirs), (alpha, eta, depth) = [0.0, 60.0, 80.0], UNDER[base], face
    found = reflected(rough(ours, eta, alpha, depth), degrees)
    for angle, value in zip(np.deg2rad(degrees), found, strict=True):
        mean, error = coat_photons.rough_albedo(theirs, angle, eta, alpha, depth=depth, count=4 * PHOTONS, seed=SEED)
        assert abs(value - mean) < max(SHARE * mean, 3 * error), np.rad2deg(angle)


SLABS: dict[str, tuple[AbstractBRDF, dict[str, Any]]] = {
    "grey": (Lambert(jnp.array(0.5)), mitsuba_slab.DIFFUSE),
    "white": (separable(0.2, 1.0), mitsuba_slab.facets(0.2, 1.0)),
    "golden": (separable(0.5, 0.73), mitsuba_slab.facets(0.5, 0.73)),
}


@pytest.mark.study
@pytest.mark.parametrize("base", SLABS)
def test_smooth_coats_reflect_what_mitsuba_traces_between_two_planes(mitsuba: ModuleType, base: str) -> None:
    """A polished face over three bases, from four directions."""
    degrees, (ours, theirs) = [0.0, 30.0, 60.0, 80.0], SLABS[base]
    for angle, value in zip(np.deg2rad(degrees), reflected(varnished(ours), degrees), strict=True):
        mean, error = mitsuba_slab.albedo(mitsuba, theirs, angle, 1.5, None, count=80 * PHOTONS, seed=SEED)
        assert error < SHARE * mean / 3
        assert abs(value - mean) < max(SHARE * mean, 3 * error), np.rad2deg(angle)


PEAKS = {
    (0.05, 0.0): 0.01,
    (0.05, 60.0): 0.03,
    (0.2, 0.0): 0.02,
    (0.2, 30.0): 0.02,
    (0.2, 60.0): 0.05,
    (0.5, 60.0): 0.08,
}
"""(alpha, degrees) → relative, of the value in the mirror direction over facets with F0 = 0.9; where the light is
raised and where it is spread is an approximation."""


@pytest.mark.parametrize(("alpha", "degrees"), PEAKS)
def test_the_peak_of_a_lacquered_metal_is_that_of_photons(alpha: float, degrees: float) -> None:
    theta = np.deg2rad([max(degrees, 0.1)])
    wi, wo = from_angles(theta, 0 * theta), from_angles(theta, 0 * theta + np.pi)
    base = coat_photons.Facets(alpha, coat_photons.schlick(0.9))
    mean, error = coat_photons.value(base, wi, wo, 1.5, count=20_000, seed=SEED)
    ours = np.asarray(jax.jit(evaluate_pairs)(varnished(facets(alpha, 0.9)), wi, wo))[0, 0]
    assert abs(ours / mean[0] - 1) < PEAKS[alpha, degrees] + 3 * error[0] / mean[0]


class AlmostMirror(AbstractSpecular):
    """GGX facets that keep every photon: the single scattering over its own albedo at normal incidence."""

    alpha: float = 0.003

    @property
    def name(self) -> str:
        return "almost-mirror"

    def __call__(self, wi: Vec3, wo: Vec3) -> Spectrum:
        return facets(self.alpha, 1.0)(wi, wo)

    def width(self) -> Scalar:
        return jnp.array(self.alpha)


KEEPING = {
    "a mirror": AlmostMirror(),
    "eon": fm.model("eon", kd=1.0, r=0.8),
    "a coat": varnished(Lambert(jnp.ones(())), 1.3),
}


@pytest.mark.parametrize("base", always({"a mirror"}, KEEPING))
def test_a_coat_over_what_keeps_all_keeps_all(base: str) -> None:
    """Facets so smooth that they lose 0.005, a diffuse base that is none of Lambert's, and a coat over white."""
    np.testing.assert_allclose(reflected(varnished(KEEPING[base]), [0.0, 40.0, 75.0]), 1.0, atol=0.006)


NARROW = [(1.05, 0.03), (1.05, 1.0), (2.5, 0.03)]
"""(eta, alpha) where what a narrow lobe sends out through a rough face changes within few degrees."""


@pytest.mark.parametrize("face", always(set(), NARROW))
def test_narrow_white_facets_under_a_rough_face_keep_the_light_and_no_more(face: tuple[float, float]) -> None:
    """Facets of slope 0.02 lose 0.001 up to 60° and 0.03 at 85°; a coat shows them at less grazing angles."""
    found = reflected(rough(facets(0.02, 1.0), *face), [0.0, 17.0, 35.0, 51.0, 60.0, 75.0, 85.0])
    assert (found < 1.0 + SHARE).all()
    assert (found > 0.97).all()


@pytest.mark.study
def test_the_mirror_image_of_a_coat_below_goes_back_and_forth() -> None:
    """Two polished faces over black, eta_1 then eta_2/eta_1 relative: F + T² p/(1 − p F), as two plates."""
    model, wi = varnished(varnished(Lambert(jnp.zeros(())), 1.4)), np.array([0.6, 0.0, 0.8])
    below = np.array([0.4, 0.0, np.sqrt(1 - 0.16)])
    first, _ = coat_photons.interface(wi[2:], 1.5)
    second, _ = coat_photons.interface(below[2:], 1.4)
    by_hand = first + (1 - first) ** 2 * second / (1 - second * first)
    assert float(model.mirror(jnp.array(wi))[0]) == pytest.approx(by_hand[0], rel=1e-12)
    assert albedo(model, np.array([0.5])).value[0, 0] == pytest.approx(0.0, abs=1e-12)


def test_a_base_that_reflects_more_than_it_receives_stays_finite() -> None:
    """Weight 10: the lobe is ten times as bright, and what is exchanged is that of a white base."""
    lobe: dict[str, Any] = {"alpha": 0.2, "f0": 0.9}
    bright, white = (fm.model("varnish-over-ggx-schlick", ks=ks, **lobe) for ks in (10.0, 1.0))
    many, one = (reflected(model, [0.0, 60.0, 85.0]) for model in (bright, white))
    assert np.all(np.isfinite(many))
    assert np.all((one < many) & (many < 12))


ENDS: list[dict[str, float]] = [
    {"eta": 1.0, "alpha": 1e-4}, {"eta": 1.0 + 1e-12, "alpha": 0.3}, {"eta": 1.0001, "alpha": 1.0},
    {"eta": 3.0, "alpha": 1e-4}, {"eta": 3.0, "alpha": 1.0, "f0": 0.999}, {"depth": 100.0}, {"depth": 0.0, "ks": 10.0},
    {"ks": 0.0},
]  # fmt: skip

NESTED = varnished(rough(facets(0.2, 0.9), 1.3, 0.2, 0.1), depth=0.1)

COATED = {
    "rough over a metal": rough(facets(0.2, 0.9), 1.5, 0.2, 0.1),
    "smooth over a metal": varnished(facets(0.2, 0.9), depth=0.1),
    "smooth over rough over a metal": NESTED,
    "smooth over smooth over a metal": varnished(varnished(facets(0.2, 0.9)), 1.3),
}


@pytest.mark.parametrize("name", always(set(), COATED))
def test_values_and_slopes_are_finite_at_all_ends(name: str) -> None:
    """Every parameter at its end in all coats and lobes at once; grazing, normal and singular pairs."""
    model = COATED[name]
    wi, wo = (jnp.array(np.array(column)) for column in zip(*singular().values(), strict=True))
    found = entries(model)

    @functools.partial(jax.jit, compiler_options=UNFUSED)
    def both(point: jax.Array) -> Any:
        def total(point: jax.Array, wi: jax.Array, wo: jax.Array) -> jax.Array:
            return jnp.sum(evaluate_pairs(with_vector(model, point), wi, wo))

        return jax.value_and_grad(total, argnums=(0, 1, 2))(point, wi, wo)

    for end in ENDS:
        point = np.array(vector(model))
        for entry in found:
            point[entry.place] = end.get(entry.name.rpartition(".")[2], point[entry.place])
        for leaf in jax.tree.leaves(both(jnp.array(point))):
            assert np.isfinite(leaf).all(), end


def test_thick_absorbing_coats_hide_the_base() -> None:
    """At 100 only the mirror is left; at 0 nothing is lost over white."""
    black = reflected(varnished(facets(0.3, 0.9), depth=100.0), [0.0, 60.0])
    np.testing.assert_allclose(black, coat_photons.interface(np.array([1.0, 0.5]), 1.5)[0], rtol=1e-9)
