"""Means and quantiles of colour differences over pixels: by hand, and by brute force on large pictures."""

import numpy as np
import pytest

import fitmat as fm
from fitmat.colour.channels import colouring
from fitmat.colour.differences import delta_e_2000, delta_e_itp
from fitmat.colour.spaces import shown
from fitmat.match.appearance import finer, scene
from fitmat.match.appearance.spheres import perceived
from fitmat.match.appearance.spread import Seen, spread
from fitmat.models.parameters import vector


def _alike(delta: np.ndarray, share: np.ndarray) -> Seen:
    """Pixels whose parts are as they are."""
    return Seen(delta, share, (delta[0], share), (delta[0], share))


def test_the_worst_twentieth_is_of_the_lit_area() -> None:
    """ΔE of 0 to 99 on even areas, then on areas that grow with it; what is unlit does not count."""
    delta = np.array([np.r_[np.arange(100.0)[::-1], 1000.0]])
    even = spread([_alike(delta, np.r_[np.full(100, 0.01), 0.0])])
    assert (even.mean.value, even.worst_twentieth.value, even.largest.value) == pytest.approx((49.5, 94.5, 99.0))
    growing = spread([_alike(delta, np.r_[np.arange(1.0, 101.0)[::-1], 0.0] / 5050)])
    assert growing.worst_twentieth.value == pytest.approx(
        np.sqrt(0.95 * 10100) - 1, abs=0.01
    )  # area below x: (x + 1)²/2


@pytest.mark.parametrize("light", [*scene.LIGHTS.values(), None])
def test_parts_of_pixels_keep_the_area_and_follow_a_straight_line(light: tuple[float, float] | None) -> None:
    """The cosine to the viewer is smooth: its parts lie on its own curve, but where a ring crosses the meridian."""
    around = scene.surrounded(0.1, isotropic=True) if light is None else scene.lit(0.1, *light, isotropic=True)
    screen = around.screen
    values = screen.normals.reshape(-1, 3)[:, 2:]
    found, area = finer.divided(screen, values)
    assert area.sum() == pytest.approx(np.asarray(screen.area).sum(), rel=1e-12)
    whole, parts = np.asarray(screen.area).ravel() @ values[:, 0], area @ found[:, 0]
    assert parts == pytest.approx(whole, rel=5e-3)
    coarse, means = finer.halved(screen, values)
    assert np.asarray(coarse.area).sum() == pytest.approx(np.asarray(screen.area).sum(), rel=1e-12)
    assert np.asarray(coarse.area).ravel() @ means[:, 0] == pytest.approx(whole, rel=2e-2)


PHONG, BLINN = "lambert+phong", "lambert+blinn-phong"
PAIRS = {
    "satin": ((BLINN, {"kd": 0.2, "ks": 0.045, "exponent": 80.0}), ("lambert+ggx", {"kd": 0.2, "alpha": 0.15})),
    "gloss": ((BLINN, {"kd": 0.3, "ks": 0.04, "exponent": 3000.0}), ("lambert+ggx", {"kd": 0.3, "alpha": 0.03})),
    "matte": ((PHONG, {"kd": 0.5, "ks": 0.02, "exponent": 10.0}), ("oren-nayar", {})),
    "metal": (("phong", {"ks": 0.7, "exponent": 20.0}), ("ggx-schlick", {"alpha": 0.3, "f0": 0.7})),
    "hazy": ((PHONG, {"kd": 0.05, "ks": 0.04, "exponent": 400.0}), ("lambert+beckmann", {"kd": 0.05, "alpha": 0.07})),
}
"""Two models each that differ in another way."""


@pytest.mark.study
@pytest.mark.parametrize("name", PAIRS)
def test_the_worst_twentieth_is_that_of_every_pixel_of_a_large_picture(name: str) -> None:
    """By brute force: 1000² pixels in a plain square grid, none of the rules of `scene`; within what `rule` states."""
    one, other = (fm.model(model, **values) for model, values in PAIRS[name])
    found = perceived(one, other, (vector(one)[None], vector(other)[None]), ("value",), pictures=False)
    middle = (np.arange(1000) + 0.5) / 500.0 - 1.0
    x, y = (part.ravel() for part in np.meshgrid(middle, middle))
    inside = x * x + y * y < 1.0 - scene.GRAZING**2
    normals = np.stack([x, y, np.sqrt(np.maximum(1.0 - x * x - y * y, 0.0))], axis=1)[inside]
    grey = colouring(("value",)).weights
    for lighting in found.lightings[:3]:
        angle, turn = np.deg2rad(scene.LIGHTS[lighting.name])
        light = np.array([np.sin(angle) * np.cos(turn), np.sin(angle) * np.sin(turn), np.cos(angle)])
        lit = normals[normals @ light > scene.GRAZING]
        across = np.cross(lit, light)
        across /= np.maximum(np.linalg.norm(across, axis=1, keepdims=True), 1e-12)
        axes = np.stack([np.cross(across, lit), across, lit], axis=1)
        wi, wo = axes @ light, axes @ [0.0, 0.0, 1.0]
        seen = [np.asarray(fm.evaluate(m, wi, wo))[:, :1] @ grey * wi[:, 2:] for m in (one, other)]
        exposure = 0.18 / seen[1][:, 1].mean()
        pairs = [exposure * xyz for xyz in seen]
        for spread_of, delta in (
            (lighting.delta_e_2000, delta_e_2000(*map(shown, pairs))),
            (lighting.delta_e_itp, delta_e_itp(*pairs)),
        ):
            assert spread_of.worst_twentieth.value == pytest.approx(np.quantile(delta, 0.95), abs=spread_of.rule)
            assert spread_of.mean.value == pytest.approx(delta.mean(), rel=0.02)
            assert spread_of.rule < 0.1 * spread_of.worst_twentieth.value + 0.01 * spread_of.largest.value
