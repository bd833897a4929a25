"""Many fits in single precision: its optima, deviations and outcomes against scipy in float64, and its range."""

import re
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest
import scipy.optimize
from oracles.ggx import brdf
from selection import always

import fitmat as fm
from fitmat.fitting.losses import LOSSES
from fitmat.fitting.many.fitting_many import shared_by_all
from fitmat.fitting.many.gathering import first_discrepancies, gathered
from fitmat.fitting.many.searching import Search
from fitmat.fitting.many.solving import solve_many
from fitmat.fitting.many.table import begin_many, table
from fitmat.maths.grams import Normal, Whole
from fitmat.maths.least_squares import relative_offset

WITHIN = 1e-6
"""In standard deviations: the double steps end at 1e-10 of units of some 100 deviations (`solving.TOLERANCE`).

Rounding of 2⁻²⁴ in values of 50 standard deviations, in some tens of them, moves an optimum by more than 1e-5.
"""


def geometry(rows: int = 64) -> tuple[np.ndarray, np.ndarray]:
    """Directions of which most see the highlight, from far outside it to its top."""
    rng = np.random.default_rng(11)
    wi = fm.directions(rng.uniform(5.0, 75.0, rows), rng.uniform(0.0, 360.0, rows), degrees=True)
    h = fm.directions(10.0 ** rng.uniform(-2.0, 1.5, rows), rng.uniform(0.0, 360.0, rows), degrees=True)
    mirrored = 2.0 * np.sum(wi * h, axis=1, keepdims=True) * h - wi
    elsewhere = fm.directions(rng.uniform(0.0, 70.0, rows), rng.uniform(0.0, 360.0, rows), degrees=True)
    return wi, np.where(mirrored[:, 2:] > 0.1, mirrored, elsewhere)


WI, WO = geometry()

SATIN = np.array([[0.3, 0.8, 0.12, 1.5], [0.6, 1.2, 0.3, 1.8], [0.15, 0.6, 0.45, 1.4], [0.5, 1.0, 0.2, 2.1]])
MIRROR = np.array([[3e-6, 3.0, 1e-3, 1.5], [0.3, 1.0, 1e-3, 1.6], [1e-5, 0.5, 3e-3, 1.4]])
# kd, ks, alpha, eta; the mirrors show 1e-6 sr⁻¹ beside their highlights of 1e4.


def shown(p: np.ndarray) -> np.ndarray:
    """lambert+ggx at the directions, (n,)."""
    kd, ks, alpha, eta = p
    return kd / np.pi + ks * brdf(WI, WO, alpha, eta)


def measured(truth: np.ndarray, relative: float = 0.02, misfit: float = 0.0) -> tuple[np.ndarray, np.ndarray]:
    """Values and their noise, (m, n) both; `misfit` is no noise that σ tells of."""
    rng = np.random.default_rng(7)
    clean = np.stack([shown(p) for p in truth])
    sigma = relative * clean
    bent = np.cbrt(clean) * (1.0 + misfit * rng.normal(size=clean.shape))
    return bent**3 + sigma * rng.normal(size=clean.shape), sigma


def best(residual: Any, truth: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """scipy's optimum, from the truth, and JᵀJ there, of the logarithms of the parameters."""
    exact = {"xtol": 1e-15, "ftol": 1e-15, "gtol": 1e-15, "jac": "3-point"}
    end = scipy.optimize.least_squares(lambda t: residual(np.exp(t)), np.log(truth), **exact)
    return np.exp(end.x), end.jac.T @ end.jac


@pytest.mark.parametrize("truth", [SATIN, MIRROR], ids=["satin", "mirror"])
def test_optima_and_deviations_are_scipys(truth: np.ndarray) -> None:
    """Values from 1e-6 to 1e4 sr⁻¹ of the mirrors, alpha 1e-3; every fifth of one surface is masked."""
    value, sigma = measured(truth)
    value[1, ::5] = np.nan
    found = fm.fit_many(WI, WO, value, sigma=sigma, loss="gaussian", precision="single")
    assert (found.result == "converged").all()
    for k, p in enumerate(truth):
        there = np.isfinite(value[k])

        def residual(p: np.ndarray, k: int = k, there: np.ndarray = there) -> np.ndarray:
            return ((shown(p) - value[k]) / sigma[k])[there]

        end, information = best(residual, p)
        sd = np.sqrt(np.diagonal(np.linalg.inv(information))) * end
        np.testing.assert_allclose(found.values[k] / sd, end / sd, rtol=0.0, atol=WITHIN)
        np.testing.assert_allclose(found.sd[k], sd, rtol=1e-6)


def test_an_objective_has_scipys_optimum() -> None:
    value, _ = measured(SATIN)
    found = fm.fit_many(WI, WO, value, loss="cube-root", precision="single")
    for k, p in enumerate(SATIN):
        end, _ = best(lambda p, k=k: np.cbrt(shown(p) * WI[:, 2]) - np.cbrt(value[k] * WI[:, 2]), p)
        np.testing.assert_allclose(found.values[k], end, rtol=1e-6)
    assert np.isnan(found.sd).all()


def test_without_noise_the_optimum_is_the_truth() -> None:
    """The default loss; single precision alone would leave 1e-7 at best."""
    found = fm.fit_many(WI, WO, measured(SATIN, 0.0)[0], precision="single")
    assert (found.result == "converged").all()
    np.testing.assert_allclose(found.values, SATIN, rtol=1e-10)


def test_deviations_come_from_the_curvature_in_double() -> None:
    """Where the model misses the data: the Hessian of ½ Σ (z(y κ) − z(f κ))², by second differences.

    z(x) = (x/a) 3(q − atan q)/q³, q² = 3 s |x|^(2/3)/a (`fitmat.fitting.stabilising`). Differences of 32 bits over
    steps of 3e-4 deviations, which the fit's information takes, would be off by some per cent.
    """
    value, sigma = measured(SATIN[:2], misfit=0.05)
    found = fm.fit_many(WI, WO, value, sigma=sigma, precision="single")
    assert (found.result == "converged").all()
    for k in range(2):

        def z(x: np.ndarray, k: int = k) -> np.ndarray:
            a = sigma[k] * WI[:, 2]
            q = np.sqrt(3.0 * found.discrepancy[k] * np.cbrt(x**2) / a)
            return x / a * 3.0 * (q - np.arctan(q)) / q**3

        def cost(t: np.ndarray, k: int = k) -> float:
            return 0.5 * float(np.sum((z(value[k] * WI[:, 2]) - z(shown(np.exp(t)) * WI[:, 2])) ** 2))

        here, h = np.log(found.values[k]), 0.02 * found.sd[k] / found.values[k]
        steps = np.diag(h)
        second = [
            [sum(i * j * cost(here + i * a + j * b) for i in (-1, 1) for j in (-1, 1)) / 4.0 for b in steps]
            for a in steps
        ]
        sd = np.sqrt(np.diagonal(np.linalg.inv(second / np.outer(h, h)))) * found.values[k]
        np.testing.assert_allclose(found.sd[k], sd, rtol=1e-3)


def test_single_precision_settles_where_it_can() -> None:
    """With steps as small as double's it never would: every start would take all its steps."""
    value, sigma = measured(np.repeat(SATIN, 5, axis=0))
    found = fm.fit_many(WI, WO, value, sigma=sigma, loss="gaussian", precision="single")
    assert np.median(found.steps) < 32
    few = fm.fit_many(WI, WO, value, sigma=sigma, loss="gaussian", precision="single", max_steps=2)
    assert (few.result == "max_steps").all()


@pytest.mark.parametrize("kind", [np.float32, np.float64])
def test_a_step_is_finite_where_columns_are_alike(kind: Any) -> None:
    """Of JᵀJ of rank 1 by what is added to its diagonal: the offset is √(freedom Jᵀr (JᵀJ)⁺ Jᵀr) of r that is small."""
    square, slope, gram = (jnp.full(shape, value, kind) for shape, value in (((), 1.0), (2, 1e-3), ((2, 2), 1.0)))
    here = Normal(square, slope, Whole(gram))
    offset = jax.jit(lambda normal: relative_offset(normal, 10.0))(here)
    assert offset.dtype == kind
    np.testing.assert_allclose(offset, np.sqrt(10.0) * 1e-3, rtol=1e-3)


def test_what_is_out_of_range_is_an_outcome() -> None:
    """float32 ends at 3e38: no such surface is converged, all have a name, and none changes another."""
    value, sigma = measured(SATIN)
    told: dict[str, Any] = {"loss": "gaussian", "precision": "single"}
    alone = fm.fit_many(WI, WO, value[:1], sigma=sigma[:1], **told)
    value[1] *= 1e40
    value[2, 0] = 1e300
    value[3, 5:] = np.inf
    found = fm.fit_many(WI, WO, value, sigma=sigma, **told)
    np.testing.assert_array_equal(found.values[0], alone.values[0])
    assert found.result[0] == "converged"
    assert found.result[3] == "too_few"
    assert not (found.result[1:] == "converged").any()
    scaled = fm.fit_many(WI, WO, value[1:2], sigma=1e40 * sigma[1:2], **told)
    assert np.isfinite(scaled.values).all()  # ks is 10 at most, so that no fit follows
    assert scaled.result[0] in ("at_bound", "unidentifiable")


@pytest.mark.parametrize(
    "of",
    always(
        {("lambert+ggx", "default"), ("lambert+phong", "gaussian")},
        [
            *(("lambert+ggx", loss) for loss in ("default", "gaussian", "student-t", "mixture", "log10", "cube-root")),
            *((name, "gaussian") for name in ("lambert+phong", "lambert+ggx-aniso", "lambert+ward", "disney-2015")),
            *((name, "default") for name in ("lambert+beckmann", "lambert+ggx-conductor", "lambert+cook-torrance")),
        ],
    ),
)
def test_nothing_is_promoted(of: tuple[str, str]) -> None:
    """Neither grid nor steps have an array of 64 bits, which one constant of NumPy's would make of all that follows."""
    name, loss = of
    shared, held = shared_by_all([WI, WO], 3, name, {}, LOSSES[loss], None)
    rough = Search(shared, table(shared, held), 3, 9).rough()
    value = np.repeat(measured(SATIN)[0][:, :, None], 3, axis=2)
    samples = gathered(shared, value, None, 4)
    narrow = jax.tree.map(lambda part: np.asarray(part, np.float32), samples)
    first = first_discrepancies(samples).astype(np.float32)
    u = np.zeros((12, shared.moved.count), np.float32)
    counts, of_surface = np.array([12, 9], np.int32), np.zeros(12, np.int32)

    def every(model: Any, known: Any, narrow: Any, *arrays: Any) -> Any:
        first, u, counts, of_surface = arrays
        ends = solve_many(model, narrow, of_surface, u, first, counts, np.float32(1.0), 4)
        return begin_many(known, narrow, first, 3), ends

    leaves, structure = jax.tree.flatten((rough.shared, rough.known, narrow, first, u, counts, of_surface))
    traced = str(jax.make_jaxpr(lambda *given: every(*jax.tree.unflatten(structure, given)))(*leaves))
    assert re.search(r"f32\[\d", traced)
    assert not re.findall(r".*f64\[\d.*", traced)[:3]
