"""Chunks of a file are what `fitmat.read` makes of it in one piece, whatever is irregular in it; else it is refused."""

import dataclasses
import re
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl
import pytest

import fitmat as fm
from fitmat.errors import ReadError
from fitmat.measurements.large import chunks, tables
from fitmat.measurements.large.chunks import Chunks
from fitmat.measurements.parsing import contents

COUNT = 400
"""Rows of a file, some 20 blocks of `SMALL` bytes."""

SMALL = 600
"""Bytes of a text block, and half of those that show the layout: each file has many."""

EVEN = 3.0
"""Standard deviations of a random choice; one that is spread evenly stays far inside."""


@pytest.fixture(autouse=True)
def _small_blocks(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(tables, "TEXT_BLOCK", SMALL)
    monkeypatch.setattr(contents, "HEAD", 2 * SMALL)


def numbers(seed: int = 1) -> dict[str, np.ndarray]:
    """Columns of a file in which nothing is odd."""
    rng = np.random.default_rng(seed)
    return {
        "theta_i": np.round(rng.uniform(0, 80, COUNT), 2),
        "theta_o": np.round(rng.uniform(0, 80, COUNT), 2),
        "phi": np.round(rng.uniform(0, 360, COUNT), 2),
        "brdf": np.round(rng.uniform(0.1, 2, COUNT), 5),
        "sigma": np.round(rng.uniform(0.01, 0.02, COUNT), 5),
    }


def lines(columns: dict[str, np.ndarray], separator: str = ",") -> list[str]:
    """Header and rows."""
    rows = zip(*(column.tolist() for column in columns.values()), strict=True)
    return [separator.join(columns), *(separator.join(map(str, row)) for row in rows)]


def saved(folder: Path, content: list[str] | str | bytes) -> Path:
    path = folder / "big.csv"
    content = "\n".join([*content, ""]) if isinstance(content, list) else content
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    return path


def assert_same(found: Chunks, whole: fm.Measurements) -> None:
    """Rows, masks, counts and notes, apart from repeats, which are not counted in a large file."""
    read = list(found)
    assert len(read) > 5
    for name in ("wi", "wo", "value", "valid"):
        np.testing.assert_array_equal(np.concatenate([getattr(m, name) for m in read]), getattr(whole, name))
    if whole.sigma is not None:
        np.testing.assert_array_equal(np.concatenate([np.asarray(m.sigma) for m in read]), whole.sigma)
    assert all((m.sigma is None) == (whole.sigma is None) for m in read)
    assert {m.channels for m in [*read, found.part]} == {whole.channels}
    assert (found.n_samples, found.n_valid, found.part.masked) == (whole.n_samples, whole.n_valid, whole.masked)
    counted = [note for note in whole.notes if not note.startswith("Rows that repeat")]
    assert [note for note in found.part.notes if not note.startswith("Shown")] == counted


def irregular(name: str) -> list[str] | str | bytes:
    """Files that differ from the plain one in how they are written."""
    plain = lines(numbers())
    if name == "comments":
        return ["# Gonio 7", plain[0], *(x for k, row in enumerate(plain[1:]) for x in ([row, "% turn"][: 1 + k % 2]))]
    if name == "closing comment":
        return "\n".join([*plain, "# end of file"])
    if name == "header in a comment":
        return ["# turn 1", f"# {plain[0]}", *plain[1:200], "# turn 2", *plain[200:]]
    if name == "decimal comma":
        return [row.replace(".", ",") for row in lines(numbers(), ";")]
    if name == "white space":
        return [re.sub(",", "   ", row) for row in plain]
    if name == "quotes":
        return [plain[0], *('"' + row.replace(",", '", "') + '"' for row in plain[1:])]
    if name == "byte-order mark":
        return b"\xef\xbb\xbf" + "\n".join(plain).encode()
    if name == "Windows":
        return "\r\n".join(["# Büro", *plain]).encode("cp1252")
    return plain


WRITTEN = ("plain", "comments", "closing comment", "header in a comment", "decimal comma", "white space", "quotes")


@pytest.mark.parametrize("name", [*WRITTEN, "byte-order mark", "Windows"])
def test_chunks_are_what_is_read_in_one_piece(name: str, tmp_path: Path) -> None:
    path = saved(tmp_path, irregular(name))
    assert_same(chunks.scan(path, rows=33), fm.read(path))


@pytest.mark.parametrize("quantity", ["brdf_cos", "reflectance_factor", "radiance"])
def test_quantities_are_converted_and_empty_cells_masked(quantity: str, tmp_path: Path) -> None:
    columns = numbers()
    columns[f"{quantity}_r"], columns[f"{quantity}_g"] = columns.pop("brdf"), columns.pop("sigma")
    content = lines(columns)
    content[100] = content[100].rsplit(",", 1)[0] + ","
    content[200] = ",".join(["n/a", *content[200].split(",")[1:]])
    content[300] = ",".join(["100", *content[300].split(",")[1:]])  # light from below the horizon
    given: dict[str, Any] = {"intensity": 10.0, "distance": 2.0} if quantity == "radiance" else {}
    path = saved(tmp_path, content)
    assert_same(chunks.scan(path, rows=33, **given), fm.read(path, **given))


def test_a_column_of_words_is_read_as_such(tmp_path: Path) -> None:
    columns = {"who": np.full(COUNT, "anna"), **numbers(), "valid": np.where(np.arange(COUNT) % 3, "true", "no")}
    path = saved(tmp_path, lines(columns))
    assert_same(chunks.scan(path, rows=33), fm.read(path))


@pytest.mark.parametrize("kind", [pl.Float64, pl.Float32, pl.String, pl.Decimal(12, 5)])
def test_parquet_is_read_like_its_columns(kind: Any, tmp_path: Path) -> None:
    """The oracle is `fitmat.read` of the same numbers as arrays."""
    columns = numbers()
    frame = pl.DataFrame(columns).with_columns(pl.col("brdf").cast(kind), valid=pl.Series(np.arange(COUNT) % 5 > 0))
    frame = frame.with_columns(list=pl.lit([1.0]), theta_i=pl.when(pl.col("valid")).then("theta_i"))
    path = tmp_path / "big.parquet"
    frame.write_parquet(path, row_group_size=50)
    plain = frame.drop("list").with_columns(pl.col("brdf").cast(pl.Float64), pl.col("valid").cast(pl.Float64))
    whole = fm.read({name: plain[name].fill_null(np.nan).to_numpy() for name in plain.columns})
    assert_same(chunks.scan(path, rows=33), whole)


@pytest.mark.parametrize("where", ["run=3", "who=anna"])
def test_rows_are_chosen_by_a_column(where: str, tmp_path: Path) -> None:
    """A number is compared as it is written; some chunks hold no such row."""
    run = np.where(np.arange(COUNT) // 20 % 3 == 1, "3", "4")
    content = lines({"run": run, "who": np.where(run == "3", "anna", "otto"), **numbers()})
    found = chunks.scan(saved(tmp_path, content), rows=11, where=where)
    whole = fm.read(found.path, where=where)
    notes = [
        note if not note.startswith("Only rows") else f"Only rows with {where.replace('=', ' = ')}."
        for note in whole.notes
    ]
    assert_same(found, dataclasses.replace(whole, notes=tuple(notes)))
    with pytest.raises(ReadError, match=r"every row is masked \(none chosen\)"):
        chunks.scan(found.path, rows=11, where="run=5")
    with pytest.raises(ReadError, match="expected a column of run, who"):
        chunks.scan(found.path, rows=11, where="walk=3")


def test_a_signal_is_compared_with_its_reference(tmp_path: Path) -> None:
    columns = numbers()
    columns["signal"], columns["reference"] = columns.pop("brdf"), 1.0 + columns.pop("sigma")
    path = saved(tmp_path, lines(columns))
    assert_same(chunks.scan(path, rows=33, panel=0.99), fm.read(path, panel=0.99))


def test_an_unknown_scale_is_one_for_the_whole_file(tmp_path: Path) -> None:
    columns = numbers()
    columns["brdf"] *= 1000
    path = saved(tmp_path, lines(columns))
    found, raw = chunks.scan(path, rows=33, part=200, unknown_scale=True), fm.read(path)
    whole = fm.read(path, unknown_scale=True)
    factor = np.unique((raw.value / np.concatenate([m.value for m in found])).round(9))
    assert factor.tolist() == [pytest.approx(found.factor)]
    assert found.factor == pytest.approx(raw.value[0, 0] / whole.value[0, 0], rel=0.1)  # its guess is as rough
    assert found.part.instrument == whole.instrument
    assert found.part.value.max() == pytest.approx(max(m.value.max() for m in found), rel=0.01)


def test_a_sentinel_is_one_of_the_whole_file(tmp_path: Path) -> None:
    """One −999 in a chunk is masked because there are others elsewhere."""
    columns = numbers()
    columns["brdf"][::90] = -999.0
    path = saved(tmp_path, lines(columns))
    found = chunks.scan(path, rows=33)
    assert found.part.masked == {"sentinel -999": 5}
    assert_same(found, fm.read(path))


def test_a_usual_sentinel_is_one_beside_other_negative_values(tmp_path: Path) -> None:
    columns = numbers()
    columns["brdf"][[3, 300]] = -0.001, -0.002
    columns["brdf"][[5, 9]] = -999.0, -9999.0
    path = saved(tmp_path, lines(columns))
    found = chunks.scan(path, rows=33)
    assert found.part.masked == {"sentinel -999": 1, "sentinel -9999": 1}
    assert "Negative values kept as noise: 2." in found.part.notes
    assert_same(found, fm.read(path))


@pytest.mark.parametrize("above", [("0,5", "1,234"), ("5", "1,234")])
def test_commas_are_read_alike_in_all_chunks(tmp_path: Path, above: tuple[str, str]) -> None:
    """Decimals above and thousands below, or the other way round, are refused; neither is read in silence."""
    below = ("5" if above[0] == "0,5" else "0,5", "1,234")
    rows = [f'10,{k % 80},"{cells[k % 2]}"' for cells in (above, below) for k in range(200)]
    path = tmp_path / "commas.csv"
    path.write_text("\n".join(["theta_i,theta_o,brdf", *rows]), encoding="utf-8")
    with pytest.raises(ReadError, match="commas that separate thousands here, or above, and decimals elsewhere"):
        chunks.scan(path, rows=33)


def test_equal_negatives_in_one_chunk_are_noise_if_others_differ(tmp_path: Path) -> None:
    columns = numbers()
    columns["brdf"][[3, 5, 9]] = -0.001
    columns["brdf"][300] = -0.002
    path = saved(tmp_path, lines(columns))
    found = chunks.scan(path, rows=33)
    assert found.part.masked == {}
    assert "Negative values kept as noise: 4." in found.part.notes
    assert_same(found, fm.read(path))


def test_small_angles_in_one_chunk_are_no_doubt_about_the_unit(tmp_path: Path) -> None:
    columns = numbers()
    columns["theta_i"][:100] = columns["theta_o"][:100] = 1.0
    path = saved(tmp_path, lines(columns))
    assert_same(chunks.scan(path, rows=33), fm.read(path))


def test_radians_are_asked_about_as_in_one_piece(tmp_path: Path) -> None:
    columns = {name: np.deg2rad(c) if name in ("theta_i", "theta_o") else c for name, c in numbers().items()}
    path = saved(tmp_path, lines(columns))
    with pytest.raises(ReadError, match="they look like radians") as whole:
        fm.read(path)
    with pytest.raises(ReadError, match="they look like radians") as found:
        chunks.scan(path, rows=33)
    largest = r"exceeds [\d.]+"
    assert re.sub(largest, "", str(found.value)) == re.sub(largest, "", str(whole.value))
    columns["phi"] = np.deg2rad(columns["phi"])
    path = saved(tmp_path, lines(columns))
    assert_same(chunks.scan(path, rows=33, angle_unit="radians"), fm.read(path, angle_unit="radians"))


@pytest.mark.parametrize("name", ["phi", "theta_o"])
def test_one_column_in_radians_is_asked_about_as_in_one_piece(name: str, tmp_path: Path) -> None:
    columns = numbers()
    columns[name] = np.round(np.deg2rad(columns[name]), 5)
    path = saved(tmp_path, lines(columns))
    said = []
    for read in (fm.read, lambda path: chunks.scan(path, rows=33)):
        with pytest.raises(ReadError, match=f"--angle-unit {name}=radians") as raised:
            read(path)
        said.append(str(raised.value))
    assert said[0] == said[1]
    unit = f"{name}=radians"
    assert_same(chunks.scan(path, rows=33, angle_unit=unit), fm.read(path, angle_unit=unit))


def test_constants_of_a_large_file_are_those_of_one_piece(tmp_path: Path) -> None:
    columns = numbers()
    del columns["theta_i"]
    plain = lines(columns)
    path = saved(tmp_path, ["# theta_i = 30 deg", *plain])
    assert_same(chunks.scan(path, rows=33), fm.read(path))
    path = saved(tmp_path, plain)
    said = {"theta_i": 40.0}
    assert_same(chunks.scan(path, rows=33, constants=said), fm.read(path, constants=said))
    path = saved(tmp_path, ["# theta_i = 30 deg", *plain, "# theta_i = 60 deg", *plain[1:]])
    for read in (fm.read, lambda path: chunks.scan(path, rows=33)):
        with pytest.raises(ReadError, match="comments state theta_i = 30 in row 1 and 60 in row 403"):
            read(path)


@pytest.mark.study
@pytest.mark.parametrize("period", [2, 64, 100])
def test_the_part_is_spread_evenly_over_rows_and_over_what_repeats(period: int, tmp_path: Path) -> None:
    """Of rows in which an angle repeats with a period, the part has all its values about equally often."""
    count = 12_800
    angle = 10.0 + np.arange(count) % period / period
    content = lines({"theta_i": np.full(count, 30.0), "theta_o": angle, "brdf": 1.0 + np.arange(count)})
    found = chunks.scan(saved(tmp_path, content), rows=1000, part=1000)
    part = found.part
    assert found.thinning == 16
    assert 500 < part.n_samples <= 1000
    assert len(np.unique(part.theta_o.round(9))) == period
    row = part.value[:, 0] - 1.0
    assert abs(row.mean() / count - 0.5) < EVEN / np.sqrt(12 * len(row))
    chosen = np.concatenate([found.in_part(first, 1000) for first in range(0, count, 1000)])
    np.testing.assert_array_equal(np.flatnonzero(chosen[:count]), row)
    assert part.notes[-1] == f"Shown: one row in 16, evenly spread over the {count:,} rows; all are fitted."


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({350: "1,2,3,4"}, "4 cells, expected 5"),
        ({350: "1,2,3,4,5,6"}, "6 cells, expected 5"),
        ({350: "1,2,3,four,5"}, "row 351: brdf = four, expected a number"),
        ({350: "1,200,3,4,5"}, "row 351: theta_o = 200"),
        ({350: '"1,2,3,4,5'}, "without its end"),
        ({0: "theta_i,theta_o,wavelength,brdf,sigma"}, "a column wavelength, one row for each channel"),
        ({0: "theta_i,theta_o,phi,value,sigma"}, "does not say what it holds"),
    ],
)
def test_what_is_wrong_in_a_later_block_is_named(change: dict[int, str], message: str, tmp_path: Path) -> None:
    content = lines(numbers())
    for row, text in change.items():
        content[row] = text
    with pytest.raises(ReadError, match=re.escape(message)):
        chunks.scan(saved(tmp_path, content), rows=33)


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ("\n".join(lines(numbers())).encode("utf-16"), "UTF-16, or carriage returns alone"),
        ("\r".join(lines(numbers())), "UTF-16, or carriage returns alone"),
        ("\n".join([*lines(numbers()), *(9 * lines(numbers())[1:]), "1" * 3 * SMALL]), "no line end within 600 bytes"),
        ("theta_i,theta_o,brdf\n" + 300 * "100,10,1\n", "every row is masked (300 at or below the horizon)"),
        (b"PAR1 and no more, PAR1", "its Parquet content cannot be read"),
        (b"", "the file is empty"),
    ],
)
def test_what_is_no_large_table_is_refused(content: str | bytes, message: str, tmp_path: Path) -> None:
    with pytest.raises(ReadError, match=re.escape(message)):
        chunks.scan(saved(tmp_path, content))


def test_a_parquet_file_without_rows_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "none.parquet"
    pl.DataFrame({"theta_i": [], "theta_o": [], "brdf": []}).write_parquet(path)
    with pytest.raises(ReadError, match="no rows, expected at least one measured value"):
        chunks.scan(path)


def test_progress_counts_the_rows_read(tmp_path: Path) -> None:
    told: list[tuple[str, int, int]] = []
    chunks.scan(saved(tmp_path, lines(numbers())), rows=33, progress=lambda *said: told.append(said))
    done = [count for _, count, _ in told]
    assert done == sorted(done)
    assert done[-1] == COUNT
    assert {(what, total) for what, _, total in told} == {("reading", 0)}
