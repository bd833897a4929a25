"""Fuzz: faulty files and objects without end for every reader; each must become `Measurements` or one plain sentence.

It knows no format: valid samples and faults in their structure come from the tests of each format. Nothing is kept but
an input that failed.

    python tests/measurements/formats/fuzz.py --inputs 200000 --reader merl --seed 0
"""

import argparse
import contextlib
import faulthandler
import os
import resource
import signal
import struct
import sys
import tempfile
import time
import tracemalloc
import warnings
from collections.abc import Callable, Iterator
from pathlib import Path
from types import FrameType
from typing import Any, NamedTuple

import numpy as np
import test_alta
import test_astm
import test_fred
import test_lighttools
import test_merl
import test_pab_opto
import test_parquet
import test_rgl
import test_road
import test_ssdd
import test_tensor
import test_utia
import test_zemax
from fuzz_faults import GENERIC, Fault, spliced
from fuzz_objects import arrays, labelled

from fitmat.errors import ReadError
from fitmat.measurements.formats import utia
from fitmat.measurements.reader import read
from fitmat.measurements.samples import Measurements

SLOWEST = 5.0
"""Seconds of this process that one input of a few kilobytes may take; most take milliseconds."""

HANG = 120.0
"""Seconds by the clock after which Python is ended with a traceback, where even the signal found no hearing."""

SWELLING = 64
"""Bytes of memory for each byte of the file, beside `SLACK`: text of one-digit cells becomes float64 several times."""

SLACK = 64 * 2**20
"""Bytes of memory that even an empty file may take: pools of threads, modules imported at first use."""

TRACED = 20
"""One input in so many is read under tracemalloc, which sees memory that is asked for and never touched."""

SMALL = 2**14
"""Bytes; smaller inputs count as so large, since messages and tracebacks take some memory."""

LONGEST = 4000
"""Characters of a message; lists of choices take a few hundred, names of columns are the user's own."""

NAME = "fuzz.dat"
WINDOW = 65_536
POOL = 100
UNIT = 1e-6
"""How far the length of a direction may be from 1: twelve digits remain after a few float64 operations."""


class Failure(Exception):
    """What a reader did that no reader may do."""


class Reader(NamedTuple):
    """What feeds one reader.

    Attributes:
        sample: A valid input: the bytes of a file, or an object.
        faults: Faults in its structure; none for objects, which are made faulty.
        real: Folder and pattern of measured files.
        prepare: What must hold while it runs.
    """

    sample: Callable[[np.random.Generator], Any]
    faults: tuple[Fault, ...] = ()
    real: str = ""
    prepare: Callable[[], contextlib.AbstractContextManager[None]] = contextlib.nullcontext


class Tally(NamedTuple):
    """What came of the inputs of one reader.

    Attributes:
        inputs: How many there were.
        read: How many became measurements.
        refused: How many were refused in a sentence.
        slowest: Seconds of this process for the slowest one.
        memory: Most bytes that one input took, resident.
        traced: Most bytes that one traced input took for each byte of its own, or of `SMALL` where it is smaller.
    """

    inputs: int = 0
    read: int = 0
    refused: int = 0
    slowest: float = 0.0
    memory: int = 0
    traced: float = 0.0


# --- the readers ----------------------------------------------------------------------------------


def _table(rng: np.random.Generator) -> bytes:
    """A text table: any delimiter, decimal mark, quantity, channels, comments; long or wide."""
    mark = (",", ";", "\t", "  ")[rng.integers(4)]
    angles = (("theta_i", "theta_o"), ("Theta_i [deg]", "theta_r", "phi"), ("aoi", "θ_o", "phi_i", "phi_o"))
    quantity = ("brdf", "brdf_cos", "reflectance_factor", "BRDF (1/sr)", "signal")[rng.integers(5)]
    tails = (("",), ("_r", "_g", "_b"), ("_550", "_600nm"))[rng.integers(3) if quantity != "BRDF (1/sr)" else 0]
    beside = (["valid"], ["flag"], [f"sigma{tail}" for tail in tails], [])[rng.integers(4)]
    beside += ["reference"] if quantity == "signal" else []
    beside += [("note", "wavelength", "channel")[rng.integers(3) if tails == ("",) else 0]]
    names = [*angles[rng.integers(3)], *(quantity + tail for tail in tails), *beside]
    rows = np.round(rng.uniform(1.7, 89, (int(rng.integers(1, 12)), len(names))), 3).astype(str)
    if mark != "," and rng.integers(4) == 0:
        rows = np.char.replace(rows, ".", ",")
    for name, good in (("valid", "true"), ("flag", "0")):
        if name in names:
            rows[:, names.index(name)] = rng.choice(["1", "0", "no", "NA"], len(rows))
            rows[0, names.index(name)] = good
    if not names[-1].startswith("wave"):
        rows[:, -1] = rng.choice(['"a"', "b c" if mark.strip() or mark == "\t" else "b", "r"], len(rows))
    head = ("", "# made up\n", "% a\n\n")[rng.integers(3)]
    return (head + "\n".join(mark.join(row) for row in [names, *rows]) + "\n").encode()


@contextlib.contextmanager
def _small_utia() -> Iterator[None]:
    """UTIA's two megabytes as a grid of a few directions; what depends on the size is the size alone."""
    kept = utia.SHAPE, utia._TYPES
    utia.SHAPE, utia._TYPES = (2, 3, 2, 3), {3 * 36 * width: f"<f{width}" for width in (8, 4)}
    try:
        yield
    finally:
        utia.SHAPE, utia._TYPES = kept


def _utia(rng: np.random.Generator) -> bytes:
    return (rng.lognormal(-2.0, 1.0, 108) - 0.01).astype(("<f8", "<f4")[rng.integers(2)]).tobytes()


def _tensor_fault(raw: bytes, rng: np.random.Generator) -> bytes:
    return list(test_tensor.MUTATORS.values())[rng.integers(len(test_tensor.MUTATORS))](raw, rng)


READERS = {
    "rgl": Reader(test_rgl.sample, (_tensor_fault,)),
    "merl": Reader(lambda rng: test_merl.sample(rng, (3, 3, 4)), (test_merl.mutated,)),
    "zemax": Reader(test_zemax.sample, (test_zemax.mutated,), "ua-loft/zemax/*.bsdf"),
    "lighttools": Reader(test_lighttools.sample, (test_zemax.mutated,)),
    "fred": Reader(test_fred.sample, (test_zemax.mutated,), "ua-loft/fred/*.txt"),
    "astm": Reader(test_astm.sample, (test_zemax.mutated,)),
    "alta": Reader(test_alta.sample, (test_zemax.mutated,)),
    "ssdd": Reader(test_ssdd.sample, (test_zemax.mutated,), "ssdd/*.ssdd"),
    "road": Reader(test_road.sample, (test_zemax.mutated,)),
    "pab_opto": Reader(test_pab_opto.sample, (test_zemax.mutated,)),
    "utia": Reader(_utia, (test_utia.mutated,), prepare=_small_utia),
    "utia_whole": Reader(test_utia.sample, (test_utia.mutated,)),
    "parquet": Reader(test_parquet.sample, (test_parquet.mutated,)),
    "text": Reader(_table, (test_zemax.mutated,), "*/*.[cd][sa][vt]"),
    "frames": Reader(arrays),
    "xarray": Reader(labelled),
}
"""Name → what feeds it; `utia_whole` is UTIA once more, at its true size."""


def inputs(reader: Reader, seed: int, folder: Path | None = None) -> Iterator[Any]:
    """Inputs without end; with the same seed the same ones.

    Args:
        reader: What to feed.
        seed: Of all draws.
        folder: Of measured files; windows of them are added to the samples.
    """
    rng = np.random.default_rng(seed)
    if not reader.faults:
        while True:
            yield reader.sample(rng)
    real = [path.read_bytes() for path in sorted(folder.glob(reader.real))] if folder and reader.real else []
    pool = [reader.sample(rng) for _ in range(POOL if len(reader.sample(rng)) < WINDOW else 3)]
    while True:
        raw, other = (pool[k] for k in rng.integers(len(pool), size=2))
        if real and rng.integers(40) == 0:
            whole = real[rng.integers(len(real))]
            raw = whole[:WINDOW] if rng.integers(2) else _cut(whole, rng)
        dice = rng.integers(100)
        if dice < 2:
            yield raw
            continue
        if 15 <= dice < 75:
            with contextlib.suppress(IndexError, ValueError, struct.error):
                raw = reader.faults[rng.integers(len(reader.faults))](raw, rng)
        if dice < 10:
            raw = spliced(raw, other, rng)
        if dice < 15 or dice >= 50:
            for _ in range((1, 1, 1, 2, 3)[rng.integers(5)]):
                raw = GENERIC[rng.integers(len(GENERIC))](raw, rng)
        yield raw


def _cut(whole: bytes, rng: np.random.Generator) -> bytes:
    """The head of a file and a window of its body."""
    at = int(rng.integers(len(whole)))
    return whole[:1000] + whole[at : at + int(rng.integers(1, 4000))]


# --- one input ------------------------------------------------------------------------------------

_WATCHED = ("os.", "shutil.", "subprocess.", "socket.", "pickle.", "ctypes.", "urllib.", "tempfile.")
_HARMLESS = ("os.listdir", "os.scandir", "os.getxattr", "os.fwalk", "os.walk")
_forbidden: list[str] = []
_watching = False


def _audit(event: str, given: tuple[Any, ...]) -> None:
    """Note what a reader must not do: write, start, connect, unpickle."""
    if not _watching:
        return
    if event == "open":
        flags = next((flags for flags in given[2:3] if isinstance(flags, int)), 0)
        if flags & (os.O_WRONLY | os.O_RDWR | os.O_CREAT | os.O_TRUNC | os.O_APPEND):
            _forbidden.append(f"open {given[:1]!r} to write")
    elif event.startswith(_WATCHED) and event not in _HARMLESS:
        _forbidden.append(f"{event} {given!r}")


sys.addaudithook(_audit)


def _expire(signum: int, frame: FrameType | None) -> None:
    raise Failure(f"it takes more than {SLOWEST:g} s")


def _state() -> tuple[object, ...]:
    return dict(os.environ), os.getcwd(), np.geterr(), len(warnings.filters), tuple(sys.path)


def _peak() -> int:
    """Most bytes of this process that were resident since `_reset`."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024


def _reset() -> int:
    with contextlib.suppress(OSError):
        Path("/proc/self/clear_refs").write_text("5")
    return _peak()


class Cost(NamedTuple):
    """Seconds, resident bytes and traced bytes of one input; the last is 0 where it was not traced."""

    seconds: float
    memory: int
    traced: int


def judged(source: Any, name: str, size: int, *, trace: bool = False) -> tuple[str | None, Cost]:
    """Read one input and judge what comes of it: what it was refused with, None where it was read; and its cost.

    Args:
        source: A path or an object.
        name: What a message must begin with.
        size: Bytes of the input.
        trace: Whether to count the memory that is asked for.

    Raises:
        Failure: neither measurements nor one sentence, or more time or memory than an input of that size may take, or
            something was written or changed.
    """
    global _watching
    message, state = None, _state()
    _forbidden.clear()
    if trace:
        tracemalloc.start()
    before, begin = _reset(), time.process_time()
    signal.setitimer(signal.ITIMER_PROF, SLOWEST)
    _watching = True
    try:
        found = read(source)
    except ReadError as error:
        message = str(error)
    except Failure:
        raise
    except (Exception, _panic()) as error:
        raise Failure(f"{type(error).__name__}: {str(error)[:500]}") from error
    else:
        _check(found)
    finally:
        _watching = False
        signal.setitimer(signal.ITIMER_PROF, 0)
        seconds, traced = time.process_time() - begin, tracemalloc.get_traced_memory()[1]
        if trace:
            tracemalloc.stop()
    cost = Cost(seconds, _peak() - before, traced)
    if message is not None:
        _check_message(message, name)
    if _forbidden or state != _state():
        raise Failure(f"it touched the world: {_forbidden or 'environment, folder, or settings'}")
    if max(cost.memory, cost.traced) > SWELLING * size + SLACK:
        raise Failure(f"{cost.memory} bytes resident, {cost.traced} asked for, for an input of {size}")
    return message, cost


def _panic() -> type[BaseException]:
    from polars.exceptions import PanicException

    return PanicException


def _check(found: object) -> None:
    if not isinstance(found, Measurements):
        raise Failure(f"{type(found).__name__} is not Measurements")
    n, c = found.value.shape
    if not found.valid.any() or (found.wi.shape, found.wo.shape, found.valid.shape) != ((n, 3), (n, 3), (n, c)):
        raise Failure("shapes disagree, or nothing is valid")
    if not np.isfinite(found.value).all() or len(found.channels) != c:
        raise Failure("values are not finite, or channels do not belong to them")
    if max(np.abs(np.linalg.norm(w, axis=1) - 1).max() for w in (found.wi, found.wo)) > UNIT:
        raise Failure("directions are no unit vectors")
    if found.sigma is not None and not (np.isfinite(found.sigma) & (found.sigma > 0)).all():
        raise Failure("sigma is not positive")
    if (np.minimum(found.wi[:, 2], found.wo[:, 2])[found.valid.any(axis=1)] <= 0).any():
        raise Failure("a valid value is below the horizon")


def _check_message(message: str, name: str) -> None:
    if len(message.splitlines()) != 1 or not message.isprintable():
        raise Failure(f"a message that is not one plain line: {message[:300]!r}")
    if not message.startswith(name) or "expected" not in message or message[-1] not in ".?":
        raise Failure(f"a message without name, expectation or end: {message[:300]!r} … {message[-50:]!r}")
    if len(message) > LONGEST:
        raise Failure(f"a message of {len(message)} characters: {message[:200]!r} …")


# --- many inputs ----------------------------------------------------------------------------------


def run(reader: Reader, count: int, seed: int, folder: Path | None = None) -> Tally:
    """Read that many inputs.

    Raises:
        Failure: what went wrong, and where the input lies.
    """
    tally, made = Tally(), inputs(reader, seed, folder)
    with watched(), reader.prepare(), tempfile.TemporaryDirectory(dir=_memory()) as scratch:
        path = Path(scratch) / NAME
        for number in range(count):
            faulthandler.dump_traceback_later(HANG, exit=True)
            source = next(made)
            raw = source if isinstance(source, bytes) else b""
            size = len(raw) if raw or isinstance(source, bytes) else _size(source)
            if isinstance(source, bytes):
                path.write_bytes(raw)
            name = NAME if isinstance(source, bytes) else type(source).__name__
            try:
                message, cost = judged(
                    path if isinstance(source, bytes) else source, name, size, trace=number % TRACED == 0
                )
                if os.listdir(scratch) not in ([NAME], []):
                    raise Failure(f"files appeared: {os.listdir(scratch)}")
            except Failure as failure:
                raise Failure(f"input {number} of seed {seed}, kept as {_kept(source)}: {failure}") from failure
            tally = _added(tally, message, cost, size)
    return tally


def _added(tally: Tally, message: str | None, cost: Cost, size: int) -> Tally:
    return Tally(
        inputs=tally.inputs + 1,
        read=tally.read + (message is None),
        refused=tally.refused + (message is not None),
        slowest=max(tally.slowest, cost.seconds),
        memory=max(tally.memory, cost.memory),
        traced=max(tally.traced, cost.traced / max(size, SMALL)),
    )


@contextlib.contextmanager
def watched() -> Iterator[None]:
    """Warnings are errors, and slow inputs are interrupted; `judged` needs it."""
    before = signal.signal(signal.SIGPROF, _expire)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            yield
    finally:
        signal.signal(signal.SIGPROF, before)
        faulthandler.cancel_dump_traceback_later()


def _memory() -> str | None:
    """A folder in memory, where there is one."""
    return "/dev/shm" if os.access("/dev/shm", os.W_OK) else None


def _size(source: Any) -> int:
    """Bytes of an object's arrays, at least one for each cell."""
    named = source.variables if hasattr(source, "variables") else source
    try:
        return sum(np.asarray(named[name]).nbytes for name in named)
    except Exception:
        return 0


def _kept(source: Any) -> Path:
    folder = Path(tempfile.mkdtemp(prefix="fitmat-fuzz-"))
    if isinstance(source, bytes):
        (folder / NAME).write_bytes(source)
        return folder / NAME
    with np.printoptions(threshold=10**6):
        (folder / "object.txt").write_text(repr(source), "utf-8", "backslashreplace")
    return folder / "object.txt"


def measured_files() -> Path | None:
    """The folder of shared measurements, where there is one."""
    folder = Path(os.environ.get("FITMAT_DATA") or Path(__file__).parents[4] / "shared" / "data")
    return folder if folder.is_dir() else None


def main() -> int:
    """Run the readers one after the other and print a line for each."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0] if __doc__ else "")
    parser.add_argument("--inputs", type=int, default=2000, help="Number for each reader.")
    parser.add_argument("--reader", choices=READERS, action="append", help="Only this one; may be repeated.")
    parser.add_argument("--seed", type=int, default=0, help="Of all draws.")
    given = parser.parse_args()
    failed = 0
    for name in given.reader or READERS:
        begin = time.process_time()
        try:
            t = run(READERS[name], given.inputs, given.seed, measured_files())
        except Failure as failure:
            failed = 1
            print(f"{name}: FAILED, {failure}", flush=True)
            continue
        print(
            f"{name}: {t.inputs} inputs, {t.read} Measurements, {t.refused} ReadError; "
            f"slowest {t.slowest * 1e3:.0f} ms; "
            f"most memory {t.memory / 2**20:.1f} MiB resident, {t.traced:.1f} times the input traced; "
            f"{time.process_time() - begin:.0f} s",
            flush=True,
        )
    return failed


if __name__ == "__main__":
    sys.exit(main())
