"""What every test stands on: float64, compiled programs shared by all workers, reproducible draws, directions."""

import gc
import importlib
import os
import tempfile
import warnings
from collections.abc import Callable, Iterator
from importlib.metadata import version
from pathlib import Path
from types import ModuleType

import hypothesis
import jax
import numpy as np
import pytest

from fitmat.maths import programs

jax.config.update("jax_enable_x64", True)
hypothesis.settings.register_profile("fitmat", derandomize=True, deadline=None, database=None)
hypothesis.settings.load_profile("fitmat")


MOST_MAPS = 30_000
"""Memory maps of a process from which on it lets go of its compiled programs; Linux grants 65,530."""

HASTE = "--xla_cpu_use_fusion_emitters=false --xla_backend_optimization_level=1"
"""Saves a third of compiling, which most tests are; the studies run without."""

MORE_HASTE = "jax_disable_most_optimizations"
"""Setting of JAX that saves another third, and runs up to five times slower."""

CAREFUL = {"test_base", "test_random_walk", "test_position_free", "test_streamed"}
"""Files that run longer than they compile, or whose slopes lie close to underflow."""

COMPILES = {
    "test_albedo",
    "test_channelwise",
    "test_coat",
    "test_exchange",
    "test_lacquer",
    "test_laboratories",
    "test_laws",
    "test_losses",
    "test_recovery",
}
"""Files whose studies compile longer than they compute: hastily there as well."""

KNOWS_HASTE = "0.10."
"""Releases of jaxlib that were seen to know these flags: an unknown flag ends the process."""

_COMPILED = pytest.StashKey[tempfile.TemporaryDirectory[str]]()


def pytest_configure(config: pytest.Config) -> None:
    """Share one folder of compiled programs, for this run, between all workers and the processes that tests start.

    The first process makes it, the others inherit its name. It is where `fitmat` looks, but not the user's own.
    FITMAT_COMPILED names a folder that outlives the run.
    """
    if "FITMAT_COMPILED" not in os.environ:
        folder = tempfile.TemporaryDirectory(prefix="fitmat-tests-", ignore_cleanup_errors=True)
        config.stash[_COMPILED] = folder
        os.environ["FITMAT_COMPILED"] = folder.name
    if config.option.markexpr == "not study" and version("jaxlib").startswith(KNOWS_HASTE):
        os.environ.setdefault("XLA_FLAGS", HASTE)
        os.environ.setdefault(MORE_HASTE.upper(), "1")
    compiled = Path(os.environ["FITMAT_COMPILED"]) / "fitmat" / "compiled"
    os.environ["XDG_CACHE_HOME"] = os.environ["FITMAT_COMPILED"]
    os.environ["FITMAT_CACHE"] = str(compiled)
    os.environ["JAX_COMPILATION_CACHE_DIR"] = str(compiled)
    os.environ["JAX_PERSISTENT_CACHE_MIN_COMPILE_TIME_SECS"] = "0"
    jax.config.update("jax_compilation_cache_dir", str(compiled))
    jax.config.update("jax_persistent_cache_min_compile_time_secs", 0.0)


def pytest_unconfigure(config: pytest.Config) -> None:
    """Remove the folder where this process made it."""
    if _COMPILED in config.stash:
        config.stash[_COMPILED].cleanup()


@pytest.fixture(autouse=True, scope="module")
def _programs(request: pytest.FixtureRequest) -> Iterator[None]:
    """Compile as suits the file, and let go of programs afterwards if a process holds many memory maps by them."""
    name = request.module.__name__.rpartition(".")[2]
    hasty = name in COMPILES or (os.environ.get(MORE_HASTE.upper()) == "1" and name not in CAREFUL)
    jax.config.update(MORE_HASTE, hasty)
    yield
    maps = Path("/proc/self/maps")
    if not maps.exists() or maps.read_bytes().count(b"\n") > MOST_MAPS:
        programs.clear()
        jax.clear_caches()
        gc.collect()


@pytest.fixture(autouse=True)
def _elsewhere(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> None:
    """Give each test of commands a current folder of its own: into it they write unless they are told another."""
    if request.path.parent.name == "cli":
        monkeypatch.chdir(request.getfixturevalue("tmp_path"))


Hemisphere = Callable[[int, int], np.ndarray]
"""(number, seed) → that many unit vectors above the surface, uniform in solid angle, shape (n, 3)."""


@pytest.fixture(scope="session")
def shared_data() -> Path:
    """The folder of shared measurements, which the repository does not contain."""
    folder = Path(os.environ.get("FITMAT_DATA") or Path(__file__).parents[2] / "shared" / "data")
    if not folder.is_dir():
        pytest.skip(f"no shared measurements at {folder}: set FITMAT_DATA to their folder")
    return folder


@pytest.fixture(scope="session")
def mitsuba() -> ModuleType:
    """Mitsuba 3, scalar and single precision: an evaluator that shares no code with fitmat.

    The faster LLVM variants need a recent LLVM library; beside LLVM 14 and 15, Mitsuba 3.9 aborted the process.
    """
    import mitsuba

    mitsuba.set_variant("scalar_rgb")
    return mitsuba


@pytest.fixture(scope="session")
def science() -> ModuleType:
    """colour-science, which sets filters for warnings."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return importlib.import_module("colour")


@pytest.fixture(scope="session")
def hemisphere() -> Hemisphere:
    """Seeded directions; see `Hemisphere`."""

    def draw(number: int, seed: int) -> np.ndarray:
        rng = np.random.default_rng(seed)
        cos, phi = rng.uniform(size=number), rng.uniform(0, 2 * np.pi, number)
        sin = np.sqrt(1 - cos**2)
        return np.stack([sin * np.cos(phi), sin * np.sin(phi), cos], axis=1)

    return draw


@pytest.fixture(scope="session")
def singular() -> dict[str, tuple[np.ndarray, np.ndarray]]:
    """Where formulas of reflection divide by zero or take the root of zero, by name."""
    from fitmat.models import laws

    return laws.singular()
