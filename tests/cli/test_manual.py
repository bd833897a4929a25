"""The pages of `fitmat models`: every lobe and parameter is there, and what is broken is said."""

import pytest

from fitmat.cli import manual
from fitmat.models.lobes.phong import BlinnPhong
from fitmat.models.registry import LOBES


@pytest.fixture(autouse=True)
def narrow(monkeypatch):
    monkeypatch.setenv("COLUMNS", "80")


def test_every_lobe_is_listed_once_with_its_fresnel_terms(capsys):
    """A family with the suffixes that make the rest of the registry."""
    manual.list_models()
    listed, current = [], ""
    for line in capsys.readouterr().out.split("\nA model is")[0].splitlines()[1:]:
        words = line[:52].split()
        if line[:1].strip():
            current = words.pop(0)
            listed.append(current)
        listed += [current + word for word in words if word.startswith("-")]
    assert sorted(listed) == sorted(LOBES)


@pytest.mark.parametrize("name", LOBES)
def test_manual_states_every_parameter(name, capsys):
    manual.page(name)
    out = capsys.readouterr().out
    assert max(map(len, out.splitlines())) <= 80
    for key, (p, default) in LOBES[name].defaults().items():
        row = [line for line in out.splitlines() if line.startswith(f"{key} ")][-1]
        assert p.symbol in row
        assert f"{default:g}" in row
    assert "Reference" in out
    assert "Limits" in out


def test_manual_states_what_is_broken(capsys):
    manual.page("blinn-phong")
    assert "Breaks the law 'energy'" in capsys.readouterr().out


def test_fresnel_page_ranks_the_terms(capsys):
    """Schlick's worst error for aluminium, 0.15, is the textbook case of its failure; Belcour's is far smaller."""
    manual.page("fresnel")
    row = next(line for line in capsys.readouterr().out.splitlines() if line.startswith("Al "))
    schlick, _, f82, _, belcour, _ = map(float, row.split()[1:])
    assert schlick > 0.1 > f82 > belcour


def test_multiple_scattering_has_a_page_and_every_name_its_parameters(capsys):
    """Both papers, what it is not for, and the names."""
    manual.page("heitz")
    out = capsys.readouterr().out
    assert all(words in out for words in ("Heitz", "Bitterli", "not fitted", "ggx-slab-conductor"))
    manual.page("ggx-walk-schlick")
    assert any(line.startswith("f0 ") for line in capsys.readouterr().out.splitlines())


@pytest.mark.study
def test_transmission_page_shows_what_glass_lets_through(capsys):
    """A smooth face, normal incidence: 4 % back, 96 % on; out of glass at 60° nothing."""
    manual.page("transmission")
    out = capsys.readouterr().out
    assert "Walter" in out
    rows = [line for line in out.splitlines() if line.startswith("smooth, from")]
    assert "0.040 + 0.960" in rows[0]
    assert "1.000 + 0.000" in rows[1]


@pytest.mark.study
def test_check_prints_laws_and_names_surprises(capsys, monkeypatch):
    """blinn-phong breaks energy and says so; with its declaration removed it is named."""
    assert manual.check(only=lambda name: name in ("lambert", "blinn-phong")) == []
    out = " ".join(capsys.readouterr().out.split())
    assert "broken 1.07" in out
    assert "Broken as their manual pages say: 2. blinn-phong (energy), blinn-phong (furnace)" in out
    assert "Broken unexpectedly: 0." in out
    monkeypatch.setattr(BlinnPhong, "breaks", {})
    assert manual.check(only=lambda name: name == "blinn-phong") == ["blinn-phong"]
    assert "Broken unexpectedly: 1. blinn-phong (energy)" in " ".join(capsys.readouterr().out.split())
