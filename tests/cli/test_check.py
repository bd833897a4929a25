"""`fitmat check` and `fitmat convert` as a stranger meets them, and how flags of file and instrument reach a fit."""

import os
import re
import struct
from pathlib import Path

import numpy as np
import pytest
import test_commands
from test_commands import Run, assert_refused, beside_progress, curves, shell, strict

from fitmat.errors import FitmatError
from fitmat.measurements.instrument import UNKNOWN_SCALE, Instrument
from fitmat.measurements.samples import Measurements

run, environment = test_commands.run, test_commands.environment

SPARSE = test_commands.DATA / "sparse.csv"

SEVEN_DIGITS = 5.1e-7
"""Relative: half a unit of the seventh digit, to which CSV values are written."""

ROUNDED = 1e-6
"""Degrees: CSV angles are rounded to this, ALTA's go through radians in between."""

GROUPED = 3e-5
"""Degrees: incidences are told apart to 10⁻⁶ radians."""

ALBEDO = 0.005
"""Relative; a sum over steps of 10° up to 80° from the normal."""

LAB = "material,theta_i,theta_o,signal,reference\n" + "".join(
    f"{material},{i},{o},{signal + 0.01 * o},{2.0 + 0.1 * k}\n"
    for material, signal in (("Alu", 3.0), ("Felt", 1.0))
    for i in (20, 50)
    for k, o in enumerate(range(-60, 61, 20))
)
"""Readings of two materials beside those of a white panel."""


@pytest.fixture
def sparse(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A catalogue material's file in an empty working folder: 3 incidences, 17 angles each."""
    monkeypatch.chdir(tmp_path)
    path = Path("sparse.csv")
    path.write_bytes(SPARSE.read_bytes())
    return path


# --- check ----------------------------------------------------------------------------------------


def test_check_describes_and_tells_how_to_see(run: Run, sparse: Path) -> None:
    ended = run("check", sparse)
    assert (ended.code, beside_progress(ended.err)) == (0, "")
    assert ended.err.splitlines()[0] == "Examining sparse.csv."
    first, *_, last = ended.out.splitlines()
    assert first == "sparse.csv: 51 samples, channel value."
    assert last == "See what was measured where: fitmat check sparse.csv --plot coverage.png"
    assert "WARNING" not in ended.out
    assert os.listdir() == ["sparse.csv"]


def test_check_warns_of_values_that_reflect_more_than_falls_on_the_sample(run: Run, tmp_path: Path) -> None:
    """A Lambertian surface of f = 2/π has an albedo of 2: what a reader gets who takes a reflectance factor for f."""
    path = tmp_path / "factor.csv"
    path.write_text(curves(lambda i, o: 2 / np.pi * (1 + 1e-3 * np.cos(o * o + o + i))))
    found = re.findall(r"WARNING: At \d+° incidence the values add up to an albedo of (\S+)", run("check", path).out)
    assert [float(albedo) for albedo in found] == pytest.approx([2.0] * 3, rel=ALBEDO)
    assert "WARNING" not in run("check", path, "--columns", "reflectance_factor=brdf").out


ODD: dict[str, str] = {
    "one row": test_commands.HEAD + "30,30,0.5\n",
    "all zero": curves(lambda i, o: 0),
    "all negative": curves(lambda i, o: -1 - 0.01 * (o % 3)),
    "large": curves(lambda i, o: 1e100 * (1 + 0.01 * (o % 3))),
    "tiny": curves(lambda i, o: 1e-200),
    "huge": curves(lambda i, o: 1e200 * (1 + 0.01 * (o % 3))),
    "a channel without values": "theta_i,theta_o,brdf_r,brdf_g\n" + "30,20,1,nan\n30,30,2,nan\n30,40,1,nan\n",
    "missing, infinite, below the horizon": curves() + "30,31,nan\n30,32,inf\n30,97,1\n",
}


@pytest.mark.parametrize("content", ODD.values(), ids=ODD)
def test_check_json_is_one_object_without_nan(run: Run, tmp_path: Path, content: str) -> None:
    path = tmp_path / "odd.csv"
    path.write_text(content)
    ended = run("check", path, "--json", "--scale", "linear")
    assert (ended.code, beside_progress(ended.err)) == (0, "")
    found = strict(ended.out)
    assert found["file"] == "odd.csv"
    assert found["samples"] == content.count("\n") - 1
    assert sum(found["masked"].values()) == content.count("nan") + content.count("inf") + content.count("97")
    angles = sorted({int(line.split(",")[0]) for line in content.splitlines()[1:]})
    assert found["geometry"]["theta_i_deg"] == pytest.approx(angles, abs=GROUPED)


SIGNATURES = {"map.png": b"\x89PNG\r\n\x1a\n", "map.PNG": b"\x89PNG\r\n\x1a\n", "map.svg": b"<?xml", "map.pdf": b"%PDF"}
"""How files of these kinds begin: RFC 2083, XML 1.0, ISO 32000."""


@pytest.mark.parametrize(("name", "signature"), SIGNATURES.items(), ids=SIGNATURES)
def test_check_draws_what_the_suffix_says(run: Run, sparse: Path, name: str, signature: bytes) -> None:
    ended = run("check", sparse, "--plot", name, "--json")
    assert (ended.code, beside_progress(ended.err)) == (0, "")
    assert ended.err.splitlines()[-1] == f"Drawing {name}."
    assert strict(ended.out)["samples"] == 51
    content = Path(name).read_bytes()
    assert content.startswith(signature)
    if name.lower().endswith("png"):
        assert min(struct.unpack(">II", content[16:24])) > 500  # width and height of the IHDR chunk


def test_a_picture_is_replaced_by_force_only(run: Run, sparse: Path) -> None:
    Path("map.png").write_text("mine")
    refused = run("check", sparse, "--plot", "map.png")
    assert_refused(refused, r"map\.png: already exists; choose another name, or --force to replace it")
    assert Path("map.png").read_text() == "mine"
    Path("link.png").symlink_to("nowhere.png")
    assert_refused(run("check", sparse, "--plot", "link.png"), r"link\.png: already exists")
    ended = run("check", sparse, "--plot", "map.png", "--force")
    assert ended.code == 0
    assert "--plot coverage.png" not in ended.out
    assert Path("map.png").read_bytes().startswith(SIGNATURES["map.png"])
    assert sorted(os.listdir()) == ["link.png", "map.png", "sparse.csv"]


def test_what_was_found_is_printed_before_a_picture_fails(
    run: Run, sparse: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It was asked for as a file, and there is none: 1, after the text, and the picture of before stays."""

    def torn(*_: object, **__: object) -> None:
        raise ValueError("no glyph")

    said = run("check", sparse).out.partition("\nSee what")[0]
    nowhere = run("check", sparse, "--plot", "/proc/x.png")
    Path("map.png").write_text("before")
    monkeypatch.setattr("matplotlib.figure.Figure.savefig", torn)
    unsaved = run("check", sparse, "--plot", "map.png", "--force")
    monkeypatch.setattr("fitmat.reports.examination_plots.examination", torn)
    undrawn = run("check", sparse, "--plot", "map.png", "--force")
    for ended in (nowhere, unsaved, undrawn):
        assert ended.out.rstrip() == said.rstrip()
    assert_refused(nowhere._replace(out=""), r"/proc/x\.png: cannot be written")
    for ended in (unsaved, undrawn):
        assert_refused(
            ended._replace(out=""), r"map\.png: could not be drawn \(ValueError: no glyph\); what was found is"
        )
    assert Path("map.png").read_text() == "before"


@pytest.mark.study
def test_check_out_of_process_prints_json_and_nothing_else(environment: dict[str, str], sparse: Path) -> None:
    ended = shell(environment, "check", sparse, "--json", "--plot", "map.png")
    assert (ended.returncode, beside_progress(ended.stderr)) == (0, "")
    assert strict(ended.stdout)["warnings"] == []
    assert sorted(os.listdir()) == ["map.png", "sparse.csv"]


# --- convert --------------------------------------------------------------------------------------


def numbers(path: str) -> dict[str, np.ndarray]:
    """Column by column, sorted by incidence and sensor, as numpy reads them; azimuth 0 as a negative theta_o."""
    lines = [line for line in Path(path).read_text().splitlines() if not line.startswith("#")]
    table = np.genfromtxt(lines, delimiter=",", names=True)
    order = np.lexsort((table["theta_o"], table["theta_i"]))
    return {name: table[name][order] for name in table.dtype.names or ()}


def test_convert_goes_round_by_parquet_and_alta(run: Run, sparse: Path) -> None:
    for source, target in (("sparse.csv", "a.parquet"), ("a.parquet", "b.alta"), ("b.alta", "c.csv")):
        ended = run("convert", source, target)
        assert (ended.code, ended.err) == (0, "")
        assert ended.out.startswith(f"{source}: 51 samples, channels value\n")
        assert ended.out.endswith(f"\n{target}\n")
        assert ("sigma not written" in ended.out) == (target == "b.alta")
    first, last = numbers("sparse.csv"), numbers("c.csv")
    assert set(first) - set(last) == {"sigma"}
    assert last["theta_i"] == pytest.approx(first["theta_i"], abs=ROUNDED)
    assert last["theta_o"] == pytest.approx(first["theta_o"], abs=ROUNDED)
    assert last["brdf"] == pytest.approx(first["brdf"], rel=SEVEN_DIGITS)
    assert sorted(os.listdir()) == ["a.parquet", "b.alta", "c.csv", "sparse.csv"]


def test_convert_to_merl_refuses_what_is_there_until_forced(run: Run, sparse: Path) -> None:
    Path("gold.binary").write_text("mine")
    refused = run("convert", sparse, "gold.binary")
    assert_refused(refused, r"gold\.binary: already exists; choose another name, or --force")
    assert Path("gold.binary").read_text() == "mine"
    ended = run("convert", sparse, "gold.binary", "--force")
    assert ended.code == 0
    assert "One channel written to all three planes of the MERL file." in ended.out
    # Matusik's BRDFRead.cpp: three int32, then a float64 for each cell of three planes.
    assert Path("gold.binary").stat().st_size == 12 + 3 * 8 * 90 * 90 * 180


@pytest.mark.study
def test_convert_completes_a_table(run: Run, sparse: Path) -> None:
    """Each third reading is missing: what is there stays, what was missing is inferred to within its sd."""
    lines = sparse.read_text().splitlines()
    head = [line for line in lines if line.startswith("#")]
    columns, *rows = lines[len(head) :]
    Path("holes.csv").write_text("\n".join([columns, *(row for k, row in enumerate(rows) if k % 3)]) + "\n")
    ended = run("convert", "holes.csv", "whole.csv", "--complete")
    assert ended.code == 0
    assert "34 rows as measured, 17 inferred, half of them to within " in ended.out
    first, last = numbers("sparse.csv"), numbers("whole.csv")
    assert last["theta_o"] == pytest.approx(first["theta_o"], abs=GROUPED)
    inferred = last["inferred"] == 1
    found, sd, meant = last["brdf"], last["inferred_sd"], first["brdf"]
    assert found[~inferred] == pytest.approx(meant[~inferred], rel=SEVEN_DIGITS)
    assert np.mean(np.abs(found - meant)[inferred] < 2.0 * np.hypot(sd, first["sigma"])[inferred]) > 0.8


def test_converting_a_completed_table_says_what_is_left_out(run: Run) -> None:
    Path("whole.csv").write_text("theta_i,theta_o,brdf,inferred\n10,10,1,0\n10,20,2,1\n20,10,1,0\n20,20,3,1\n")
    ended = run("convert", "whole.csv", "again.csv")
    assert ended.code == 0
    assert "2 rows hold values that were inferred, not measured, which are not written: only what was" in ended.out
    assert "They are still in whole.csv; --complete infers them anew." in ended.out
    Path("other.csv").write_text("theta_i,theta_o,brdf\n30,10,1\n30,20,2\n")
    assert "2 rows hold values that were inferred" in run("convert", "whole.csv", "other.csv", "b.csv", "--join").out


def test_what_cannot_be_completed_is_one_sentence(run: Run, sparse: Path) -> None:
    whole = run("convert", sparse, "b.csv", "--complete")
    assert_refused(
        whole, r"sparse\.csv: nothing to complete: every direction of its grid was measured\. Leave --complete out"
    )
    assert_refused(run("convert", sparse, "b.csv", "--complete", "--model", "lambort"), "no lobe 'lambort'")
    assert_refused(run("convert", sparse, "b.csv", "--model", "ggx"), "--model ggx without --complete")
    two = run("convert", sparse, "b.csv", "--complete", "--model", "lambert,ggx")
    assert_refused(two, r"--model lambert,ggx: 2 models, expected the one that fills the gaps")
    Path("few.csv").write_text("theta_i,theta_o,brdf\n10,10,1\n10,20,1\n20,10,1\n")
    few = run("convert", "few.csv", "b.csv", "--complete")
    assert_refused(few, r"few\.csv: 3 valid samples, but lambert\+ggx has 4 free parameters")
    assert sorted(os.listdir()) == ["few.csv", "sparse.csv"]


def test_a_conversion_that_fails_leaves_the_old_file(run: Run, tmp_path: Path) -> None:
    """Three directions at random fill no grid, which a Zemax file needs."""
    source, target = tmp_path / "few.csv", tmp_path / "few.bsdf"
    source.write_text("theta_i,theta_o,phi,brdf\n" + "".join(f"{k},{7 * k},{11 * k},0.{k}\n" for k in range(1, 10)))
    target.write_text("mine")
    assert_refused(run("convert", source, target, "--force"), "No Zemax file can hold .* samples")
    assert target.read_text() == "mine"
    assert sorted(os.listdir(tmp_path)) == ["few.bsdf", "few.csv"]


def test_convert_reads_as_the_flags_say(run: Run, tmp_path: Path) -> None:
    """f = signal / reference · R/π; the cosines of sample and panel cancel (Nicodemus et al. 1977, eq. 5)."""
    source, target = tmp_path / "lab.csv", tmp_path / "alu.csv"
    source.write_text(LAB)
    ended = run("convert", source, target, "--where", "material=Alu", "--panel", 0.98, "--forward", "negative")
    assert (ended.code, ended.err) == (0, "")
    expected = {
        (i, -o): (3.0 + 0.01 * o) / (2.0 + 0.1 * k) * 0.98 / np.pi
        for i in (20, 50)
        for k, o in enumerate(range(-60, 61, 20))
    }
    found = numbers(str(target))
    pairs = zip(found["theta_i"].round(), found["theta_o"].round(), strict=True)
    assert found["brdf"] == pytest.approx([expected[pair] for pair in pairs], rel=SEVEN_DIGITS)
    assert len(found["brdf"]) == len(expected)


# --- refusals -------------------------------------------------------------------------------------

REFUSED: dict[str, tuple[tuple[object, ...], str]] = {
    "no such file": (("check", "none.csv"), r"none\.csv: no such file"),
    "nothing to convert": (("convert", "none.csv", "a.alta"), r"none\.csv: no such file"),
    "picture of no kind": (("check", "sparse.csv", "--plot", "map.txt"), r"map\.txt: no picture, .* png, svg, pdf"),
    "picture without suffix": (("check", "sparse.csv", "--plot", "map"), "map: no picture, expected a name that ends"),
    "format of no kind": (
        ("convert", "sparse.csv", "a.xlsx"),
        r"a\.xlsx: no format has the suffix \.xlsx, .*\.parquet",
    ),
    "format without suffix": (
        ("convert", "sparse.csv", "a"),
        "a: the name has no suffix, which says the format, expected",
    ),
    "onto itself": (("convert", "sparse.csv", "sparse.csv"), r"sparse\.csv: already exists"),
    "to nowhere": (("convert", "sparse.csv", "/proc/x.csv"), r"/proc/x\.csv: cannot be written"),
    "dark in words": (("fit", "sparse.csv", "--dark", "abc"), "--dark abc: expected a number in sr⁻¹, or fit"),
    "dark in words, for check": (("check", "sparse.csv", "--dark", "abc"), "--dark abc: expected a number"),
    "dark below 0": (("fit", "sparse.csv", "--dark", "-1"), "dark = -1 of the instrument, expected 0 to 1"),
    "panel of 3": (("fit", "sparse.csv", "--panel", 3), r"panel = 3 \(--panel\), expected its reflectance factor"),
    "where nothing is": (("check", "sparse.csv", "--where", "material=Alu"), r"expected a column of theta_i.*brdf"),
    "where without value": (
        ("convert", "sparse.csv", "a.csv", "--where", "sigma"),
        r"where = 'sigma' \(--where\), expected NAME=VALUE",
    ),
}


@pytest.mark.parametrize(("arguments", "sentence"), REFUSED.values(), ids=REFUSED)
def test_wrong_input_ends_in_one_line(run: Run, sparse: Path, arguments: tuple[object, ...], sentence: str) -> None:
    assert_refused(run(*arguments), sentence)
    assert os.listdir() == ["sparse.csv"]


@pytest.mark.parametrize(
    "flag", [("--calibration", 3), ("--calibration", "nan"), ("--receiver-angle", 40), ("--source-angle", -1)]
)
def test_numbers_out_of_range_are_wrong_usage(run: Run, sparse: Path, flag: tuple[str, object]) -> None:
    ended = run("check", "sparse.csv", *flag)
    assert ended.code == 2
    assert flag[0] in ended.err


@pytest.mark.parametrize("command", ["check", "convert"])
def test_help_of_check_and_convert_is_complete_at_80_columns(run: Run, command: str) -> None:
    ended = run(command, "--help")
    assert ended.code == 0
    assert "…│" not in ended.out.replace(" ", "")  # no option is cut off
    for word in ("Examples", "--columns", "--panel", "--where", "--force"):
        assert word in ended.out


# --- flags on their way into a fit ----------------------------------------------------------------

SAID: dict[str, tuple[tuple[object, ...], Instrument]] = {
    "nothing": ((), Instrument()),
    "calibration": (("--calibration", 0.03), Instrument(calibration=0.03)),
    "apertures": (("--receiver-angle", 2, "--source-angle", 0.5), Instrument(np.deg2rad(0.5), np.deg2rad(2))),
    "dark signal": (("--dark", 0.002), Instrument(dark=0.002)),
    "dark signal to be fitted": (("--dark", "fit"), Instrument(dark=None)),
    "unknown scale": (("--unknown-scale",), Instrument(calibration=UNKNOWN_SCALE)),
}


@pytest.fixture
def reached(monkeypatch: pytest.MonkeyPatch) -> list[Measurements]:
    """What a fit was asked to fit; it is stopped there."""
    arrived: list[Measurements] = []

    def study(measurements: Measurements, *_: object, **__: object) -> None:
        arrived.append(measurements)
        raise FitmatError("arrived")

    monkeypatch.setattr("fitmat.cli.fit.study", study)
    return arrived


@pytest.mark.parametrize(("flags", "instrument"), SAID.values(), ids=SAID)
def test_what_is_said_of_the_instrument_reaches_the_fit(
    run: Run, sparse: Path, reached: list[Measurements], flags: tuple[object, ...], instrument: Instrument
) -> None:
    assert_refused(run("fit", sparse, *flags), "arrived")
    assert reached[0].instrument == instrument


def test_where_and_panel_reach_the_fit(run: Run, tmp_path: Path, reached: list[Measurements]) -> None:
    path = tmp_path / "lab.csv"
    path.write_text(LAB)
    assert_refused(run("fit", path, "--where", "material=Felt", "--panel", 0.5), "arrived")
    rows = [line.split(",") for line in LAB.splitlines() if line.startswith("Felt")]
    expected = [float(signal) / float(reference) * 0.5 / np.pi for *_, signal, reference in rows]
    assert reached[0].value[:, 0] == pytest.approx(expected, rel=1e-12)  # one division and one product in float64


@pytest.fixture
def halves(sparse: Path) -> list[str]:
    """The file in two, one incidence in the first, and a comma for the point and a reflectance factor in the second."""
    head, *rows = [line for line in sparse.read_text().splitlines() if not line.startswith("#")]
    Path("steep.csv").write_text("\n".join([head, *rows[:17], ""]))
    flat = [[float(cell) for cell in row.split(",")] for row in rows[17:]]
    cells = [f"{i};{o};{np.pi * f:.12g};{np.pi * s:.12g}".replace(".", ",") for i, o, f, s in flat]
    Path("flat.txt").write_text("\n".join(["AOI;VZA;BRF;sigma", *cells, ""]))
    return ["steep.csv", "flat.txt"]


def test_joined_halves_reach_the_fit_as_the_whole(run: Run, halves: list[str], reached: list[Measurements]) -> None:
    assert_refused(run("fit", *halves, "--join", "--calibration", 0.03), "arrived")
    assert_refused(run("fit", "sparse.csv", "--calibration", 0.03), "arrived")
    joined, whole = reached
    for name in ("wi", "wo", "value", "sigma"):
        np.testing.assert_allclose(getattr(joined, name), getattr(whole, name), rtol=1e-9, atol=1e-12)
    assert joined.instrument == whole.instrument


def test_check_and_convert_join_too(run: Run, halves: list[str]) -> None:
    ended = run("check", *halves, "--join")
    assert (ended.code, beside_progress(ended.err)) == (0, "")
    assert ended.out.startswith("steep.csv + flat.txt: 51 samples, channel value.\n")
    assert ended.out.endswith("fitmat check steep.csv flat.txt --join --plot coverage.png\n")
    assert run("convert", *halves, "all.csv", "--join").code == 0
    written, whole = numbers("all.csv"), numbers("sparse.csv")
    assert written["brdf"] == pytest.approx(whole["brdf"], rel=SEVEN_DIGITS)


def test_large_files_are_not_joined(run: Run, halves: list[str], monkeypatch: pytest.MonkeyPatch) -> None:
    """They are read in parts, of one file; several would have to be in memory at once."""
    monkeypatch.setattr("fitmat.measurements.large.chunks.LARGE", 500)
    assert_refused(run("fit", *halves, "--join"), r"steep\.csv: more than 0 MB, expected less in files that are joined")


def test_calibration_and_dark_signal_are_fitted_and_reported(run: Run, tmp_path: Path) -> None:
    r"""A Lambertian surface: f = g (kd/π + b/cosθ_o). kd is known no better than g, and b grows like 1/cosθ_o."""
    kd, dark, path = 0.5, 0.01, tmp_path / "felt.csv"
    wave = np.cos(np.arange(51) ** 2)
    rows = [(i, o, kd / np.pi + dark / np.cos(np.deg2rad(o))) for i in (10, 30, 60) for o in range(-80, 81, 10)]
    lines = (f"{i},{o},{f * (1 + 1e-3 * w):.9g},{1e-3 * f:.9g}" for (i, o, f), w in zip(rows, wave, strict=True))
    path.write_text("\n".join(["theta_i,theta_o,brdf,sigma", *lines, ""]))
    ended = run("fit", path, "--models", "lambert", "--no-mcmc", "--json", "--calibration", 0.03, "--dark", "fit")
    assert ended.code == 0
    found = strict(ended.out)["fits"][0]["parameters"]
    # 51 samples of 0.1 % know kd g to 0.03 %, so that the 3 % of g remain; the sd of 2,000 weighted draws, some 1,000
    # independent ones, has an error of 2.2 %, here three times that.
    assert found["kd"]["sd"] == pytest.approx(0.03 * kd, rel=0.066)
    assert found["scale"]["sd"] == pytest.approx(0.03, rel=0.066)
    assert found["kd"]["value"] == pytest.approx(kd, rel=2e-3)
    assert found["dark"]["value"] == pytest.approx(dark, rel=1e-2)
