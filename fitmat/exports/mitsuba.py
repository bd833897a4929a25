"""Mitsuba 3: a material as the dictionary and the XML that it loads, and its own values of them.

Holds what its plugins can: `diffuse`, `roughconductor`, and one of each; nothing is fitted to be like them.
"""

import importlib.util
import json
from collections.abc import Mapping, Sequence
from typing import Any
from xml.sax.saxutils import quoteattr

import numpy as np
from jaxtyping import Float

from fitmat.errors import ModelError
from fitmat.exports.verification import Difference, compared, directions, exact
from fitmat.models.around.shown import surface
from fitmat.models.base import AbstractBRDF, Sum, evaluate
from fitmat.models.lobes.lambert import Lambert
from fitmat.models.lobes.microfacet import Microfacet
from fitmat.models.lobes.walter import Walter
from fitmat.models.terms.distributions import Anisotropic, Beckmann
from fitmat.models.terms.fresnel import Conductor, Dielectric

VARIANT = "scalar_rgb"
"""In which it is run: one direction at a time, single precision."""

LEAST = 1e-14
"""Values in sr⁻¹ below this count as this: Mitsuba cuts a distribution of normals where D c_h is below 1e-20."""

HALF = 0.5
"""Weight of a specular lobe beside a diffuse one, where the diffuse one is not too bright for it."""

ROUNDING = 1e-9
"""By which a quotient may exceed 1."""

Plugin = dict[str, Any]


def translated(model: AbstractBRDF) -> Plugin:
    """The dictionary that `mitsuba.load_dict` takes.

    A diffuse and a specular lobe become a `blendbsdf`, each divided by its weight. Mitsuba's masking is separable, and
    Beckmann's G1 Walter's: where the model has another, the values differ, which is measured and no parameter moved.

    Args:
        model: Of one or three channels.

    Raises:
        ModelError: Mitsuba has no plugin for a lobe, or for so many.
    """
    material = surface(model)
    lobes = material.lobes if isinstance(material, Sum) else (material,)
    diffuse = [lobe for lobe in lobes if isinstance(lobe, Lambert)]
    specular = [lobe for lobe in lobes if isinstance(lobe, Microfacet | Walter)]
    others = [lobe for lobe in lobes if lobe not in (*diffuse, *specular)]
    if others or len(diffuse) > 1 or len(specular) > 1:
        what = others[0].name if others else "two lobes of a kind"
        can = "lambert, and ggx or beckmann with the dielectric or the conductor term, alone or one of each"
        raise ModelError(f"{material.name}: Mitsuba has no plugin for {what}, expected {can}.")
    if not specular:
        return _diffuse(diffuse[0], 1.0)
    if not diffuse:
        return _specular(specular[0], 1.0)
    weight = _weight(diffuse[0].kd, specular[0].ks)
    parts = {"diffuse": _diffuse(diffuse[0], 1.0 - weight), "specular": _specular(specular[0], weight)}
    return {"type": "blendbsdf", "weight": weight, **parts}


def notes(model: AbstractBRDF) -> list[str]:
    """In which conventions Mitsuba differs from the model, as sentences; no parameter is moved for them."""
    material, found = surface(model), []
    for lobe in material.lobes if isinstance(material, Sum) else (material,):
        if isinstance(lobe, Microfacet) and lobe.masking != "separable":
            found.append(
                f"Mitsuba masks light and eye separately, {lobe.name} does not ({lobe.masking}): no parameter was "
                "moved for that. Fit with --masking separable for Mitsuba."
            )
        if isinstance(lobe, Microfacet) and isinstance(lobe.distribution, Beckmann):
            found.append("Mitsuba's masking of Beckmann's normals is Walter's rational function, off by up to 0.35 %.")
    return found


def _weight(kd: Any, ks: Any) -> float:
    """Of the specular lobe: what is divided by a weight must stay within 1 where it is coloured, not where grey."""
    least, most = _brightest(ks), 1.0 - _brightest(kd)
    if least > most + ROUNDING:
        got = f"kd and ks are coloured and up to {1.0 - most:.3g} and {least:.3g}"
        raise ModelError(
            f"{got}, expected a sum within 1: Mitsuba's colours end there. Fit with one ks, as --fix ks=1."
        )
    return float(np.clip(HALF, max(least, 1e-3), max(most, 1e-3)))


def _brightest(value: Any) -> float:
    """The largest of three different values; 0 where all are the same."""
    values = np.ravel(np.asarray(value))
    return float(values.max()) if np.ptp(values) > 0.0 else 0.0


def _diffuse(lobe: Lambert, weight: float) -> Plugin:
    return {"type": "diffuse", "reflectance": _reflectance("kd", np.asarray(lobe.kd) / weight)}


def _specular(lobe: Microfacet | Walter, weight: float) -> Plugin:
    fresnel, rough = lobe.fresnel, lobe.roughness
    if isinstance(fresnel, Dielectric):
        eta, kappa = fresnel.eta, np.zeros(())
    elif isinstance(fresnel, Conductor):
        eta, kappa = fresnel.eta, fresnel.kappa
    else:
        raise ModelError(
            f"{lobe.name}: Mitsuba's rough surfaces have a refractive index, expected the dielectric or the conductor "
            f"term, as {lobe.name.removesuffix(fresnel.suffix)}-conductor."
        )
    slopes = [float(slope) for slope in rough.slopes]
    if isinstance(rough, Anisotropic):
        turns = float(rough.rotation) / 90.0
        if turns != round(turns):
            raise ModelError(f"{lobe.name}: a Mitsuba plugin turns no tangent, expected a rotation of 0 or 90 degrees.")
        slopes = slopes[::-1] if round(turns) % 2 else slopes
    alphas = {"alpha": slopes[0]} if slopes[0] == slopes[1] else {"alpha_u": slopes[0], "alpha_v": slopes[1]}
    return {
        "type": "roughconductor",
        "distribution": lobe.distribution.label,
        **alphas,
        "eta": _spectrum(eta),
        "k": _spectrum(kappa),
        "specular_reflectance": _reflectance("ks", np.asarray(lobe.ks) / weight),
    }


def _reflectance(name: str, value: Any) -> Plugin:
    """A spectrum that a plugin checks: coloured ones end at 1."""
    if _brightest(value) > 1.0 + ROUNDING:
        raise ModelError(f"{name} is coloured and up to {_brightest(value):.3g}, expected at most 1 in Mitsuba.")
    found = _spectrum(value)
    return found | {"value": [min(v, 1.0) for v in found["value"]]} if found["type"] == "rgb" else found


def _spectrum(value: Any) -> Plugin:
    values = [float(v) for v in np.ravel(np.asarray(value))]
    if len(values) not in (1, 3):
        raise ModelError(f"there are {len(values)} channels, expected 1 or 3: Mitsuba's colours are three.")
    return {"type": "uniform", "value": values[0]} if len(set(values)) == 1 else {"type": "rgb", "value": values}


def texts(name: str, header: Sequence[str], plugin: Plugin) -> dict[str, str]:
    """File names → texts: the dictionary in Python, the XML, which a scene includes and refers to by `material`."""
    comment = "\n".join(line.replace("--", "-\\u002d") for line in header)
    code = f"bsdf = {json.dumps(plugin, indent=4)}\n"
    return {
        f"{name}.py": "".join(f"# {line}\n" for line in header) + f"\n{code}",
        f"{name}.xml": f'<!--\n{comment}\n-->\n<scene version="3.0.0">\n{xml(plugin, 1, name="material")}</scene>\n',
    }


def xml(plugin: Plugin, depth: int = 0, name: str = "") -> str:
    """A BSDF's element with what is in it."""
    pad = "    " * depth
    inner = "".join(_element(key, value, depth + 1) for key, value in plugin.items() if key != "type")
    said = f" id={quoteattr(name)}" if name else ""
    version = "" if depth else ' version="3.0.0"'
    return f"{pad}<bsdf type={quoteattr(plugin['type'])}{said}{version}>\n{inner}{pad}</bsdf>\n"


def _element(key: str, value: Any, depth: int) -> str:
    pad, called = "    " * depth, f"name={quoteattr(key)}"
    if isinstance(value, Mapping) and value["type"] == "rgb":
        return f'{pad}<rgb {called} value="{", ".join(map(repr, value["value"]))}"/>\n'
    if isinstance(value, Mapping) and value["type"] == "uniform":
        return f'{pad}<spectrum {called} value="{value["value"]!r}"/>\n'
    if isinstance(value, Mapping):
        return xml(dict(value), depth)
    kind = "string" if isinstance(value, str) else "float"
    return f"{pad}<{kind} {called} value={quoteattr(str(value))}/>\n"


def difference(model: AbstractBRDF, plugin: Plugin) -> Difference | None:
    """How far Mitsuba's values are from the model's, of the dictionary and of the XML; None without Mitsuba."""
    if importlib.util.find_spec("mitsuba") is None:
        return None
    wi, wo = directions()
    values, executor = run(plugin, wi, wo)
    own = evaluate(model, *exact(wi, wo))
    found = [compared(one, own, wi, wo, executor, least=LEAST) for one in values]
    return max(found, key=lambda one: one.largest)


def run(
    plugin: Plugin, wi: Float[np.ndarray, "n 3"], wo: Float[np.ndarray, "n 3"]
) -> tuple[list[Float[np.ndarray, "n 3"]], str]:
    """Values of the dictionary and of the XML at pairs of directions, and what ran them; needs Mitsuba.

    The variant that is set before is set afterwards.
    """
    import mitsuba

    before = mitsuba.variant()
    mitsuba.set_variant(VARIANT)
    try:
        loaded = mitsuba.load_dict(plugin), mitsuba.load_string(xml(plugin))
        return [_values(mitsuba, bsdf, wi, wo) for bsdf in loaded], f"Mitsuba {mitsuba.__version__}"
    finally:
        if before is not None:
            mitsuba.set_variant(before)


def _values(mitsuba: Any, bsdf: Any, wi: np.ndarray, wo: np.ndarray) -> Float[np.ndarray, "n 3"]:
    """BRDF values: what Mitsuba has includes cosθ_o."""
    context, place = mitsuba.BSDFContext(), mitsuba.SurfaceInteraction3f()
    place.sh_frame = mitsuba.Frame3f([0.0, 0.0, 1.0])
    values = []
    for light, eye in zip(wi.tolist(), wo.tolist(), strict=True):
        place.wi = mitsuba.Vector3f(light)
        values.append(list(bsdf.eval(context, place, mitsuba.Vector3f(eye))))
    return np.array(values) / np.maximum(wo[:, 2:], 1e-7)
