"""Imitation and conversion: SciPy on another grid, closed forms, and exponents recovered from simulated surfaces."""

from typing import Any

import numpy as np
import pytest
from oracles import ggx
from scipy.optimize import least_squares

import fitmat as fm
from fitmat.errors import FitmatError
from fitmat.match.imitation import LEAST_SQUARES, imitate
from fitmat.models.conversion import (
    ALPHA_CORRECTION,
    EXPONENT_CORRECTION,
    alpha_from_exponent,
    exponent_from_alpha,
    fitted_alpha,
    fitted_exponent,
)

SAME = 1e-6
"""Relative; the solver's tolerance is 1e-8 in the steps."""

GRID = 0.01
"""Relative; midpoint grids of 45 × 45 × 60 here and the library's rule see the same lobe differently."""

METAL: dict[str, Any] = {"kd": 0.3, "ks": 1.0, "alpha": 0.4, "eta": 1.5}


COLOURED: dict[str, Any] = {"kd": np.array([0.1, 0.2, 0.3]), "ks": np.array([0.2, 0.1, 0.05]), "exponent": 50.0}
"""Three channels with one exponent."""


@pytest.mark.parametrize("metric", LEAST_SQUARES)
def test_a_model_imitates_itself_exactly(metric: str) -> None:
    found = imitate(fm.model("lambert+blinn-phong", channels=3, **COLOURED), "lambert+blinn-phong", metric)
    assert found.converged
    assert found.distance < SAME
    for name, value in COLOURED.items():
        assert found.parameters[name] == pytest.approx(np.atleast_1d(value), rel=SAME)
    assert str(found).startswith(
        f"lambert+blinn-phong closest to lambert+blinn-phong by {metric}: kd = 0.1 0.2 0.3, ks"
    )


@pytest.mark.parametrize(
    ("metric", "weighted"),
    [("relative", None), ("cube-root", None), ("log-ratio", None), ("cube-root", "projected")],
)
def test_the_closest_blinn_phong_is_that_of_scipy(metric: str, weighted: Any) -> None:
    """GGX and Blinn–Phong in numpy on a grid in the three angles; three parameters by SciPy's own solver."""
    count = 45
    theta, phi = (np.arange(count) + 0.5) * np.pi / 2 / count, (np.arange(60) + 0.5) * np.pi / 60
    ti, to, azimuth = (x.ravel() for x in np.meshgrid(theta, theta, phi, indexing="ij"))
    wi, wo = ggx.hemisphere(ti, 0.0), ggx.hemisphere(to, azimuth)
    c_h = (wi + wo)[:, 2] / np.linalg.norm(wi + wo, axis=1)
    ci, co, solid = np.cos(ti), np.cos(to), np.sin(ti) * np.sin(to)
    target = METAL["kd"] / np.pi + ggx.brdf(wi, wo, METAL["alpha"], METAL["eta"])

    def seen(f: np.ndarray) -> np.ndarray:
        kappa = np.maximum(ci * co, 1e-3)
        return {"relative": f, "cube-root": np.cbrt(f * ci), "log-ratio": np.log(f * kappa + 1e-3)}[metric]

    weight = solid * ci * co if metric == "relative" or weighted == "projected" else solid
    norm = weight @ target**2 if metric == "relative" else weight.sum()

    def residual(p: np.ndarray) -> np.ndarray:
        kd, ks, n = p[0], p[1], np.exp(p[2])
        return np.sqrt(weight / norm) * (seen(kd / np.pi + ks * (n + 8) / (8 * np.pi) * c_h**n) - seen(target))

    theirs = least_squares(residual, [0.3, 0.1, np.log(10.0)], bounds=([0, 0, -2], [1, 10, 12]), x_scale="jac")
    ours = imitate(fm.model("lambert+ggx", **METAL), "lambert+blinn-phong", metric, weight=weighted)
    kd, ks, n = (ours.parameters[name][0] for name in ("kd", "ks", "exponent"))
    assert [kd, ks, n] == pytest.approx([*theirs.x[:2], np.exp(theirs.x[2])], rel=GRID)
    assert ours.distance == pytest.approx(np.sqrt(2 * theirs.cost), rel=GRID)


def test_what_is_fixed_stays() -> None:
    found = imitate(fm.model("lambert+ggx", **METAL), "lambert+blinn-phong", fixed={"exponent": 30.0, "ks": 0.0})
    assert found.parameters["exponent"] == pytest.approx([30.0], rel=SAME)
    assert found.parameters["ks"] == [0.0]
    assert found.parameters["kd"] > 0.3


def test_what_cannot_be_imitated_is_refused() -> None:
    truth = fm.model("lambert+ggx")
    with pytest.raises(FitmatError, match=r"metric is the text 'albedo', expected 'relative' or 'ngan' or 'low-e1'"):
        imitate(truth, "lambert+blinn-phong", "albedo")
    with pytest.raises(FitmatError, match=r"cannot fix 'alpha': lambert\+blinn-phong has kd, ks, exponent"):
        imitate(truth, "lambert+blinn-phong", fixed={"alpha": 0.1})
    with pytest.raises(FitmatError, match=r"parameter exponent = -1: expected a value from 0\.1"):
        imitate(truth, "lambert+blinn-phong", fixed={"exponent": -1.0})


def test_the_closed_form_matches_the_peaks() -> None:
    """(n+2)/(2π) of the cosine power is 1/(πα²) of GGX; the inverse undoes it."""
    alpha = np.geomspace(0.02, 1.0, 9)
    n = exponent_from_alpha(alpha)
    assert (n + 2) / (2 * np.pi) == pytest.approx(1 / (np.pi * alpha**2))
    assert alpha_from_exponent(n) == pytest.approx(alpha)
    assert exponent_from_alpha(0.1) == pytest.approx(198.0)


def test_corrections_end_with_their_range() -> None:
    """Below 0.02 and above 0.8 the width keeps the factor of the nearer end."""
    ratio = alpha_from_exponent(fitted_exponent(np.array([0.001, 0.02, 0.8, 1.0]))) / np.array([0.001, 0.02, 0.8, 1.0])
    assert ratio[0] == pytest.approx(ratio[1])
    assert ratio[2] == pytest.approx(ratio[3])
    x = np.log(0.1)
    assert np.log(alpha_from_exponent(fitted_exponent(0.1)) / 0.1) == pytest.approx(
        np.polyval(EXPONENT_CORRECTION[::-1], x)
    )
    assert np.log(fitted_alpha(198.0) / 0.1) == pytest.approx(np.polyval(ALPHA_CORRECTION[::-1], x))
