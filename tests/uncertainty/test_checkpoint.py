"""Checkpoints: a killed run ends with the chain of one that nobody killed; nothing foreign or damaged is trusted."""

import dataclasses
import math
import signal
import subprocess
import sys
import time
import types
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import fitmat as fm
from fitmat.errors import FitmatError, OutputError
from fitmat.fitting.priors import prepare_prior
from fitmat.fitting.result import Fit
from fitmat.uncertainty import chains, checkpoint
from fitmat.uncertainty.chains import CHUNK, resumable_steps
from fitmat.uncertainty.posterior import Posterior

STEPS = 250
"""Of every run here, also where the chain would have been long enough before: five parts."""

PATIENCE = 300.0
"""Seconds that a process may take to begin sampling on a busy machine."""

CHILD = """
import sys, time
from pathlib import Path
sys.path.insert(0, {tests!r})
import jax
jax.config.update("jax_enable_x64", True)
import test_checkpoint as t
t.chains.SHORTEST = t.STEPS
t.fm.sample(t.fitted(), seed=1, max_steps=t.STEPS, checkpoint=Path({folder!r}), progress=lambda *_: time.sleep(0.2))
"""


def fitted(seed: int = 1) -> Fit:
    theta = np.linspace(0.0, 1.2, 51)
    value = 0.1 * (1 + 0.02 * np.random.default_rng(seed).normal(size=51))
    return fm.fit(fm.from_arrays(theta, 0.3, value, sigma=np.full(51, 0.002)), "lambert")


@pytest.fixture(scope="module", autouse=True)
def five_parts() -> Iterator[None]:
    with pytest.MonkeyPatch.context() as patched:
        patched.setattr(chains, "SHORTEST", STEPS)
        yield


@pytest.fixture(scope="module")
def fit() -> Fit:
    return fitted()


@pytest.fixture(scope="module")
def whole(fit: Fit) -> Posterior:
    """What a run gives that nobody killed, and that kept no checkpoints."""
    return run(fit)


@pytest.fixture
def every_chunk(monkeypatch: pytest.MonkeyPatch) -> None:
    """A part after each chunk, however fast the sampling."""
    monkeypatch.setattr(checkpoint, "SHARE", math.inf)


@pytest.fixture
def kept(fit: Fit, tmp_path: Path, every_chunk: None) -> Path:
    """The folder of a run that was killed after 200 of its steps, a torn file beside its parts."""
    folder = tmp_path / "kept"
    run(fit, folder)
    parts(folder)[-1].unlink()
    (folder / "draft").write_bytes(b"torn")
    return folder


def run(fit: Fit, folder: Path | None = None) -> Posterior:
    return fm.sample(fit, seed=1, max_steps=STEPS, checkpoint=folder)


def assert_same(one: Posterior, other: Posterior) -> None:
    """Bit for bit: the chain, and how it went."""
    assert one.chain is not None
    assert other.chain is not None
    assert one.diagnostics is not None
    assert other.diagnostics is not None
    np.testing.assert_array_equal(one.chain, other.chain)
    for field in dataclasses.fields(one.diagnostics):
        np.testing.assert_array_equal(getattr(one.diagnostics, field.name), getattr(other.diagnostics, field.name))


def parts(folder: Path) -> list[Path]:
    return sorted(folder.glob("*.part"))


def steps(fit: Fit, folder: Path) -> int:
    return resumable_steps(fit, seed=1, max_steps=STEPS, checkpoint=folder)


@pytest.mark.study
@pytest.mark.parametrize("kills", [(2,), pytest.param((1, 3), marks=pytest.mark.study)], ids=["once", "twice"])
def test_a_killed_run_ends_with_the_same_chain(
    fit: Fit, whole: Posterior, tmp_path: Path, kills: tuple[int, ...]
) -> None:
    """Kill −9 of processes after so many parts; the last start, here, ends with the chain that nobody killed."""
    folder = tmp_path / "kept"
    code = CHILD.format(tests=str(Path(__file__).parent), folder=str(folder))
    for wanted in kills:
        process = subprocess.Popen([sys.executable, "-c", code])
        end = time.monotonic() + PATIENCE
        while len(parts(folder)) < wanted and process.poll() is None and time.monotonic() < end:
            time.sleep(0.005)
        process.kill()
        assert process.wait() == -signal.SIGKILL
        assert wanted * CHUNK <= steps(fit, folder) < STEPS
    assert_same(run(fit, folder), whole)


def test_a_run_goes_on_from_each_of_its_parts(
    fit: Fit, whole: Posterior, kept: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for count in (4, 3, 1, 0):
        for part in parts(kept)[count:]:
            part.unlink()
        assert steps(fit, kept) == count * CHUNK
        assert_same(run(fit, kept), whole)
        assert len(parts(kept)) == STEPS / CHUNK
    monkeypatch.setattr("emcee.EnsembleSampler.run_mcmc", None)
    assert_same(run(fit, kept), whole)  # a finished run is read, not sampled


def test_a_resumed_run_remembers_how_far_it_wanted_to_go(
    fit: Fit, tmp_path: Path, every_chunk: None, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The first look asks for 200 steps, later ones for fewer."""
    monkeypatch.setattr(chains, "SHORTEST", CHUNK)
    monkeypatch.setattr(chains, "_steps_needed", lambda sampler: 200 if sampler.iteration == CHUNK else 0)
    first = run(fit, tmp_path)
    for part in parts(tmp_path)[2:]:
        part.unlink()
    assert_same(run(fit, tmp_path), first)
    assert len(parts(tmp_path)) * CHUNK == 200


DAMAGES: dict[str, Callable[[bytes], bytes]] = {
    "torn": lambda content: content[: len(content) // 2],
    "empty": lambda _: b"",
    "one bit": lambda content: content[:5000] + bytes([content[5000] ^ 1]) + content[5001:],
    "its digest": lambda content: bytes(32) + content[32:],
}


@pytest.mark.parametrize("damage", DAMAGES.values(), ids=DAMAGES)
def test_a_damaged_part_is_left_out_with_a_note(
    fit: Fit, whole: Posterior, kept: Path, damage: Callable[[bytes], bytes]
) -> None:
    third = parts(kept)[2]
    third.write_bytes(damage(third.read_bytes()))
    with pytest.warns(UserWarning, match=r"kept: 1 damaged checkpoints are left out; sampling goes on from step 100\."):
        assert_same(run(fit, kept), whole)
    assert steps(fit, kept) == STEPS  # and has been written anew


def test_parts_count_only_in_their_order(fit: Fit, whole: Posterior, kept: Path) -> None:
    second, fourth = parts(kept)[1], parts(kept)[3]
    second.write_bytes(fourth.read_bytes())
    assert steps(fit, kept) == CHUNK
    assert_same(run(fit, kept), whole)


def test_checkpoints_of_another_run_are_refused(fit: Fit, kept: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    x = fit.data.x.copy()
    x[7] *= 1 + 1e-12
    moved = dataclasses.replace(fit, data=dataclasses.replace(fit.data, x=x))
    prior = prepare_prior(fit.model, fit.measurements.instrument, {"kd": (0.3, 0.2)})
    informed = dataclasses.replace(fit, data=dataclasses.replace(fit.data, prior=prior))
    refused = r"kept holds checkpoints of another run: other data, model, priors, .*; remove that folder, or name"
    for other in (moved, informed):
        assert steps(other, kept) == 0
        with pytest.raises(FitmatError, match=refused):
            run(other, kept)
    for change in ({"seed": 2}, {"max_steps": STEPS + 1}, {"walkers": 34}):
        given: dict[str, Any] = {"seed": 1, "max_steps": STEPS} | change
        assert resumable_steps(fit, checkpoint=kept, **given) == 0
        with pytest.raises(FitmatError, match=refused):
            fm.sample(fit, checkpoint=kept, **given)
    monkeypatch.setattr(chains.importlib.metadata, "version", lambda _: "0")
    assert steps(fit, kept) == 0


def test_a_part_of_another_run_is_refused_wherever_it_is(fit: Fit, kept: Path, tmp_path: Path) -> None:
    fm.sample(fit, seed=2, max_steps=STEPS, checkpoint=tmp_path / "other")
    parts(kept)[2].write_bytes(parts(tmp_path / "other")[2].read_bytes())
    with pytest.raises(FitmatError, match="another run"):
        run(fit, kept)


def test_a_disk_that_refuses_does_not_end_the_run(
    fit: Fit, whole: Posterior, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(*_: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(checkpoint.os, "fsync", full)
    with pytest.warns(
        UserWarning, match=r"no further checkpoints \(No space left on device\); sampling goes on"
    ) as told:
        assert_same(run(fit, tmp_path), whole)
    assert len(told) == 1
    (tmp_path / "file").touch()
    with pytest.raises(OutputError, match=r"file: no place for checkpoints \(File exists\); choose another\."):
        run(fit, tmp_path / "file")


def test_a_slow_disk_gets_fewer_parts(
    fit: Fit, whole: Posterior, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Each write takes 0.3 s, so that the next would be due after 15 s: the first and the last alone."""
    clock = [0.0]
    monkeypatch.setattr(checkpoint, "time", types.SimpleNamespace(monotonic=lambda: clock[0]))
    monkeypatch.setattr(checkpoint.os, "fsync", lambda _: clock.append(clock.pop() + 0.3))
    assert_same(run(fit, tmp_path), whole)
    assert [part.name for part in parts(tmp_path)] == ["00000050.part", "00000250.part"]


def test_only_parts_are_removed(kept: Path) -> None:
    """What somebody put beside them stays, also where its name ends as theirs do."""
    for name in ("mine.txt", "mine.part"):
        (kept / name).write_text("mine")
    checkpoint.discard(kept)
    assert sorted(path.name for path in kept.iterdir()) == ["mine.part", "mine.txt"]
    for path in kept.iterdir():
        path.unlink()
    checkpoint.discard(kept)
    assert not kept.exists()


def test_a_file_that_is_no_part_is_not_read_as_one(fit: Fit, whole: Posterior, kept: Path) -> None:
    (kept / "mine.part").write_text("mine")
    assert_same(run(fit, kept), whole)  # warnings are errors
