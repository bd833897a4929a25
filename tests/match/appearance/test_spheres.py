"""What an eye sees: spheres by hand, by brute force on even grids of pixels, and as Mitsuba 3 renders them."""

import dataclasses
from types import ModuleType

import numpy as np
import pytest
from oracles import ggx

import fitmat as fm
from fitmat.match.appearance import scene
from fitmat.match.appearance.spheres import Lighting, Perceived, Pictures, perceived
from fitmat.match.appearance.spread import Spread
from fitmat.models.base import AbstractBRDF, evaluate
from fitmat.models.parameters import vector
from fitmat.reports import plot
from fitmat.uncertainty.estimate import Estimate

EVEN = 3e-3
"""Relative; an even grid of 1500 × 1500 pixels has a jagged edge."""

RANKED = 0.05
"""Relative; quantiles between the ranks of the 1152 pixels of a light."""

HALVES, CORNERS = 2e-4, 2e-3
"""Relative, of the light and of the area; 96 rings meet the edge of the lune and its corners with a kink."""

HORIZON = 0.015
"""Relative; 64 × 24 nodes meet the jump of the sky at the horizon."""

NARROW = 2e-3
"""Relative; 96 rings over a highlight of α = 0.001, midpoints of 4000 × 60 in the brute force."""

COARSE = 0.01
"""Relative; the exposure by 12 rings and 32 × 12 nodes, as for anisotropic models, against 24 and 64 × 24."""

PIXEL = 0.03, 0.002
"""sRGB from 0 to 1, largest and mean, up to 3 pixels from the edge and the night: Mitsuba's 64 samples a pixel in
single precision, and linear interpolation here."""

ALPHA, ETA, KAPPA = 0.2, 1.5, 2.9


def drawn_of(lighting: Lighting) -> Pictures:
    """The pictures, which were asked for."""
    assert lighting.pictures is not None
    return lighting.pictures


def alone(one: AbstractBRDF, other: AbstractBRDF) -> Perceived:
    """Two models that are certain."""
    return perceived(one, other, (vector(one)[None], vector(other)[None]), ("value",))


@pytest.fixture(scope="module")
def greys() -> Perceived:
    """Albedos 0.3 ± 0.01 and 0.25, of which the draws know the first only."""
    one, other = fm.model("lambert", kd=0.3), fm.model("lambert", kd=0.25)
    draws = np.array([[0.3], [0.29], [0.31], [0.3]]), np.full((4, 1), 0.25)
    return perceived(one, other, draws, ("value",))


@pytest.fixture(scope="module")
def metal() -> Perceived:
    rough = fm.model("ggx-conductor", alpha=ALPHA, eta=ETA, kappa=KAPPA, masking="separable")
    return alone(fm.model("lambert", kd=0.5), rough)


def direction(angle: float, azimuth: float) -> np.ndarray:
    return ggx.hemisphere(np.deg2rad(angle), np.deg2rad(azimuth))


def even_pixels(count: int, light: np.ndarray) -> np.ndarray:
    """n·l of the pixels of an even grid that are seen and lit at 3° or more."""
    middle = (np.arange(count) + 0.5) * 2 / count - 1
    x, y = np.meshgrid(middle, middle)
    z = np.sqrt(np.maximum(1 - x * x - y * y, 0.0))
    cos = x * light[0] + y * light[1] + z * light[2]
    least = np.cos(np.deg2rad(87))
    return cos[(z > least) & (cos > least)]


@pytest.mark.parametrize("name", scene.LIGHTS)
def test_grey_spheres_look_as_different_as_on_an_even_grid(greys: Perceived, name: str) -> None:
    """Greys differ by ΔL*/S_L (Sharma et al. 2005, eqs. 15 and 22), L* = 116 ∛Y − 16."""
    found = next(lighting for lighting in greys.lightings if lighting.name == name)
    cos = even_pixels(1500, direction(*scene.LIGHTS[name]))
    assert found.exposure == pytest.approx(0.18 / (0.25 / np.pi * cos.mean()), rel=EVEN)
    reference = 0.18 * cos / cos.mean()

    def lightness(y: np.ndarray) -> np.ndarray:
        return np.where(y > (6 / 29) ** 3, 116 * np.cbrt(y) - 16, (29 / 3) ** 3 * y)

    for albedo, got in ((0.3, "value"), (0.31, "high")):
        one, other = (lightness(np.minimum(factor * reference, 1.0)) for factor in (albedo / 0.25, 1.0))
        square = ((one + other) / 2 - 50) ** 2
        delta = np.sort(np.abs(one - other) / (1 + 0.015 * square / np.sqrt(20 + square)))
        if got == "value":
            assert found.delta_e_2000.mean.value == pytest.approx(delta.mean(), rel=EVEN)
            assert found.delta_e_2000.worst_twentieth.value == pytest.approx(np.quantile(delta, 0.95), rel=RANKED)
            assert found.delta_e_2000.largest.value == pytest.approx(delta[-1], rel=RANKED)
        else:
            low, high = found.delta_e_2000.mean.ci95
            assert low < found.delta_e_2000.mean.value < high < delta.mean() * (1 + EVEN)
            assert high > found.delta_e_2000.mean.value + 0.9 * (delta.mean() - found.delta_e_2000.mean.value)


def test_all_lightings_have_the_same_share(greys: Perceived) -> None:
    for together, name in ((greys.delta_e_2000, "delta_e_2000"), (greys.delta_e_itp, "delta_e_itp")):
        each = [getattr(lighting, name) for lighting in greys.lightings]
        assert together.mean.value == pytest.approx(np.mean([spread.mean.value for spread in each]))
        assert together.largest.value == pytest.approx(max(spread.largest.value for spread in each))


@pytest.mark.parametrize("name", scene.LIGHTS)
def test_light_that_a_lambertian_sphere_sends_back(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """∫ c_i c_o dω over what is seen and lit = (2/3)(sin β + (π − β) cos β); its area on the screen π(1 + cos β)/2."""
    monkeypatch.setattr(scene, "GRAZING", 0.0)
    spot = scene.lit(0.1, *scene.LIGHTS[name], isotropic=True)
    beta, area = np.deg2rad(scene.LIGHTS[name][0]), np.asarray(spot.screen.area).ravel()
    assert area.sum() == pytest.approx(np.pi * (1 + np.cos(beta)) / 2, rel=CORNERS)
    sent = area @ np.asarray(spot.wi)[:, 2]
    assert sent == pytest.approx(2 / 3 * (np.sin(beta) + (np.pi - beta) * np.cos(beta)), rel=HALVES)


@pytest.mark.parametrize("isotropic", [True, False])
def test_pixels_see_the_light_and_the_viewer_where_they_are(isotropic: bool) -> None:
    """The angles at each normal, both axes of the tangent field, and the highlight's centre."""
    light = direction(60, 150)
    spot = scene.lit(0.1, 60.0, 150.0, isotropic=isotropic)
    n = np.asarray(spot.screen.normals).reshape(-1, 3)
    parallel = np.stack([n[:, 2], 0 * n[:, 0], -n[:, 0]], axis=1)
    parallel /= np.linalg.norm(parallel, axis=1, keepdims=True)
    for found, w in ((spot.wi, light), (spot.wo, np.array([0.0, 0.0, 1.0]))):
        expected = np.stack([parallel @ w, np.cross(n, parallel) @ w, n @ w], axis=1)
        np.testing.assert_allclose(found, expected, atol=1e-12)
    middle = light + np.array([0, 0, 1])
    np.testing.assert_allclose(n[0], middle / np.linalg.norm(middle), atol=1e-3)


def test_a_narrow_highlight_is_resolved() -> None:
    """∫ f c_i c_o dω of α = 0.001 in the side light, by midpoints in ln θ and φ about the mirroring normal."""
    spot = scene.lit(0.001, *scene.LIGHTS["side light"], isotropic=True)
    f = fm.evaluate(fm.model("ggx", alpha=0.001, eta=ETA), spot.wi, spot.wo)[:, 0]
    found = np.asarray(spot.screen.area).ravel() @ (f * np.asarray(spot.wi)[:, 2])
    log, phi = np.linspace(np.log(1e-6), np.log(1.0), 4001), (np.arange(60) + 0.5) * np.pi / 60
    theta = np.exp((log[1:] + log[:-1]) / 2)[:, None]
    viewer, light = np.array([0.5, 0, np.sqrt(0.75)]), np.array([-0.5, 0, np.sqrt(0.75)])
    n = ggx.hemisphere(theta, phi)
    ci, co = n @ light, n @ viewer
    seen = (ci > 0) & (co > 0)
    h = np.cos(np.broadcast_to(theta, ci.shape))
    tan2 = 1 / h**2 - 1
    d = 0.001**2 / (np.pi * h**4 * (0.001**2 + tan2) ** 2)
    masks = [(np.sqrt(1 + 0.001**2 * (1 / np.maximum(c, 1e-3) ** 2 - 1)) - 1) / 2 for c in (ci, co)]
    radiance = ggx.fresnel(np.sqrt(0.75), ETA) * d / (1 + masks[0] + masks[1]) / (4 * ci * co)
    solid = theta * (log[1] - log[0]) * np.sin(theta) * 2 * np.pi / 60
    assert found == pytest.approx(np.sum(np.where(seen, radiance * ci * co * solid, 0.0)), rel=NARROW)


def _sky(model: AbstractBRDF) -> tuple[scene.Surrounded, np.ndarray, np.ndarray]:
    """The environment's pixels, their radiance and their irradiance, (rings, pixels)."""
    around = scene.surrounded(float(model.width()), isotropic=True)
    f = evaluate(model, around.wi.reshape(-1, 3), around.wo.reshape(-1, 3)).reshape(around.wi.shape[:2])
    return around, np.einsum("sjk,sk->sj", around.light, f), around.light.sum(axis=2)


def environment(w: np.ndarray) -> np.ndarray:
    """The radiance as the docstrings of `scene` say it."""
    total = np.where(w[..., 1] > 0, (1 + 2 * w[..., 1]) / 3, 0.2 * 7 / 9)
    return total + sum(10 * np.exp(20 * (w @ direction(*where) - 1)) for where in ((50, 135), (120, 20)))


@pytest.mark.parametrize("alpha", [0.02, 0.1, 0.3, 0.8])
def test_the_environment_in_ggx_is_as_by_brute_force(alpha: float) -> None:
    """Mean of L_e F G2/G1 over 90,000 visible normals of Heitz's map, for normals in all directions of the screen."""
    around, found, _ = _sky(fm.model("ggx", alpha=alpha, eta=ETA))
    t, u2 = (part.ravel() for part in np.meshgrid(*[(np.arange(300) + 0.5) / 300] * 2))
    normals = np.asarray(around.screen.normals).reshape(len(found), -1, 3)
    for ring, pixel in ((2, 5), (12, 12), (12, 27), (19, 1), (21, 20)):
        n = normals[ring, pixel]
        across = np.cross([0.0, 0.0, 1.0], n) / np.linalg.norm(n[:2])
        to_viewer = np.cross(n, across)  # away from the viewer's side, so that the viewer is at −x
        view = np.array([to_viewer[2], 0.0, n[2]])
        h = ggx.visible_normals(view, alpha, 1 - (1 - t) ** 2, u2)
        cos = h @ view
        wi = 2 * cos[:, None] * h - view
        up = wi[:, 2] > 1e-9
        masks = 1 + ggx.smith(view, alpha)
        share = 2 * (1 - t[up]) * ggx.fresnel(cos[up], ETA) * masks / (masks + ggx.smith(wi[up], alpha))
        brute = np.sum(share * environment(wi[up] @ np.stack([to_viewer, across, n]))) / len(up)
        assert found[ring, pixel] == pytest.approx(brute, rel=HORIZON)


def irradiance(n: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """On normals that lean by t from upright, sky and ground by hand, windows over the whole sphere; where this holds.

    π(1 + cos t)/6 + (4/9)(sin t + (π − t) cos t) of the sky and π(1 − cos t)/2 times the ground's radiance; a window
    well above the pixel's horizon adds (n·c) 2π L (1/κ − 1/κ²), one well below it nothing.
    """
    cos = n[..., 1]
    t = np.arccos(cos)
    total = np.pi * (1 + cos) / 6 + 4 / 9 * (np.sin(t) + (np.pi - t) * cos) + 0.2 * 7 / 9 * np.pi * (1 - cos) / 2
    clear = np.ones(cos.shape, bool)
    for where in ((50, 135), (120, 20)):
        height = n @ direction(*where)
        total += np.maximum(height, 0.0) * 2 * np.pi * 10 * (1 / 20 - 1 / 400)
        clear &= np.abs(height) > 0.6
    return total, clear


def test_the_environment_on_a_lambertian_sphere(greys: Perceived) -> None:
    """The irradiance of the pixels, and the picture at its own."""
    around, _, found = _sky(fm.model("ggx", alpha=0.3, eta=ETA))
    total, clear = irradiance(np.asarray(around.screen.normals).reshape(*found.shape, 3))
    assert clear.sum() > 20
    np.testing.assert_allclose(np.asarray(found)[clear], total[clear], rtol=HORIZON)
    middle = (np.arange(72) + 0.5) / 36 - 1
    x, y = np.meshgrid(middle, -middle)
    inner = np.hypot(x, y) < 0.9
    n = np.stack([x, y, np.sqrt(np.maximum(1 - x * x - y * y, 0.0))], axis=-1)[inner]
    total, clear = irradiance(n)
    lighting = greys.lightings[-1]
    encoded = 1.055 * (lighting.exposure * 0.25 / np.pi * total[clear]) ** (1 / 2.4) - 0.055
    np.testing.assert_allclose(drawn_of(lighting).microfacet[inner][clear][:, 1], encoded, rtol=HORIZON)


def test_the_same_model_twice_looks_the_same() -> None:
    one = fm.model("lambert+ggx", kd=0.2, alpha=0.1)
    found = alone(one, one)
    for alike in (found.delta_e_2000, found.delta_e_itp):
        assert alike.largest == Estimate(0.0, (0.0, 0.0))
    assert all(np.nanmax(drawn_of(lighting).difference) == 0.0 for lighting in found.lightings)
    assert (
        found.words
        == "On a lit sphere an eye would see no difference (ΔE2000 0.0 on average, 0.0 in the worst twentieth)."
    )


def test_an_anisotropic_model_of_equal_slopes_is_the_isotropic_one(metal: Perceived) -> None:
    """The other rules of pixels and directions, with their own frames."""
    values = {"alpha_x": ALPHA, "alpha_y": ALPHA, "eta": ETA, "kappa": KAPPA, "masking": "separable"}
    found = alone(fm.model("lambert", kd=0.5), fm.model("ggx-aniso-conductor", **values))
    for lighting, other in zip(found.lightings, metal.lightings, strict=True):
        assert lighting.exposure == pytest.approx(other.exposure, rel=COARSE)
        assert lighting.delta_e_2000.mean.value == pytest.approx(other.delta_e_2000.mean.value, rel=COARSE)


@pytest.mark.parametrize("name", scene.LIGHTS)
def test_pictures_are_those_of_mitsuba(mitsuba: ModuleType, metal: Perceived, name: str) -> None:
    """An orthographic rendering under a directional light of irradiance 1, exposed alike, clipped, encoded as sRGB."""
    mi, lighting = mitsuba, next(lighting for lighting in metal.lightings if lighting.name == name)
    size = len(drawn_of(lighting).difference)
    away = mi.ScalarTransform4f().look_at(origin=[0, 0, 5], target=[0, 0, 0], up=[0, 1, 0])
    film = {"type": "hdrfilm", "width": size, "height": size, "rfilter": {"type": "box"}, "component_format": "float32"}
    bsdfs = {
        "empirical": {"type": "diffuse", "reflectance": 0.5},
        "microfacet": {"type": "roughconductor", "alpha": ALPHA, "eta": ETA, "k": KAPPA, "distribution": "ggx"},
    }
    x, y = np.meshgrid(*[(np.arange(size) + 0.5) * 2 / size - 1] * 2)
    z = np.sqrt(np.maximum(1 - x * x - y * y, 0))
    light = direction(*scene.LIGHTS[name])
    inner = (np.hypot(x, y) < 1 - 3 * 2 / size) & (np.abs(x * light[0] - y * light[1] + z * light[2]) > 0.15)
    for which, bsdf in bsdfs.items():
        world = {
            "type": "scene",
            "integrator": {"type": "direct"},
            "sensor": {"type": "orthographic", "to_world": away, "film": film},
            "ball": {"type": "sphere", "bsdf": bsdf},
            "light": {"type": "directional", "direction": (-light).tolist(), "irradiance": 1.0},
        }
        rendered = np.array(mi.render(mi.load_dict(world), spp=64, seed=1))[..., 1].astype(float)
        linear = np.clip(lighting.exposure * rendered, 0.0, 1.0)
        encoded = np.where(linear > 0.0031308, 1.055 * linear ** (1 / 2.4) - 0.055, 12.92 * linear)
        off = np.abs(getattr(drawn_of(lighting), which)[..., 1] - encoded)[inner]
        assert off.max() < PIXEL[0]
        assert off.mean() < PIXEL[1]


@pytest.mark.parametrize(
    ("interval", "words"),
    [
        ((0.5, 0.9), "see no difference (ΔE2000"),
        ((1.5, 2.9), "hardly see a difference, most under the "),
        ((3.1, 4.0), "clearly see a difference, most under the "),
        ((0.1, 38.7), "see no difference or clearly see a difference, which the data leave open, most under the "),
    ],
)
def test_the_sentence_says_every_word_of_the_interval(
    greys: Perceived, interval: tuple[float, float], words: str
) -> None:
    """As that of the distance does: the last is of a fit that determines nothing, which is 0.1 or 38.7."""
    e = Estimate(sum(interval) / 2, interval)
    found = dataclasses.replace(greys)
    vars(found)["delta_e_2000"] = Spread(e, e, e, 0.0)
    assert f"On a lit sphere an eye would {words}" in found.words


def test_spheres_are_drawn_by_light_and_model(greys: Perceived) -> None:
    figure = plot.spheres(greys)
    pictures = [ax for ax in figure.axes if ax.images]
    assert len(pictures) == 12
    assert [ax.get_title() for ax in pictures[:4]] == [*scene.LIGHTS, scene.ENVIRONMENT]
    assert [ax.get_ylabel() for ax in pictures[::4]] == ["lambert", "lambert", "difference"]
    drawn = np.asarray(pictures[0].images[0].get_array())
    assert drawn.shape == (72, 72, 4)
    assert drawn[0, 0, 3] == 0.0  # nothing beside the sphere
    np.testing.assert_allclose(drawn[36, 36, :3], drawn_of(greys.lightings[0]).empirical[36, 36])
