"""Results on disk: a folder or a file appears complete or not at all, and never over something unasked.

Knows nothing of what is in it.
"""

import contextlib
import itertools
import os
import shutil
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path

from fitmat.errors import OutputError

DRAFT = ".fitmat-"
"""How the names of unfinished folders begin."""

ABANDONED = 7 * 24 * 3600.0
"""Seconds after which an unfinished folder is nobody's any more."""


def default(source: Path) -> Path:
    """`NAME-fitmat` beside the input, or the first `NAME-fitmat-2`, `-3`, … that does not exist."""
    first = source.parent / f"{source.stem}-fitmat"
    if not os.path.exists(first):
        return first
    return next(p for k in itertools.count(2) if not os.path.exists(p := first.with_name(f"{first.name}-{k}")))


def resumed(target: Path) -> Path:
    """Where a run keeps what it would need to go on, `NAME-fitmat.resume` beside its results."""
    place = target.absolute()
    return place.parent / f"{place.name}.resume"


def discard(folder: Path) -> None:
    """Remove what has served; what cannot be removed stays."""
    shutil.rmtree(folder, ignore_errors=True)


@contextlib.contextmanager
def new(target: Path, *, force: bool = False, stale: str = "") -> Iterator[Path]:
    """A folder to write into that appears as `target`, complete, when the block ends well.

    Args:
        target: The folder to make.
        force: Replace the files of an earlier run in `target`.
        stale: Pattern of names; of the earlier run's files that match, those that the block does not write are removed.

    Raises:
        OutputError: `target` holds something and `force` is off, or the disk refuses.
    """
    try:
        if target.exists() and (not target.is_dir() or any(target.iterdir())) and not force:
            raise OutputError(f"{target} already exists; give another --out DIR, or --force to replace the run in it.")
        place = next(p for p in (target, *target.absolute().parents) if p.exists())
        _sweep(place)
        draft = Path(tempfile.mkdtemp(prefix=DRAFT, dir=place))
    except OSError as error:
        raise OutputError(f"cannot write {target}: {_reason(error)}; choose another place with --out.") from error
    try:
        yield draft
        _move(draft, target, stale)
    except OSError as error:
        raise OutputError(f"cannot write {target}: {_reason(error)}; the report is not there.") from error
    finally:
        shutil.rmtree(draft, ignore_errors=True)


def _sweep(place: Path) -> None:
    """Remove the drafts that killed runs left, once they are older than any run."""
    for left in place.glob(f"{DRAFT}*"):
        with contextlib.suppress(OSError):
            if time.time() - left.stat().st_mtime > ABANDONED:
                shutil.rmtree(left, ignore_errors=True)


def _move(draft: Path, target: Path, stale: str) -> None:
    """Move the draft's files into place, and remove what is stale."""
    target.mkdir(parents=True, exist_ok=True)
    written = {item.name for item in draft.iterdir()}
    for name in sorted(written):
        os.replace(draft / name, target / name)
    for old in target.glob(stale) if stale else ():
        if old.name not in written:
            old.unlink()


def _reason(error: OSError) -> str:
    return error.strerror or str(error)


def write_text(path: Path, text: str) -> Path:
    """Write text in one stroke, as UTF-8 with newlines as they are; see `write_bytes`."""
    return write_bytes(path, text.encode("utf-8"))


def write_bytes(path: Path, content: bytes) -> Path:
    """Write a file in one stroke: a reader sees the old content or the whole new one.

    Args:
        path: The file, replaced where it exists; its folder is made where it does not.
        content: What to write.

    Returns:
        The path.

    Raises:
        OutputError: it cannot be written; what was there before is still there.
    """
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryDirectory(prefix=".fitmat-", dir=path.parent, ignore_cleanup_errors=True) as folder:
            draft = Path(folder) / "draft"
            draft.write_bytes(content)
            os.replace(draft, path)
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or error
        raise OutputError(f"{path}: cannot be written ({reason}); choose another place.") from error
    return path
