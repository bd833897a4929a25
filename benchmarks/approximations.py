"""Ten materials in glTF and OpenPBR: the closest material beside the one whose parameters are renamed, in ΔE2000.

Five are fitted (lambert+ggx) to measured-like materials of the shared data, five are models with known values. Renamed
means what is usual: base colour = kd, roughness = √α, the index or F0 as it is, the specular weight at most 1; a
metal's base colour is its F0. Both are rendered as lit spheres beside the material itself. The tables go between the
markers of approximations.md.

Run: python benchmarks/approximations.py; FITMAT_DATA names the folder of shared data.
"""

import tempfile
from pathlib import Path
from typing import Any

import jax
import numpy as np
from materials import reconstructions
from tables import replace_between, to_markdown

import fitmat as fm
from fitmat.exports import gltf, metallic_roughness
from fitmat.exports.closest import Closest, channels, judged
from fitmat.exports.material import Chosen, chosen
from fitmat.exports.materialx import document
from fitmat.exports.materialx.models import template
from fitmat.models.base import AbstractBRDF
from fitmat.models.conversion import alpha_from_exponent
from fitmat.models.parameters import entries, vector, with_vector
from fitmat.models.terms.fresnel import Conductor

PAGE = Path(__file__).with_name("approximations.md")

MEASURED = ("specular-blue-phenolic", "green-plastic", "pvc", "aluminium", "gold-metallic-paint2")
NOISE = 0.02

GREYISH = np.array([0.3, 0.2, 0.1])
GOLD: dict[str, Any] = {"eta": np.array([0.2, 0.4, 1.4]), "kappa": np.array([3.9, 2.4, 1.6])}
KNOWN: dict[str, AbstractBRDF] = {
    "satin plastic": fm.model("lambert+ggx", kd=GREYISH, ks=np.ones(3), alpha=0.15),
    "glossy plastic, Beckmann": fm.model("lambert+beckmann", kd=GREYISH, ks=np.ones(3), alpha=0.05),
    "rough plastic of high index": fm.model("lambert+ggx", kd=GREYISH, ks=np.ones(3), alpha=0.4, eta=2.0),
    "gold": fm.model("ggx-conductor", alpha=0.3, **GOLD),
    "painted wall, Blinn–Phong": fm.model("lambert+blinn-phong", kd=GREYISH, ks=np.full(3, 0.05), exponent=20.0),
}


def fitted(name: str) -> AbstractBRDF:
    """lambert+ggx fitted to in-plane curves of a material with noise."""
    materials = reconstructions()
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / f"{name}.csv"
        materials.write_csv(name, path, NOISE, 1)
        return fm.fit(fm.read(path), "lambert+ggx").model


def looks(model: AbstractBRDF) -> dict[str, Any]:
    """What a user would read from a model: kd, ks, alpha, F0, and whether it is a metal."""
    every = {e.name: np.asarray(vector(model))[e.place] for e in entries(model)}
    lobes = getattr(model, "lobes", (model,))
    fresnel = next((vars(lobe)["fresnel"] for lobe in lobes if "fresnel" in vars(lobe)), None)
    alpha = every["alpha"] if "alpha" in every else alpha_from_exponent(every["exponent"])
    f0 = np.asarray(fresnel.normal_reflectance()) if fresnel is not None else np.array(0.04)
    ks = float(np.clip(np.mean(every.get("ks", 1.0)), 0.0, 1.0))
    return {
        "kd": every.get("kd"),
        "ks": ks,
        "alpha": float(alpha[0]),
        "f0": f0,
        "metal": isinstance(fresnel, Conductor),
    }


def renamed(into: AbstractBRDF, told: dict[str, Any]) -> AbstractBRDF:
    """A target's model with the parameters that are called alike."""
    color = told["f0"] if told["metal"] or told["kd"] is None else told["kd"]
    root = np.sqrt(np.mean(told["f0"]))
    named = {
        "base_color": color, "f0": told["f0"], "specular": told["ks"], "metallic": float(told["metal"]),
        "roughness": told["alpha"] ** 0.5, "specular_roughness": told["alpha"] ** 0.5,
        "base_metalness": float(told["metal"]), "base_diffuse_roughness": 0.0,
        "specular_color": 1.0 if told["metal"] else told["ks"], "specular_ior": (1.0 + root) / (1.0 - root),
    }  # fmt: skip
    values = np.array(vector(into), float)
    for entry in entries(into):
        values[entry.place] = np.clip(named[entry.name], entry.param.lower, entry.param.upper)
    return with_vector(into, values)


def both(what: Chosen) -> dict[str, tuple[Closest, Closest]]:
    """Target → the closest, and the renamed one."""
    count, told = channels(what), looks(what.model)
    templates = {
        "glTF": metallic_roughness.template(what.model, count)[0],
        "OpenPBR": template(count)[0],
    }
    found = {"glTF": gltf.translated(what), "OpenPBR": document.open_surface(what).found}
    result = {}
    for target, into in templates.items():
        near = found[target]
        assert near is not None
        result[target] = near, judged(what, renamed(into, told))
    return result


def main() -> None:
    """Compare each material, print as it goes, remake the page."""
    jax.config.update("jax_enable_x64", True)
    models = {f"{name} (fitted)": fitted(name) for name in MEASURED} | KNOWN
    rows, factors = [], {"glTF": [], "OpenPBR": []}
    for name, model in models.items():
        for target, (near, other) in both(chosen(model)).items():
            factor = other.delta_e / max(near.delta_e, 1e-3)
            factors[target].append(factor)
            numbers = [near.delta_e, other.delta_e, factor, near.delta_e_worst, other.delta_e_worst]
            gaps = [f"{100 * one.relative:.0f} %" for one in (near, other)]
            rows.append([name, f"`{model.name}`", target, *(f"{x:.2f}" for x in numbers), *gaps])
            print(*rows[-1], sep=" | ", flush=True)
    headings = [
        "material", "model", "target", "ΔE2000 closest", "renamed", "factor", "worst twentieth, closest", "renamed",
        "distance, closest", "renamed",
    ]  # fmt: skip
    said = [
        f"{target}: ΔE2000 of the renamed: {np.exp(np.mean(np.log(found))):.1f} times the closest's in "
        f"the geometric mean of {len(found)} materials, from {min(found):.1f} to {max(found):.1f} times."
        for target, found in factors.items()
    ]
    replace_between(PAGE, "approximations", "\n".join(said) + "\n\n" + to_markdown(headings, rows))


if __name__ == "__main__":
    main()
