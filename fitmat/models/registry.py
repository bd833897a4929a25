"""Model names: which lobes there are, and how a name such as `varnish-over-lambert+ggx-schlick` becomes a model.

Knows no formula; every lobe is described where it is defined.
"""

import dataclasses
import difflib
from collections.abc import Callable, Mapping
from typing import Any, Literal, get_args

import equinox as eqx
from jaxtyping import ArrayLike

from fitmat import arguments
from fitmat.errors import ModelError
from fitmat.models import names
from fitmat.models.around.coat import RoughCoat, SmoothCoat
from fitmat.models.around.plastic import Plastic
from fitmat.models.around.tilt import Tilted
from fitmat.models.around.varnish import Varnish
from fitmat.models.base import AbstractBRDF, Sum
from fitmat.models.estimated import Estimator, Walked, unfitted
from fitmat.models.lobes.abg import ABg
from fitmat.models.lobes.ashikhmin_shirley import AshikhminShirley, OneExponent, TwoExponents
from fitmat.models.lobes.cook_torrance import CookTorrance
from fitmat.models.lobes.disney_2012 import Disney2012
from fitmat.models.lobes.disney_2015 import Disney2015
from fitmat.models.lobes.disney_terms import Clearcoat, Perceptual, Sheen
from fitmat.models.lobes.kulla_conty import KullaConty
from fitmat.models.lobes.lambert import Lambert
from fitmat.models.lobes.microfacet import Microfacet
from fitmat.models.lobes.oren_nayar import EnergyPreservingOrenNayar, OrenNayar, OrenNayarFull
from fitmat.models.lobes.phong import BlinnPhong, BlinnPhongExact, Phong
from fitmat.models.lobes.turquin import Turquin
from fitmat.models.lobes.walter import Walter
from fitmat.models.lobes.ward import Ward, WardBounded
from fitmat.models.parameters import Param, check_range, of_size
from fitmat.models.terms.belcour import Belcour
from fitmat.models.terms.distributions import GGX, MASKINGS, Anisotropic, Beckmann, BeckmannRational, Isotropic
from fitmat.models.terms.film import Film, placed
from fitmat.models.terms.fresnel import F82, Conductor, Dielectric, Schlick

OVER = "-over-"
"""Between a coat, or a tilted mount, and what lies below it."""

FRESNELS = (Dielectric, Schlick, F82, Conductor, Belcour, Film)
"""Fresnel terms that any microfacet lobe can carry, in the order of their suffixes in `fitmat models`."""

LobeKind = Literal["diffuse", "empirical", "microfacet", "cover"]


@dataclasses.dataclass(frozen=True)
class Lobe:
    """One name of the registry.

    Attributes:
        shape: The lobe's class; its docstring is the manual page.
        kind: "diffuse", "empirical", "microfacet" (with a Fresnel term), or "cover" (stands over a base).
        parts: Field of the class → the module it is made of: roughness, Fresnel term, distribution.
    """

    shape: Callable[..., AbstractBRDF]
    kind: LobeKind
    parts: Mapping[str, type[eqx.Module]] = dataclasses.field(default_factory=dict)

    def defaults(self) -> dict[str, tuple[Param, float]]:
        """Parameter name → (its `Param`, its default value), in the order of the model's vector."""
        found = {}
        for field in _fields(self.shape):
            inner = _fields(self.parts[field.name]) if field.name in self.parts else (field,)
            found |= {f.name: (f.metadata["param"], f.default) for f in inner if "param" in f.metadata}
        return found

    def per_channel(self, name: str) -> bool:
        """Whether `name` has one value per channel; ks is shared where the Fresnel level is per channel."""
        if name == "ks":
            fresnel = _fields(self.parts["fresnel"]) if "fresnel" in self.parts else ()
            return not any(f.metadata["param"].per_channel for f in fresnel)
        return self.defaults()[name][0].per_channel

    def fresnel_suffix(self, name: str) -> str:
        """What in a lobe's name says its Fresnel term; "" for the default and where the lobe has no choice."""
        suffix = getattr(self.parts.get("fresnel"), "suffix", "")
        return suffix if name.endswith(suffix) else ""

    @property
    def breaks(self) -> Mapping[str, str]:
        """Law → how the lobe breaks it; see `AbstractBRDF.breaks`."""
        return getattr(self.shape, "breaks", {})

    @property
    def has_masking(self) -> bool:
        """Whether its shadowing can be chosen."""
        return any(f.name == "masking" for part in (self.shape, *self.parts.values()) for f in _fields(part))


def _fields(cls: Any) -> tuple[dataclasses.Field, ...]:
    return dataclasses.fields(cls)


def _microfacet() -> dict[str, Lobe]:
    return {
        normals.label + rough.suffix + fresnel.suffix: Lobe(
            Microfacet, "microfacet", {"roughness": rough, "fresnel": fresnel, "distribution": normals}
        )
        for normals in (GGX, Beckmann)
        for rough in (Isotropic, Anisotropic)
        for fresnel in FRESNELS
    }


def _compensated(shape: type[KullaConty | Turquin], suffix: str, *distributions: Any) -> dict[str, Lobe]:
    return {
        normals.label + suffix + fresnel.suffix: Lobe(
            shape, "microfacet", {"roughness": Isotropic, "fresnel": fresnel, "distribution": normals}
        )
        for normals in distributions
        for fresnel in FRESNELS
    }


def _walter(distribution: type[eqx.Module]) -> Lobe:
    return Lobe(Walter, "microfacet", {"roughness": Isotropic, "fresnel": Dielectric, "distribution": distribution})


_DISNEY = {"shape": Perceptual, "fabric": Sheen, "coat": Clearcoat}

LOBES: dict[str, Lobe] = {
    "lambert": Lobe(Lambert, "diffuse"),
    "oren-nayar": Lobe(OrenNayar, "diffuse"),
    "oren-nayar-full": Lobe(OrenNayarFull, "diffuse"),
    "eon": Lobe(EnergyPreservingOrenNayar, "diffuse"),
    "phong": Lobe(Phong, "empirical"),
    "blinn-phong": Lobe(BlinnPhong, "empirical"),
    "blinn-phong-exact": Lobe(BlinnPhongExact, "empirical"),
    **{"ward" + r.suffix: Lobe(Ward, "empirical", {"roughness": r}) for r in (Isotropic, Anisotropic)},
    **{"ward-gmd" + r.suffix: Lobe(WardBounded, "empirical", {"roughness": r}) for r in (Isotropic, Anisotropic)},
    **{
        "ashikhmin-shirley" + e.suffix: Lobe(AshikhminShirley, "empirical", {"exponents": e, "fresnel": Schlick})
        for e in (OneExponent, TwoExponents)
    },
    "abg": Lobe(ABg, "empirical"),
    **{
        "cook-torrance" + f.suffix: Lobe(CookTorrance, "microfacet", {"roughness": Isotropic, "fresnel": f})
        for f in FRESNELS
    },
    "walter-ggx": _walter(GGX),
    "walter-beckmann": _walter(BeckmannRational),
    **_microfacet(),
    **_compensated(KullaConty, "-kc", GGX, Beckmann),
    **_compensated(Turquin, "-turquin", GGX),
    "plastic": Lobe(Plastic, "microfacet"),
    "disney-2012": Lobe(Disney2012, "microfacet", _DISNEY),
    "disney-2015": Lobe(Disney2015, "microfacet", _DISNEY),
    "varnish": Lobe(Varnish, "cover", {"coat": SmoothCoat}),
    "rough-varnish": Lobe(Varnish, "cover", {"coat": RoughCoat}),
    "tilt": Lobe(Tilted, "cover"),
}

WALKS: dict[str, tuple[str, Estimator]] = {
    f"{normals.label}-{estimator}{fresnel.suffix}": (normals.label + fresnel.suffix, estimator)
    for normals in (GGX, Beckmann)
    for estimator in get_args(Estimator)
    for fresnel in FRESNELS
}
"""Names of multiple scattering without a formula → the lobe of its single scattering, and who estimates it."""


def lobe_names(name: str) -> list[str]:
    """The lobes of a model name, covers first.

    Raises:
        ModelError: a lobe is unknown; the message names close ones.
    """
    covers, base = _parsed(name)
    return covers + base


def normalised(name: str) -> str:
    """The name as a model calls itself: lower case, no spaces.

    Raises:
        ModelError: as `lobe_names`.
    """
    covers, base = _parsed(name)
    return OVER.join([*covers, "+".join(base)])


def _parsed(name: str) -> tuple[list[str], list[str]]:
    """Covers, outermost first, and the lobes of the base."""
    covers, parts = _split(name)
    known = {kind: [n for n, lobe in LOBES.items() if (lobe.kind == "cover") is kind] for kind in (True, False)}
    for part in covers + parts:
        if part in WALKS:
            raise ModelError(unfitted("".join(name.split()).lower()))
        if part not in LOBES:
            close = difflib.get_close_matches(part, [*LOBES, *WALKS]) or ["lambert", "phong", "ggx"]
            raise ModelError(f"model {name!r}: no lobe {part!r}; try {', '.join(close)}; 'fitmat models' lists all.")
    for part in covers:
        if part not in known[True]:
            raise ModelError(f"model {name!r}: {part} cannot stand over a base; {', '.join(known[True])} can.")
    for part in parts:
        if part not in known[False]:
            raise ModelError(f"model {name!r}: {part} needs a base, for example {part}{OVER}lambert.")
    if len(set(covers + parts)) != len(covers + parts):
        raise ModelError(f"model {name!r}: the same lobe twice cannot be told apart; use each once.")
    return covers, parts


def _split(name: str) -> tuple[list[str], list[str]]:
    """Covers and lobes as they are written."""
    arguments.kind("name of a model", name, str)
    *covers, base = "".join(name.split()).lower().split(OVER)
    return covers, base.split("+")


def _walked(name: str, **given: Any) -> Walked:
    """A model of which one lobe is estimated."""
    covers, parts = _split(name)
    walks = [part for part in parts if part in WALKS]
    single, estimator = WALKS[walks[0]]
    if covers or len(walks) != 1 or single in parts:
        can = f"expected one of {', '.join(walks)}, alone or in a sum without {single}, below no cover"
        raise ModelError(f"model {name!r}: {can}; {single} is its first collision.")
    names = "+".join([single, *(part for part in parts if part not in WALKS)])
    built = model(names, **{key.replace(f"{walks[0]}.", f"{single}."): value for key, value in given.items()})
    lobe, *rest = built.lobes if isinstance(built, Sum) else (built,)
    assert isinstance(lobe, Microfacet)
    return Walked(lobe, Sum(tuple(rest)) if rest else None, "+".join(parts), estimator)


def model(
    name: str,
    *,
    masking: str | None = None,
    channels: int | None = None,
    wavelengths: ArrayLike | None = None,
    **values: ArrayLike,
) -> AbstractBRDF:
    """Build a model from its name.

    Args:
        name: A lobe or a sum of lobes, "lambert+ggx", under a coat, "varnish-over-lambert+ggx", or on a sample that
            may be tilted, "tilt-over-lambert+ggx"; `fitmat models` lists the lobes. One may be of `WALKS`.
        masking: "correlated", "separable" or "v-cavity" for the microfacet lobes; None keeps each lobe's own.
        channels: Give per-channel parameters this many values; None keeps what is passed.
        wavelengths: Of each channel in nm, for lobes with a thin film, as `ggx-film`; None is 550 nm, of one channel.
        **values: Parameters by name, also as others call them (`names.READINGS`); the rest take defaults. A name that
            two lobes share means both, or one of them as `**{"ggx.ks": 0.5}`.

    Returns:
        A frozen module; call it through `fitmat.evaluate`.

    Raises:
        ModelError: unknown lobe, parameter or masking, a value out of range, or wavelengths of what has no film.

    Example:
        >>> import fitmat as fm
        >>> fm.model("lambert+ggx", kd=0.3, alpha=0.2, eta=1.5).name
        'lambert+ggx'
    """
    arguments.kind("masking", masking, str, optional=True)
    arguments.whole("channels", channels, 1, optional=True)
    if any(part in WALKS for part in _split(name)[1]):
        return _walked(name, masking=masking, channels=channels, wavelengths=wavelengths, **values)
    covers, parts = _parsed(name)
    lobes = covers + parts
    known = {key for part in lobes for key in LOBES[part].defaults()}
    dotted = {f"{part}.{key}" for part in lobes for key in LOBES[part].defaults()}
    values = names.own(name, known | dotted, values)
    for key in values:
        if key not in known | dotted:
            raise ModelError(f"model {name!r} has no parameter {key!r}; it has {', '.join(sorted(known))}.")
    if masking is not None and masking not in MASKINGS:
        raise ModelError(f"masking {masking!r}: expected one of {', '.join(MASKINGS)}.")
    if masking is not None and not any(LOBES[part].has_masking for part in lobes):
        raise ModelError(f"model {name!r} has no masking to choose; leave out masking.")
    made = tuple(_lobe(part, masking, channels, values) for part in parts)
    built = made[0] if len(made) == 1 else Sum(made)
    for cover in reversed(covers):
        built = _lobe(cover, masking, channels, values, base=built)
    check_range(built)
    return built if wavelengths is None else placed(built, wavelengths, channels)


def _lobe(
    name: str, masking: str | None, channels: int | None, values: dict[str, ArrayLike], **inner: Any
) -> AbstractBRDF:
    """The lobe of that name; `inner` holds the base of a cover."""
    lobe = LOBES[name]
    wanted: dict[str, Any] = {key: default for key, (_, default) in lobe.defaults().items()} | values
    wanted |= {key.removeprefix(f"{name}."): value for key, value in values.items() if key.startswith(f"{name}.")}
    numbers = {key: of_size(key, wanted[key], channels, lobe.per_channel(key)) for key in lobe.defaults()}
    given = numbers if masking is None else numbers | {"masking": masking}
    for field, part in lobe.parts.items():
        inner[field] = part(**{f.name: given[f.name] for f in _fields(part) if f.name in given})
    own = {f.name: given[f.name] for f in _fields(lobe.shape) if f.name in given}
    return lobe.shape(**own, **inner)
