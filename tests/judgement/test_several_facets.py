"""What single scattering leaves out of the albedo: against Heitz's walk, in words."""

import re
from types import SimpleNamespace
from typing import Any

import jax
import numpy as np
import pytest

import fitmat as fm
from fitmat.judgement.several_facets import left_out
from fitmat.maths.directions import from_angles

NEAR = 0.04
"""Absolute; what the docstring claims of Kulla & Conty's energies."""


def fitted(name: str, *degrees: float, **values: Any) -> Any:
    """As much of a fit as is read."""
    return SimpleNamespace(
        model=fm.model(name, **values), finite=True, measurements=SimpleNamespace(theta_i=np.deg2rad(degrees))
    )


@pytest.mark.parametrize(("alpha", "f0"), [(0.3, 0.9), (0.8, 0.5)])
def test_the_number_is_what_the_walk_adds(alpha: float, f0: float) -> None:
    said = left_out(fitted("lambert+ggx-schlick", 60.0, alpha=alpha, f0=f0, kd=0.1))
    number = float(re.findall(r"would add about (\S+) to the albedo at 60°: ggx-kc-schlick fits", said)[0])
    walk = fm.model("ggx-walk-schlick", alpha=alpha, f0=f0)
    wi = from_angles(np.deg2rad([60.0]), np.zeros(1))
    every, once = (
        fm.albedo_walk(walk.surface, wi, samples=40_000, seed=1, order=order).reflected.value[0, 0]  # type: ignore[attr-defined]
        for order in (None, 1)
    )
    assert number == pytest.approx(every - once, abs=NEAR)
    assert number > 0.01


def test_the_most_and_the_least_of_several_incidences() -> None:
    said = left_out(fitted("ggx-schlick", 5.0, 45.0, 75.0, alpha=0.7, f0=np.array([0.3, 0.8]), channels=2))
    most, least = map(float, re.findall(r"add about (\S+) to .* the most; (\S+) at least", said)[0])
    assert most > least > 0.03


def test_little_is_called_little_and_other_lobes_nothing() -> None:
    assert "less than 0.001" in left_out(fitted("lambert+ggx", 45.0, alpha=0.1, eta=1.5))
    for name in ("lambert+blinn-phong", "ggx-kc", "ggx-aniso", "plastic"):
        assert left_out(fitted(name, 45.0)) == ""


def test_nothing_is_compiled() -> None:
    """A fitted model holds plain numbers: NumPy computes."""
    fit = fitted("ggx", 10.0, 60.0, alpha=0.5)
    with jax.transfer_guard("disallow"):
        assert "would add" in left_out(fit)
