"""Flags: none is passed over in silence; all explain themselves; asking for a name or a version loads little."""

import subprocess
import sys
from importlib.metadata import version
from pathlib import Path

import pytest
from typer.main import get_command
from typer.testing import CliRunner, Result

from fitmat.cli import manual
from fitmat.cli.application import app
from fitmat.models.registry import LOBES

FILE = str(Path(__file__).parents[2] / "data" / "synthetic" / "sparse.csv")
COMMANDS = get_command(app).commands  # pyright: ignore[reportAttributeAccessIssue]


def run(*arguments: str) -> Result:
    return CliRunner().invoke(app, arguments, prog_name="fitmat", env={"COLUMNS": "300"})


IDLE: dict[str, tuple[tuple[str, ...], str]] = {
    "nothing to replace": (("fit", FILE, "--force"), "--force would replace nothing without --out"),
    "no picture to replace": (("check", FILE, "--force"), "--force would replace nothing without --plot"),
    "no drawing to replace": (("design", FILE, "--force"), "--force would replace nothing without --plot"),
    "a catalogue has its own materials": (
        ("simulate", "lambert", "--catalogue", "x", "--noise", "0.1"),
        "MODEL, --noise would change nothing beside --catalogue",
    ),
    "nothing to join": (("check", FILE, "--join"), "--join would change nothing for one file"),
    "files that nobody joins": (
        ("fit", "a.csv", "b.csv"),
        "2 files are given (a.csv, b.csv), expected one. If they are one measurement of one sample, as one for each "
        "incidence, add --join; to fit each by itself: fitmat batch.",
    ),
    "many files": (("check", *(f"{k}.csv" for k in range(9))), "9 files are given (0.csv, 1.csv, 2.csv, 3.csv, …)"),
    "a file too many": (("convert", "a.csv", "b.csv", "c.csv"), "2 files are given (a.csv, b.csv), expected one"),
    "models twice": (("fit", FILE, "--models", "ggx", "--models", "phong"), "--models is given 2 times, expected one"),
    "columns twice": (("check", FILE, "--columns", "a=1", "--columns", "b=2"), "--columns is given 2 times"),
    "seed twice": (("simulate", "ggx", "--seed", "1", "--seed", "1", "--seed", "2"), "--seed is given 3 times"),
}


@pytest.mark.parametrize(("arguments", "sentence"), IDLE.values(), ids=IDLE)
def test_what_would_do_nothing_is_wrong_usage(arguments: tuple[str, ...], sentence: str) -> None:
    ended = run(*arguments)
    assert ended.exit_code == 2
    assert sentence in ended.output
    assert f"Try 'fitmat {arguments[0]} --help' for help" in ended.output


@pytest.mark.parametrize(
    ("name", "lobes"), [("ggx", {"ggx"}), ("lambert+phong", {"lambert", "phong"}), (None, set(LOBES))]
)
def test_laws_are_measured_of_what_is_named(name: str | None, lobes: set[str]) -> None:
    assert {lobe for lobe in LOBES if manual.within(name)(lobe)} == lobes


@pytest.mark.parametrize("name", COMMANDS)
def test_every_flag_explains_itself(name: str) -> None:
    """In its own words, beyond what its name says."""
    ended = run(name, "-h")
    assert ended.exit_code == 0
    assert ended.output == run(name, "--help").output
    assert all(len(p.help or "") > len("Replace the file") for p in COMMANDS[name].params)


def test_help_names_the_extras_whole() -> None:
    """Square brackets are markup unless they are escaped."""
    said = " ".join(run("fit", "--help").output.split())
    assert "pip install 'fitmat[nuts]'" in said
    assert "pip install 'fitmat[materials]'" in said


def test_the_version_is_the_package() -> None:
    ended = run("--version")
    assert (ended.exit_code, ended.output) == (0, f"fitmat {version('fitmat')}\n")


@pytest.mark.parametrize(
    ("line", "word"), [("fitmat si", "simulate"), ("fitmat fit --cal", "--calibration"), ("fitmat check --ca", "--cal")]
)
def test_a_shell_completes_commands_and_flags(line: str, word: str) -> None:
    asked = {"_FITMAT_COMPLETE": "complete_bash", "COMP_WORDS": line, "COMP_CWORD": str(len(line.split()) - 1)}
    ended = CliRunner().invoke(app, (), prog_name="fitmat", env=asked)
    assert ended.output.startswith(word)


def test_the_commands_load_nothing_heavy() -> None:
    """A shell that completes a name, and --version, wait for no array library."""
    heavy = {"jax", "numpy", "polars", "matplotlib", "equinox", "scipy"}
    code = f"import sys, fitmat.cli.main; print(sorted({heavy} & set(sys.modules)))"
    assert subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout == "[]\n"
