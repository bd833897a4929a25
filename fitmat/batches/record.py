"""Record: what a batch's folder holds, by which the same batch that goes on is told from another.

It fits nothing, and removes only what a batch wrote.
"""

import dataclasses
import hashlib
import json
import os
import re
import shutil
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

from fitmat import files
from fitmat.batches import runs
from fitmat.errors import OutputError
from fitmat.studies.result import BATCH
from fitmat.text import visible

PARTS = "parts"
"""Folder in a batch's folder of what is kept to go on, by key."""

_PART = re.compile(r"[0-9a-f]{32}\.(json|npz)")
"""Names of files in it."""


@dataclasses.dataclass(frozen=True)
class Record:
    """What a folder holds.

    Attributes:
        of: What was fitted → how, or what it was, as a digest.
        files: Names of the results.
        parts: Names of what they are made of, in `PARTS`.
        runs: Names of runs, in `runs.RUNS`.
    """

    of: Mapping[str, str]
    files: Sequence[str]
    parts: Sequence[str]
    runs: Sequence[str] = ()


@dataclasses.dataclass(frozen=True)
class Claim:
    """A folder in which nothing is in the way of results.

    Attributes:
        folder: Of the batch.
        before: What it holds.
        of: What is fitted now, as in `Record`.
    """

    folder: Path
    before: Record
    of: Mapping[str, str]

    def renew(self, names: Sequence[str], parts: Sequence[str], of_runs: Sequence[str] | None = None) -> None:
        """Write the record, before the results; of something else, what nothing replaces is removed.

        Args:
            names: Of the results.
            parts: Of what they are made of.
            of_runs: Names of runs; None where none was asked for: then those of the same files stay.

        Raises:
            OutputError: something cannot be written or removed.
        """
        other = _lost(self.before, self.of)
        kept = of_runs if of_runs is not None else () if other else self.before.runs
        for name in set(self.before.runs) - set(kept):
            _remove(self.folder / runs.RUNS / name, runs.remove)
        if other:
            for name in set(self.before.files) - set(names):
                _remove(self.folder / name)
            for name in set(self.before.parts) - set(parts):
                _remove(self.folder / PARTS / name)
        after = dataclasses.asdict(Record(self.of, names, parts, kept))
        files.write_text(self.folder / BATCH, json.dumps(after))


def digest(told: Any) -> str:
    """Of anything that JSON, or its words, can say."""
    return hashlib.sha256(json.dumps(told, sort_keys=True, default=str).encode()).hexdigest()[:32]


def claimed(folder: Path, of: Mapping[str, str], names: Sequence[str], *, force: bool) -> Claim:
    """The folder for results of `of`, in files of these names.

    Args:
        folder: Of the batch.
        of: What is to be fitted → how, or what it is, as a digest.
        names: Of every file that may be written.
        force: Whether results of something else may be replaced.

    Raises:
        OutputError: they would be lost, or a file of such a name is of no batch.
    """
    before = _earlier(folder) or _unrecorded(folder, names)
    for name in names:
        if name not in before.files and os.path.lexists(folder / name):
            why = f"{folder / name} is not known to be of an earlier batch, and is not replaced"
            raise OutputError(f"{why}; move it, or give another --out DIR.")
    if (lost := _lost(before, of)) and not force:
        more = f" and {len(lost) - 1} more" if len(lost) > 1 else ""
        got = f"{folder} holds results of other data or flags, or of another fitmat ({visible(lost[0])}{more})"
        raise OutputError(f"{got}, which would be lost; give another --out DIR, or --force to replace them.")
    return Claim(folder, before, of)


def _earlier(folder: Path) -> Record | None:
    """What a batch left; None where there is no record."""
    try:
        found = json.loads((folder / BATCH).read_text(encoding="utf-8"))
        known = ([name for name in found.get(key, ()) if Path(name).name == name] for key in ("files", "parts", "runs"))
        return Record(dict(found["of"]), *known)
    except FileNotFoundError:
        return None
    except (OSError, ValueError, LookupError, TypeError) as error:
        why = f"{folder / BATCH} is no record of a batch, and is not replaced"
        raise OutputError(f"{why}; move it, or give another --out DIR.") from error


def _unrecorded(folder: Path, names: Sequence[str]) -> Record:
    """What a batch of a fitmat without records left, which is of unknown data; nothing where anything else is there."""
    there = [path.name for path in folder.iterdir() if not path.name.startswith(files.WORK)]
    parts = os.listdir(folder / PARTS) if (folder / PARTS).is_dir() else []
    if not parts or not {PARTS, *names}.issuperset(there) or not all(map(_PART.fullmatch, parts)):
        return Record({}, (), ())
    results = [name for name in there if name != PARTS]
    return Record(dict.fromkeys(results, ""), results, parts)


def _lost(before: Record, of: Mapping[str, str]) -> list[str]:
    """What is in a record and would not be, or not so, in the next."""
    return [name for name, how in before.of.items() if of.get(name) != how]


def _remove(path: Path, of_folder: Callable[[Path], None] = shutil.rmtree) -> None:
    try:
        if path.is_dir():
            of_folder(path)
        else:
            path.unlink(missing_ok=True)
    except OSError as error:
        why = f"{path} is of what --force replaces, and cannot be removed ({error.strerror or error})"
        raise OutputError(f"{why}; remove it, or give another --out DIR.") from error
