"""Dispersed: a model at the wavelengths at which it was measured, its refractive index by a law, its films in place.

It fits nothing; it turns "the index follows Cauchy's law" into a model that `fit` understands.
"""

from typing import Any

import equinox as eqx
import jax
import numpy as np

from fitmat import arguments
from fitmat.errors import ModelError
from fitmat.models.base import AbstractBRDF
from fitmat.models.dispersion import LONGEST, SHORTEST
from fitmat.models.registry import LOBES, OVER, lobe_names
from fitmat.models.terms.dispersive import LAWS, AbstractDispersive
from fitmat.models.terms.film import has_film, placed
from fitmat.models.terms.fresnel import Conductor, Dielectric


def dispersed(template: AbstractBRDF, law: str, channels: tuple[str, ...]) -> AbstractBRDF:
    """The model with the law's parameters in place of eta, or of eta and kappa, and one ks for all channels.

    Where the level of Fresnel's term differs from channel to channel, so must not ks: the two would be one.

    Args:
        template: Its microfacet lobes with the exact terms take the law.
        law: A key of `LAWS`; that of a metal makes conductors of dielectric lobes.
        channels: Names of the channels: wavelengths in nm.

    Raises:
        ModelError: the law is not known, a channel is no wavelength, or no lobe has an index that could follow it.
    """
    arguments.choice("dispersion", law, LAWS)
    um, term = tuple((1e-3 * wavelengths(law, channels)).tolist()), LAWS[law]
    takes = (Dielectric,) if term.suffix == "" else (Dielectric, Conductor)
    changed = []

    def tied(part: Any) -> Any:
        if not _carries(part, takes):
            return part
        changed.append(part.name)
        weight = np.mean(np.asarray(part.ks))
        return eqx.tree_at(lambda lobe: (lobe.fresnel, lobe.ks), part, (term(um=um), weight))

    found = jax.tree.map(tied, template, is_leaf=lambda part: _carries(part, takes))
    if not changed:
        which = "exact dielectric" if term.suffix == "" else "exact dielectric or conductor"
        raise ModelError(
            f"dispersion = {law} with {template.name}: no lobe has the {which} term, whose index it would tell; use "
            f"ggx{term.suffix} or beckmann{term.suffix}."
        )
    return found


def carrying(name: str, law: str) -> str | None:
    """The name of a model with a law as it calls itself; None where no lobe has an index that could follow it.

    Raises:
        ModelError: the law is not known.
    """
    arguments.choice("dispersion", law, LAWS)
    metal = LAWS[law].suffix == "-conductor"
    parts = {part: LOBES[part].parts.get("fresnel") for part in lobe_names(name)}
    takes = (Dielectric, Conductor) if metal else (Dielectric,)
    if not any(term in takes for term in parts.values()):
        return None
    renamed = {part: part + "-conductor" * (metal and term is Dielectric) for part, term in parts.items()}
    covers = name.count(OVER)
    every = list(renamed.values())
    return OVER.join([*every[:covers], "+".join(every[covers:])])


def law_of(model: AbstractBRDF) -> str | None:
    """The name of the law that tells its index; None where none does."""
    terms = laws_of(model)
    return next((name for name, law in LAWS.items() if terms and type(terms[0]) is law), None)


def _carries(part: Any, takes: tuple[type, ...]) -> bool:
    return isinstance(part, AbstractBRDF) and isinstance(getattr(part, "fresnel", None), takes)


def laws_of(model: AbstractBRDF) -> list[AbstractDispersive]:
    """The terms that follow a law."""
    parts = jax.tree.leaves(model, is_leaf=lambda part: isinstance(part, AbstractDispersive))
    return [part for part in parts if isinstance(part, AbstractDispersive)]


def located(model: AbstractBRDF, channels: tuple[str, ...]) -> AbstractBRDF:
    """The model with its films at the wavelengths that the channels are; one without films as it is.

    Raises:
        ModelError: it has a film, and a channel is no wavelength.
    """
    if not has_film(model):
        return model
    found = _numbers(channels)
    if (odd := _odd(channels, found)) is not None:
        raise ModelError(
            f"{model.name}: channel {odd!r}, expected channels that are wavelengths from {SHORTEST:g} to {LONGEST:g} "
            "nm, as in columns brdf_450, brdf_550: what a film reflects turns on the wavelength. Name them so, or take "
            "another Fresnel term, as ggx-conductor."
        )
    return placed(model, found, len(channels))


def wavelengths(law: str, channels: tuple[str, ...]) -> np.ndarray:
    """Of each channel, nm.

    Raises:
        ModelError: a channel is no wavelength, or there is one channel, of which no law could be told.
    """
    found = _numbers(channels)
    odd = _odd(channels, found)
    if odd is not None or len(found) < 2:
        got = f"channel {odd!r}" if odd is not None else f"the one channel {channels[0]!r}"
        raise ModelError(
            f"dispersion = {law}: {got}, expected two channels or more that are wavelengths from {SHORTEST:g} to "
            f"{LONGEST:g} nm, as in columns brdf_450, brdf_550. Leave the law out."
        )
    return found


def _numbers(channels: tuple[str, ...]) -> np.ndarray:
    """The channels' names as numbers; NaN of all where one is none."""
    names = [name.strip().lower().removesuffix("nm").strip() for name in channels]
    try:
        return np.array([float(name) for name in names])
    except ValueError:
        return np.full(len(names), np.nan)


def _odd(channels: tuple[str, ...], nm: np.ndarray) -> str | None:
    """The first channel that is no wavelength."""
    return next((name for name, x in zip(channels, nm, strict=True) if not SHORTEST <= x <= LONGEST), None)
