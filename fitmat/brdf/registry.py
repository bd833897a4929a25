"""Model names: which lobes there are, and how a name such as `lambert+ggx-schlick` becomes a model.

Knows no formula; every lobe is described where it is defined.
"""

import dataclasses
from collections.abc import Callable
from typing import Any

import numpy as np
from jaxtyping import ArrayLike

from fitmat.brdf.base import AbstractBRDF, Sum
from fitmat.brdf.cook_torrance import CookTorrance
from fitmat.brdf.lambert import Lambert
from fitmat.brdf.phong import BlinnPhong, BlinnPhongExact, Phong
from fitmat.brdf.walter import Microfacet
from fitmat.errors import ModelError
from fitmat.fresnel import AbstractFresnel, Conductor, Dielectric, Schlick
from fitmat.microfacet import GGX, MASKINGS, AbstractDistribution, Beckmann
from fitmat.params import as_parameter, check_range


@dataclasses.dataclass(frozen=True)
class Lobe:
    """One name of the registry.

    Attributes:
        shape: The lobe's class; its docstring is the manual page.
        fresnel: Its Fresnel term, None for lobes that have none.
        distribution: Its distribution of normals where the class leaves that open.
    """

    shape: Callable[..., AbstractBRDF]
    fresnel: type[AbstractFresnel] | None = None
    distribution: type[AbstractDistribution] | None = None

    def defaults(self) -> dict[str, tuple[Any, Any]]:
        """Parameter name → (its `Param`, its default value)."""
        classes = [self.shape] + ([self.fresnel] if self.fresnel else [])
        fields = [field for cls in classes for field in dataclasses.fields(cls)]  # pyright: ignore[reportArgumentType]
        return {f.name: (f.metadata["param"], f.default) for f in fields if "param" in f.metadata}

    def per_channel(self, name: str) -> bool:
        """Whether `name` has one value per channel; ks is shared where the Fresnel level is per channel."""
        if name == "ks" and self.fresnel is not None:
            return not any(f.metadata["param"].per_channel for f in dataclasses.fields(self.fresnel))
        return self.defaults()[name][0].per_channel


LOBES: dict[str, Lobe] = {
    "lambert": Lobe(Lambert),
    "phong": Lobe(Phong),
    "blinn-phong": Lobe(BlinnPhong),
    "blinn-phong-exact": Lobe(BlinnPhongExact),
    **{"cook-torrance" + f.suffix: Lobe(CookTorrance, f) for f in (Dielectric, Schlick, Conductor)},
    **{"ggx" + f.suffix: Lobe(Microfacet, f, GGX) for f in (Dielectric, Schlick, Conductor)},
    **{"beckmann" + f.suffix: Lobe(Microfacet, f, Beckmann) for f in (Dielectric, Schlick, Conductor)},
}


def lobe_names(name: str) -> list[str]:
    """The lobes of a model name.

    Raises:
        ModelError: a lobe is unknown; the message lists the known ones.
    """
    parts = [part.strip().lower() for part in name.split("+")]
    for part in parts:
        if part not in LOBES:
            raise ModelError(f"model {name!r}: no lobe {part!r}; known lobes are {', '.join(LOBES)}.")
    if len(set(parts)) != len(parts):
        raise ModelError(f"model {name!r}: the same lobe twice cannot be told apart; use each once.")
    return parts


def model(name: str, *, masking: str | None = None, channels: int | None = None, **values: ArrayLike) -> AbstractBRDF:
    """Build a model from its name.

    Args:
        name: A lobe or a sum of lobes, "lambert+ggx"; `fitmat models` lists the lobes.
        masking: "correlated", "separable" or "v-cavity" for the microfacet lobes; None keeps each lobe's own.
        channels: Give per-channel parameters this many values; None keeps what is passed.
        **values: Parameters by name (a name that two lobes share needs a tuple-free sum); the rest take defaults.

    Returns:
        A frozen module; call it through `fitmat.evaluate`.

    Raises:
        ModelError: unknown lobe, parameter or masking, or a value out of range.

    Example:
        >>> import fitmat as fm
        >>> fm.model("lambert+ggx", kd=0.3, alpha=0.2, eta=1.5).name
        'lambert+ggx'
    """
    parts = lobe_names(name)
    known = {key for part in parts for key in LOBES[part].defaults()}
    for key in values:
        if key not in known:
            raise ModelError(f"model {name!r} has no parameter {key!r}; it has {', '.join(sorted(known))}.")
    if masking is not None and masking not in MASKINGS:
        raise ModelError(f"masking {masking!r}: expected one of {', '.join(MASKINGS)}.")
    if masking is not None and not any(LOBES[part].fresnel for part in parts):
        raise ModelError(f"model {name!r} has no masking to choose; leave out masking.")
    lobes = tuple(_lobe(LOBES[part], masking, channels, values) for part in parts)
    built = lobes[0] if len(lobes) == 1 else Sum(lobes)
    check_range(built)
    return built


def _lobe(lobe: Lobe, masking: str | None, channels: int | None, values: dict[str, ArrayLike]) -> AbstractBRDF:
    numbers = {}
    for key, (_, default) in lobe.defaults().items():
        value = as_parameter(values.get(key, default))
        if channels is not None and lobe.per_channel(key):
            if value.size not in (1, channels):
                raise ModelError(f"parameter {key} has {value.size} values: expected 1 or {channels}, one a channel.")
            value = np.broadcast_to(np.ravel(value), (channels,))
        elif channels is not None and value.size != 1:
            raise ModelError(f"parameter {key} has {value.size} values: expected 1, it is shared by all channels.")
        numbers[key] = value
    if lobe.fresnel is None:
        return lobe.shape(**numbers)
    own = {f.name for f in dataclasses.fields(lobe.fresnel)}
    static: dict[str, Any] = {} if masking is None else {"masking": masking}
    if lobe.distribution is not None:
        static["distribution"] = lobe.distribution()
    fresnel = lobe.fresnel(**{k: v for k, v in numbers.items() if k in own})
    return lobe.shape(fresnel=fresnel, **static, **{k: v for k, v in numbers.items() if k not in own})
