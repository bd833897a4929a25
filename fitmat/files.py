"""Results on disk: a folder or a file appears complete or not at all, and never over something unasked.

Knows nothing of what is in it.
"""

import contextlib
import itertools
import os
import shutil
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

from fitmat.errors import OutputError

WORK = ".fitmat-"
"""How the names of folders begin in which something is made; they hold nothing but `_LOCK` and `_DRAFT`."""

ABANDONED = 7 * 24 * 3600.0
"""Seconds after which such a folder, left by a killed run, is removed by a run of something else."""

_LOCK, _DRAFT, _OLD, _SWAP = "lock", "draft", "old", ".fitmat-swap"
_DEVICES = Path("/dev")
_TRIES, _WAIT = 10, 0.02


def default(source: Path, what: str = "fitmat") -> Path:
    """`NAME-fitmat` beside the input, or the first `NAME-fitmat-2`, `-3`, … that neither exists nor is being made.

    Beside a device, as standard input is one, nothing is written, but in the working folder.
    """
    place = Path() if _DEVICES in source.parents else source.parent
    return _free(place / f"{source.name if source.is_dir() else source.stem}-{what}")


def _free(first: Path) -> Path:
    names = itertools.chain([first], (first.with_name(f"{first.name}-{k}") for k in itertools.count(2)))
    return next(path for path in names if not os.path.lexists(path) and not _in_the_making(path))


def resumed(target: Path) -> Path:
    """Where a run keeps what it would need to go on, `NAME-fitmat.resume` beside its results."""
    place = target.absolute()
    return place.parent / f"{place.name}.resume"


def abandon(draft: Path) -> None:
    """Remove an unfinished draft of `new`, where the process is about to end."""
    _clear(draft.parent)


@contextlib.contextmanager
def new(target: Path, *, own: Callable[[Path], Sequence[str]], force: bool = False) -> Iterator[Path]:
    """A folder to write into that appears as `target`, complete, when the block ends well.

    It appears by one renaming. Only where `target` holds something, files are moved into it one by one.

    Args:
        target: The folder to make.
        own: Names of the files that a run wrote into a folder, last the one that tells the others; no other file is
            replaced or removed.
        force: Replace the files of an earlier run in `target`.

    Raises:
        OutputError: `target` holds something and `force` is off, another run is making it, or the disk refuses.
    """
    place = Path(os.path.realpath(target))
    with contextlib.ExitStack() as held:
        with _refused(target):
            work = _work(place)
            held.enter_context(_locked(work, target))
            old = own(place) if _holds_anything(target, work, force) else ()
            _sweep(work.parent)
            draft = work / _DRAFT
            draft.mkdir()
        with _refused(target, "nothing was put there"):
            yield draft
            if work.parent == place:
                _move_files(draft, place, old, own(draft))
            else:
                _move_folder(draft, place)


@contextlib.contextmanager
def alone(target: Path) -> Iterator[None]:
    """A folder that stays as it grows, for one run at a time; made where it does not exist.

    Raises:
        OutputError: another run writes into it, or it cannot be made.
    """
    with contextlib.ExitStack() as held:
        with _refused(target):
            target.mkdir(parents=True, exist_ok=True)
            held.enter_context(_locked(target / f"{WORK}run", target))
            for left in target.glob(f".*{_SWAP}"):
                _put_back(left)
        yield


@contextlib.contextmanager
def replaced(folder: Path) -> Iterator[Path]:
    """A folder to write into that takes the place of another of that name when the block ends well, in two renamings.

    Where it is killed between the two, the next, or `alone` of the folder around it, puts the old one back.

    Raises:
        OutputError: it cannot be written; what was there before is still there.
    """
    work = folder.with_name(f".{folder.name}{_SWAP}")
    with _refused(folder):
        try:
            _put_back(work)
            work.mkdir()
            yield work / _DRAFT
            if folder.exists():
                os.replace(folder, work / _OLD)
            os.replace(work / _DRAFT, folder)
        finally:
            _put_back(work)


def _put_back(work: Path) -> None:
    """Remove what `replaced` works in; a folder in whose place nothing came is put back first."""
    folder = work.with_name(work.name[1 : -len(_SWAP)])
    if (work / _OLD).exists() and not folder.exists():
        os.replace(work / _OLD, folder)
    _remove(work)


@contextlib.contextmanager
def _refused(target: Path, then: str = "choose another place with --out") -> Iterator[None]:
    try:
        yield
    except OSError as error:
        raise OutputError(f"cannot write {target}: {error.strerror or error}; {then}.") from error


def _work(target: Path) -> Path:
    """The folder in which `target` is made: beside it, or in it where it cannot be replaced as a whole."""
    place = Path(os.path.realpath(target))
    beside = next(p for p in place.parents if p.exists())
    if place.is_dir():
        replaceable = os.access(beside, os.W_OK | os.X_OK) and beside.stat().st_dev == place.stat().st_dev
        if not replaceable or any(place.iterdir()):
            beside = place
    return beside / f"{WORK}{place.name}"


@contextlib.contextmanager
def _locked(work: Path, target: Path) -> Iterator[None]:
    """The folder as this process's own, without what a killed run left in it; removed at the end."""
    handle = _lock(work)
    if handle is None:
        raise OutputError(f"{target} is being written by another run; wait for it, or give another --out DIR.")
    try:
        _remove(work / _DRAFT)
        yield
    finally:
        _clear(work)
        os.close(handle)


def _lock(work: Path) -> int | None:
    """A handle that holds the lock as long as it is open, however the process ends; None where another process does."""
    for _ in range(_TRIES):
        work.mkdir(exist_ok=True)
        with contextlib.suppress(FileNotFoundError):  # the folder's owner has just removed it
            handle = os.open(work / _LOCK, os.O_RDWR | os.O_CREAT, 0o600)
            if _is_taken(handle) or not _is_at(handle, work / _LOCK):
                os.close(handle)
            else:
                return handle
        time.sleep(_WAIT)
    return None


def _is_taken(handle: int) -> bool:
    """Whether another process holds the lock of a file; if none does, this one does from now on."""
    try:
        import fcntl  # not on every system
    except ImportError:
        return False
    try:
        fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return True
    except OSError:
        return False  # a disk without locks
    return False


def _is_at(handle: int, path: Path) -> bool:
    return path.exists() and os.path.samestat(os.fstat(handle), path.stat())


def _in_the_making(target: Path) -> bool:
    """Whether a run is making the folder."""
    try:
        return _is_locked(_work(target))
    except OSError:
        return False


def _is_locked(work: Path) -> bool:
    try:
        handle = os.open(work / _LOCK, os.O_RDWR)
    except OSError:
        return False
    taken = _is_taken(handle)
    os.close(handle)
    return taken


def _holds_anything(target: Path, work: Path, force: bool) -> bool:
    """Whether the target is there and not empty; refused unless it is a folder whose files may be replaced."""
    folder = target.is_dir()
    if not target.exists() or (folder and all(item.name == work.name for item in target.iterdir())):
        return False
    if not (force and folder):
        remedy = ", or --force to replace the run in it" if folder else ""
        raise OutputError(f"{target} already exists; give another --out DIR{remedy}.")
    return True


def _sweep(place: Path) -> None:
    """Remove what killed runs of other things left in a folder, once it is older than any run."""
    for left in place.glob(f"{WORK}*"):
        with contextlib.suppress(OSError):
            if time.time() - left.stat().st_mtime > ABANDONED and not _is_locked(left):
                _clear(left)


def _clear(work: Path) -> None:
    """Remove a folder of drafts, if nothing else is in it; what cannot be removed stays."""
    _remove(work / _DRAFT)
    with contextlib.suppress(OSError):
        (work / _LOCK).unlink(missing_ok=True)
        work.rmdir()


def _remove(draft: Path) -> None:
    shutil.rmtree(draft, ignore_errors=True)
    with contextlib.suppress(OSError):
        draft.unlink(missing_ok=True)


def _move_folder(draft: Path, target: Path) -> None:
    """The draft as the target, in one step; as the next free name where somebody has made the target meanwhile."""
    target.parent.mkdir(parents=True, exist_ok=True)
    try:
        os.replace(draft, target)
    except OSError:
        if not target.exists():
            raise
        _move_aside(draft, target, f"{target} was made while this run went on")


def _move_files(draft: Path, target: Path, old: Sequence[str], fresh: Sequence[str]) -> None:
    """The draft's files into the target; what tells of the others goes last and comes first."""
    for name in set(fresh) - set(old):
        if os.path.lexists(target / name):
            _move_aside(draft, target, f"{target / name} is not of an earlier run")
    for name in old:
        (target / name).unlink(missing_ok=True)
    for name in reversed(fresh):
        os.replace(draft / name, target / name)


def _move_aside(draft: Path, target: Path, why: str) -> None:
    free = _free(target)
    os.replace(draft, free)
    raise OutputError(f"{why}, and stays as it is; the report is in {free}.")


def write_text(path: Path, text: str) -> Path:
    """Write text in one stroke, as UTF-8 with newlines as they are; see `write_bytes`."""
    return write_bytes(path, text.encode("utf-8"))


def write_bytes(path: Path, content: bytes) -> Path:
    """Write a file in one stroke: a reader sees the old content or the whole new one.

    Args:
        path: The file, replaced where it exists; its folder is made where it does not.
        content: What to write.

    Raises:
        OutputError: it cannot be written; what was there before is still there.
    """
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryDirectory(prefix=WORK, dir=path.parent, ignore_cleanup_errors=True) as folder:
            draft = Path(folder) / "draft"
            draft.write_bytes(content)
            os.replace(draft, path)
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or error
        raise OutputError(f"{path}: cannot be written ({reason}); choose another place.") from error
    return path
