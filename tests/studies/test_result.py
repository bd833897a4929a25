"""What a run left on disk is read back as it was, or refused in one sentence."""

import json
import shutil
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import jax
import numpy as np
import polars as pl
import pytest

import fitmat as fm
from fitmat.errors import FitmatError, ModelError, ReadError
from fitmat.models import laws
from fitmat.models.around.instrument import Seen
from fitmat.models.around.noise import Noisy
from fitmat.models.base import AbstractBRDF
from fitmat.models.parameters import entries, vector
from fitmat.models.registry import LOBES
from fitmat.studies.result import FORMAT, load, masking
from fitmat.studies.study import study

NAMES = ("lambert", "tilt-over-lambert+ggx")


@pytest.fixture
def run(tmp_path: Path) -> Path:
    """A run's folder with a record of two models, and without draws."""
    models = [fm.model(name, channels=2, kd=np.array([0.3, 0.1])) for name in NAMES]
    folder = _written(tmp_path / "run", models, 2)
    record = json.loads((folder / "fit.json").read_text())
    record["choice"] = {"candidates": [{"model": name} for name in reversed(NAMES)]}
    (folder / "fit.json").write_text(json.dumps(record))
    return folder


@pytest.mark.study
def test_a_result_is_what_was_written(tmp_path: Path) -> None:
    """Models, values, intervals and draws; of the material, not of the instrument, whose scale is not certain."""
    names = ("lambert", "tilt-over-ggx")
    truth, angles = (
        fm.model("lambert", kd=np.array([0.3, 0.1])),
        (np.deg2rad([20, 45, 70]), np.deg2rad(np.arange(-80, 81, 20))),
    )
    instrument = fm.Instrument(calibration=0.03)
    told: dict[str, Any] = {"relative_noise": 0.02, "absolute_noise": 1e-3, "seed": 1, "instrument": instrument}
    options: dict[str, Any] = {"masking": "separable", "fixed": {"ks": 1.0}, "sampling": False}
    studied = study(fm.simulate(truth, *angles, **told), names, **options)
    fm.report(studied, tmp_path / "run")
    result = load(tmp_path / "run")
    assert [one.name for one in result.fits] == list(names)
    assert result.source == studied.measurements.source
    pair = np.tile([0.6, 0.0, 0.8], (2, 1))
    for one, found in zip(result.fits, studied.findings, strict=True):
        bare = found.fit.model
        while isinstance(bare, Seen | Noisy):
            bare = bare.base
        assert np.array_equal(fm.evaluate(one.model, pair, pair), fm.evaluate(bare, pair, pair))
        assert [q.name for q in one.parameters] == [q.name for q in found.parameters]
        assert "scale" in {q.name for q in one.parameters}
        for read, quoted in zip(one.parameters, found.parameters, strict=True):
            assert np.array_equal(read.value, quoted.value)
            assert np.array_equal(read.ci95, quoted.ci95, equal_nan=True)
            assert read.remarks == quoted.remarks
        places = [e.place for e in found.fit.entries if e.name in {e.name for e in entries(one.model)}]
        drawn = np.concatenate([found.posterior.values[:, place] for place in places], axis=1)
        assert np.array_equal(one.draws, drawn)
        assert (one.result, one.verdict) == (found.fit.result, found.posterior.verdict)


def test_a_model_is_found_by_its_name_or_by_what_the_data_prefer(run: Path) -> None:
    assert load(run / "fit.json").fitted().name == NAMES[1]
    assert load(str(run)).fitted(NAMES[0]).name == NAMES[0]
    with pytest.raises(ModelError, match="no values of phong, expected one of its models; it has lambert, tilt-over-l"):
        load(run).fitted("phong")


WAVELENGTHS = (450, 550, 650)
"""Names of channels, which a film takes its wavelengths from."""


def _written(folder: Path, models: Sequence[AbstractBRDF], channels: int) -> Path:
    """A record, made without the code that makes records."""
    fits = []
    for model in models:
        values, told = np.asarray(vector(model)), {}
        for e in entries(model):
            part = values[e.place].tolist()
            one = {"sd": 0.1, "ci95": [0.0, 1.0], "unit": "1", "symbol": "x", "remark": ""}
            several = {"sd": [0.1] * len(part), "ci95": [[0.0, 1.0]] * len(part), "remark": [""] * len(part)}
            told[e.name] = one | ({"value": part} | several if e.shape else {"value": part[0]})
        fit = {"model": model.name, "masking": masking(model), "parameters": told, "result": "converged"}
        fits.append(fit | {"doubts": [], "posterior": {"verdict": "not sampled"}})
    record = {"format": FORMAT, "fitmat": "0.1.0", "file": "a.csv", "fits": fits, "choice": None}
    folder.mkdir(exist_ok=True)
    (folder / "fit.json").write_text(json.dumps(record | {"channels": [str(nm) for nm in WAVELENGTHS[:channels]]}))
    return folder


@pytest.mark.parametrize("chosen", [None, "correlated", "separable", "v-cavity"])
def test_every_model_is_built_again(tmp_path: Path, chosen: str | None) -> None:
    """From its name, its masking and its values alone; names that two lobes share, and covers over covers, too."""
    names = [example for name in LOBES for example in laws.examples(name)]
    names += ["phong+ggx", "varnish-over-rough-varnish-over-lambert+ggx-conductor", "tilt-over-lambert+ggx-aniso"]
    built = 0
    for name in names:
        try:
            lines: dict[str, Any] = {"wavelengths": WAVELENGTHS} if "-film" in name else {}
            model = fm.model(name, masking=chosen, channels=3, **lines)
        except ModelError:
            assert chosen is not None  # where there is no masking to choose
            continue
        again = load(_written(tmp_path / "run", [model], 3)).fits[0].model
        assert jax.tree.structure(again) == jax.tree.structure(model)
        assert np.array_equal(vector(again), vector(model))
        built += 1
    assert built > (70 if chosen is None else 40)


def test_a_file_of_measurements_is_to_be_fitted_first(tmp_path: Path) -> None:
    for content in (b"theta_i,theta_o,brdf\n10,20,0.1\n", b"\x89PNG\xff"):
        (tmp_path / "scan.csv").write_bytes(content)
        with pytest.raises(ReadError, match=r"scan\.csv is no record of a run, expected the folder that `fitmat fit`"):
            load(tmp_path / "scan.csv")


DAMAGES: dict[str, tuple[Callable[[dict[str, Any]], Any], str]] = {
    "older": (
        lambda r: r.pop("format"),
        r"by another version \(fitmat 0\.1\.0\) and is of no format, expected format 1\. Fit the measurements again",
    ),
    "later": (lambda r: r.update(format=2), "and is of format 2, expected"),
    "hostile format": (lambda r: r.update(format="\x1b[31m"), r"is of format \"\\u001b"),
    "no fits": (lambda r: r.pop("fits"), "is no record of a run, expected what `fitmat fit` writes"),
    "fits of numbers": (lambda r: r.update(fits=[1, 2]), r"is damaged \('int' object is not subscriptable\)"),
    "no channels": (lambda r: r.pop("channels"), r"is damaged \(no 'channels'\)"),
    "no choice": (lambda r: r.pop("choice"), r"is damaged \(no 'choice'\)"),
    "no value": (lambda r: r["fits"][0]["parameters"].pop("kd"), r"is damaged \(no value of kd\)"),
    "a text for a value": (lambda r: r["fits"][0]["parameters"]["kd"].update(value="much"), "parameter value 'much'"),
    "out of range": (lambda r: r["fits"][0]["parameters"]["kd"].update(value=[7.0, 0.1]), "kd = 7: expected a value"),
    "no number": (lambda r: r["fits"][0]["parameters"]["kd"].update(value=[np.nan, 0.1]), "kd = nan: expected a value"),
    "another lobe": (lambda r: r["fits"][0].update(model="../../lambort"), "no lobe '../../lambort'"),
    "another masking": (lambda r: r["fits"][1].update(masking="none"), "masking 'none': expected one of"),
    "no verdict": (lambda r: r["fits"][0].update(posterior={}), r"is damaged \(no 'verdict'\)"),
}


@pytest.mark.parametrize(("damage", "sentence"), DAMAGES.values(), ids=DAMAGES)
def test_a_damaged_record_is_refused(
    run: Path, tmp_path: Path, damage: Callable[[dict[str, Any]], Any], sentence: str
) -> None:
    record = json.loads((run / "fit.json").read_text(encoding="utf-8"))
    damage(record)
    (tmp_path / "fit.json").write_text(json.dumps(record), encoding="utf-8")
    with pytest.raises(ReadError, match=sentence) as refused:
        load(tmp_path)
    assert "\n" not in str(refused.value)
    assert str(refused.value).endswith((".", "version."))


@pytest.mark.parametrize("content", [b"", b"{", b"\xff\xfe", b"[" * 100_000, b"[]", b"5", b'{"fits": []}', b"null"])
def test_what_is_no_record_is_refused(tmp_path: Path, content: bytes) -> None:
    (tmp_path / "fit.json").write_bytes(content)
    with pytest.raises(ReadError, match=r"is damaged \(.*\), expected|is no record of a run"):
        load(tmp_path)


def test_every_truncation_is_refused(run: Path, tmp_path: Path) -> None:
    text = (run / "fit.json").read_bytes()
    for end in range(0, len(text) - 3, 97):
        (tmp_path / "fit.json").write_bytes(text[:end])
        with pytest.raises(FitmatError, match="is damaged"):
            load(tmp_path)


def test_a_folder_without_a_record_is_refused(tmp_path: Path) -> None:
    for path in (tmp_path, tmp_path / "nowhere"):
        with pytest.raises(ReadError, match=r"No such file or directory; expected the folder of a run, with fit\.json"):
            load(path)


def test_draws_are_asked_for_when_they_are_needed(run: Path, tmp_path: Path) -> None:
    """Values and intervals are there without them."""
    shutil.copy(run / "fit.json", tmp_path)
    alone = load(tmp_path).fitted()
    assert np.isfinite(alone.parameters[0].ci95).all()
    with pytest.raises(ReadError, match=r"the draws cannot be read \(.*\)\. Fit again"):
        _ = alone.draws
    alone.file.write_bytes(b"PAR1, or not")
    with pytest.raises(ReadError, match=r"the draws cannot be read"):
        _ = alone.draws
    pl.DataFrame({"chain": [0], "kd 0": [0.5]}).write_parquet(alone.file)
    with pytest.raises(ReadError, match=r"has no draws of 'kd .*': it is of another run"):
        _ = alone.draws


def test_a_fit_without_values_is_passed_over(run: Path, tmp_path: Path) -> None:
    record = json.loads((run / "fit.json").read_text(encoding="utf-8"))
    record["fits"][1]["parameters"]["alpha"]["value"] = None
    (tmp_path / "fit.json").write_text(json.dumps(record), encoding="utf-8")
    result = load(tmp_path)
    assert [one.name for one in result.fits] == [NAMES[0]]
    assert result.fitted().name == NAMES[0]
    with pytest.raises(ModelError, match="it ended without values"):
        result.fitted(NAMES[1])


def test_the_name_is_asked_for_where_none_is_preferred(run: Path, tmp_path: Path) -> None:
    record = json.loads((run / "fit.json").read_text(encoding="utf-8"))
    (tmp_path / "fit.json").write_text(json.dumps(record | {"choice": None}), encoding="utf-8")
    with pytest.raises(ModelError, match="prefers none of its models, expected the name of one: lambert, tilt"):
        load(tmp_path).fitted()
