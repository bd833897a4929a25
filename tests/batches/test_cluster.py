"""A cluster finds what this process finds, loses nothing with a worker, and says in one sentence what it lacks."""

import os
import signal
import time
from collections.abc import Callable, Iterator
from importlib.metadata import version
from pathlib import Path
from typing import Any

import pytest

import fitmat as fm
from fitmat.batches import cluster, workers
from fitmat.batches.jobs import Job, digest
from fitmat.batches.workers import studied
from fitmat.errors import FitmatError

distributed: Any = pytest.importorskip("distributed", reason="install it with pip install 'fitmat[cluster]'")

WAX = Path(__file__).parents[2] / "data" / "synthetic" / "wax.csv"

TOLD: dict[str, Any] = {"models": "lambert", "sampling": False}


@pytest.fixture
def started() -> Iterator[Callable[..., Any]]:
    """Starts clusters on this machine, and ends them."""
    begun: list[Any] = []

    def start(**told: Any) -> Any:
        begun.append(distributed.LocalCluster(dashboard_address=None, silence_logs=50, **told))
        return begun[-1]

    yield start
    for one in begun:
        one.close()


@pytest.fixture
def scans(tmp_path: Path) -> Path:
    """Five good files and one broken."""
    folder = tmp_path / "scans"
    folder.mkdir()
    lines = WAX.read_text(encoding="utf-8").splitlines()
    for k in range(5):
        (folder / f"scan{k}.csv").write_text("\n".join(lines[: len(lines) - 2 * k]) + "\n", encoding="utf-8")
    (folder / "scan5.csv").write_text("theta_i,theta_o,brdf\n10,20,much\n", encoding="utf-8")
    return folder


def one_by_one(jobs: Any, count: int) -> Any:
    del count
    for key, told in list(jobs.items()):
        yield key, studied(*told)


@pytest.mark.study
def test_a_cluster_that_loses_a_worker_finds_what_this_process_finds(
    scans: Path, tmp_path: Path, started: Callable[..., Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    two = started(n_workers=2, threads_per_worker=1, processes=True)
    killed: list[int] = []

    def kill_one(words: str, done: int, total: int) -> None:
        if done and not killed:
            with distributed.Client(two, set_as_default=False) as client:
                busy = next(worker for worker, tasks in client.processing().items() if tasks)
                killed.append(client.run(os.getpid, workers=[busy])[busy])
            os.kill(killed[0], signal.SIGKILL)

    found = fm.batch(scans, tmp_path / "cluster", "lambert", scheduler=two.scheduler_address, progress=kill_one)
    assert len(killed) == 1
    monkeypatch.setattr(workers, "each", one_by_one)
    here = fm.batch(scans, tmp_path / "here", "lambert")
    assert found.counts == {"fitted": 5, "refused": 1, "earlier": 0}
    assert found.table.drop("seconds").equals(here.table.drop("seconds"))
    again = fm.batch(scans, tmp_path / "cluster", "lambert")
    assert again.counts["earlier"] == 6


def told_of(path: Path) -> dict[str, tuple[Job, str]]:
    return {"key": (Job(path, {}, TOLD), digest(WAX))}


def test_a_worker_of_another_version_is_refused(started: Callable[..., Any], monkeypatch: pytest.MonkeyPatch) -> None:
    one = started(n_workers=1, threads_per_worker=1, processes=False)
    monkeypatch.setattr(cluster, "HERE", "77.0")
    with pytest.raises(FitmatError, match=r"^worker \S+ has fitmat \S+, expected fitmat 77\.0 as here: install it"):
        list(cluster.each(told_of(WAX), one.scheduler_address))
    monkeypatch.setattr(cluster, "version", lambda name: version(f"no-{name}"))
    with pytest.raises(
        FitmatError, match=r"^worker \S+ has no fitmat, expected fitmat 77\.0 as here: install it there"
    ):
        list(cluster.each(told_of(WAX), one.scheduler_address))


def test_a_worker_of_several_threads_is_refused(started: Callable[..., Any]) -> None:
    one = started(n_workers=1, threads_per_worker=2, processes=False)
    with pytest.raises(FitmatError, match=r"^worker \S+ has 2 threads, expected 1: start it with --nthreads 1\.$"):
        list(cluster.each(told_of(WAX), one.scheduler_address))


def test_a_file_that_a_worker_does_not_see_is_not_a_refused_file(started: Callable[..., Any], tmp_path: Path) -> None:
    """Its row is not kept: the folder may be there another time."""
    one = started(n_workers=1, threads_per_worker=1, processes=False)
    ((key, (row,)),) = cluster.each(told_of(tmp_path / "wax.csv"), one.scheduler_address)
    assert (key, row["outcome"]) == ("key", "failed")
    assert f"{tmp_path / 'wax.csv'}: No such file or directory on worker " in row["message"]


@pytest.mark.parametrize("address", ["tcp://127.0.0.1:9", "nowhere at all", "tcp://no.such.host.invalid:8786"])
def test_a_scheduler_that_does_not_answer_is_said_soon(address: str) -> None:
    begin = time.monotonic()
    with pytest.raises(FitmatError, match=rf"^no scheduler answers at {address} .*, expected the address that"):
        list(cluster.each(told_of(WAX), address))
    assert time.monotonic() - begin < 3 * cluster.WAIT


def test_processes_mean_nothing_on_a_cluster(tmp_path: Path) -> None:
    with pytest.raises(FitmatError, match="processes is 2, expected None with a scheduler"):
        fm.batch(WAX, tmp_path / "out", processes=2, scheduler="tcp://127.0.0.1:9")
