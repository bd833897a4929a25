"""Names that users or their files choose are text: no terminal and no page obeys them."""

import json
import logging
import shlex
import signal
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import polars as pl
import pytest
from test_commands import beside_progress

from fitmat.cli.main import main
from fitmat.measurements.reader import read
from fitmat.text import for_shell, visible

HOSTILE = "\x1b]0;pwn\x07\x9b31m\u202e\u200b\x7f\r\n[red]forged"
"""A title for the window, C1 colour, a turn of direction, no width, deletion, another line, and markup of rich."""

Run = Callable[..., tuple[int, str, str]]


@pytest.fixture
def run(monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]) -> Iterator[Run]:
    """Run `fitmat ARGUMENTS` in this process."""

    def call(*arguments: object) -> tuple[int, str, str]:
        monkeypatch.setattr(sys, "argv", ["fitmat", *map(str, arguments)])
        with pytest.raises(SystemExit) as end:
            main()
        out, err = capfd.readouterr()
        return int(end.value.code or 0), out, err

    monkeypatch.setenv("COLUMNS", "200")
    handler = signal.getsignal(signal.SIGINT)
    yield call
    signal.signal(signal.SIGINT, handler)
    logging.disable(logging.NOTSET)


@pytest.fixture
def hostile(tmp_path: Path) -> Path:
    """A file whose name, channels and spare column are hostile."""
    rows = [(i, o) for i in (10.0, 30.0, 60.0) for o in range(-80, 81, 10)]
    channels = [HOSTILE, f"b{HOSTILE}"]
    path = tmp_path / f"it's {HOSTILE}.parquet"
    table = {
        "theta_i": [i for i, _ in rows for _ in channels],
        "theta_o": [float(o) for _, o in rows for _ in channels],
        "brdf": [0.1 + 0.001 * o + 0.1 * k for _, o in rows for k in range(2)],
        "channel": channels * len(rows),
        HOSTILE: 0.0,
    }
    pl.DataFrame(table).write_parquet(path)
    return path


def odd_letters(text: str) -> list[str]:
    return sorted({letter for letter in text if not letter.isprintable() and letter != "\n"})


def assert_obeyed_by_none(text: str) -> None:
    assert odd_letters(text) == [], text
    assert not any(line.startswith(("forged", "[red]forged")) for line in text.splitlines())


def test_what_cannot_be_printed_is_shown_as_json_writes_it():
    text = '\x1b\x7f\x9b\u202e\ud800\U000e0001\t\n"θ€'
    assert visible(text) == '\\u001b\\u007f\\u009b\\u202e\\ud800\\udb40\\udc01\\t\\n"θ€'
    assert visible(text, keep="\n").count("\n") == 1
    assert json.loads(visible(json.dumps([text], ensure_ascii=False))) == [text]


def test_paths_in_commands_are_quoted(tmp_path):
    path = tmp_path / "a b$(x)'c.csv"
    assert shlex.split(for_shell(path)) == [str(path)]


def test_check_shows_hostile_names_as_text(run, hostile):
    code, out, err = run("check", hostile)
    assert (code, beside_progress(err)) == (0, "")
    assert_obeyed_by_none(out)
    assert_obeyed_by_none(err)
    assert r"channels (\u001b]0;pwn\u0007\u009b31m\u202e\u200b\u007f\r\n[red]forged" in out
    assert f"fitmat check {for_shell(hostile)} --plot" in out


def test_json_with_hostile_names_stays_json(run, hostile):
    code, out, _ = run("check", hostile, "--json")
    assert code == 0
    assert_obeyed_by_none(out)
    assert list(json.loads(out)["channels"]) == [HOSTILE, f"b{HOSTILE}"]


def test_convert_shows_hostile_names_as_text(run, hostile, tmp_path):
    target = tmp_path / f"{HOSTILE}.alta"
    code, out, err = run("convert", hostile, target)
    assert (code, err) == (0, "")
    assert_obeyed_by_none(out)
    assert "Names of channels not written" in out
    assert read(target).n_samples == 51


@pytest.mark.parametrize(
    ("arguments", "ends"),
    [
        (("fit", f"none{HOSTILE}.csv"), 1),
        (("check", "HOSTILE", "--columns", f"theta_i=x{HOSTILE}"), 1),
        (("check", "HOSTILE", "--where", f"{HOSTILE}={HOSTILE}"), 1),
        (("convert", "HOSTILE", f"a.{HOSTILE}"), 1),
        (("convert", "HOSTILE", "HOSTILE"), 1),
        (("models", HOSTILE), 1),
        (("fit", "a.csv", f"--{HOSTILE}"), 2),
        (("fit", "a.csv", HOSTILE), 2),
        ((HOSTILE,), 2),
    ],
)
def test_errors_show_hostile_names_as_text(run, hostile, arguments, ends):
    code, out, err = run(*(hostile if word == "HOSTILE" else word for word in arguments))
    assert (code, out) == (ends, "")
    assert_obeyed_by_none(err)
    assert r"\u202e" in err
    if ends == 1:
        assert err.count("\n") == 1


@pytest.mark.study
def test_fit_shows_hostile_names_as_text(run, hostile, tmp_path):
    code, out, err = run("fit", hostile, "--no-mcmc", "--full", "--out", tmp_path / f"{HOSTILE}out")
    assert code in (0, 3)
    assert_obeyed_by_none(out)
    assert_obeyed_by_none(err)
    assert "[red]forged" in out
    assert odd_letters((tmp_path / f"{HOSTILE}out" / "report.html").read_text(encoding="utf-8")) == []
