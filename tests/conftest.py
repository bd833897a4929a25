"""What every test stands on: float64, no programs cached on disk, reproducible draws, shared directions."""

import gc
import os
from collections.abc import Callable, Iterator
from pathlib import Path
from types import ModuleType

import hypothesis
import jax
import numpy as np
import pytest

jax.config.update("jax_enable_x64", True)
jax.config.update("jax_enable_compilation_cache", False)
hypothesis.settings.register_profile("fitmat", derandomize=True, deadline=None, database=None)
hypothesis.settings.load_profile("fitmat")


@pytest.fixture(autouse=True, scope="module")
def _forget_programs() -> Iterator[None]:
    """Let go of compiled programs after each file: together they need more memory maps than Linux grants a process."""
    yield
    jax.clear_caches()
    gc.collect()


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
