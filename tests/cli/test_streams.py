"""The streams of a command: closed, full, or read by nobody; Ctrl-C from the first moment on."""

import os
import subprocess
import sys
import threading
from collections.abc import Callable
from pathlib import Path

import pytest
import test_commands
from rich.console import Console
from test_commands import DATA, PATIENCE, QUICK, Run

from fitmat.cli import session

run, environment = test_commands.run, test_commands.environment

CLOSED = "cannot write the output: Bad file descriptor."


def after(redirections: str, *arguments: object, stdout: int = subprocess.PIPE) -> subprocess.CompletedProcess[str]:
    """A command of the shell, with what stands behind it."""
    words = ["sh", "-c", f'"$@" {redirections}', "sh", sys.executable, "-m", "fitmat", *map(str, arguments)]
    return subprocess.run(words, stdout=stdout, stderr=subprocess.PIPE, text=True, timeout=PATIENCE)


@pytest.mark.parametrize(
    ("redirections", "arguments", "code", "out", "err"),
    [
        (">&-", ("losses",), 1, "", f"fitmat: {CLOSED}\n"),
        ("<&- >&-", ("--help",), 1, "", f"fitmat: {CLOSED}\n"),
        ("2>&-", ("models", "none"), 1, "", ""),
        (">/dev/full", ("losses",), 1, "", "fitmat: cannot write the output: No space left on device.\n"),
        ("2>/dev/full", ("models", "none"), 1, "", ""),
        ("| head -c 0", ("losses",), 0, "", ""),
    ],
    ids=lambda given: given if isinstance(given, str) and ("&" in given or "/" in given or "|" in given) else "",
)
def test_streams_that_take_nothing(redirections: str, arguments: tuple, code: int, out: str, err: str) -> None:
    """Said in one line where somebody listens, never a traceback; of a pipe the shell counts its last command."""
    ended = after(redirections, *arguments)
    assert (ended.returncode, ended.stdout, ended.stderr) == (code, out, err)


@pytest.mark.parametrize("arguments", [("losses",), ("models",), ("--help",)], ids=" ".join)
def test_a_reader_that_has_gone_is_no_error(arguments: tuple[str, ...]) -> None:
    """141 = 128 + SIGPIPE, as of every command of a shell, whichever library writes."""
    reading, writing = os.pipe()
    os.close(reading)
    ended = after("", *arguments, stdout=writing)
    os.close(writing)
    assert (ended.returncode, ended.stderr) == (141, "")


def test_progress_that_nobody_reads_stops_no_run(monkeypatch: pytest.MonkeyPatch) -> None:
    reading, writing = os.pipe()
    os.close(reading)
    silenced: list[int] = []
    monkeypatch.setattr(session.process, "silence", silenced.append)
    with os.fdopen(os.open(os.devnull, os.O_WRONLY), "w") as unread:
        os.dup2(writing, unread.fileno())
        os.close(writing)
        told = session.Watch(Console(file=unread))
        told("fitting ggx", 0, 0)
        told.close()
        assert silenced == [2]
        os.dup2(os.open(os.devnull, os.O_WRONLY), unread.fileno())


@pytest.mark.study
def test_a_run_whose_progress_nobody_reads_is_saved(environment: dict[str, str], tmp_path: Path) -> None:
    reading, writing = os.pipe()
    os.close(reading)
    command = [sys.executable, "-m", "fitmat", "fit", str(DATA / "sparse.csv"), *QUICK, "--out", str(tmp_path / "out")]
    ended = subprocess.run(command, env=environment, stdout=subprocess.PIPE, stderr=writing, text=True)
    os.close(writing)
    assert ended.returncode == 0
    assert ended.stdout.endswith("out/report.html\n")
    assert {"fit.json", "posterior-lambert.parquet", "report.html"} <= set(os.listdir(tmp_path / "out"))


EARLY = """
import signal, sys

class Now:
    def find_spec(self, name, *_):
        if name == "typer":
            signal.raise_signal(signal.SIGINT)

sys.meta_path.insert(0, Now())
sys.argv = ["fitmat", "losses"]
from fitmat.cli.main import main
main()
"""


def test_ctrl_c_while_the_program_loads() -> None:
    ended = subprocess.run([sys.executable, "-c", EARLY], capture_output=True, text=True, timeout=PATIENCE)
    said = "fitmat: interrupted before the end; no report was written.\n"
    assert (ended.returncode, ended.stdout, ended.stderr) == (130, "", said)


def test_standard_input_is_read(run: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """As - and by its name."""
    monkeypatch.chdir(tmp_path)
    before = os.dup(0)
    try:
        for name in ("-", "/dev/stdin"):
            with (DATA / "sparse.csv").open("rb") as file:
                reading, writing = os.pipe()
                os.write(writing, file.read())
            os.close(writing)
            os.dup2(reading, 0)
            os.close(reading)
            ended = run("convert", name, "out.parquet", "--force")
            assert (ended.code, ended.err) == (0, "")
            assert ended.out.startswith("stdin: 51 samples, channel")
    finally:
        os.dup2(before, 0)
        os.close(before)


@pytest.mark.parametrize("command", ["check", "convert", "fit"])
def test_little_memory_is_said_before_anything_is_loaded(command: str, tmp_path: Path) -> None:
    """600 MB of address space: compiled libraries abort there."""
    words = ["sh", "-c", 'ulimit -v 600000; exec "$@"', "sh", sys.executable, "-m", "fitmat", command, "x.csv"]
    made = [str(tmp_path / "x.parquet")] if command == "convert" else []
    ended = subprocess.run([*words, *made], capture_output=True, text=True, timeout=PATIENCE)
    assert (ended.returncode, ended.stdout) == (1, "")
    assert ended.stderr == (
        "fitmat: this process may use 0.61 GB of address space, expected at least 2 GB. "
        "Raise the limit with ulimit -v unlimited.\n"
    )


def _too_long() -> None:
    bytearray(1 << 60)


def _too_large_for_xla() -> None:
    import jax.numpy as jnp

    jnp.zeros(1 << 50).block_until_ready()


def _no_room_for_a_stack() -> None:
    before = threading.stack_size(1 << 45)
    try:
        threading.Thread(target=print).start()
    finally:
        threading.stack_size(before)


MEMORY = "there is not enough memory; take fewer models or rows at once, or a machine with more."
ENDED = {
    "memory": (_too_long, MEMORY),
    "memory of XLA": (_too_large_for_xla, MEMORY),
    "threads": (
        _no_room_for_a_stack,
        "the machine grants no more threads to this user, expected some tens. End other programs, or raise the limit "
        "of processes (ulimit -u).",
    ),
}
"""What truly ends, and what is said of it."""


@pytest.mark.parametrize(("ends", "sentence"), ENDED.values(), ids=ENDED)
def test_a_machine_that_has_no_more_is_said(
    run: Run, monkeypatch: pytest.MonkeyPatch, ends: Callable[[], None], sentence: str
) -> None:
    monkeypatch.setattr("fitmat.cli.manual.list_losses", ends)
    ended = run("losses")
    assert (ended.code, ended.out, ended.err) == (1, "", f"fitmat: {sentence}\n")


def test_another_error_is_not_called_so(run: Run, monkeypatch: pytest.MonkeyPatch) -> None:
    def wrong() -> None:
        raise RuntimeError("something else")

    monkeypatch.setattr("fitmat.cli.manual.list_losses", wrong)
    with pytest.raises(RuntimeError, match="something else"):
        run("losses")
