"""Turquin's lobe by hand with Blender's albedos, in the furnace of one viewer, and against Heitz's walk."""

import jax.numpy as jnp
import numpy as np
import pytest
from oracles import white_facets

import fitmat as fm
from fitmat.maths.directions import from_angles
from fitmat.maths.quadrature import lobe_rule
from fitmat.models.base import AbstractBRDF
from fitmat.models.lobes.turquin import Turquin
from fitmat.models.terms.distributions import GGX, Isotropic
from fitmat.models.terms.fresnel import Schlick, White

BY_HAND = 1e-3
"""Relative; Blender's albedos, of 10⁸ samples a number, enter as (1 − E)/E."""

FURNACE = 2e-4
"""Absolute; the error of E over E itself, and that of the rule."""

SIGMAS = 4.0


def towards_viewer(model: AbstractBRDF, degrees: float, alpha: float) -> np.ndarray:
    """∫ f c_i dω_i: what a viewer sees of light that comes from everywhere."""
    rule = lobe_rule(np.deg2rad(degrees), alpha)
    return rule.weight @ fm.evaluate(model, rule.wo, np.broadcast_to(rule.wi, rule.wo.shape))


def test_the_factor_by_hand() -> None:
    """1 + F0 (1 − E)/E with E at the viewer's cosine 15/31, alpha (22/31)²; whatever the light's direction."""
    alpha, f0 = (22 / 31) ** 2, 0.6
    e = white_facets.CYCLES[15 / 31][4]
    wo = np.tile([np.sqrt(1 - (15 / 31) ** 2), 0, 15 / 31], (3, 1))
    wi = from_angles(np.array([0.0, 0.5, 1.3]), np.array([0.0, 3.0, 1.0]))
    scaled, single = (
        fm.evaluate(fm.model(name, alpha=alpha, f0=f0, ks=0.8), wi, wo)
        for name in ("ggx-turquin-schlick", "ggx-schlick")
    )
    np.testing.assert_allclose(scaled / single, 1 + f0 * (1 - e) / e, rtol=BY_HAND)


@pytest.mark.parametrize("alpha", [0.05, 0.3, 1.0])
def test_a_viewer_sees_a_white_surface_white(alpha: float) -> None:
    white = Turquin(jnp.ones(()), Isotropic(jnp.array(alpha)), White(), GGX())
    for degrees in (0.0, 45.0, 80.0, 89.0):
        assert towards_viewer(white, degrees, alpha)[0] == pytest.approx(1, abs=FURNACE)


def test_both_compensations_are_near_heitz_walk() -> None:
    """Of a coloured metal, alpha 0.6: what single scattering lacks of the walk's albedo they give back to a quarter."""
    alpha, f0, degrees = 0.6, np.array([0.95, 0.6, 0.3]), 60.0
    surface = fm.Surface(GGX(), (alpha, alpha), Schlick(jnp.array(f0)))
    walk = fm.albedo_walk(surface, from_angles(np.deg2rad([degrees]), np.zeros(1)), samples=40_000, seed=1).reflected
    single, kc, turquin = (
        towards_viewer(fm.model(f"ggx{suffix}-schlick", alpha=alpha, f0=f0, channels=3), degrees, alpha)
        for suffix in ("", "-kc", "-turquin")
    )
    error = SIGMAS * walk.standard_error[0]
    for found in (kc, turquin):
        assert np.all(np.abs(found - walk.value[0]) < 0.25 * (walk.value[0] - single) + error)
