"""What a table or a MERL file holds is read back as the model, within the digits and the cells of the format."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import fitmat as fm
from fitmat.errors import FitmatError, ModelError, OutputError
from fitmat.exports import table
from fitmat.exports.material import Chosen
from fitmat.models.base import evaluate

SATIN = fm.model("lambert+ggx", kd=np.array([0.1, 0.3, 0.5]), ks=np.ones(3), alpha=0.2)
DIGITS = 2e-6
"""Relative: values have 7 digits, angles 10⁻⁶ degrees."""


@pytest.mark.parametrize("suffix", ["csv", "parquet"])
def test_a_table_is_read_back_as_the_model(tmp_path: Path, suffix: str) -> None:
    fm.export(SATIN, "table", tmp_path / "out", name="m", theta_i=np.deg2rad([10.0, 60.0]), step=np.deg2rad(10.0))
    back = fm.read(tmp_path / "out" / f"m.{suffix}")
    assert np.unique(np.round(np.rad2deg(back.theta_i), 4)).tolist() == [10.0, 60.0]
    assert back.n_samples == 2 * 9 * 19
    assert back.channels == ("r", "g", "b")
    own = evaluate(SATIN, back.wi, back.wo)
    assert np.abs(back.value / own - 1.0).max() < DIGITS
    assert np.abs(back.value / evaluate(fm.model("lambert"), back.wi, back.wo) - 1.0).max() > 0.1


def test_a_table_in_json_has_the_same_columns(tmp_path: Path) -> None:
    hostile = 'a"b\n*/ --> <script>é\u202e\\'
    made = fm.export(fm.model("lambert", kd=0.25), "table", name=hostile, step=np.deg2rad(30.0))
    columns = json.loads(made.files["a-b-script-é.json"])["columns"]
    assert list(columns) == ["theta_i", "theta_o", "phi", "brdf"]
    assert np.allclose(columns["brdf"], 0.25 / np.pi, rtol=1e-12)
    assert sorted(set(np.round(columns["phi"], 6))) == [0, 30, 60, 90, 120, 150, 180]
    assert made.files["a-b-script-é.csv"].startswith('# "a\\"b\\n*/ --> <script>\\u00e9\\u202e\\\\": lambert, a table')
    assert made.difference is not None
    assert made.difference.largest < DIGITS
    assert "between them whoever reads it interpolates" in str(made)


def test_a_brushed_table_turns_the_sample(tmp_path: Path) -> None:
    brushed = fm.model("ggx-aniso", alpha_x=0.1, alpha_y=0.4, rotation=30.0)
    made = fm.export(brushed, "table", tmp_path / "out", name="m", theta_i=[0.5], step=np.deg2rad(30.0))
    back = fm.read(tmp_path / "out" / "m.parquet")
    assert np.abs(back.value / evaluate(brushed, back.wi, back.wo) - 1.0).max() < DIGITS
    assert len(np.unique(np.round(back.phi_i, 6))) == 6
    assert made.difference is not None
    assert made.difference.largest < 1e-4  # angles of 10⁻⁶ degrees on the flank of a lobe


@pytest.mark.study
def test_merl_cells_are_the_model_at_their_centres(tmp_path: Path) -> None:
    made = fm.export(SATIN, "merl", tmp_path / "out", name="m")
    back = fm.read(tmp_path / "out" / "m.binary")
    kept = back.valid.all(axis=1)
    assert kept.sum() > 900_000
    some = np.flatnonzero(kept)[::997]
    assert np.abs(back.value[some] / evaluate(SATIN, back.wi[some], back.wo[some]) - 1.0).max() < 1e-12
    assert "Looked up in the nearest cell, as BRDFRead.cpp does, over 12288" in str(made)
    assert made.difference is not None
    assert made.difference.mean > 1e-3  # a cell is as wide as it is
    assert made.notes == ()
    fm.export(SATIN, "merl", strict=True, verify=False)


@pytest.mark.study
def test_what_a_merl_file_cannot_hold_is_said_or_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(table, "AZIMUTHS", 3)
    brushed = fm.model("ggx-aniso+phong", alpha_x=0.1, alpha_y=0.4)
    made = fm.export(brushed, "merl", verify=False)
    assert "means over 3 azimuths" in made.notes[0]
    assert made.notes[0] in str(made)
    with pytest.raises(ModelError, match=r"means over 3 azimuths of incidence\. Leave out strict"):
        fm.export(brushed, "merl", strict=True)
    cells = table.in_cells(Chosen(fm.model("ggx-aniso", alpha_x=0.1, alpha_y=0.4)))
    row = int(np.argmax(cells.value[:, 0]))
    angles = np.arange(3) * np.pi / 3
    wi, wo = (
        np.stack([np.cos(angles) * w[0] - np.sin(angles) * w[1], np.sin(angles) * w[0] + np.cos(angles) * w[1]], 1)
        for w in (cells.wi[row], cells.wo[row])
    )
    wi, wo = (np.c_[w, np.full(3, z)] for w, z in ((wi, cells.wi[row, 2]), (wo, cells.wo[row, 2])))
    mean = evaluate(fm.model("ggx-aniso", alpha_x=0.1, alpha_y=0.4), wi, wo).mean()
    assert cells.value[row, 0] == pytest.approx(mean, rel=1e-9)
    with pytest.raises(OutputError, match="MERL files hold r, g and b, got 4 channels"):
        fm.export(fm.model("lambert", channels=4), "merl")


@pytest.mark.parametrize(
    ("grid", "sentence"),
    [
        ({"step": 5.0}, r"step .*0\.1 to 45 degrees"),
        ({"step": np.deg2rad(0.1)}, r"a table of \d+ rows \(step 0\.1 degrees\), expected 1 to 5000000"),
        ({"theta_i": [30.0]}, r"theta_i"),
    ],
)
def test_angles_that_are_none_are_refused(grid: Any, sentence: str) -> None:
    with pytest.raises(FitmatError, match=sentence):
        fm.export(SATIN, "table", **grid)
