"""Means and quantiles of colour differences over pixels: by hand, and by brute force on large pictures."""

from collections.abc import Callable
from types import ModuleType
from typing import Any

import numpy as np
import pytest
import scipy.special
from oracles import field_papers, ggx

import fitmat as fm
from fitmat.colour import differences
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


Formula = Callable[[np.ndarray, np.ndarray], np.ndarray]
"""Directions to the light and to the viewer, (n, 3), to a BRDF in r, g and b, (n, 3)."""

MATRIX = np.array([[0.4124, 0.3576, 0.1805], [0.2126, 0.7152, 0.0722], [0.0193, 0.1192, 0.9505]])
"""Linear sRGB to XYZ, IEC 61966-2-1."""


def lambert(kd: np.ndarray) -> Formula:
    return lambda wi, wo: np.broadcast_to(kd / np.pi, wi.shape)


def phong(ks: Any, n: float) -> Formula:
    """Lafortune & Willems 1994; r is ω_i on the other side of the normal."""
    mirrored = np.array([-1.0, -1.0, 1.0])
    return lambda wi, wo: ks * (n + 2) / (2 * np.pi) * np.maximum((mirrored * wi * wo).sum(axis=1), 0.0)[:, None] ** n


def blinn(ks: Any, n: float) -> Formula:
    return lambda wi, wo: ks * (n + 8) / (8 * np.pi) * _half(wi, wo)[:, 2:] ** n


def facets(alpha: float, fresnel: Callable[[np.ndarray], np.ndarray], *, beckmann: bool = False) -> Formula:
    """F D G/(4 c_i c_o), Walter et al. 2007, eqs. 33 and 25; masking by Heitz 2014, eqs. 72, 80 and 99."""

    def brdf(wi: np.ndarray, wo: np.ndarray) -> np.ndarray:
        h = _half(wi, wo)
        ch, tan2 = h[:, 2], 1.0 / h[:, 2] ** 2 - 1.0
        if beckmann:
            density = np.exp(-tan2 / alpha**2) / (np.pi * alpha**2 * ch**4)
        else:
            density = alpha**2 / (np.pi * ch**4 * (alpha**2 + tan2) ** 2)
        hidden = np.zeros(len(wi))
        for c in (wi[:, 2], wo[:, 2]):
            a = c / (alpha * np.sqrt(np.maximum(1.0 - c**2, 1e-24)))
            smooth = (scipy.special.erf(a) - 1) / 2 + np.exp(-(a**2)) / (2 * a * np.sqrt(np.pi))
            hidden += smooth if beckmann else (np.sqrt(1.0 + 1.0 / a**2) - 1.0) / 2
        shape = density / (1.0 + hidden) / (4.0 * wi[:, 2] * wo[:, 2])
        return fresnel(np.sum(wi * h, axis=1))[:, None] * shape[:, None]

    return brdf


def schlick(alpha: float, f0: np.ndarray) -> Formula:
    white, black = facets(alpha, np.ones_like), facets(alpha, lambda cos: (1.0 - cos) ** 5)
    return lambda wi, wo: f0 * white(wi, wo) + (1.0 - f0) * black(wi, wo)


def _half(wi: np.ndarray, wo: np.ndarray) -> np.ndarray:
    return (wi + wo) / np.linalg.norm(wi + wo, axis=1, keepdims=True)


def both(one: Formula, other: Formula) -> Formula:
    return lambda wi, wo: one(wi, wo) + other(wi, wo)


def glass(cos: np.ndarray) -> np.ndarray:
    return ggx.fresnel(cos, 1.5)


def rough(rho: np.ndarray) -> Formula:
    return lambda wi, wo: rho * field_papers.oren_nayar(wi, wo, 1.0, np.deg2rad(20.0))[:, None]


RED, GREEN, BLUE, GOLD = (
    np.array(rgb) for rgb in ((0.5, 0.12, 0.08), (0.15, 0.35, 0.1), (0.05, 0.1, 0.4), (0.95, 0.75, 0.4))
)
PAIRS = {
    "red satin": (
        ("lambert+blinn-phong", {"kd": RED, "ks": 0.045, "exponent": 80.0}, both(lambert(RED), blinn(0.045, 80.0))),
        ("lambert+ggx", {"kd": RED, "alpha": 0.15}, both(lambert(RED), facets(0.15, glass))),
    ),
    "green gloss": (
        ("lambert+blinn-phong", {"kd": GREEN, "ks": 0.04, "exponent": 3e3}, both(lambert(GREEN), blinn(0.04, 3e3))),
        ("lambert+ggx", {"kd": GREEN, "alpha": 0.03}, both(lambert(GREEN), facets(0.03, glass))),
    ),
    "red matte": (
        ("lambert+phong", {"kd": RED, "ks": 0.02, "exponent": 10.0}, both(lambert(RED), phong(0.02, 10.0))),
        ("oren-nayar", {"kd": RED, "sigma_n": 20.0}, rough(RED)),
    ),
    "gold": (
        ("phong", {"ks": GOLD, "exponent": 20.0}, phong(GOLD, 20.0)),
        ("ggx-schlick", {"alpha": 0.3, "f0": GOLD}, schlick(0.3, GOLD)),
    ),
    "blue haze": (
        ("lambert+phong", {"kd": BLUE, "ks": 0.04, "exponent": 400.0}, both(lambert(BLUE), phong(0.04, 400.0))),
        ("lambert+beckmann", {"kd": BLUE, "alpha": 0.07}, both(lambert(BLUE), facets(0.07, glass, beckmann=True))),
    ),
}
"""Two models each that differ in another way: name, parameters, and the formula in NumPy."""

PIXELS = 1600


@pytest.mark.study
@pytest.mark.parametrize("name", PAIRS)
def test_means_and_worst_twentieths_are_those_of_every_pixel_of_a_large_picture(name: str, science: ModuleType) -> None:
    """An own renderer: 1600² pixels of a plain square grid, formulas in NumPy, ΔE2000 by colour-science.

    None of the rules of `scene`, of the models or of ΔE2000; quantiles within what `rule` states, means within
    2 %: in the rim light they hang on the last pixels before grazing.
    """
    (one, given, first), (other, told, second) = PAIRS[name]
    models = fm.model(one, channels=3, **given), fm.model(other, channels=3, **told)
    vectors = [vector(each)[None] for each in models]
    found = perceived(*models, (vectors[0], vectors[1]), ("r", "g", "b"), pictures=False)
    middle = (np.arange(PIXELS) + 0.5) * 2.0 / PIXELS - 1.0
    x, y = (part.ravel() for part in np.meshgrid(middle, middle))
    inside = x * x + y * y < 1.0 - scene.GRAZING**2
    normals = np.stack([x, y, np.sqrt(np.maximum(1.0 - x * x - y * y, 0.0))], axis=1)[inside]
    white = science.XYZ_to_xy(differences.WHITE)
    for lighting in found.lightings[:3]:
        angle, turn = np.deg2rad(scene.LIGHTS[lighting.name])
        light = np.array([np.sin(angle) * np.cos(turn), np.sin(angle) * np.sin(turn), np.cos(angle)])
        lit = normals[normals @ light > scene.GRAZING]
        across = np.cross(lit, light)
        across /= np.maximum(np.linalg.norm(across, axis=1, keepdims=True), 1e-12)
        axes = np.stack([np.cross(across, lit), across, lit], axis=1)
        wi, wo = axes @ light, axes @ [0.0, 0.0, 1.0]
        seen = [brdf(wi, wo) * wi[:, 2:] for brdf in (first, second)]
        exposure = 0.18 / (seen[1] @ MATRIX[1]).mean()
        labs = [science.XYZ_to_Lab(np.clip(exposure * rgb, 0.0, 1.0) @ MATRIX.T, white) for rgb in seen]
        itp = differences.delta_e_itp(*(exposure * rgb @ MATRIX.T for rgb in seen))
        for kind, spread_of, delta in (
            ("ΔE2000", lighting.delta_e_2000, science.delta_E(*labs, method="CIE 2000")),
            ("ΔE_ITP", lighting.delta_e_itp, itp),
        ):
            worst, mean = float(np.quantile(delta, 0.95)), float(delta.mean())
            ours = spread_of.worst_twentieth.value, spread_of.mean.value
            print(f"| {name}, {lighting.name}, {kind} | {ours[1]:.3f} | {mean:.3f} |", end="")
            print(f" {ours[0]:.2f} ± {spread_of.rule:.2f} | {worst:.2f} |")
            assert ours[0] == pytest.approx(worst, abs=spread_of.rule)
            assert ours[1] == pytest.approx(mean, rel=0.02)
            assert spread_of.rule < 0.1 * ours[0] + 0.01 * spread_of.largest.value
