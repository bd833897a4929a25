"""Programs on disk: the numbers of the plain function, whatever lies in the folder; a later process traces none."""

import dataclasses
import inspect
import json
import os
import shutil
import stat
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from jaxtyping import Array

import fitmat as fm
from fitmat.fitting import settling
from fitmat.fitting.coordinates import coordinates
from fitmat.fitting.likelihood import prepare
from fitmat.maths import program_files, program_names, programs
from fitmat.maths.program_files import SUFFIX, kept, remove
from fitmat.maths.programs import Program, program
from fitmat.measurements.noise import measured_noise
from fitmat.models.base import AbstractBRDF, evaluate_pairs
from fitmat.models.lobes.lambert import Lambert

ROUNDING = 1e-12
"""Relative; compiled as a whole or operation by operation."""

SUMS = 1e-10
"""Relative, also to the largest of them; sums over all rows in another order, some of which cancel."""

DATA = Path(__file__).parents[2] / "data" / "synthetic" / "satin-plastic.csv"

FITTED = "lambert+blinn-phong"
"""Few operations, soon compiled."""

CHILD = """
import collections, json, sys
import jax
jax.config.update("jax_enable_x64", True)
import fitmat as fm
from fitmat.maths import programs
from fitmat.models.lobes.lambert import Lambert

counts, formula = collections.Counter(), Lambert.__call__

def counted(*args):
    counts["formula"] += 1
    return formula(*args)

def heard(event, *_, fun_name="", **__):
    counts[event.rpartition("/")[2]] += 1

def traced(event, seconds, fun_name="", **_):
    if event.endswith("jaxpr_trace_duration"):
        names.append(fun_name)

names = []
Lambert.__call__ = counted
jax.monitoring.register_event_listener(heard)
jax.monitoring.register_event_duration_secs_listener(traced)
found = fm.fit(fm.read({data!r}), {model!r})
print(json.dumps({{
    "values": found.values.tolist(), "information": found.information.tolist(), "result": found.result,
    "formula": counts["formula"], "traced": names,
    "hits": counts["cache_hits"], "misses": counts["cache_misses"], "at": programs.__file__,
}}))
"""


class Run(NamedTuple):
    """What another process found, and what it did for it.

    Attributes:
        found: Values, information and result of the fit.
        formula: How often Lambert's formula was traced.
        traced: Functions that were traced.
        hits: Compiled programs that lay in the folder.
        misses: Programs that were compiled.
        warned: What it wrote to stderr.
    """

    found: tuple[list, list, str]
    formula: int
    traced: list[str]
    hits: int
    misses: int
    warned: str


def started(place: Path | str, package: Path) -> subprocess.Popen[str]:
    """A process that fits, with warnings as errors where they are Python's."""
    environment = {k: v for k, v in os.environ.items() if not k.startswith("JAX_")}
    environment |= {"FITMAT_CACHE": str(place), "PYTHONWARNINGS": "error"}
    code = CHILD.format(data=str(DATA), model=FITTED)
    pipe = subprocess.PIPE
    command = [sys.executable, "-c", code]  # which looks for packages where it runs
    return subprocess.Popen(command, env=environment, cwd=package, stdout=pipe, stderr=pipe, text=True)


def ended(process: subprocess.Popen[str]) -> Run:
    out, warned = process.communicate()
    assert process.returncode == 0, warned
    told = json.loads(out)
    assert Path(told["at"]) != Path(programs.__file__)
    found = told["values"], told["information"], told["result"]
    return Run(found, told["formula"], told["traced"], told["hits"], told["misses"], warned)


@pytest.fixture(scope="module")
def package(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Where a copy of the package lies that nobody edits while the processes run: its sources name the programs."""
    place = tmp_path_factory.mktemp("package")
    shutil.copytree(program_names.PACKAGE, place / "fitmat")
    return place


@pytest.fixture(scope="module")
def filled(package: Path, tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, list[Run]]:
    """A folder that two processes filled at once, and what they found."""
    place = tmp_path_factory.mktemp("programs")
    return place, [ended(process) for process in [started(place, package) for _ in range(2)]]


def kinds(names: list[str]) -> set[str]:
    """The functions of programs, without the digests."""
    return {name.rpartition("-")[0] for name in names}


@pytest.mark.study
def test_two_processes_fill_one_folder(filled: tuple[Path, list[Run]]) -> None:
    place, (one, other) = filled
    assert one.found == other.found
    assert one.formula > 0
    assert (one.warned, other.warned) == ("", "")
    assert {path.name.rpartition("-")[0] for path in place.glob(f"*{SUFFIX}")} == kinds(one.traced)
    assert not list(place.glob(".*"))


def test_a_later_process_traces_none(filled: tuple[Path, list[Run]], package: Path) -> None:
    """Nor does it compile: no formula is called, and only the call of each kept program is traced, once."""
    place, (first, _) = filled
    before = {path.name: path.read_bytes() for path in place.iterdir()}
    later = ended(started(place, package))
    assert later.found == first.found
    assert later.formula == 0
    assert {"refine", "block", "settled"} <= kinds(first.traced)
    assert sorted(later.traced) == sorted(path.stem for path in place.glob(f"*{SUFFIX}"))
    assert (later.hits, later.misses) == (len(later.traced), 0)
    assert later.warned == ""
    assert {path.name: path.read_bytes() for path in place.iterdir()} == before


DAMAGES: dict[str, Callable[[bytes], bytes]] = {
    "truncated": lambda content: content[: len(content) // 2],
    "empty": lambda _: b"",
    "garbage": lambda content: np.random.default_rng(1).bytes(len(content)),
    "one bit": lambda content: content[:500] + bytes([content[500] ^ 1]) + content[501:],
}


@pytest.mark.study
@pytest.mark.parametrize("damage", DAMAGES)
def test_a_damaged_folder_is_made_anew(
    filled: tuple[Path, list[Run]], package: Path, tmp_path: Path, damage: str
) -> None:
    """All files of it, JAX's too: the same numbers, no warning, and the process after that traces none."""
    place, (first, _) = filled
    shutil.copytree(place, tmp_path / "damaged")
    for path in (tmp_path / "damaged").iterdir():
        path.write_bytes(DAMAGES[damage](path.read_bytes()))
    again, later = (ended(started(tmp_path / "damaged", package)) for _ in range(2))
    assert (again.found, again.warned) == (first.found, "")
    assert (later.found, later.formula, later.misses, later.warned) == (first.found, 0, 0, "")


@pytest.mark.study
def test_a_process_without_a_folder_finds_the_same(filled: tuple[Path, list[Run]], package: Path) -> None:
    alone = ended(started("", package))
    assert (alone.found, alone.warned) == (filled[1][0].found, "")


Arguments = tuple[AbstractBRDF, np.ndarray, np.ndarray]


@pytest.fixture
def given(hemisphere: Callable[[int, int], np.ndarray]) -> Arguments:
    model = fm.model("lambert+phong", channels=2, kd=np.array([0.2, 0.4]))
    return model, hemisphere(11, 1), hemisphere(11, 2)


@pytest.fixture
def place(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """An empty place for programs of this process; what it has loaded stays aside."""
    monkeypatch.setenv("FITMAT_CACHE", str(tmp_path / "programs"))
    monkeypatch.setattr(programs, "_EVERY", [])
    return tmp_path / "programs"


@pytest.fixture
def traced(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """Names of the programs that this process exports from now on."""
    names: list[str] = []
    exported = programs._exported

    def noted(flat: Any, shapes: list[Any]) -> Any:
        names.append(flat.__name__)
        return exported(flat, shapes)

    monkeypatch.setattr(programs, "_exported", noted)
    return names


def fresh() -> Program:
    """A program of which nothing is loaded, as at the start of a process."""
    return program(evaluate_pairs)


def plain(model: AbstractBRDF, wi: np.ndarray, wo: np.ndarray) -> np.ndarray:
    """What the function itself gives."""
    return np.asarray(evaluate_pairs(model, jnp.asarray(wi), jnp.asarray(wo)))


def assert_right(given: Arguments) -> None:
    """What a fresh program gives is what the function gives."""
    np.testing.assert_allclose(fresh()(*given), plain(*given), rtol=ROUNDING)


def files(place: Path) -> list[Path]:
    return sorted(place.glob(f"*{SUFFIX}"))


def test_a_program_gives_what_the_function_gives(place: Path, given: Arguments, traced: list[str]) -> None:
    """Made, loaded, from the memory, by keywords, in a loop, for other shapes and other structures."""
    model, wi, wo = given
    for _ in range(2):
        assert_right(given)
    assert len(traced) == 1
    one = fresh()
    for count in (11, 3, 11):
        found = one(model, wi=wi[:count], wo=wo[:count])
        np.testing.assert_allclose(found, plain(model, wi[:count], wo[:count]), rtol=ROUNDING)
    run = one.bound((model,), wi, wo)
    for light, sensor in ((wi, wo), (wo, wi)):
        np.testing.assert_allclose(run(light, sensor), plain(model, light, sensor), rtol=ROUNDING)
    other_values = fm.model("lambert+phong", channels=2, kd=np.array([0.5, 0.1]))
    for other in (other_values, fm.model("lambert"), fm.model("phong")):
        np.testing.assert_allclose(one(other, wi, wo), plain(other, wi, wo), rtol=ROUNDING)


def test_what_is_made_ready_is_told(place: Path, given: Arguments) -> None:
    """Compiled the first time, loaded the second, and nothing where it is in memory; the end of each too."""
    told: list[tuple[str, str]] = []
    with programs.announced(lambda *said: told.append(said)):
        fresh()(*given)
        first = len(told)
        again = fresh()
        again(*given)
        again(*given)
    name = "lambert+phong"
    assert told[:first] == [("loading", name), ("", name), ("compiling", name), ("", name)]
    assert told[first:] == [("loading", name), ("", name)]
    fresh()(*given)
    assert len(told) == 6


def test_within_another_program_it_is_the_function(given: Arguments, traced: list[str]) -> None:
    model, wi, wo = given
    one = fresh()

    def total(wi: Array) -> Array:
        return jnp.sum(one(model, wi, jnp.asarray(wo)))

    value, slope = jax.jit(jax.value_and_grad(total))(jnp.asarray(wi))
    assert float(value) == pytest.approx(float(plain(*given).sum()), rel=ROUNDING)
    assert np.isfinite(slope).all()
    assert traced == []


def test_tuples_and_static_coordinates(place: Path, traced: list[str]) -> None:
    """Σ r², Jᵀr and JᵀJ in the coordinates of all parameters, then of some; each choice is a program of its own."""
    m, model = fm.read(DATA), fm.model(FITTED)
    data, s, counts = prepare(m, measured_noise(m)), np.array(0.01), np.array([2, 1, 0])
    function = inspect.unwrap(settling._settled)
    for moved in (coordinates(model), coordinates(model, {"kd": 0.3})):
        lower, upper, p = moved.low, moved.high, moved.count
        points = lower + np.array([[0.3], [0.6]]) * (upper - lower)
        frame = settling.Frame(0.0 * lower, lower, upper, upper - lower, np.eye(p), np.ones(p, bool))
        walks = settling._packed(settling.Walks.standing(points, np.zeros(2, int)), slice(0, 2))
        given = model, moved, None, data, s, frame, walks, counts
        found = Program(function)(*given)
        expected: Any = function(*given)
        assert isinstance(found, tuple)
        for part, wanted, shape in zip(
            found, expected, [(settling.STEPS, p), (settling.STEPS,), (p,), (p, p)], strict=True
        ):
            assert part.shape == (settling.AT_ONCE, *shape)
            np.testing.assert_allclose(part, wanted, rtol=SUMS, atol=SUMS * np.abs(wanted).max())
    assert len(set(traced)) == 2
    moved = coordinates(model)
    other = dataclasses.replace(moved, upper=(*moved.upper[:-1], 2 * moved.upper[-1]))
    assert program_names.words(other) != program_names.words(moved)
    assert program_names.words(dataclasses.replace(moved, names=())) == program_names.words(moved)


@pytest.mark.parametrize("damage", DAMAGES)
def test_a_damaged_program_is_replaced(place: Path, given: Arguments, traced: list[str], damage: str) -> None:
    assert_right(given)
    (path,) = files(place)
    path.write_bytes(DAMAGES[damage](path.read_bytes()))
    assert_right(given)
    assert len(traced) == 2
    assert_right(given)
    assert len(traced) == 2


@pytest.mark.parametrize("foreign", ["bytes", "program of other shapes", "program of the same shapes"])
def test_a_foreign_file_is_replaced(place: Path, given: Arguments, traced: list[str], foreign: str) -> None:
    """Its digest is right, but it is not what its name says."""
    _, wi, wo = given
    assert_right(given)
    (path,) = files(place)
    if foreign == "bytes":
        content = b"not a module"
        path.write_bytes(program_files._digest(path.stem, content) + content)
    else:
        count = 5 if "other" in foreign else len(wi)
        other = fm.model("lambert+blinn-phong", channels=2)
        fresh()(other, wi[:count], wo[:count])
        (theirs,) = set(files(place)) - {path}
        path.write_bytes(theirs.read_bytes())
    traced.clear()
    assert_right(given)
    assert_right(given)
    assert len(traced) == 1


def test_files_of_others_stay(place: Path, given: Arguments) -> None:
    place.mkdir()
    (place / f"notes{SUFFIX}").write_text("mine")
    (place / f"folder{SUFFIX}").mkdir()
    assert_right(given)
    assert (place / f"notes{SUFFIX}").read_text() == "mine"
    assert len(files(place)) == 3


def assert_unkept(given: Arguments, traced: list[str]) -> None:
    """The same numbers, and nothing is kept: the next process traces again."""
    for count in (1, 2):
        assert_right(given)
        assert len(traced) == count


def test_none_is_wanted(given: Arguments, traced: list[str], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("FITMAT_CACHE", "")
    assert_unkept(given, traced)
    assert program_files.folder() is None


@pytest.mark.parametrize("below", [False, True])
def test_the_place_is_a_file(place: Path, given: Arguments, traced: list[str], below: bool, monkeypatch: Any) -> None:
    place.write_text("a file")
    monkeypatch.setenv("FITMAT_CACHE", str(place / "programs" if below else place))
    assert_unkept(given, traced)
    assert place.read_text() == "a file"


def test_the_folder_is_read_only(
    place: Path, given: Arguments, traced: list[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    place.mkdir(mode=0o500)
    # The superuser, who may run the tests, may write it all the same: say what others are told.
    monkeypatch.setattr(program_files.os, "access", lambda _, mode: not mode & os.W_OK)
    assert_unkept(given, traced)
    assert list(place.iterdir()) == []
    assert stat.S_IMODE(place.stat().st_mode) == 0o500


@pytest.mark.parametrize("call", ["write_bytes", "replace", "read_bytes"])
def test_the_disk_refuses(
    place: Path, given: Arguments, traced: list[str], monkeypatch: pytest.MonkeyPatch, call: str
) -> None:
    def refuse(*_: object) -> None:
        raise OSError(28, "No space left on device")

    sources = program_names.surroundings()  # reads them
    monkeypatch.setattr(program_names, "surroundings", lambda: sources)
    monkeypatch.setattr(program_files.os if call == "replace" else Path, call, refuse)
    assert_unkept(given, traced)
    monkeypatch.undo()
    assert not list(place.glob(".*"))


def test_the_folder_is_for_this_user_alone(place: Path, given: Arguments) -> None:
    assert_right(given)
    assert stat.S_IMODE(place.stat().st_mode) == 0o700


def test_a_folder_that_is_open_to_others_is_closed(place: Path) -> None:
    place.mkdir()
    place.chmod(0o775)
    assert program_files.folder() == place
    assert stat.S_IMODE(place.stat().st_mode) == 0o700


def test_a_folder_of_another_user_is_not_used(
    place: Path, given: Arguments, traced: list[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    place.mkdir()
    owner = os.getuid()
    monkeypatch.setattr(program_files.os, "getuid", lambda: owner + 1)
    assert_unkept(given, traced)
    assert program_files.folder() is None
    assert list(place.iterdir()) == []


def test_what_was_not_used_for_longest_is_removed(
    place: Path, given: Arguments, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Of three programs the second: the first, though older, was loaded since."""
    model, wi, wo = given
    made: list[Path] = []
    for age, count in ((300, 2), (200, 3), (100, 4)):
        fresh()(model, wi[:count], wo[:count])
        made += sorted(set(files(place)) - set(made))
        then = made[-1].stat().st_mtime - age
        os.utime(made[-1], (then, then))
    first, _, third = made
    fresh()(model, wi[:2], wo[:2])
    program_files._prune(place)
    assert files(place) == sorted(made)
    monkeypatch.setattr(program_files, "LIMIT", kept().size - 1)
    program_files._prune(place)
    assert files(place) == sorted((first, third))
    monkeypatch.setattr(program_files, "LIMIT", 1)
    program_files._prune(place)
    assert files(place) == []


def test_each_program_that_is_kept_makes_room(place: Path, given: Arguments, monkeypatch: pytest.MonkeyPatch) -> None:
    model, wi, wo = given
    fresh()(model, wi[:2], wo[:2])
    (first,) = files(place)
    then = first.stat().st_mtime - 100
    os.utime(first, (then, then))
    monkeypatch.setattr(program_files, "LIMIT", int(1.5 * first.stat().st_size))
    fresh()(model, wi[:3], wo[:3])
    assert len(files(place)) == 1
    assert not first.exists()


def test_what_is_kept_is_counted_and_removed(place: Path, given: Arguments) -> None:
    assert (kept().programs, kept().size) == (0, 0)
    assert_right(given)
    (path,) = files(place)
    assert (kept().programs, kept().size) == (1, path.stat().st_size)
    assert remove().programs == 1
    assert (kept().programs, files(place)) == (0, [])
    assert_right(given)


def test_what_a_command_used_is_loaded_ahead(
    place: Path, given: Arguments, traced: list[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Of that command only, and only where it ended well; what is noted there may be anything."""
    used: list[str] = []
    early: dict[str, Any] = {}
    monkeypatch.setattr(programs, "_USED", used)
    monkeypatch.setattr(programs, "_AHEAD", early)
    with programs.ahead("fit"):
        assert_right(given)
    with pytest.raises(ZeroDivisionError), programs.ahead("check"):
        raise ZeroDivisionError
    used.clear()
    with programs.ahead("check"):
        assert early == {}
    with programs.ahead("fit"):
        (loading,) = early.values()
        assert loading.result() is not None
        assert_right(given)
        assert early == {}
    (place / "last-fit").write_bytes(b"\x00\xff ../../evil-0123 plain\n" * 40)
    with programs.ahead("fit"):
        assert_right(given)
    assert len(traced) == 1


def test_clear_lets_go_of_what_is_loaded(place: Path, given: Arguments, traced: list[str]) -> None:
    one = fresh()
    one(*given)
    (path,) = files(place)
    path.unlink()
    one(*given)
    assert len(traced) == 1
    programs.clear()
    one(*given)
    assert len(traced) == 2


def foreign_lambert(module: str) -> Callable[..., AbstractBRDF]:
    """A class of that name and module whose formula is another one."""

    def twice(self: Any, wi: Array, wo: Array) -> Array:
        return 2.0 * Lambert.__call__(self, wi, wo)

    return type("Lambert", (Lambert,), {"__module__": module, "__qualname__": "Lambert", "__call__": twice})


@pytest.mark.parametrize("module", ["__main__", "lambert", "fitmatter.models.lobes.lambert"])
def test_classes_of_others_are_never_on_disk(place: Path, given: Arguments, traced: list[str], module: str) -> None:
    """Beside a program of fitmat's own class of that name, alone and within a model of fitmat's."""
    _, wi, wo = given
    own, other = fm.model("lambert", kd=0.3), foreign_lambert(module)(kd=0.3)
    assert_right((own, wi, wo))
    assert len(traced) == 1
    expected = 2.0 * plain(own, wi, wo)
    np.testing.assert_allclose(fresh()(other, wi, wo), expected, rtol=ROUNDING)
    dark: Any = fm.model("lambert+phong", ks=0.0)
    both = dataclasses.replace(dark, lobes=(other, *dark.lobes[1:]))
    np.testing.assert_allclose(fresh()(both, wi, wo), expected, rtol=ROUNDING)
    assert len(traced) == 1
    assert len(files(place)) == 1


def test_functions_of_others_are_never_on_disk(place: Path, given: Arguments, traced: list[str]) -> None:
    @program
    def evaluate_pairs(model: AbstractBRDF, wi: Array, wo: Array) -> dict[str, Array]:
        return {"value": jnp.asarray(wi) @ jnp.asarray(wo).T}

    np.testing.assert_allclose(evaluate_pairs(*given)["value"], given[1] @ given[2].T, rtol=ROUNDING)
    assert (traced, kept().programs) == ([], 0)


def test_another_machine_has_programs_of_its_own(
    place: Path, given: Arguments, traced: list[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    assert_right(given)
    with monkeypatch.context() as patched:
        patched.setattr(program_names, "machine", lambda: "another machine")
        program_names.surroundings.cache_clear()
        assert_right(given)
        assert len(files(place)) == len(set(traced)) == 2
    program_names.surroundings.cache_clear()
    assert_right(given)
    assert len(traced) == 2


def test_the_machine_is_known() -> None:
    assert program_names.machine().strip()
