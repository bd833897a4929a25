"""What is exported, executed: how far its values are from the model's own; writes the table of docs/exports.md.

`python benchmarks/renderers.py`; needs Chromium and Mitsuba.
"""

import sys
from pathlib import Path

import jax

import fitmat as fm
from fitmat.exports import browser, mitsuba
from fitmat.exports.translation import translated
from fitmat.exports.verification import Difference, compared, directions, exact, run
from fitmat.models.base import AbstractBRDF

sys.path.append(str(Path(__file__).parents[1] / "tests"))
from exports.test_glsl import NAMES, SHARP, own, sharp
from exports.test_mitsuba import SAME
from tables import replace_between, to_markdown

NARROWER = {"alpha": 0.001, "alpha_x": 0.001, "exponent": 1e5, "exponent_u": 1e5, "b": 1e-10, "roughness": 0.03}
"""Beyond what single precision is trusted with."""


def cells(found: Difference) -> list[str]:
    """Worst, mean and where."""
    place = f"{found.theta_i_deg:.1f}°, {found.theta_o_deg:.1f}°, {found.phi_deg:.0f}°"
    return [f"{found.largest:.1e}", f"{found.mean:.1e}", place]


def mitsubas() -> list[tuple[str, AbstractBRDF, Difference]]:
    """What Mitsuba holds as we do, and what it masks otherwise, at alpha 0.1."""
    other = {
        "another masking": fm.model("lambert+ggx", alpha=0.1),
        "another masking, rough": fm.model("ggx", alpha=0.5),
    }
    wi, wo = directions()
    rows = []
    for name, model in (SAME | other).items():
        values, executor = mitsuba.run(mitsuba.translated(model), wi, wo)
        rows.append(
            (name, model, compared(values[1], own(model, *exact(wi, wo)), wi, wo, executor, least=mitsuba.LEAST))
        )
    return rows


def main() -> None:
    """Run all shaders in one browser, and compare."""
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
    rows = [
        ["GLSL ES 3.00", f"`{name}`", *cells(first), cells(second)[0], "yes"]
        for name, first, second in zip(NAMES, found[: len(NAMES)], found[len(NAMES) :], strict=True)
    ]
    rows += [["Mitsuba 3", f"`{model.name}`, {name}", *cells(d), "", "yes"] for name, model, d in mitsubas()]
    headings = ["target", "model", "worst", "mean", "worst at θ_i, θ_o, φ", "worst, narrower", "executed"]
    text = to_markdown(headings, rows) + f"\n\n{len(wi)} pairs of directions, {executor}."
    replace_between(Path(__file__).parents[1] / "docs" / "exports.md", "exports", text)


if __name__ == "__main__":
    jax.config.update("jax_enable_x64", True)
    jax.config.update("jax_disable_most_optimizations", True)
    main()
