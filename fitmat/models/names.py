"""Names: parameters by what users of renderers and of papers call them, as a model's own, with the convention said.

It converts nothing itself (`conversion`, `terms.fresnel`); what could mean two things is refused.
"""

import warnings
from collections.abc import Callable, Collection, Mapping
from typing import Any, NamedTuple

import numpy as np
from jaxtyping import ArrayLike, Float

from fitmat import arguments
from fitmat.errors import ModelError, ReadAs
from fitmat.models.conversion import (
    alpha_from_glossiness,
    alpha_from_roughness,
    diffuse_from_metallic,
    f0_from_metallic,
    f0_from_specular,
)
from fitmat.models.terms.fresnel import eta_from_f0, f0_from_eta

Numbers = Float[np.ndarray, "..."]


class Reading(NamedTuple):
    """One way in which a name may be meant.

    Attributes:
        own: The model's parameter.
        convert: Value → the parameter's.
        words: The convention, after "read as".
        without: Parameters beside which the name would say too little.
    """

    own: str
    convert: Callable[[Any], Any]
    words: str
    without: tuple[str, ...] = ()


def _same(value: Any) -> Any:
    return value


METAL = ("kappa",)
"""Beside it one number tells no index."""

READINGS: dict[str, tuple[Reading, ...]] = {
    "roughness": (Reading("alpha", alpha_from_roughness, "√α"), Reading("r", _same, "the roughness of EON")),
    "glossiness": (Reading("alpha", alpha_from_glossiness, "1 − √α"),),
    "F0": (
        Reading("f0", _same, "the reflectance at normal incidence"),
        Reading("eta", eta_from_f0, "((η−1)/(η+1))²", METAL),
    ),
    "ior": (Reading("eta", _same, "η", METAL), Reading("f0", f0_from_eta, "η with F0 = ((η−1)/(η+1))²")),
    "m": (Reading("alpha", _same, "the rms slope of Beckmann's normals, which is α"),),
    "specular": (
        Reading("f0", f0_from_specular, "F0/0.08"),
        Reading("eta", lambda s: eta_from_f0(f0_from_specular(s)), "F0/0.08, F0 = ((η−1)/(η+1))²", METAL),
        Reading("ks", _same, "the weight of the highlight"),
    ),
    "shininess": (Reading("exponent", _same, "the exponent"),),
}
READINGS["f0"] = READINGS["F0"]
"""Name → the ways in which it may be meant; "specular" is the weight only where a model has no Fresnel level."""

RANGES = {
    **dict.fromkeys(("roughness", "glossiness", "specular", "metallic", "base_color"), (0.0, 1.0)),
    **dict.fromkeys(("F0", "f0"), (0.0, 0.999)),
    **dict.fromkeys(("ior",), (1.0, 50.0)),
}
"""What a name may hold."""

SLOPES = ("beckmann", "cook-torrance", "ward")
"""Lobes whose normals have the rms slope m; GGX has none."""


def own(name: str, known: Collection[str], given: Mapping[str, ArrayLike]) -> dict[str, Any]:
    """Parameters by a model's own names; what is read as another is warned of with `ReadAs`.

    Args:
        name: The model's, for messages.
        known: Its parameters' names, with and without their lobe, as `ggx.alpha`.
        given: Values by any name; those that are no names of anything stay as they are.

    Raises:
        ModelError: a name could mean two parameters, says too little, or says what another says as well; or a value
            is out of its range.

    Example:
        >>> import warnings
        >>> with warnings.catch_warnings(record=True) as said:
        ...     warnings.simplefilter("always")
        ...     found = own("ggx", {"ks", "alpha", "eta"}, {"roughness": 0.4})
        >>> round(float(found["alpha"]), 4), str(said[0].message)
        (0.16, 'roughness=0.4 read as √α: alpha = 0.16.')
    """
    found: dict[str, Any] = {key: value for key, value in given.items() if key in known}
    said = {key: key for key in found}
    for key, value in _metallic(name, known, given).items():
        _put(found, said, key, value, "metallic")
    for key, value in given.items():
        lobe, dot, word = key.rpartition(".")
        if key in found or word in ("metallic", "base_color"):
            if key not in found and "metallic" not in given:
                found[key] = value
            continue
        reading = _reading(name, known, key, (lobe + dot, word)) if word in READINGS else None
        if reading is None:
            found[key] = value
            continue
        numbers = _numbers(key, word, value)
        target = lobe + dot + reading.own
        result = np.asarray(reading.convert(numbers))
        _put(found, said, target, result, key)
        _say(f"{key}={_text(numbers)} read as {reading.words}: {target} = {_text(result)}.")
    return found


def _put(found: dict[str, Any], said: dict[str, str], key: str, value: Any, by: str) -> None:
    """Enter a parameter that nothing else has said."""
    if key in said:
        raise ModelError(f"{said[key]} and {by} both say {key}, expected one of them. Leave one out.")
    found[key], said[key] = value, by


def _reading(name: str, known: Collection[str], key: str, parts: tuple[str, str]) -> Reading | None:
    """How a name is meant in a model; None where the model has nothing of the kind."""
    prefix, word = parts
    ways = [way for way in READINGS[word] if prefix + way.own in known]
    if word == "specular" and len(ways) > 1:
        ways = [way for way in ways if way.own != "ks"]
    if word == "m" and ways and not any(part in (prefix or name) for part in SLOPES):
        raise ModelError(
            f"{key} is the rms slope of Beckmann's normals, which {name} does not have; expected alpha, its slope "
            "parameter. Give alpha."
        )
    if len(ways) > 1:
        could = " or ".join(prefix + way.own for way in ways)
        raise ModelError(f"{key} could be {could} of {name}, expected one of these names.")
    if ways and (beside := [other for other in ways[0].without if prefix + other in known]):
        raise ModelError(
            f"{key} alone does not tell {ways[0].own} and {beside[0]} of {name}, expected both. Give {ways[0].own} and "
            f"{beside[0]}, or take the lobe with -schlick."
        )
    return ways[0] if ways else None


def _metallic(name: str, known: Collection[str], given: Mapping[str, ArrayLike]) -> dict[str, Any]:
    """kd and F0 of a base colour and how metallic it is, as glTF has them; {} where none is given."""
    if "metallic" not in given or "metallic" in known:
        return {}
    if "base_color" not in given or not {"kd", "f0"} <= set(known):
        got = "without base_color" if "base_color" not in given else f"with {name}, which has no kd and f0"
        raise ModelError(
            f"metallic {got}, expected both names with a model of kd and f0, as lambert+ggx-schlick. Give kd and f0."
        )
    metal, color = (_numbers(key, key, given[key]) for key in ("metallic", "base_color"))
    kd, f0 = diffuse_from_metallic(color, metal), f0_from_metallic(color, metal)
    both = f"kd = {_text(kd)}, f0 = {_text(f0)}"
    _say(f"metallic={_text(metal)}, base_color={_text(color)} read as glTF's: {both}.")
    return {"kd": kd, "f0": f0}


def _numbers(key: str, word: str, value: ArrayLike) -> Numbers:
    low, high = RANGES.get(word, (-np.inf, np.inf))
    return arguments.numbers(key, value, low, high)


def _text(value: Any) -> str:
    return ",".join(f"{x:.6g}" for x in np.ravel(np.asarray(value, float)))


def _say(sentence: str) -> None:
    warnings.warn(sentence, ReadAs, stacklevel=4)
