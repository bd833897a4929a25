"""Lobes against closed forms and finite differences; and what `model` and `evaluate` refuse."""

from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from lanes import mapped, programmed
from scipy.integrate import quad
from selection import always

import fitmat as fm
from fitmat.errors import ModelError
from fitmat.fitting.coordinates import coordinates
from fitmat.models.base import AbstractBRDF
from fitmat.models.laws import examples
from fitmat.models.parameters import entries, vector, with_vector
from fitmat.models.registry import LOBES

DIFFERENCES = 1e-7
"""Relative to |∂f/∂p| + |f/p|; five-point differences, steps h = 1e-4 p: (2h ln f)⁴ and 1e-16/h."""

TABULATED = 1e-6
"""The same where a polynomial of order 1 stands for energies of order 1e-6, as for alpha near 1e-4."""

UNDERFLOW = 1e-25
"""Lobes fainter than this (sr⁻¹) carry no light and vary too fast for the step of the differences."""

EXACT = 1e-12
"""Relative; the same formula written twice in double precision."""

TURNED = 1e-9
"""Relative; turning directions rounds the half vector of narrow lobes."""

QUADRATURE = 1e-8
"""Relative; scipy's adaptive rule on a smooth integrand."""

AXES = {"tilt": {"tilt_x": 2.0}, "disney": {"anisotropic": 0.5}}
"""Parameters by which models show their axes that hide them by default."""

COATS = {"plastic", "varnish", "rough-varnish"}
"""What comes back to their base is solved once for all pairs, by a program; others are tried operation by operation."""

PLAIN = {"lambert+phong", *(n for n, lobe in LOBES.items() if not ("-aniso" in n and lobe.fresnel_suffix(n)))}
PLAIN -= COATS
"""Tried in every run: all but brushed lobes with another Fresnel term, which is the same code as in the others, and but
coats, which take long."""

SLOPED = {"lambert+phong", *(n for n, lobe in LOBES.items() if n.startswith("ggx") or not lobe.fresnel_suffix(n))}
SLOPED -= {n for n in LOBES if any(part in n for part in ("-kc", "-turquin", "-film", "-belcour"))} - {"ggx-turquin"}
SLOPED -= {"plastic", "disney-2015"}
"""Whose slopes are tried in every run: every shape, and every Fresnel term on one of them; `-kc`, films and Belcour's
term have tests of their own, plastic takes long, and Disney's lobe is that of 2012 as well."""

Hemisphere = Any
Pairs = dict[str, tuple[np.ndarray, np.ndarray]]


def _normal_albedo(model: AbstractBRDF) -> float:
    """∫ f cosθ dω at normal incidence."""
    up, evaluate = np.array([[0.0, 0.0, 1.0]]), fm.evaluate

    def ring(cos: float) -> float:
        wo = np.array([[np.sqrt(1 - cos**2), 0.0, cos]])
        return 2 * np.pi * cos * float(evaluate(model, up, wo)[0, 0])

    return quad(ring, 0, 1, epsrel=1e-10, limit=200)[0]


@pytest.mark.parametrize("exponent", [0.1, 1.0, 4.0, 50.0, 1000.0])
@pytest.mark.parametrize("name", ["phong", "blinn-phong-exact"])
def test_phong_lobes_reflect_ks_at_normal_incidence(name: str, exponent: float) -> None:
    """Mitsuba 3 has no Phong plugin; the integral is known: 2π ∫ (n+2)/(2π) cⁿ⁺¹ dc = 1."""
    assert _normal_albedo(fm.model(name, ks=0.7, exponent=exponent)) == pytest.approx(0.7, rel=QUADRATURE)


@pytest.mark.parametrize(("exponent", "albedo"), [(1.0, 1.024), (4.0, 1.063), (10.0, 1.075)])
def test_blinn_phong_of_the_courses_reflects_too_much(exponent: float, albedo: float) -> None:
    """(n+8)/(8π) over the exact (n+2)(n+4)/(8π(2^(−n/2)+n)) of F. Giesen 2009, by hand to three digits."""
    by_hand = (exponent + 8) * (2 ** (-exponent / 2) + exponent) / ((exponent + 2) * (exponent + 4))
    assert by_hand == pytest.approx(albedo, abs=5e-4)
    assert _normal_albedo(fm.model("blinn-phong", exponent=exponent)) == pytest.approx(by_hand, rel=QUADRATURE)


@pytest.mark.parametrize(
    ("name", "peak"), [("blinn-phong", 12 / (8 * np.pi)), ("blinn-phong-exact", 48 / (8 * np.pi * 4.25))]
)
def test_blinn_phong_peaks_at_n_4(name: str, peak: float) -> None:
    """0.47746 and 0.44938 sr⁻¹."""
    up = np.array([[0.0, 0.0, 1.0]])
    np.testing.assert_allclose(fm.evaluate(fm.model(name, exponent=4.0), up, up), [[peak]], rtol=EXACT)


def test_lobes_by_hand() -> None:
    """Light at 60°, sensor at 30° on the mirror side: r·ω_o = cos 30°, h at 15°, ω_i·h = cos 45°."""
    wi, wo = np.array([[np.sqrt(0.75), 0, 0.5]]), np.array([[-0.5, 0, np.sqrt(0.75)]])
    ch, cd, ci, co, alpha = np.cos(np.pi / 12), np.sqrt(0.5), 0.5, np.sqrt(0.75), 0.5
    fresnel = 0.5 + 0.5 * (1 - cd) ** 5
    d_cook = np.exp(-((np.tan(np.pi / 12) / alpha) ** 2)) / (alpha**2 * ch**4)
    d_ggx = alpha**2 / (np.pi * ((alpha**2 - 1) * ch**2 + 1) ** 2)
    g_cook = min(1, 2 * ch * ci / cd, 2 * ch * co / cd)
    g_ggx = 2 / (np.sqrt(1 + alpha**2 * 3) + np.sqrt(1 + alpha**2 / 3))
    expected = {
        "lambert": 0.25 / np.pi,
        "phong": 12 / (2 * np.pi) * np.cos(np.pi / 6) ** 10,
        "blinn-phong": 18 / (8 * np.pi) * ch**10,
        "cook-torrance-schlick": fresnel * d_cook * g_cook / (np.pi * ci * co),
        "ggx-schlick": fresnel * d_ggx * g_ggx / (4 * ci * co),
    }
    given: dict[str, dict[str, Any]] = {
        "lambert": {"kd": 0.25},
        "phong": {"exponent": 10},
        "blinn-phong": {"exponent": 10},
    }
    for name, value in expected.items():
        model = fm.model(name, **given.get(name, {"alpha": alpha, "f0": 0.5}))
        np.testing.assert_allclose(fm.evaluate(model, wi, wo), [[value]], rtol=EXACT, err_msg=name)


def test_cook_torrance_is_four_times_walter(hemisphere: Hemisphere) -> None:
    """D' = π D and π for 4: with V cavities and Beckmann normals the two differ by exactly 4."""
    wi, wo = hemisphere(200, 8), hemisphere(200, 9)
    walter = fm.evaluate(fm.model("beckmann", alpha=0.4, masking="v-cavity"), wi, wo)
    np.testing.assert_allclose(fm.evaluate(fm.model("cook-torrance", alpha=0.4), wi, wo), 4 * walter, rtol=EXACT)


CLOSED = [n for n, lobe in LOBES.items() if lobe.kind != "cover"]
"""Lobes that stand alone; covers have tests of their own."""


def _directions(hemisphere: Hemisphere, singular: Pairs) -> tuple[np.ndarray, np.ndarray]:
    """Random pairs, random mirror pairs, and the singular sets."""
    wi = hemisphere(60, 10)
    apart, mirrored = hemisphere(60, 11), wi * [-1, -1, 1]
    special_i, special_o = (np.array(column) for column in zip(*singular.values(), strict=True))
    return np.concatenate([wi, wi, special_i]), np.concatenate([apart, mirrored, special_o])


@pytest.mark.parametrize("name", always(SLOPED, [*CLOSED, "lambert+phong"]))
def test_gradients_are_finite_differences(name: str, hemisphere: Hemisphere, singular: Pairs) -> None:
    """Every parameter of every lobe, drawn within its bounds; reverse mode, and forward mode the same."""
    model = fm.model(name)
    wi, wo = _directions(hemisphere, singular)
    every_pair, draws = programmed if name in COATS else mapped, 4

    def one(values: jax.Array, wi: jax.Array, wo: jax.Array) -> jax.Array:
        return jnp.sum(with_vector(model, values)(wi, wo))

    def along(values: jax.Array, to: jax.Array, wi: jax.Array, wo: jax.Array) -> jax.Array:
        return jax.jvp(lambda v: one(v, wi, wo), (values,), (to,))[1]

    every, rng = coordinates(model), np.random.default_rng(12)
    low, span, count = every.low, every.span, len(every.low)
    drawn = low + span * rng.uniform(0.02, 0.98, (draws, count))
    points = np.array([every.physical(jnp.array(natural)) for natural in drawn])
    value, slopes = every_pair(jax.value_and_grad(one), [points], [wi, wo])
    value, slopes = value[:, None], np.moveaxis(slopes, 2, 1)
    each = [np.repeat(points, count, axis=0), np.tile(np.eye(count), (draws, 1))]
    forward = every_pair(along, each, [wi, wo]).reshape(slopes.shape)
    np.testing.assert_allclose(forward, slopes, rtol=EXACT, atol=EXACT * np.abs(slopes).max())
    # A tangent need not turn far to be felt: by the width of the lobe.
    angles = np.array([entry.param.unit == "°" for entry in entries(model) for _ in range(entry.size)])
    widths = np.array([[np.rad2deg(with_vector(model, jnp.array(point)).width())] for point in points])
    sizes = np.where(angles, widths, np.abs(points))
    steps = 1e-4 * sizes[..., None]
    moved = points[:, None, None] + np.array([-2, -1, 1, 2])[:, None] * steps[..., None] * np.eye(count)[:, None]
    at = every_pair(one, [moved.reshape(-1, count)], [wi, wo]).reshape(draws, count, 4, -1)
    expected = (at[:, :, 0] - 8 * at[:, :, 1] + 8 * at[:, :, 2] - at[:, :, 3]) / (12 * steps)
    scale = np.abs(slopes) + (value + UNDERFLOW) / sizes[..., None]
    allowed = TABULATED if "-kc" in name or "-turquin" in name else DIFFERENCES
    wrong = np.abs(slopes - expected) >= allowed * scale + UNDERFLOW
    assert not wrong.any(), [(k, points[row]) for row, k in np.argwhere(wrong.any(axis=2))]


def test_channels_are_independent(hemisphere: Hemisphere) -> None:
    """Column k of a model with three values per channel is the model with value k."""
    wi, wo, f0 = hemisphere(20, 13), hemisphere(20, 14), np.array([0.02, 0.1, 0.6])
    columns = fm.evaluate(fm.model("lambert+ggx-schlick", kd=0.3, f0=f0, channels=3), wi, wo)
    single = [fm.evaluate(fm.model("lambert+ggx-schlick", kd=0.3, f0=v), wi, wo)[:, 0] for v in f0]
    np.testing.assert_allclose(columns, np.stack(single, axis=1), rtol=EXACT)


def test_channels_widen_only_what_is_per_channel() -> None:
    """With a Fresnel level per channel the specular weight is shared, else both could scale each other."""
    assert len(vector(fm.model("ggx", channels=3))) == 3 + 1 + 1
    assert len(vector(fm.model("ggx-schlick", channels=3))) == 1 + 1 + 3
    assert len(vector(fm.model("ggx-conductor", channels=3))) == 1 + 1 + 3 + 3
    assert len(vector(fm.model("lambert+phong", channels=2))) == 2 + 2 + 1


def test_names_are_read_loosely_and_written_strictly() -> None:
    assert fm.model("Lambert + GGX").name == "lambert+ggx"
    assert all(fm.model(examples(lobe)[0]).name == examples(lobe)[0] for lobe in LOBES)


def test_a_sum_is_as_narrow_as_its_narrowest_lobe() -> None:
    """√(2/(n+2)) of Blinn's lobe; Phong's is half as wide in h because r·ω_o turns twice as fast."""
    assert float(fm.model("lambert+ggx", alpha=0.2).width()) == pytest.approx(0.2)
    assert float(fm.model("blinn-phong", exponent=48.0).width()) == pytest.approx(0.2)
    assert float(fm.model("lambert+phong", exponent=48.0).width()) == pytest.approx(0.1)


@pytest.mark.parametrize(
    ("name", "options", "message"),
    [
        ("ggxx", {}, r"model 'ggxx': no lobe 'ggxx'; try ggx, .*'fitmat models' lists all"),
        ("ggx+", {}, r"model 'ggx\+': no lobe ''; try lambert, phong, ggx;"),
        ("ggx+ggx", {}, r"the same lobe twice cannot be told apart"),
        ("lambert", {"ks": 1.0}, r"model 'lambert' has no parameter 'ks'; it has kd\."),
        ("ggx", {"rough": 0.1}, r"has no parameter 'rough'; it has alpha, eta, ks\."),
        ("ggx", {"masking": "smith"}, r"masking 'smith': expected one of correlated, separable, v-cavity\."),
        ("lambert+phong", {"masking": "separable"}, r"model 'lambert\+phong' has no masking to choose"),
        ("ggx", {"alpha": 2.0}, r"parameter alpha = 2: expected a value from 0\.0001 to 1\."),
        ("lambert", {"kd": -0.1}, r"parameter kd = -0\.1: expected a value from 0 to 1\."),
        ("lambert", {"kd": "red"}, r"parameter value 'red': expected a number or one number per channel"),
        (
            "lambert",
            {"kd": "red", "channels": 3},
            r"parameter value 'red': expected a number or one number per channel",
        ),
        (
            "lambert",
            {"kd": [0.1, 0.2], "channels": 3},
            r"parameter kd has 2 values: expected 1 or 3, one a channel\.",
        ),
    ],
)
def test_model_refuses(name: str, options: dict[str, Any], message: str) -> None:
    with pytest.raises(ModelError, match=message):
        fm.model(name, **options)


@pytest.mark.parametrize(
    ("wi", "wo", "message"),
    [
        (
            np.zeros((2, 3)),
            np.zeros((3, 3)),
            r"wi and wo have shapes \(2, 3\) and \(3, 3\): expected \(n, 3\), n ≥ 1, of both",
        ),
        ([0.0, 0.0, 1.0], [0.0, 0.0, 1.0], r"shapes \(3,\) and \(3,\): expected \(n, 3\), n ≥ 1, of both"),
        ([[0, 0, 1], [0, 0, 2.0]], [[0, 0, 1], [0, 0, 1]], r"wi row 1 has length 2: expected unit vectors"),
        ([[0, 0, 1 + 2e-6]], [[0, 0, 1.0]], r"wi row 0 has length 1\.000002: expected unit vectors"),
        ([[0, 0, 1.0]], [[0, np.nan, 1]], r"wo row 0 has length nan: expected unit vectors"),
    ],
)
def test_evaluate_refuses(wi: Any, wo: Any, message: str) -> None:
    with pytest.raises(ModelError, match=message):
        fm.evaluate(fm.model("lambert"), wi, wo)


def test_a_name_that_two_lobes_share_may_be_given_for_one() -> None:
    """`ks` alone means both; with the lobe before it, that one."""
    given: dict[str, Any] = {"ks": 0.2, "ggx.ks": 0.7}
    built = fm.model("phong+ggx", **given)
    assert dict(zip([e.name for e in entries(built)], vector(built).tolist(), strict=True)) == {
        "phong.ks": 0.2, "exponent": 50.0, "ggx.ks": 0.7, "alpha": 0.3, "eta": 1.5,
    }  # fmt: skip


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("varnish", r"varnish needs a base, for example varnish-over-lambert"),
        ("ggx-over-lambert", r"ggx cannot stand over a base; varnish, rough-varnish, tilt can"),
    ],
)
def test_covers_and_bases_are_told_apart(name: str, message: str) -> None:
    with pytest.raises(ModelError, match=message):
        fm.model(name)


def test_masking_reaches_lobes_and_coats() -> None:
    assert fm.model("rough-varnish-over-lambert", masking="separable").coat.masking == "separable"  # pyright: ignore
    assert fm.model("lambert+ggx", masking="v-cavity").lobes[1].masking == "v-cavity"  # pyright: ignore


@pytest.mark.parametrize("name", always(PLAIN, LOBES))
def test_only_models_with_axes_change_when_both_directions_turn(name: str, hemisphere: Hemisphere) -> None:
    """An isotropic model depends on the difference of the azimuths; a brushed or tilted one says that it does not."""
    wi, wo = hemisphere(60, 20), hemisphere(60, 21)
    turn = np.array([[0.6, 0.8, 0.0], [-0.8, 0.6, 0.0], [0.0, 0.0, 1.0]])
    with_axes: dict[str, Any] = next((axes for family, axes in AXES.items() if family in name), {})
    model = fm.model(examples(name)[0], **with_axes)
    every_pair = programmed if name in COATS else mapped
    straight, turned = (every_pair(model, [], [wi @ turning, wo @ turning]) for turning in (np.eye(3), turn))
    assert model.isotropic == np.allclose(turned, straight, rtol=TURNED)
