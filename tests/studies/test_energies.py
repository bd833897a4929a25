"""The colour that renderers lose at rough metals, against other programs' numbers; and what is refused."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import fitmat as fm
from fitmat.errors import FitmatError
from fitmat.models.refractive_index import index
from fitmat.studies.energies import energy_of
from fitmat.studies.result import Fitted

NM = np.arange(390.0, 731.0, 20.0)
NAMES = tuple(f"{nm:g}" for nm in NM)


def fitted(name: str, names: tuple[str, ...] = NAMES, **values: Any) -> Fitted:
    """A model of a run without draws."""
    return Fitted(
        name, fm.model(name, channels=len(names), **values), names, (), "converged", "reliable", (), Path("x")
    )


@pytest.mark.parametrize(
    ("alpha", "degrees", "known"),
    [
        (0.3, 60.0, (4.0, 0.3, 0.3)),
        (0.6, 60.0, (8.9, 0.7, 0.3)),
        (1.0, 0.0, (23.0, 1.5, 2.6)),
        (1.0, 60.0, (16.0, 1.9, 1.2)),
    ],
)
def test_gold_loses_what_it_is_known_to_lose(alpha: float, degrees: float, known: tuple[float, ...]) -> None:
    """ΔE2000 by a random walk outside of this program: single, Kulla–Conty, Turquin, told to one or two digits.

    Gold of three numbers, the index at 642, 543 and 441 nm, taken as linear sRGB.
    """
    gold = index("Au", [642.0, 543.0, 441.0])
    shape: dict[str, Any] = {"alpha": 0.2, "ks": 1.0, "eta": np.real(gold), "kappa": np.imag(gold)}
    found = energy_of(fitted("lambert+ggx-conductor", ("r", "g", "b"), **shape), theta=np.deg2rad(degrees), alpha=alpha)
    ways = [float(apart[0]) for apart in found.delta_e_2000.values()]
    np.testing.assert_allclose(ways, known, rtol=0.01, atol=0.1)
    assert found.error[0] < 0.1
    assert "What your renderer will lose of ggx-conductor" in found.sentence


def test_a_smooth_highlight_loses_nothing() -> None:
    """Of a spectrum: alpha 0.01 at normal incidence, and with the lobe's own alpha."""
    gold = index("Au", NM)
    one = fitted("ggx-conductor", alpha=0.01, ks=1.0, eta=np.real(gold), kappa=np.imag(gold))
    found = energy_of(one, theta=0.0)
    assert found.alpha == 0.01
    assert all(apart[0] < 0.1 for apart in found.delta_e_2000.values())


@pytest.mark.parametrize(
    ("name", "names", "given", "words"),
    [
        ("lambert+phong", NAMES, {}, r"lambert\+phong has 0 isotropic lobes of facets, expected one"),
        ("ggx-aniso", NAMES, {}, r"ggx-aniso has 0 isotropic lobes"),
        ("ggx+beckmann", NAMES, {}, r"has 2 isotropic lobes"),
        ("ggx", ("1", "2"), {}, r"channels 1, 2: no colour under D65|1 to 2 nm do not cover"),
        ("ggx", NAMES, {"alpha": 2.0}, r"alpha is 2\.0, expected a number from 0\.0001 to 1"),
        ("ggx", NAMES, {"theta": 60.0}, r"theta = 60: expected 0 to π/2 radians"),
        ("ggx", NAMES, {"samples": 1}, r"samples"),
    ],
)
def test_what_cannot_be_followed_is_refused(name: str, names: tuple[str, ...], given: Any, words: str) -> None:
    with pytest.raises(FitmatError, match=words):
        energy_of(fitted(name, names), **given)
