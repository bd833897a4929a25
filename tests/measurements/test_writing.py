"""Writing: what is written is read back, by fitmat and by others, and no file of the user's is lost on the way."""

import contextlib
import csv
import dataclasses
import errno
import os
import sys
import types
import warnings
from pathlib import Path

import numpy as np
import polars as pl
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from fitmat.errors import OutputError, ReadError
from fitmat.files import write_bytes, write_text
from fitmat.measurements import options, writing
from fitmat.measurements.formats import parquet
from fitmat.measurements.parsing import tabular
from fitmat.measurements.reader import measured as finished
from fitmat.measurements.reader import read
from fitmat.measurements.samples import Measurements, default_channels, from_arrays
from fitmat.measurements.writing import write

SEVEN_DIGITS = 5.1e-7
"""Relative: half a unit of the seventh digit, where the first is 1."""

ANGLE = 1e-8
"""Radians: CSV angles are rounded to 10⁻⁶ degrees, which is 1.7e-8 radians."""

EXACT = 1e-15
"""Degrees and back to radians, and the sine and cosine of them, in float64."""


def scattered(rows: int = 60) -> Measurements:
    """Measurements out of plane, over nine decades, with σ and masked values."""
    rng = np.random.default_rng(1)
    value = 10 ** rng.uniform(-5, 4, (rows, 3))
    value[rng.random((rows, 3)) < 0.1] = np.nan
    theta_i, theta_o = rng.uniform(0, 1.5, rows), rng.uniform(0.1, 1.5, rows)
    phi, phi_i = rng.uniform(0, np.pi, rows), rng.uniform(0, 2 * np.pi, rows)
    return from_arrays(theta_i, theta_o, value, phi=phi, phi_i=phi_i, sigma=0.02 * np.abs(value))


def in_plane() -> Measurements:
    """One channel along the plane of incidence, without σ, one of 30 values masked."""
    theta_i, theta_o = (a.ravel() for a in np.meshgrid([0.2, 1.0], np.linspace(-1.4, 1.4, 15), indexing="ij"))
    value = 0.1 + np.cos(theta_i - theta_o) ** 50
    value[7] = np.nan
    return from_arrays(theta_i, theta_o, value)


def from_parquet(path: Path) -> Measurements:
    """The table of a Parquet file, read as `read` reads a table."""
    choices = options.Options()
    return finished(tabular.recording(parquet.load(path), None, choices), choices)


# --- round trips ----------------------------------------------------------------------------------


@pytest.mark.parametrize("make", [scattered, in_plane])
def test_csv_comes_back_to_seven_digits(tmp_path, make):
    there = make()
    back = read(write(there, tmp_path / "table.csv"))
    assert back.channels == there.channels
    assert np.array_equal(back.valid, there.valid)
    assert back.value[there.valid] == pytest.approx(there.value[there.valid], rel=SEVEN_DIGITS)
    assert (back.sigma is None) == (there.sigma is None)
    if back.sigma is not None and there.sigma is not None:
        assert back.sigma[there.valid] == pytest.approx(there.sigma[there.valid], rel=SEVEN_DIGITS)
    assert back.wi == pytest.approx(there.wi, abs=ANGLE)
    assert back.wo == pytest.approx(there.wo, abs=ANGLE)


@pytest.mark.parametrize("make", [scattered, in_plane])
def test_parquet_comes_back_exactly(tmp_path, make):
    there = make()
    path = write(there, tmp_path / "table.parquet")
    back = from_parquet(path)
    assert back.channels == there.channels
    assert np.array_equal(back.valid, there.valid)
    assert np.array_equal(back.value, there.value)
    if back.sigma is not None and there.sigma is not None:
        assert np.array_equal(back.sigma[there.valid], there.sigma[there.valid])
    assert back.wi == pytest.approx(there.wi, abs=EXACT)
    assert back.wo == pytest.approx(there.wo, abs=EXACT)


def test_parquet_and_csv_hold_the_same_columns(tmp_path):
    """Readers: Python's csv module and polars' read_parquet, which know nothing of fitmat."""
    there = scattered()
    with write(there, tmp_path / "table.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    frame = pl.read_parquet(write(there, tmp_path / "table.parquet"))
    assert list(rows[0]) == frame.columns == ["theta_i", "theta_o", "phi_i", "phi_o", *VALUES]
    assert set(frame.dtypes) == {pl.Float64}
    for name in frame.columns:
        text = np.array([float(row[name]) for row in rows])
        rounding = 5.1e-7 if name.startswith(("theta", "phi")) else 0
        assert text == pytest.approx(frame[name].to_numpy(), rel=SEVEN_DIGITS, abs=rounding, nan_ok=True)


VALUES = ("brdf_r", "brdf_g", "brdf_b", "sigma_r", "sigma_g", "sigma_b")


NASTY = (
    "VIS", "R", "sigma_r", "theta_i", "brdf", "channel", "cos", "value", "550nm", "a,b", "a;b", "a\tb", 'a"b', '"',
    '""', '" , "', "a , b", "# a", "#N/A", "NA", "%", "//", "a b", " a", "a ", " ", "", "θ, °", "日本", "1", "1,5",
    "10,691", "-999", "1e3", "sep=;", "[red]", "a\nb", "a\rb", "a\0", "\x1b[31m", "\u202e", "\ufeff", "\ud800",
)  # fmt: skip


def named(*channels: str, sigma: float | None = 0.1) -> Measurements:
    """Two rows of each channel, no value like another."""
    value = 1.0 + np.arange(2.0 * len(channels)).reshape(2, -1)
    return dataclasses.replace(from_arrays([0.1, 0.2], [0.3, 0.4], value, sigma=sigma), channels=channels)


@settings(deadline=None, derandomize=True, max_examples=40)
@given(
    channels=st.lists(st.sampled_from(NASTY) | st.text(max_size=6), min_size=1, max_size=4),
    suffix=st.sampled_from([".csv", ".parquet", ".alta"]),
    sigma=st.sampled_from([None, 0.1]),
)
@example(channels=["VIS", "NIR"], suffix=".parquet", sigma=None)
@example(channels=["r", "sigma_r"], suffix=".csv", sigma=0.1)
@example(channels=["r", "r"], suffix=".csv", sigma=None)
@example(channels=["a , b"], suffix=".csv", sigma=None)
def test_a_channels_name_comes_back_or_is_refused(tmp_path_factory, channels, suffix, sigma):
    there = named(*channels, sigma=sigma)
    path = tmp_path_factory.mktemp("names") / f"table{suffix}"
    with warnings.catch_warnings(), contextlib.suppress(OutputError):
        warnings.simplefilter("ignore")
        write(there, path)
    if not path.exists():
        return
    back = read(path, angle_unit="degrees") if suffix != ".alta" else read(path)
    assert back.value.tolist() == there.value.tolist()
    lost = any("Names of channels not written" in words for words in writing.losses(there, path))
    assert back.channels == (default_channels(len(channels)) if lost else tuple(channels))
    if sigma is not None and suffix != ".alta":
        assert back.sigma == pytest.approx(np.full(there.value.shape, sigma), rel=1e-15)


@pytest.mark.parametrize("suffix", [".csv", ".parquet"])
@pytest.mark.parametrize("name", ["VIS", "R", "sigma_r", "a,b", 'a"b', "a , b", "550nm", "θ, °", "# a", "a\tb", "NA"])
def test_usual_names_of_channels_are_held(tmp_path, suffix, name):
    back = read(write(named("g", name), tmp_path / f"table{suffix}"), angle_unit="degrees")
    assert back.channels == ("g", name)
    assert back.value.tolist() == [[1.0, 2.0], [3.0, 4.0]]


@pytest.mark.parametrize(
    ("suffix", "names", "sentence"),
    [
        (
            ".csv",
            ("a\nb", "c"),
            r"array: 'a\\nb' is a channel's name that would not be read back from such a file, exp",
        ),
        (".csv", ("10,691", "c"), "'10,691' is a channel's name that would not"),
        (".csv", ("r", "r"), "'r' is the name of two channels, expected .*, each once. Rename the channel."),
        (".parquet", ("a ", "c"), "'a ' is a channel's name that would not"),
        (".parquet", ("", "c"), "'' is a channel's name that would not"),
        (".parquet", ("\ud800", "c"), r"'\\ud800' is a channel's name that would not"),
    ],
)
def test_a_name_that_would_be_lost_is_refused(tmp_path, suffix, names, sentence):
    with pytest.raises(OutputError, match=sentence):
        write(named(*names), tmp_path / f"table{suffix}")
    assert not list(tmp_path.iterdir())


def test_a_line_for_each_channel_is_what_others_read(tmp_path):
    """Reader: Python's csv module."""
    with write(named("VIS", 'a,"b"'), tmp_path / "table.csv").open(newline="", encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    assert [(row["channel"], float(row["brdf"])) for row in rows] == [
        ("VIS", 1.0),
        ('a,"b"', 2.0),
        ("VIS", 3.0),
        ('a,"b"', 4.0),
    ]


def test_the_name_of_one_channel_comes_back(tmp_path):
    assert read(write(named("550", sigma=None), tmp_path / "a.csv"), angle_unit="degrees").channels == ("550",)


@pytest.mark.parametrize("channels", [("r", "r"), ("r",), ("r", "g", "b")])
def test_each_channel_has_a_name_of_its_own(channels):
    with pytest.raises(ReadError, match=r"channels r.* for 2 columns of values, expected one name each, all diff"):
        from_arrays([0.1], [0.2], [[1.0, 2.0]], channels=channels)


def test_what_a_source_is_called_breaks_no_file(tmp_path):
    there = dataclasses.replace(named("value"), source="a\n#DIM 9 9\x1b[31m")
    with pytest.warns(UserWarning, match="sigma not written"):
        path = write(there, tmp_path / "a.alta")
    assert read(path).n_samples == 2


# --- files of the user ----------------------------------------------------------------------------


def test_an_existing_file_is_replaced_by_force_only(tmp_path):
    path = tmp_path / "table.csv"
    path.write_text("mine")
    with pytest.raises(OutputError, match=r"table\.csv: already exists; .* or --force \(force=True\) to replace it"):
        write(in_plane(), path)
    assert path.read_text() == "mine"
    assert write(in_plane(), path, force=True) == path
    assert read(path).n_valid == 29
    assert [item.name for item in tmp_path.iterdir()] == ["table.csv"]


def test_a_link_counts_as_a_file_even_where_it_leads_nowhere(tmp_path):
    link = tmp_path / "link.csv"
    link.symlink_to(tmp_path / "nowhere")
    with pytest.raises(OutputError, match="already exists"):
        write(in_plane(), link)
    assert link.is_symlink()


@pytest.mark.parametrize("step", ["write_bytes", "replace"])
def test_a_full_disk_leaves_the_old_file_and_nothing_else(tmp_path, monkeypatch, step):
    def refuse(*_: object, **__: object) -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    path = tmp_path / "table.csv"
    path.write_text("mine")
    (tmp_path / "table.csv.part").write_text("mine too")
    monkeypatch.setattr(os if step == "replace" else Path, step, refuse)
    with pytest.raises(OutputError, match=r"table\.csv: cannot be written \(No space left on device\); choose another"):
        write(in_plane(), path, force=True)
    assert {item.name: item.read_text() for item in tmp_path.iterdir()} == {
        "table.csv": "mine",
        "table.csv.part": "mine too",
    }


def test_impossible_places_are_refused(tmp_path):
    (tmp_path / "file").write_text("mine")
    (tmp_path / "folder.csv").mkdir()
    for path in (tmp_path / "file" / "a.csv", tmp_path / "a\0.csv", tmp_path / f"{'a' * 300}.csv"):
        with pytest.raises(OutputError, match="cannot be written"):
            write(in_plane(), path)
    with pytest.raises(OutputError, match=r"folder\.csv: cannot be written \(Is a directory\)"):
        write(in_plane(), tmp_path / "folder.csv", force=True)
    assert sorted(item.name for item in tmp_path.iterdir()) == ["file", "folder.csv"]


def test_a_folder_is_made_and_text_and_bytes_are_written_as_they_are(tmp_path):
    path = tmp_path / "a" / "b" / "c.txt"
    assert write_text(path, "θ\r\n").read_bytes() == "θ\r\n".encode()
    assert write_bytes(path, b"\0\n").read_bytes() == b"\0\n"
    ordinary = tmp_path / "ordinary"
    ordinary.write_bytes(b"")
    assert path.stat().st_mode == ordinary.stat().st_mode


@pytest.mark.parametrize("name", ["table", "table.xlsx", "table.csv.gz"])
def test_an_unknown_suffix_is_refused(tmp_path, name):
    with pytest.raises(OutputError, match=r"expected \.csv, \.parquet, \.binary, \.bsdf, \.alta"):
        write(in_plane(), tmp_path / name)
    assert not list(tmp_path.iterdir())


def test_a_suffix_may_be_in_capitals(tmp_path):
    assert read(write(in_plane(), tmp_path / "TABLE.CSV")).n_valid == 29


@pytest.mark.parametrize("suffix", [".bsdf", ".alta"])
def test_text_of_a_format_is_written_and_what_it_loses_is_warned_of(tmp_path, monkeypatch, suffix):
    room = types.ModuleType("room")
    vars(room).update(dump=lambda m: f"{m.n_samples} θ\n", losses=lambda m: ("No sigma.", "No hue."))
    monkeypatch.setitem(sys.modules, f"fitmat.measurements.formats.{writing.FORMATS[suffix]}", room)
    with pytest.warns(UserWarning, match=rf"^table\{suffix}: No sigma\. No hue\.$") as caught:
        path = write(in_plane(), tmp_path / f"table{suffix}")
    assert path.read_text(encoding="utf-8") == "30 θ\n"
    assert caught[0].filename == __file__


def test_what_the_instrument_adds_is_not_in_the_file(tmp_path: Path) -> None:
    """A table of values known but for a factor would be read as sr⁻¹."""
    table = {"theta_i": [30.0, 30.0], "theta_o": [10.0, 20.0], "brdf": [500.0, 600.0]}
    with pytest.warns(UserWarning, match=r"say it again when it is read: Instrument: scale unknown\."):
        write(read(table, unknown_scale=True), tmp_path / "scaled.csv")
