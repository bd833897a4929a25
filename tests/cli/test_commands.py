"""The command line as a stranger meets it: exit codes, one clear sentence for wrong input, no traceback, no litter."""

import errno
import json
import logging
import os
import re
import shlex
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pytest

import fitmat as fm
from fitmat._types import Progress
from fitmat.cli.main import main
from fitmat.studies import sampling
from fitmat.studies import study as room
from fitmat.uncertainty.chains import CHUNK

DATA = Path(__file__).parents[2] / "data" / "synthetic"
HEAD = "theta_i,theta_o,brdf\n"
QUICK = ("--models", "lambert", "--no-mcmc")
PATIENCE = 300.0
"""Seconds that a process may take on a busy machine."""


class Ended(NamedTuple):
    """How a command ended."""

    code: int
    out: str
    err: str


Run = Callable[..., Ended]


@pytest.fixture
def run(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Iterator[Run]:
    """Run `fitmat ARGUMENTS` in this process."""

    def call(*arguments: object) -> Ended:
        monkeypatch.setattr(sys, "argv", ["fitmat", *map(str, arguments)])
        with pytest.raises(SystemExit) as end:
            main()
        written = capsys.readouterr()
        return Ended(int(end.value.code or 0), written.out, written.err)

    monkeypatch.setattr(os, "_exit", sys.exit)
    monkeypatch.setenv("COLUMNS", "80")
    handler = signal.getsignal(signal.SIGINT)
    yield call
    signal.signal(signal.SIGINT, handler)
    logging.disable(logging.NOTSET)


@pytest.fixture(scope="session")
def environment() -> dict[str, str]:
    """For subprocesses."""
    return os.environ | {"COLUMNS": "80"}


def curves(value: Callable[[int, int], float] = lambda i, o: 0.1 + 0.001 * o, theta_o: Any = range(-80, 81, 10)) -> str:
    """A table of three in-plane curves."""
    return HEAD + "".join(f"{i},{o},{value(i, o):.6g}\n" for i in (10, 30, 60) for o in theta_o)


def with_sigma(sigma: Callable[[int], float]) -> str:
    """A table of three in-plane curves with σ as a function of theta_o."""
    rows = [f"{i},{o},{0.1 + 0.001 * o:.6g},{sigma(o):g}" for i in (10, 30, 60) for o in range(-80, 81, 10)]
    return HEAD.rstrip("\n") + ",sigma\n" + "\n".join(rows) + "\n"


BAD: dict[str, tuple[str | bytes, str]] = {
    "sigma 0": (with_sigma(lambda o: 0), r"every row is masked \(51 sigma missing, infinite or not positive\)"),
    "0 bytes": (b"", r"bad\.csv: the file is empty \(0 bytes\)"),
    "header only": (HEAD, r"bad\.csv: a header and no rows"),
    "one row": (HEAD + "30,30,0.5\n", r"1 valid samples, but lambert has 1 free parameters and needs at least 3"),
    "fewer samples than parameters": (HEAD + "30,30,1\n30,40,1\n", "2 valid samples, but lambert has 1 free"),
    "all rows masked": (HEAD + "30,95,1\n30,40,nan\n", r"every row is masked \(1 at or below the horizon, 1"),
    "unknown columns": ("a,b,c\n1,2,3\n", "the columns are a, b, c, expected theta_i .*--columns"),
    "missing quantity": ("theta_i,theta_o,I\n30,45,1\n", "expected a measured quantity: brdf, brdf_cos"),
    "text in a number": (HEAD + "30,45,1\n30,50,abc\n", r"bad\.csv row 3: brdf = abc, expected a number\. Correct"),
    "beyond 180 degrees": (HEAD + "30,450,1\n", "row 2: theta_o = 450, expected −180 to 180 degrees"),
    "radians": (curves(theta_o=np.linspace(-1.3, 1.3, 9)).replace("\n10,", "\n0.1,").replace("\n30,", "\n0.5,")
                .replace("\n60,", "\n1.1,"), "they look like radians. Confirm with --angle-unit"),
    "binary": (bytes(range(256)), "a binary file or an unknown encoding"),
}  # fmt: skip


@pytest.mark.parametrize(("content", "sentence"), BAD.values(), ids=BAD)
def test_bad_file(run, tmp_path, content, sentence):
    path = tmp_path / "bad.csv"
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    assert_refused(run("fit", path, *QUICK), sentence)
    assert os.listdir(tmp_path) == ["bad.csv"]


PROGRESS = re.compile(
    r"((Fitting|Sampling|Comparing|Weighing|Examining|Writing|Looking|Reading|Drawing|Simulating) ?[^\n]*\."
    r"|compiling .*, once for this machine)\n"
)
"""What is told of the progress where stderr is no terminal."""


def beside_progress(err: str) -> str:
    """What else is on stderr."""
    return "".join(line for line in err.splitlines(keepends=True) if not PROGRESS.fullmatch(line))


def without_command(text: str) -> dict[str, Any]:
    """A record but for how it was asked for, which names the folder."""
    found = json.loads(text)
    assert found.pop("command").startswith("fitmat fit ")
    return found


def assert_refused(ended: Ended, sentence: str, code: int = 1) -> None:
    assert ended.code == code
    assert ended.out == ""
    said = beside_progress(ended.err)
    assert said.startswith("fitmat: ")
    assert said.count("\n") == 1
    assert ended.err.endswith(said)
    assert re.search(sentence, said), said


BAD_ARGUMENTS: dict[str, tuple[tuple[str, ...], str]] = {
    "directory": (("fit", "."), "a directory, expected a file"),
    "no such file": (("fit", "none.csv"), r"none\.csv: no such file"),
    "no model": (("fit", "sparse.csv", "--models", ","), "no model given; try --models"),
    "unknown lobe": (("fit", "sparse.csv", "--models", "lambert+ggg"), "no lobe 'ggg'; try ggx"),
    "same lobe twice": (("fit", "sparse.csv", "--models", "ggx+ggx"), "the same lobe twice"),
    "unknown parameter": (("fit", "sparse.csv", "--fix", "zz=1"), "--fix zz: no model of .* they have alpha, eta"),
    "not an assignment": (("fit", "sparse.csv", "--fix", "ks"), "--fix 'ks': expected NAME=NUMBER"),
    "out of range": (("fit", "sparse.csv", "--fix", "kd=9", *QUICK), "parameter kd = 9: expected a value from 0 to 1"),
    "no masking": (("fit", "sparse.csv", *QUICK, "--masking", "separable"), "none of lambert has a masking"),
    "unknown masking": (("fit", "sparse.csv", "--masking", "x"), "masking 'x': expected one of correlated"),
    "unknown quantity": (("fit", "sparse.csv", "--quantity", "x"), r"quantity = 'x' \(--quantity\), expected 'brdf'"),
    "unknown column": (("fit", "sparse.csv", "--columns", "brdf=I"), "no column 'I'; the columns are"),
    "out is a file": (("fit", "sparse.csv", "--out", "sparse.csv"), r"sparse\.csv already exists; give another --out"),
    "out below a file": (("fit", "sparse.csv", "--out", "sparse.csv/x"), "cannot write .*: Not a directory; choose"),
    "out not writable": (("fit", "sparse.csv", "--out", "/proc/x"), "cannot write /proc/x: .*; choose another place"),
    "name too long": (("fit", "sparse.csv", "--out", "a" * 300), "File name too long; choose another place"),
    "unknown loss": (("fit", "sparse.csv", *QUICK, "--loss", "lg"), "unknown loss 'lg': choose from default, gaussian"),
    "half a prior": (("fit", "sparse.csv", *QUICK, "--prior", "kd=0.3"), "--prior 'kd=0.3': expected NAME=CENTRE,SD"),
    "prior of nothing": (
        ("fit", "sparse.csv", *QUICK, "--prior", "eta=2,1"),
        "--prior eta: no model of lambert has it",
    ),
    "no manual": (("models", "foo"), "no lobe 'foo'; try "),
    "simulate nothing": (("simulate",), r"name a model to simulate, for example lambert\+ggx"),
    "simulate unknown": (("simulate", "lambert", "--set", "x=1"), "has no parameter 'x'; it has kd"),
    "two values of a shared parameter": (
        ("simulate", "ggx", "--set", "alpha=0.1,0.2"),
        "parameter alpha has 2 values: expected 1, it is shared",
    ),
    "unlike channels": (
        ("simulate", "lambert+ggx", "--set", "kd=1,1", "--set", "ks=1,1,1"),
        "kd has 2 values: expected 1 or 3",
    ),
    "half a range": (("simulate", "lambert", "--theta-o", "1:2"), "--theta-o '1:2': expected a list 10,30,60 or"),
    "falling range": (("simulate", "lambert", "--theta-o", "9:1:1"), "expected angles from -90 .* rising order"),
    "endless range": (("simulate", "lambert", "--theta-o", "0:80:1e-9"), "expected at most 10000 angles"),
    "negative incidence": (
        ("simulate", "lambert", "--theta-i", "-5"),
        "--theta-i '-5': expected angles from 0 to below",
    ),
    "not a number": (("simulate", "lambert", "--theta-i", "nan"), "--theta-i 'nan': expected angles from 0"),
    "micrometres": (
        ("simulate", "ggx", "--wavelengths", "0.4:0.7:0.1"),
        "250 to 20000 nm, in rising order. Are they in",
    ),
    "wavelength twice": (("simulate", "ggx", "--wavelengths", "450,450"), "expected each wavelength once"),
    "no wavelengths": (("simulate", "ggx", "--wavelengths", "blue"), "expected a list 450,550,650 or FIRST:LAST:STEP"),
    "film nowhere": (("simulate", "ggx-film", "--film", "TiO2", "--ior", "Ti"), "--film TiO2 without --wavelengths"),
    "index beside a law": (
        ("simulate", "ggx", "--dispersion", "cauchy", "--set", "eta=1.5", "--wavelengths", "450,550"),
        "--set eta beside --dispersion cauchy, whose law says it: expected any of ks, alpha, cauchy_a, cauchy_b",
    ),
    "no such parameter of a law": (
        ("simulate", "ggx", "--dispersion", "cauchy", "--set", "drude_ep=9", "--wavelengths", "450,550"),
        "The law cauchy has cauchy_a, cauchy_b",
    ),
    "law of nothing": (("simulate", "ggx", "--dispersion", "drude"), "--dispersion drude without --wavelengths"),
    "law and material": (
        ("simulate", "ggx", "--dispersion", "drude", "--ior", "Au", "--wavelengths", "450,550"),
        "--dispersion drude beside --ior, which says an index already",
    ),
    "said by its material": (
        ("simulate", "ggx", "--ior", "Au", "--set", "kappa=2", "--wavelengths", "450,550"),
        "--set kappa beside --ior or --film, which say it already",
    ),
    "simulate no film": (("simulate", "ggx", "--film", "TiO2"), "none of ggx has a film; use ggx-film"),
    "simulate onto a folder": (("simulate", "lambert", "--out", "."), "already exists; give another name, or --force"),
    "simulate to nowhere": (("simulate", "lambert", "--out", "/proc/x.csv"), "cannot be written"),
}


@pytest.mark.parametrize(("arguments", "sentence"), BAD_ARGUMENTS.values(), ids=BAD_ARGUMENTS)
def test_bad_arguments(run, tmp_path, monkeypatch, arguments, sentence):
    monkeypatch.chdir(tmp_path)
    Path("sparse.csv").write_bytes((DATA / "sparse.csv").read_bytes())
    assert_refused(run(*arguments), sentence)
    assert os.listdir() == ["sparse.csv"]


@pytest.mark.parametrize(
    "arguments",
    [
        ("fit",),
        ("bogus",),
        ("fit", "x.csv", "--bogus"),
        ("fit", "x.csv", "--seed", "-1"),
        ("simulate", "--noise", "nan"),
    ],
    ids=" ".join,
)
def test_wrong_usage(run, arguments):
    ended = run(*arguments)
    assert ended.code == 2
    assert ended.out == ""
    assert "--help' for help" in ended.err


def test_odd_rows_are_kept_or_masked_and_counted(run, tmp_path):
    path = tmp_path / "odd.csv"
    extra = "30,30,nan\n30,31,inf\n30,97,1\n30,32,-0.1\n30,33,0\n10,10,0.11\n"
    path.write_text(curves(lambda i, o: 0.1 + 1e-4 * ((7 * o + i) % 13)) + extra)
    ended = run("fit", path, *QUICK, "--out", tmp_path / "out")
    assert ended.code == 0
    for sentence in (
        "1 masked: value missing or NaN",
        "1 masked: value infinite",
        "1 masked: at or below the horizon",
        "Rows that repeat an earlier geometry, all kept: 1.",
        "Negative values kept as noise: 1.",
    ):
        assert sentence in ended.out
    found = json.loads((tmp_path / "out" / "fit.json").read_text())
    assert found["n_samples"] == 57
    assert found["n_masked"] == sum(found["masked"].values()) == 3


LABELLED: dict[str, tuple[str, tuple[str, ...], str]] = {
    "sigma negative": (with_sigma(lambda o: 0.002 * np.sign(o + 75)), ("converged",), "3 masked: sigma missing, infin"),
    "inadequate": (with_sigma(lambda o: 0.002), ("converged",), "in doubt: lambert is inadequate: it misses the data"),
    "all zero": (curves(lambda i, o: 0), ("at_bound",), "Noise unknown"),
    "all negative": (curves(lambda i, o: -1 - 0.01 * (o % 3)), ("at_bound", "unidentifiable"), "kept as noise: 51"),
    "rows copied": (curves() + curves()[len(HEAD) :], ("converged",), "or exact copies"),
    "one theta_o": (curves(theta_o=(40,) * 17), ("converged",), "Rows that repeat"),
    "tiny": (curves(lambda i, o: 1e-200), ("nonfinite", "at_bound", "unidentifiable"), "51 samples"),
    "huge": (curves(lambda i, o: 1e200 * (1 + 0.01 * (o % 3))), ("at_bound", "unidentifiable", "nonfinite"), "51 samp"),
}


@pytest.mark.parametrize(("content", "results", "words"), LABELLED.values(), ids=LABELLED)
def test_hopeless_data_end_in_a_labelled_result(run, tmp_path, content, results, words):
    path = tmp_path / "odd.csv"
    path.write_text(content)
    ended = run("fit", path, *QUICK, "--scale", "linear")
    found = json.loads((tmp_path / "odd-fitmat" / "fit.json").read_text())
    assert found["fits"][0]["result"] in results
    assert ended.code == (0 if found["fits"][0]["result"] == "converged" else 3)
    assert beside_progress(ended.err) == ""
    assert words in ended.out
    assert "nan" not in ended.out.replace("value missing or NaN", "")


@pytest.mark.study
def test_nothing_finite_has_no_match(run, tmp_path):
    """Both default models on values beneath the floats' range: labelled, with a report, not compared."""
    path = tmp_path / "tiny.csv"
    path.write_text(curves(lambda i, o: 0))
    ended = run("fit", path, "--no-mcmc", "--json")
    assert ended.code == 3
    assert strict(ended.out)["match"] is None
    assert (tmp_path / "tiny-fitmat" / "report.html").exists()


def strict(text: str) -> dict[str, Any]:
    """One JSON object, without the NaN that Python allows."""

    def refuse(token: str) -> None:
        raise AssertionError(f"{token} is not JSON")

    return json.loads(text, parse_constant=refuse)


@pytest.mark.parametrize("step", ["write_text", "write_bytes", "replace"])
def test_full_disk(run, tmp_path, monkeypatch, step):
    def refuse(*_: object, **__: object) -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(os if step == "replace" else Path, step, refuse)
    ended = run("fit", DATA / "sparse.csv", *QUICK, "--out", tmp_path / "a" / "b")
    assert_refused(ended, "cannot write .*: No space left on device; nothing was put there")
    assert [path for path in tmp_path.rglob("*") if path.is_file() or path.name.startswith(".")] == []


def test_a_run_whose_page_fails_keeps_its_numbers(run, tmp_path, monkeypatch):
    """The fit converged: 0, one sentence, and the place of the numbers."""

    def torn(*_: object, **__: object) -> None:
        raise ValueError("no glyph")

    monkeypatch.setattr("fitmat.reports.rendering.to_html", torn)
    made = run("fit", DATA / "sparse.csv", *QUICK, "--out", tmp_path / "made")
    assert made.code == 0
    missing = r".*made: report\.html could not be made \(ValueError: no glyph\); the numbers are saved in fit\.json\.\n"
    assert re.fullmatch(missing, beside_progress(made.err))
    assert made.out.endswith("made/fit.json\n")
    told = json.loads((tmp_path / "made" / "fit.json").read_text())
    assert told["fits"][0]["result"] == "converged"
    assert shlex.split(told["command"])[:2] == ["fitmat", "fit"]


def test_the_page_of_a_run_is_made_again(run, tmp_path):
    """From what is on disk: the same page, never over one that is there unless that is asked for."""
    out = tmp_path / "out"
    assert run("fit", DATA / "sparse.csv", *QUICK, "--out", out).code == 0
    before = (out / "report.html").read_bytes()
    assert_refused(run("report", out), r"report\.html: already exists; --force makes it again\.")
    again = run("report", out / "fit.json", "--force")
    assert (again.code, again.out, again.err) == (0, f"{out / 'report.html'}\n", "")
    assert (out / "report.html").read_bytes() == before
    (out / "figures.json").unlink()
    assert_refused(run("report", out, "--force"), r"figures\.json: No such file or directory; the run is older .*")


def test_the_page_is_opened_where_there_is_a_browser(run, tmp_path, monkeypatch):
    asked, out = [], tmp_path / "out"
    monkeypatch.setattr("webbrowser.open", lambda address: asked.append(address) or len(asked) > 1)
    ended = run("fit", DATA / "sparse.csv", *QUICK, "--out", out, "--open")
    assert (ended.code, asked) == (0, [(out / "report.html").resolve().as_uri()])
    assert f"no browser was found to open {out / 'report.html'} with." in ended.err
    ended = run("fit", DATA / "sparse.csv", *QUICK, "--out", out, "--force", "--open")
    assert (ended.code, len(asked)) == (0, 2)
    assert "browser" not in ended.err


def test_out_is_refused_then_replaced_by_force(run, tmp_path):
    out = tmp_path / "out"
    assert run("fit", DATA / "sparse.csv", *QUICK, "--out", out).code == 0
    before = {path.name: path.read_bytes() for path in out.iterdir()}
    assert sorted(before) == ["budget.txt", "figures.json", "fit.json", "posterior-lambert.parquet", "report.html"]
    assert_refused(
        run("fit", DATA / "noisy.csv", *QUICK, "--out", out), "already exists; give another --out DIR, or --f"
    )
    assert {path.name: path.read_bytes() for path in out.iterdir()} == before
    (out / "notes.txt").write_text("mine")
    other = ("--models", "lambert+phong", "--fix", "exponent=20", "--fix", "ks=0.1", "--no-mcmc")
    assert run("fit", DATA / "sparse.csv", *other, "--out", out, "--force").code in (0, 3)
    names = sorted(path.name for path in out.iterdir())
    assert names == [
        "budget.txt",
        "figures.json",
        "fit.json",
        "notes.txt",
        "posterior-lambert+phong.parquet",
        "report.html",
    ]


@pytest.mark.study
def test_default_folder_is_numbered(run, tmp_path):
    path = tmp_path / "a.b.csv"
    path.write_bytes((DATA / "sparse.csv").read_bytes())
    for name in ("a.b-fitmat", "a.b-fitmat-2", "a.b-fitmat-3"):
        ended = run("fit", path, *QUICK, "--fix", "kd=0.3")
        assert f"{name}/report.html" in ended.out
        assert (tmp_path / name / "fit.json").exists()
    assert len(os.listdir(tmp_path)) == 4


@pytest.mark.study
def test_same_seed_same_numbers(run, tmp_path):
    written = []
    for name, seed in (("one", 5), ("two", 5), ("three", 6)):
        ended = run(
            "fit", DATA / "sparse.csv", "--models", "lambert", "--seed", seed, "--out", tmp_path / name, "--json"
        )
        written.append((tmp_path / name / "fit.json").read_text())
        assert (ended.code, ended.out) == (0, written[-1])
    one, two, three = map(without_command, written)
    assert one == two != three


def test_interrupted_sampling_keeps_what_is_done(run, tmp_path, monkeypatch):
    sample = sampling.sample

    def interrupted(found: Any, *, seed: int, progress: Progress, checkpoint: Path) -> Any:
        def tick(what: str, done: int, total: int) -> None:
            signal.raise_signal(signal.SIGINT)
            progress(what, done, total)

        return sample(found, seed=seed, progress=tick, checkpoint=checkpoint)

    monkeypatch.setattr(sampling, "sample", interrupted)
    ended = run("fit", DATA / "sparse.csv", "--models", "lambert,lambert+phong", "--out", tmp_path / "out")
    assert ended.code == 3
    assert beside_progress(ended.err) == ""
    assert "interrupted: sampling was stopped; what was done is kept." in ended.out
    first, second = (f["posterior"] for f in json.loads((tmp_path / "out" / "fit.json").read_text())["fits"])
    assert first["interrupted"]
    assert first["steps"] == CHUNK
    assert second["verdict"] == "not sampled"
    assert "sampling was interrupted" in (tmp_path / "out" / "report.html").read_text()


@pytest.mark.study
@pytest.mark.parametrize("part", ["laplace_each", "compare"])
def test_interrupted_computation_leaves_nothing(run, tmp_path, monkeypatch, part):
    def interrupt(*_: object, **__: object) -> None:
        signal.raise_signal(signal.SIGINT)

    monkeypatch.setattr(room, part, interrupt)
    ended = run("fit", DATA / "sparse.csv", "--no-mcmc", "--out", tmp_path / "out")
    assert_refused(ended, "interrupted before the end; no report was written", code=130)
    assert os.listdir(tmp_path) == []


@pytest.mark.study
def test_simulate_and_fit_agree(run, tmp_path):
    path = tmp_path / "new" / "paint.csv"
    truth = ("--set", "kd=0.4,0.1,0.2", "--set", "alpha=0.3", "--theta-i", "20,45,70", "--theta-o", "-80:80:10")
    ended = run("simulate", "lambert+ggx", *truth, "--seed", 3, "--out", path)
    assert (ended.code, ended.out, beside_progress(ended.err)) == (0, f"{path}\n", "")
    assert ended.err.splitlines()[0] == "Simulating lambert+ggx."
    assert path.read_text().startswith("# simulated lambert+ggx; noise 0.02 relative + 0.001 sr^-1, seed 3\n")
    assert_refused(run("simulate", "lambert", "--out", path), "already exists; give another name, or --force")
    ended = run("fit", path, "--models", "lambert+ggx", "--no-mcmc", "--json")
    found = strict(ended.out)
    assert (ended.code, found["channels"], found["n_samples"]) == (0, ["r", "g", "b"], 51)
    parameters = found["fits"][0]["parameters"]
    # 51 samples of 2 %: kd to about 1 %, alpha to about 1 %; four standard deviations.
    assert parameters["kd"]["value"] == pytest.approx([0.4, 0.1, 0.2], rel=0.04)
    assert parameters["alpha"]["value"] == pytest.approx(0.3, rel=0.04)


LINES = np.array([450.9, 548.6, 659.5])
"""Of Johnson & Christy's table, nm."""


@pytest.mark.parametrize(
    ("told", "index"),
    [
        (("--ior", "Au"), np.array([1.38 + 1.914j, 0.43 + 2.455j, 0.14 + 3.697j])),
        (("--dispersion", "cauchy", "--set", "cauchy_a=1.5", "--set", "cauchy_b=0.01"), 1.5 + 1e4 / LINES**2),
    ],
    ids=["named", "law"],
)
def test_simulated_spectra(run, tmp_path, told, index):
    """Straight back F = |(n − 1)/(n + 1)|², D = 1/(π α²) and G2 = 1: F/(4 π α²); gold by Johnson & Christy's table."""
    path = tmp_path / "spectrum.csv"
    alone = ("--theta-i", "0", "--theta-o", "0", "--noise", 0, "--floor", 0, "--set", "alpha=0.5")
    assert run("simulate", "ggx", *told, *alone, "--wavelengths", "450.9,548.6,659.5", "--out", path).code == 0
    found = fm.read(path)
    assert found.channels == ("450.9", "548.6", "659.5")
    np.testing.assert_allclose(found.value[0], np.abs((index - 1) / (index + 1)) ** 2 / np.pi, rtol=1e-6)


def test_a_simulated_metal_says_its_wavelength_or_has_it_said(run, tmp_path):
    told = ("simulate", "ggx", "--ior", "Au", "--theta-i", "0", "--theta-o", "0", "--noise", 0, "--floor", 0)
    assert "--ior Au: taken at 550 nm" in run(*told, "--out", tmp_path / "a.csv").err
    ended = run(*told, "--wavelengths", "450.9", "--out", tmp_path / "b.csv")
    assert (ended.code, beside_progress(ended.err)) == (0, "")
    assert ended.err.splitlines()[0] == "Simulating ggx-conductor."
    assert fm.read(tmp_path / "b.csv").channels == ("450.9",)


def test_simulated_catalogue(run, tmp_path):
    ended = run("simulate", "--catalogue", tmp_path / "all")
    assert ended.code == 0
    assert len(ended.out.splitlines()) == len(os.listdir(tmp_path / "all")) > 20
    assert_refused(run("simulate", "--catalogue", tmp_path / "all"), "already exists")


def test_models_are_listed_and_explained(run):
    listed = run("models").out
    assert all(name in listed for name in ("lambert", "blinn-phong", "ggx-schlick", "fitmat models ggx"))
    page = run("models", "lambert+ggx").out
    assert all(word in page for word in ("Walter", "alpha", "0.0001 – 1", "η", "References", "kd"))
    assert max(map(len, page.splitlines())) <= 80


def test_losses_are_listed(run):
    listed = " ".join(run("losses").out.split())
    assert all(word in listed for word in ("student-t", "low-e2", "Lange, Little", "posterior", "--loss NAME"))


@pytest.mark.parametrize("command", [(), ("fit",), ("simulate",), ("models",), ("design",)], ids=" ".join)
def test_help_is_complete_at_80_columns(run, command):
    ended = run(*command, "--help")
    assert ended.code == 0
    assert "…│" not in ended.out.replace(" ", "")  # no option is cut off
    words = {"fit": ("Examples", "report.html", "brdf_550"), "simulate": ("Example", "--set"), "models": ("manual",)}
    words["design"] = ("--for match", "Examples")
    for word in words.get("".join(command), ("Exit codes", "0 all fits converged", "Examples")):
        assert word in " ".join(ended.out.split())


def shell(environment: dict[str, str], *arguments: object, **options: Any) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", "fitmat", *map(str, arguments)]
    return subprocess.run(command, env=environment, capture_output=True, text=True, timeout=PATIENCE, **options)


def test_start_up_is_light(environment):
    """Neither `import fitmat` nor --help may load what takes seconds."""
    heavy = "heavy = {'jax', 'numpy', 'scipy', 'matplotlib', 'emcee', 'polars', 'xarray'} & set(sys.modules)"
    program = f"""
import sys, fitmat.cli.main
sys.argv = ["fitmat", "fit", "--help"]
try:
    fitmat.cli.main.main()
except SystemExit:
    {heavy}
    sys.exit(", ".join(heavy) or 0)
"""
    command = [sys.executable, "-c", program]
    ended = subprocess.run(command, env=environment, capture_output=True, text=True, timeout=PATIENCE)
    assert ended.stderr.strip() == ""
    assert ended.returncode == 0


@pytest.mark.study
def test_default_run_prints_one_object_and_nothing_else(environment, tmp_path):
    path = tmp_path / "sparse.csv"
    path.write_bytes((DATA / "sparse.csv").read_bytes())
    ended = shell(environment, "fit", path, "--json", "--seed", 1)
    assert beside_progress(ended.stderr) == ""
    found = strict(ended.stdout)
    assert ended.returncode == (0 if all(f["result"] == "converged" for f in found["fits"]) else 3)
    assert [f["model"] for f in found["fits"]] == ["lambert+blinn-phong", "lambert+ggx"]
    assert all(f["posterior"]["verdict"] in ("reliable", "tentative") for f in found["fits"])
    assert sorted(os.listdir(tmp_path / "sparse-fitmat")) == [
        "budget.txt",
        "figures.json",
        "fit.json",
        "posterior-lambert+blinn-phong.parquet",
        "posterior-lambert+ggx.parquet",
        "report.html",
    ]


LOADED = """
import atexit, sys, fitmat.cli.main
heavy = "scipy.stats scipy.optimize colour arviz_stats corner matplotlib optimistix xarray".split()
atexit.register(lambda: print("LOADED", *(name for name in heavy if name in sys.modules), file=sys.stderr))
sys.argv = ["fitmat", "fit", *sys.argv[1:]]
fitmat.cli.main.main()
"""


@pytest.mark.study
def test_a_default_run_loads_nothing_that_it_does_not_need(environment, tmp_path):
    """The second of two runs, which finds its programs; no matplotlib; the page says how to get what is left out."""
    for name in ("one", "two"):
        command = [sys.executable, "-c", LOADED, str(DATA / "sparse.csv"), "--out", str(tmp_path / name)]
        ended = subprocess.run(command, env=environment, capture_output=True, text=True, timeout=PATIENCE)
        assert ended.returncode in (0, 3), ended.stderr
    assert "compiling" not in ended.stderr
    assert ended.stderr.splitlines()[-1] == "LOADED"
    page = (tmp_path / "two" / "report.html").read_text()
    assert len(page.encode()) < 400_000
    assert "fitmat fit --full" in page


@pytest.mark.study
def test_the_folder_of_programs_is_shown_and_cleared(environment, tmp_path):
    here = environment | {"FITMAT_CACHE": str(tmp_path / "programs")}
    assert shell(here, "fit", DATA / "sparse.csv", *QUICK, "--out", tmp_path / "out").returncode in (0, 3)
    kept = shell(here, "cache").stdout
    assert re.fullmatch(r"\d+ compiled programs, [\d.]+ MB, are kept in .*programs\.\n", kept)
    assert shell(here, "cache", "--clear").stdout == kept.replace("are kept in", "were removed from the folder")
    assert shell(here, "cache").stdout.startswith("0 compiled programs, 0.0 MB")
    assert os.listdir(tmp_path / "programs") == []


@pytest.mark.study
def test_a_folder_that_cannot_be_used_is_said_once(environment, tmp_path):
    """The same numbers without it."""
    (tmp_path / "file").write_text("")
    results = []
    for name, place in (("kept", environment["FITMAT_CACHE"]), ("not", str(tmp_path / "file"))):
        ended = shell(
            environment | {"FITMAT_CACHE": place}, "fit", DATA / "sparse.csv", *QUICK, "--out", tmp_path / name
        )
        assert ended.returncode in (0, 3)
        results.append(((tmp_path / name / "fit.json").read_text(), beside_progress(ended.stderr)))
    assert without_command(results[0][0]) == without_command(results[1][0])
    assert results[0][1] == ""
    assert results[1][1].startswith("Compiled programs are not kept (")
    assert results[1][1].count("\n") == 1


def test_ctrl_c_while_fitting(environment, tmp_path):
    command = [sys.executable, "-m", "fitmat", "fit", str(DATA / "sparse.csv"), "--out", str(tmp_path / "out")]
    running = subprocess.Popen(command, env=environment, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    deadline = time.monotonic() + PATIENCE
    while not list(tmp_path.iterdir()) and time.monotonic() < deadline:
        time.sleep(0.02)
    running.send_signal(signal.SIGINT)
    out, err = running.communicate(timeout=PATIENCE)
    assert_refused(Ended(running.returncode, out, err), "interrupted before the end", code=130)
    assert os.listdir(tmp_path) == []


def test_closed_pipe_and_full_stdout(environment):
    with subprocess.Popen(
        [sys.executable, "-m", "fitmat", "models"], env=environment, stdout=subprocess.PIPE, stderr=subprocess.PIPE
    ) as piped:
        assert piped.stdout
        assert piped.stderr
        piped.stdout.close()
        assert b"Traceback" not in piped.stderr.read()
    with open("/dev/full", "w") as full:
        ended = subprocess.run(
            [sys.executable, "-m", "fitmat", "models"], env=environment, stdout=full, stderr=subprocess.PIPE, text=True
        )
    assert_refused(Ended(ended.returncode, "", ended.stderr), "cannot write the output: No space left on device")


@pytest.mark.study
def test_terminal_and_names_that_are_not_utf8(environment, tmp_path):
    path = os.fsdecode(os.fsencode(tmp_path) + b"/\xff[bold]<b>.csv")
    Path(path).write_bytes((DATA / "sparse.csv").read_bytes())
    ended = shell(environment | {"PYTHONIOENCODING": "ascii"}, "fit", path, *QUICK)
    assert ended.returncode == 0
    assert beside_progress(ended.stderr) == ""
    assert "[bold]<b>.csv: 51 samples" in ended.stdout
    page = next(tmp_path.glob("*-fitmat/report.html")).read_text()
    assert "&lt;b&gt;.csv" in page
    assert "<b>.csv" not in page
