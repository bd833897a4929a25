"""What an export writes: all of it or nothing, never over something unasked, from whatever holds a material."""

import json
import os
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from typer.testing import CliRunner

import fitmat as fm
from fitmat.cli.application import app
from fitmat.errors import FitmatError, ModelError, OutputError
from fitmat.exports import export as room
from fitmat.exports.glsl import browser
from fitmat.exports.verification import Difference
from fitmat.models.parameters import entries, vector
from fitmat.studies.result import FORMAT

LAMBERT = fm.model("lambert", kd=0.25)
FILES = ["m.glsl", "m.vert", "m.frag", "export.json"]


@pytest.fixture(autouse=True)
def _alone(monkeypatch: pytest.MonkeyPatch) -> None:
    """No browser, whatever the machine has."""
    monkeypatch.setattr(browser, "program", lambda: None)


@pytest.fixture
def result(tmp_path: Path) -> Path:
    """A run of two models on three channels, the second tilted, better, and with intervals."""
    fits = []
    for name in ("lambert+phong", "tilt-over-lambert+ggx"):
        model = fm.model(name, channels=3)
        values, told = np.asarray(vector(model)), {}
        for e in entries(model):
            value = values[e.place].tolist()
            several = {"value": value, "sd": [0.1] * 3, "ci95": [[0.1, 0.2]] * 3, "remark": [""] * 3}
            one = {"value": value[0], "sd": 0.1, "ci95": [0.1, 0.2], "remark": ""}
            told[e.name] = {"unit": "1", "symbol": "x"} | (several if e.shape else one)
        fit = {"model": name, "masking": None, "parameters": told, "result": "converged", "doubts": []}
        fits.append(fit | {"posterior": {"verdict": "reliable"}})
    choice = {"candidates": [{"model": "tilt-over-lambert+ggx"}, {"model": "lambert+phong"}]}
    record = {"format": FORMAT, "fitmat": "0", "file": "my gold.csv", "fits": fits, "choice": choice}
    folder = tmp_path / "run.1"
    folder.mkdir()
    (folder / "fit.json").write_text(json.dumps(record | {"channels": ["700 nm", "b\n", "c"]}))
    return folder


def test_an_export_is_its_files(tmp_path: Path) -> None:
    made = fm.export(LAMBERT, "glsl", tmp_path / "out", name="m")
    assert list(made.files) == FILES
    assert sorted(os.listdir(tmp_path / "out")) == sorted(FILES)
    for name, text in made.files.items():
        assert (tmp_path / "out" / name).read_text(encoding="utf-8") == text
    record = json.loads(made.files["export.json"])
    assert record["values"] == {"kd": 0.25}
    assert (record["model"], record["files"], record["executed"]) == ("lambert", FILES[:3], None)
    assert made.files["m.frag"].startswith('#version 300 es\n// "m": lambert, GLSL ES 3.00, by fitmat ')
    assert "// Not executed here.\n" in made.files["m.glsl"]
    assert str(made).endswith("Not executed here.\nWhere there is Chromium, it is run and compared with the model.")
    assert made.files["m.glsl"].partition("const ")[2] in made.files["m.frag"]


def test_nothing_is_written_without_a_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    assert fm.export(LAMBERT).folder is None
    assert os.listdir(tmp_path) == []


def test_a_result_is_exported_level_with_its_intervals(result: Path) -> None:
    """The model that the data prefer, of its measurements' name; the tilt is the mount's."""
    made = fm.export(fm.load(result))
    assert next(iter(made.files)) == "my-gold.glsl"
    assert made.model == "lambert+ggx"
    text = made.files["my-gold.glsl"]
    assert '// Fitted to "my gold.csv".\n' in text
    assert '// Red, green and blue are the channels "700 nm", "b\\n", "c".\n' in text
    assert "//   kd 0.1 to 0.2, 0.1 to 0.2, 0.1 to 0.2\n" in text
    assert "tilt" not in text
    other = fm.export(fm.load(result), model="lambert+phong", name="p")
    assert "lambert_phong" not in other.files["p.glsl"]
    assert "vec3 phong(vec3 wi, vec3 wo)" in other.files["p.glsl"]


def test_what_stands_there_is_replaced_when_asked_and_only_if_it_is_an_exports(tmp_path: Path) -> None:
    out = tmp_path / "out"
    fm.export(LAMBERT, "glsl", out, name="m")
    (out / "mine.txt").write_text("mine")
    with pytest.raises(OutputError, match=r"out already exists; give another --out DIR, or --force"):
        fm.export(LAMBERT, "glsl", out)
    fm.export(LAMBERT, "glsl", out, name="other", force=True)
    assert sorted(os.listdir(out)) == ["export.json", "mine.txt", "other.frag", "other.glsl", "other.vert"]
    (out / "export.json").write_text('{"files": ["../../x", "mine.txt"]}')
    with pytest.raises(OutputError, match="is not known to hold an export, and nothing in it is replaced"):
        fm.export(LAMBERT, "glsl", out, force=True)
    hostile = {"fitmat": "0", "target": "glsl", "files": ["../x", "/etc/passwd", "mine.txt\x00", "other.vert"]}
    (out / "export.json").write_text(json.dumps(hostile))
    assert room.own(out) == ["other.vert", "export.json"]


def test_a_disk_that_fills_leaves_nothing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    write, count = Path.write_bytes, iter(range(10))

    def full(self: Path, *arguments: Any, **options: Any) -> int:
        if next(count) == 2:
            raise OSError(28, "No space left on device")
        return write(self, *arguments, **options)

    monkeypatch.setattr(Path, "write_bytes", full)
    with pytest.raises(OutputError, match="No space left on device"):
        fm.export(LAMBERT, "glsl", tmp_path / "out")
    assert os.listdir(tmp_path) == []


def test_half_a_letter_in_a_name_is_written(tmp_path: Path) -> None:
    """A name of a file that is no text: a surrogate, which UTF-8 does not have."""
    name = "caf\udce9 \ud800"
    fm.export(LAMBERT, "glsl", tmp_path / "out", name=name)
    assert json.loads((tmp_path / "out" / "export.json").read_text(encoding="utf-8"))["name"] == name


def test_what_is_found_is_said_everywhere(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """In the header, in the record and on the screen; also how many are too far."""
    found = Difference(0.01, 1e-5, 80.0, 79.0, 180.0, 12288, 3, "Chrome/1")
    monkeypatch.setitem(room.TARGETS, "glsl", room.TARGETS["glsl"]._replace(difference=lambda *_: found))
    made = fm.export(LAMBERT, "glsl", tmp_path / "out", name="m")
    first, second = found.words.split("\n")
    assert f"// {first}\n// {second}\n" in made.files["m.vert"]
    assert "at most 1.0e-02 (theta_i 80.0, theta_o 79.0, phi 180 degrees), 1.0e-05 on average" in second
    assert json.loads(made.files["export.json"])["executed"]["largest"] == 0.01
    assert str(made).endswith("3 directions are further apart than 0.002.")


@pytest.mark.parametrize(
    ("call", "sentence"),
    [
        (lambda r: fm.export(LAMBERT, model="ggx"), "model 'ggx' beside one model"),
        (
            lambda r: fm.export(fm.load(r), model="ggx"),
            r"no values of ggx, expected one of its models; it has lambert\+p",
        ),
        (
            lambda r: fm.export(LAMBERT, step=0.1),
            "step with target 'glsl', expected it with table, zemax only",
        ),
        (lambda r: fm.export(LAMBERT, "hlsl"), "target is the text 'hlsl', expected 'glsl' or 'glsl-330' or 'mit"),
    ],
)
def test_what_is_not_there_is_refused(result: Path, call: Any, sentence: str) -> None:
    with pytest.raises(FitmatError, match=sentence):
        call(result)


def run(*arguments: object) -> tuple[int, str, str]:
    """The code, what was said but for the stages, and why it ended."""
    ended = CliRunner().invoke(app, [str(a) for a in arguments], prog_name="fitmat", env={"COLUMNS": "300"})
    return ended.exit_code, ended.stdout, str(ended.exception or "")


def test_the_command_writes_beside_the_run(result: Path) -> None:
    code, said, _ = run("export", result, "--to", "glsl")
    assert code == 0
    assert said.startswith(f"my-gold.glsl, my-gold.vert, my-gold.frag, export.json in {result}-glsl: lambert+ggx in GL")
    assert (result.parent / "run.1-glsl" / "my-gold.frag").exists()
    assert run("export", result / "fit.json")[0] == 0
    assert (result.parent / "run.1-glsl-2").is_dir()
    assert run("export", result, "--force")[0] == 2
    code, _, error = run("export", result.parent)
    assert code == 1
    assert "No such file or directory; expected the folder of a run, with fit.json" in error


@pytest.mark.study
def test_studies_and_fits_are_exported_as_well() -> None:
    measured = fm.simulate(
        fm.model("lambert"), 0.5, np.linspace(-1, 1, 9), relative_noise=0.01, absolute_noise=0, seed=1
    )
    studied = fm.study(measured, "lambert", sampling=False)
    made = fm.export(studied)
    assert "// 95 % intervals:\n//   kd 0." in next(iter(made.files.values()))
    fit = studied.findings[0].fit
    assert json.loads(fm.export(fit).files["export.json"])["values"]["kd"] == pytest.approx(fit.values.tolist())
    with pytest.raises(ModelError, match="model is 'ggx', expected one of the study: lambert"):
        fm.export(studied, model="ggx")
    with pytest.raises(ModelError, match="model is 'ggx', expected that of the fit, lambert"):
        fm.export(fit, model="ggx")
