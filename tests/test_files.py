"""Results on disk: one run at a time in a folder, nothing of anybody else's touched, no half of a folder."""

import os
import signal
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from fitmat import files
from fitmat.errors import OutputError

NAMES = ("a.txt", "b.txt", "record")


def own(folder: Path) -> list[str]:
    """Of the folders made here, which hold one file of each name or some of them."""
    return [name for name in NAMES if (folder / name).exists()]


def make(target: Path, content: str = "new", *, force: bool = False) -> None:
    with files.new(target, own=own, force=force) as draft:
        for name in NAMES:
            (draft / name).write_text(content)


def inside(target: Path) -> dict[str, str]:
    return {path.name: path.read_text() for path in target.iterdir()}


HOLDER = """
import sys
from pathlib import Path
from fitmat import files

with files.new(Path(sys.argv[1]), own=lambda _: ()) as draft:
    (draft / "half").write_text("of a killed run")
    print("making", flush=True)
    sys.stdin.read()
"""


KILLED = """
import os
import signal
import sys
from pathlib import Path
from fitmat import files

def killed(source, target, replace=os.replace):
    replace(source, target)
    os.kill(os.getpid(), signal.SIGKILL)

folder = Path(sys.argv[1])
with files.alone(folder), files.replaced(folder / "group") as draft:
    draft.mkdir()
    (draft / "a.txt").write_text("new")
    files.os.replace = killed
"""


@pytest.fixture
def other(tmp_path: Path) -> Iterator[subprocess.Popen[str]]:
    """Another process that is making the folder `out`."""
    command = [sys.executable, "-c", HOLDER, str(tmp_path / "out")]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        assert process.stdout.readline() == "making\n"
        yield process
        process.kill()


def test_a_folder_appears_complete_and_alone(tmp_path: Path) -> None:
    make(tmp_path / "a" / "b")
    assert inside(tmp_path / "a" / "b") == dict.fromkeys(NAMES, "new")
    (tmp_path / "empty").mkdir()
    make(tmp_path / "empty")
    (tmp_path / "link").symlink_to(tmp_path / "elsewhere")
    make(tmp_path / "link")
    assert inside(tmp_path / "elsewhere") == inside(tmp_path / "empty") == dict.fromkeys(NAMES, "new")
    assert sorted(os.listdir(tmp_path)) == ["a", "elsewhere", "empty", "link"]
    assert os.stat(tmp_path / "elsewhere").st_mode == os.stat(tmp_path / "a").st_mode


def test_one_run_at_a_time_makes_a_folder(tmp_path: Path, other: subprocess.Popen[str]) -> None:
    with pytest.raises(OutputError, match=r"out is being written by another run; wait for it, or give another --out"):
        make(tmp_path / "out", force=True)
    assert not (tmp_path / "out").exists()
    other.communicate("")
    assert inside(tmp_path / "out") == {"half": "of a killed run"}


def test_a_default_name_that_is_being_made_is_not_free(tmp_path: Path) -> None:
    first = files.default(tmp_path / "x.csv")
    with files.new(first, own=own):
        assert files.default(tmp_path / "x.csv") == tmp_path / "x-fitmat-2"
    assert first == tmp_path / "x-fitmat"
    assert files.default(Path("/dev/fd/63")) == Path("63-fitmat")  # a pipe: beside it is no place


def test_what_a_killed_run_left_makes_way(tmp_path: Path, other: subprocess.Popen[str]) -> None:
    other.kill()
    other.wait()
    assert os.listdir(tmp_path) == [".fitmat-out"]
    make(tmp_path / "out")
    assert inside(tmp_path / "out") == dict.fromkeys(NAMES, "new")
    assert os.listdir(tmp_path) == ["out"]


def test_old_drafts_are_swept_without_what_others_put_there(
    tmp_path: Path, other: subprocess.Popen[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(files, "ABANDONED", -1.0)
    for name in ("left", "mine"):
        (tmp_path / f".fitmat-{name}" / "draft").mkdir(parents=True)
    (tmp_path / ".fitmat-mine" / "notes.txt").write_text("mine")
    make(tmp_path / "another")
    assert sorted(os.listdir(tmp_path)) == [".fitmat-mine", ".fitmat-out", "another"]
    assert inside(tmp_path / ".fitmat-mine") == {"notes.txt": "mine"}


def test_force_replaces_what_a_run_wrote_and_nothing_else(tmp_path: Path) -> None:
    make(tmp_path, "old")
    (tmp_path / "notes.txt").write_text("mine")
    with pytest.raises(OutputError, match="already exists; give another --out DIR, or --force to replace the run in"):
        make(tmp_path)
    with files.new(tmp_path, own=own, force=True) as draft:
        (draft / "record").write_text("new")
    assert inside(tmp_path) == {"notes.txt": "mine", "record": "new"}


def test_a_name_that_is_somebody_elses_is_left_to_them(tmp_path: Path) -> None:
    """A file that the run before did not write, and a folder that appears while a run goes on."""
    target = tmp_path / "out"
    target.mkdir()
    (target / "a.txt").write_text("mine")
    with (
        pytest.raises(OutputError, match=r"a\.txt is not of an earlier run, and stays .*; the report is in .*out-2\."),
        files.new(target, own=lambda folder: own(folder) if folder.name == "draft" else [], force=True) as draft,
    ):
        (draft / "a.txt").write_text("new")
    assert inside(target) == {"a.txt": "mine"}
    assert inside(tmp_path / "out-2") == {"a.txt": "new"}

    def while_somebody_makes_it(target: Path) -> None:
        with files.new(target, own=own) as draft:
            (draft / "a.txt").write_text("new")
            target.mkdir()
            (target / "notes.txt").write_text("mine")

    with pytest.raises(
        OutputError, match=r"late was made while this run went on, and stays .*; the report is in .*e-2"
    ):
        while_somebody_makes_it(tmp_path / "late")
    assert inside(tmp_path / "late") == {"notes.txt": "mine"}
    assert inside(tmp_path / "late-2") == {"a.txt": "new"}
    assert sorted(os.listdir(tmp_path)) == ["late", "late-2", "out", "out-2"]


def test_no_folder_is_ever_seen_in_part(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Each step of the disk may be the last: what stands under the name then is nothing, or all."""
    seen: list[list[str]] = []
    replace = os.replace

    def watched(source: Path, target: Path) -> None:
        for step in (lambda: None, lambda: replace(source, target)):
            step()
            seen.append(sorted(os.listdir(tmp_path / "out")) if (tmp_path / "out").exists() else [])

    monkeypatch.setattr(files.os, "replace", watched)
    make(tmp_path / "out")
    assert seen == [[], sorted(NAMES)]


def replace(folder: Path, content: str) -> None:
    with files.replaced(folder) as draft:
        draft.mkdir()
        (draft / "a.txt").write_text(content)


def test_what_a_killed_run_moved_aside_is_put_back(tmp_path: Path) -> None:
    """Killed between the two renamings: whoever writes next finds the old folder in its place."""
    group = tmp_path / "group"

    def interrupted() -> None:
        replace(group, "old")
        assert subprocess.run([sys.executable, "-c", KILLED, str(tmp_path)]).returncode == -signal.SIGKILL
        assert not group.exists()

    interrupted()
    with files.replaced(group) as draft:
        assert inside(group) == {"a.txt": "old"}
        draft.mkdir()
    assert inside(group) == {}
    interrupted()
    with files.alone(tmp_path):
        assert inside(group) == {"a.txt": "old"}
    assert os.listdir(tmp_path) == ["group"]


def test_what_was_moved_aside_is_put_back_where_nothing_comes_in_its_place(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    group = tmp_path / "group"
    replace(group, "old")
    renamed = os.replace

    def refused(source: Path, target: Path) -> None:
        if source.name == "draft":
            raise OSError(28, "No space left on device")
        renamed(source, target)

    monkeypatch.setattr(files.os, "replace", refused)
    with pytest.raises(OutputError, match=r"cannot write .*group: No space left on device; choose another place"):
        replace(group, "new")
    assert inside(group) == {"a.txt": "old"}
    assert os.listdir(tmp_path) == ["group"]


def test_a_file_in_the_way_is_refused_with_force_too(tmp_path: Path) -> None:
    (tmp_path / "out").write_text("mine")
    with pytest.raises(OutputError, match=r"out already exists; give another --out DIR\."):
        make(tmp_path / "out", force=True)
    assert inside(tmp_path) == {"out": "mine"}
