"""What is exported, executed: how far its values are from the model's own; writes the table of docs/exports.md.

`python benchmarks/renderers.py` remakes all of it, `python benchmarks/renderers.py TARGET …` the rows of some. Needs
Chromium, glslangValidator, Mitsuba, the wheels MaterialX and pyradiance, and Blender.
"""

import functools
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import jax
import numpy as np

import fitmat as fm
from fitmat.exports import mitsuba
from fitmat.exports.closest import Closest
from fitmat.exports.glsl import browser, shaders
from fitmat.exports.glsl.shaders import DESKTOP, Shader
from fitmat.exports.glsl.translation import translated
from fitmat.exports.material import Chosen
from fitmat.exports.targets import TARGETS
from fitmat.exports.verification import Difference, compared, directions, exact, run
from fitmat.models.base import AbstractBRDF, evaluate

sys.path.append(str(Path(__file__).parents[1] / "tests"))
from exports.test_glsl import NAMES, SHARP, own, sharp
from exports.test_mitsuba_export import SAME
from tables import replace_between, to_markdown

NARROWER = {"alpha": 0.001, "alpha_x": 0.001, "exponent": 1e5, "exponent_u": 1e5, "b": 1e-10, "roughness": 0.03}
"""Beyond what single precision is trusted with."""


def cells(found: Difference) -> list[str]:
    """Worst, mean and where."""
    place = f"{found.theta_i_deg:.1f}°, {found.theta_o_deg:.1f}°, {found.phi_deg:.0f}°"
    return [f"{found.largest:.1e}", f"{found.mean:.1e}", place]


def desktop() -> list[list[str]]:
    """One row: the same functions in the other version, compiled and not run."""
    compilers = {shaders.compiled(shaders.texts("m", (), Shader(translated(sharp(name)), DESKTOP))) for name in NAMES}
    if None in compilers:
        sys.exit("no glslangValidator: nothing is compiled, and the table stays as it is")
    return [["GLSL 3.30", f"all {len(NAMES)} above", "", "", "", "", f"compiled by {compilers.pop()}"]]


def mitsubas() -> list[list[str]]:
    """What Mitsuba holds as we do, and what it masks otherwise, at alpha 0.1."""
    other = {
        "another masking": fm.model("lambert+ggx", alpha=0.1),
        "another masking, rough": fm.model("ggx", alpha=0.5),
    }
    wi, wo = directions()
    rows = []
    for name, model in (SAME | other).items():
        values, executor = mitsuba.run(mitsuba.translated(model), wi, wo)
        found = compared(values[1], own(model, *exact(wi, wo)), wi, wo, executor, least=mitsuba.LEAST)
        rows.append(["Mitsuba 3", f"`{model.name}`, {name}", *cells(found), "", "yes"])
    return rows


COLOURED: dict[str, Any] = {"kd": np.array([0.3, 0.2, 0.1]), "ks": np.ones(3)}
METAL: dict[str, Any] = {"eta": np.array([0.2, 0.4, 1.4]), "kappa": np.array([3.9, 2.4, 1.6])}
APPROXIMATED = {
    "coloured": fm.model("lambert", kd=COLOURED["kd"]),
    "alpha 0.15": fm.model("lambert+ggx", alpha=0.15, **COLOURED),
    "alpha 0.1": fm.model("lambert+beckmann", alpha=0.1, **COLOURED),
    "gold, alpha 0.3": fm.model("ggx-conductor", alpha=0.3, **METAL),
    "exponent 50": fm.model("lambert+blinn-phong", kd=COLOURED["kd"], ks=np.full(3, 0.05), exponent=50.0),
}
"""What most targets hold as the closest."""

FORMULAS = {"gltf": "its formulas, no viewer", "usd": "its formulas, no viewer", "pbrt": "its formulas, not run"}
SAID = {"klems": "means over patches"}
FORMULAS |= dict.fromkeys(("unreal", "unity"), "its formulas, no engine")
CLOSEST = ("materialx", "openpbr", "gltf", "usd", "pbrt", "radiance", "klems", "blender", "unreal", "unity", "osl")
TABLE = Path(__file__).parents[1] / "docs" / "exports.md"
HEADINGS = ["target", "model", "worst", "mean", "worst at θ_i, θ_o, φ", "worst, narrower", "executed"]


def approximated(target: str) -> list[list[str]]:
    """Rows of a target that gets the closest material: its values, run there, beside the model's own."""
    rows = []
    for name, model in APPROXIMATED.items():
        what, made = Chosen(model), TARGETS[target]
        form = made.translate(what)
        found = by_formulas(model, form) if target == "pbrt" else made.difference(what, form)
        if found is None:
            sys.exit(f"{target} is not run here, see what is needed above; the table stays as it is")
        closest = made.facts(form).get("closest")
        said = f"ΔE2000 {closest['delta_e']:.2f}" if closest else SAID.get(target, "the same")
        executed = FORMULAS.get(target, "yes")
        rows.append([made.title, f"`{model.name}`, {name}: {said}", *cells(found), "", executed])
        print(*rows[-1], flush=True)
    return rows


def by_formulas(model: AbstractBRDF, form: Closest) -> Difference:
    """Of a target that nothing runs: what its formulas give."""
    wi, wo = directions()
    return compared(evaluate(form.model, *exact(wi, wo)), evaluate(model, *exact(wi, wo)), wi, wo, "")


def shaded() -> list[list[str]]:
    """Every lobe in GLSL, all in one browser."""
    program = browser.program()
    if program is None:
        sys.exit("no Chromium: nothing is executed, and the table stays as it is")
    models = [sharp(name, values) for values in (SHARP, SHARP | NARROWER) for name in NAMES]
    wi, wo = directions()
    values, executor = run([translated(model) for model in models], wi, wo, program)
    found = []
    for model, pixels in zip(models, values, strict=True):
        found.append(compared(pixels, own(model, *exact(wi, wo)), wi, wo, executor))
        print(model.name, *cells(found[-1]), flush=True)
    return [
        ["GLSL ES 3.00", f"`{name}`", *cells(first), cells(second)[0], "yes"]
        for name, first, second in zip(NAMES, found[: len(NAMES)], found[len(NAMES) :], strict=True)
    ]


ROWS = {"glsl": shaded, "glsl-330": desktop, "mitsuba": mitsubas}
ROWS |= {target: functools.partial(approximated, target) for target in CLOSEST}


def kept() -> dict[str, list[list[str]]]:
    """Rows that the table has, by target."""
    lines = TABLE.read_text(encoding="utf-8").partition("<!-- exports -->")[2].partition("<!-- /exports -->")[0]
    titles = {TARGETS[target].title: target for target in ROWS}
    found: dict[str, list[list[str]]] = {}
    for row in (line.split(" | ") for line in lines.splitlines() if line.startswith("| ")):
        if (target := titles.get(row[0].removeprefix("| "))) is not None:
            found.setdefault(target, []).append([row[0].removeprefix("| "), *row[1:-1], row[-1].removesuffix(" |")])
    return found


def main(targets: Sequence[str]) -> None:
    """Run what is asked for, and put its rows beside the others."""
    remade = kept() if targets else {}
    for target in targets or ROWS:
        remade[target] = ROWS[target]()
    rows = [row for target in ROWS for row in remade.get(target, [])]
    text = to_markdown(HEADINGS, rows) + f"\n\n{len(directions()[0])} pairs of directions."
    replace_between(TABLE, "exports", text)


if __name__ == "__main__":
    jax.config.update("jax_enable_x64", True)
    jax.config.update("jax_disable_most_optimizations", True)
    main(sys.argv[1:])
