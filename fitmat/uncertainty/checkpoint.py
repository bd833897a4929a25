"""Checkpoints: the state of a long sampling run in a folder, one small file for each part of the chain.

Trusts nothing that it reads: every part carries the digest of its own content, of the part before it, and of what was
sampled. Knows no model, draws nothing, and never stops the run that it serves.
"""

import contextlib
import dataclasses
import hashlib
import io
import os
import time
import warnings
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float

from fitmat.errors import FitmatError, OutputError
from fitmat.text import brief

SHARE = 0.02
"""Writing takes at most this fraction of the time: where a disk is slow, parts become longer."""

PART = "{:08d}.part"
"""Name of a part, by the step at which it ends."""

_PARTS, _DRAFT = "[0-9]" * 8 + ".part", "draft"

_DIGEST = hashlib.sha256().digest_size


@dataclasses.dataclass(frozen=True, eq=False)
class Saved:
    """Where a run stood.

    Attributes:
        chain: All steps so far, (steps, walkers, d).
        log_prob: Their log densities, (steps, walkers).
        accepted: Accepted proposals of every walker so far, (walkers,).
        random_state: Of numpy's `RandomState`, exactly.
        goal: Steps that the run expected to need.
    """

    chain: Float[np.ndarray, "steps walkers d"]
    log_prob: Float[np.ndarray, "steps walkers"]
    accepted: Float[np.ndarray, " walkers"]
    random_state: tuple[Any, ...]
    goal: int

    __repr__ = brief


class Checkpoint:
    """The folder of one run: what was saved, and where the next part goes.

    Args:
        folder: Made where it does not exist.
        run: Digest of all that decides the chain (`digest`); parts of another run are refused.

    Attributes:
        saved: What an earlier start of the same run left; None where there is nothing.

    Raises:
        OutputError: the folder cannot be made or read.
        FitmatError: it holds parts of another run.
    """

    def __init__(self, folder: Path, run: bytes) -> None:
        self._folder, self._run, self._last, self._steps = folder, run, run, 0
        self._cost, self._written, self._writable = 0.0, 0.0, True
        try:
            folder.mkdir(parents=True, exist_ok=True)
            parts = [(path, path.read_bytes()) for path in sorted(folder.glob(_PARTS))]
        except OSError as error:
            raise OutputError(f"{folder}: no place for checkpoints ({error.strerror}); choose another.") from error
        self.saved = self._joined(parts)

    def _joined(self, parts: list[tuple[Path, bytes]]) -> Saved | None:
        """The parts that follow one another from the run's beginning; damaged ones are left out with a warning."""
        whole = [part for part in parts if hashlib.sha256(part[1][_DIGEST:]).digest() == part[1][:_DIGEST]]
        following: dict[bytes, tuple[bytes, dict[str, np.ndarray]]] = {}
        for _, content in whole:
            with np.load(io.BytesIO(content[_DIGEST:])) as arrays:
                found = dict(arrays)
            if found["run"].tobytes() != self._run:
                raise FitmatError(
                    f"{self._folder} holds checkpoints of another run: other data, model, priors, seed, length or "
                    "program versions; remove that folder, or name another."
                )
            following[found["before"].tobytes()] = content[:_DIGEST], found
        chosen = []
        while self._last in following:
            self._last, found = following[self._last]
            chosen.append(found)
        self._steps = sum(len(found["chain"]) for found in chosen)
        if lost := len(parts) - len(whole):
            words = (
                f"{self._folder}: {lost} damaged checkpoints are left out; sampling goes on from step {self._steps}."
            )
            warnings.warn(words, stacklevel=2)
        return _saved(chosen) if chosen else None

    def write(self, backend: Any, goal: int, *, finished: bool) -> None:
        """Keep what was sampled since the last part, unless that part took long and is recent.

        A disk that refuses is said once, as a warning, and the run goes on without.

        Args:
            backend: emcee's, with the chain so far.
            goal: Steps that the run expects to need.
            finished: True at the end of a run, when the part is written in any case.
        """
        begin = time.monotonic()
        due = finished or begin - self._written >= self._cost / SHARE
        if not (self._writable and due and backend.iteration > self._steps):
            return
        content = self._content(backend, goal)
        draft = self._folder / _DRAFT
        try:
            with draft.open("wb") as file:
                file.write(content)
                file.flush()
                os.fsync(file.fileno())
            os.replace(draft, self._folder / PART.format(backend.iteration))
        except OSError as error:
            self._writable = False
            words = f"{self._folder}: no further checkpoints ({error.strerror}); sampling goes on without."
            warnings.warn(words, stacklevel=3)
            return
        self._last, self._steps = content[:_DIGEST], backend.iteration
        self._written = time.monotonic()
        self._cost = self._written - begin

    def _content(self, backend: Any, goal: int) -> bytes:
        fresh = slice(self._steps, backend.iteration)
        _, keys, *rest = backend.random_state
        memory = io.BytesIO()
        np.savez(
            memory,
            run=np.frombuffer(self._run, np.uint8),
            before=np.frombuffer(self._last, np.uint8),
            chain=backend.chain[fresh],
            log_prob=backend.log_prob[fresh],
            accepted=backend.accepted,
            keys=keys,
            rest=np.array(rest, float),
            goal=goal,
        )
        content = memory.getvalue()
        return hashlib.sha256(content).digest() + content


def discard(folder: Path) -> None:
    """Remove the parts of a run, and the folder if there is nothing else in it; what cannot be removed stays."""
    with contextlib.suppress(OSError):
        for path in (*folder.glob(_PARTS), folder / _DRAFT):
            path.unlink(missing_ok=True)
        folder.rmdir()


def _saved(parts: list[dict[str, np.ndarray]]) -> Saved:
    position, has_gauss, cached = parts[-1]["rest"].tolist()
    return Saved(
        chain=np.concatenate([part["chain"] for part in parts]),
        log_prob=np.concatenate([part["log_prob"] for part in parts]),
        accepted=parts[-1]["accepted"],
        random_state=("MT19937", parts[-1]["keys"], int(position), int(has_gauss), cached),
        goal=int(parts[-1]["goal"]),
    )


def digest(words: str, arrays: list[np.ndarray]) -> bytes:
    """A digest of a text and of arrays, their shapes and types included.

    Args:
        words: What is not a number.
        arrays: Of any shape.

    Example:
        >>> digest("ggx", [np.zeros(2)]) == digest("ggx", [np.zeros((2, 1))])
        False
    """
    total = hashlib.sha256(words.encode("utf-8"))
    for array in arrays:
        total.update(f"|{array.dtype.str}{array.shape}|".encode())
        total.update(np.ascontiguousarray(array).tobytes())
    return total.digest()
