"""Shows what a run is made of: every compiled program with its seconds, and every import that takes long.

A program that is new is traced, lowered and compiled; afterwards it is read, lowered (a call of what
was exported) and loaded. A default run has at most 12, and traces no function of fitmat's afterwards.

Run: python benchmarks/programs.py [FILE]
"""

import collections
import json
import os
import re
import subprocess
import sys
import tempfile
from pathlib import Path

import machine

DATA = Path(__file__).parents[1] / "data" / "synthetic" / "satin-plastic.csv"

WATCHED = """
import atexit, collections, json, sys
import jax
seconds = collections.defaultdict(lambda: collections.defaultdict(float))
def hear(event, taken, **given):
    kind = event.rsplit("/", 1)[-1]
    name = str(given.get("fun_name", "")).removeprefix("jit(").rstrip(")")
    seconds[name][kind] += taken
jax.monitoring.register_event_duration_secs_listener(hear)
atexit.register(lambda: print("PROGRAMS" + json.dumps(seconds), file=sys.stderr))
from fitmat.cli.main import main
main()
"""

KINDS = {
    "trace": "jaxpr_trace_duration",
    "lower": "jaxpr_to_mlir_module_duration",
    "compile or load": "backend_compile_duration",
}

LONG = 0.1
"""Seconds from which on an import is listed."""


def environment(cache: Path) -> dict[str, str]:
    """Without what the caller set for fitmat and JAX."""
    kept = {k: v for k, v in os.environ.items() if not k.startswith(("FITMAT_", "JAX_"))}
    return kept | {"XDG_CACHE_HOME": str(cache)}


def programs(file: Path, cache: Path, out: Path) -> list[list[str]]:
    """One run: a line for each program."""
    command = [sys.executable, "-c", WATCHED, "fit", str(file), "--out", str(out), "--force"]
    ended = subprocess.run(command, env=environment(cache), capture_output=True, text=True, check=False)
    found = re.search(r"^PROGRAMS(.*)$", ended.stderr, re.MULTILINE)
    if found is None:
        raise SystemExit(ended.stderr)
    rows, total = [], collections.Counter()
    for name, taken in json.loads(found.group(1)).items():
        if KINDS["compile or load"] in taken:
            rows.append([name, *(f"{taken.get(kind, 0.0):.3f}" for kind in KINDS.values())])
            total.update({kind: taken.get(kind, 0.0) for kind in KINDS.values()})
    return [*rows, [f"{len(rows)} programs", *(f"{total[kind]:.2f}" for kind in KINDS.values())]]


def imports(file: Path, cache: Path, out: Path) -> list[list[str]]:
    """Imports of a run that take long with all that they bring, the longest first; threads make them look longer."""
    command = [sys.executable, "-X", "importtime", "-m", "fitmat", "fit", str(file), "--out", str(out), "--force"]
    ended = subprocess.run(command, env=environment(cache), capture_output=True, text=True, check=False)
    found = re.findall(r"^import time:\s*(\d+) \|\s*(\d+) \|( *)(\S+)$", ended.stderr, re.MULTILINE)
    long = sorted(((int(every) / 1e6, name) for _, every, _, name in found if int(every) > 1e6 * LONG), reverse=True)
    return [[name, f"{seconds:.2f}"] for seconds, name in long]


def main() -> None:
    """Run twice, and list."""
    file = Path(sys.argv[1]) if len(sys.argv) > 1 else DATA
    print(machine.described(), "\n")
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        for title in ("first", "afterwards"):
            rows = programs(file, folder / "cache", folder / "report")
            machine.show(f"programs of a default run, {title}: seconds", ["", *KINDS], rows)
        machine.show("imports", ["", "seconds"], imports(file, folder / "cache", folder / "report"))


if __name__ == "__main__":
    main()
