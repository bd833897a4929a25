"""Plan: which models a study fits, and what is known of each beforehand.

It fits nothing; a model or a parameter that does not exist is refused here, before any work.
"""

from collections.abc import Container, Iterable, Mapping, Sequence
from typing import Any

import numpy as np

from fitmat import arguments
from fitmat.errors import ModelError
from fitmat.fitting import known
from fitmat.fitting.dispersed import carrying, dispersed, located
from fitmat.fitting.losses import DEFAULT
from fitmat.fitting.losses import loss as find_loss
from fitmat.fitting.priors import DISCREPANCY, refuse_idle
from fitmat.judgement.choice.choice import every_model
from fitmat.measurements.samples import Measurements
from fitmat.models import names as other_names
from fitmat.models.parameters import entries
from fitmat.models.registry import LOBES, lobe_names, model, normalised
from fitmat.studies import DEFAULT_MODELS

EVERY = "all"
"""Asks for every model that makes sense for the measurements."""

Jobs = Mapping[str, Mapping[str, Any]]
"""Model name → keyword arguments of `fit`."""

_BESIDE = {DISCREPANCY}
# What has a prior beside the parameters of a model.


def model_names(asked: str | Sequence[str], measurements: Measurements) -> list[str]:
    """Model names, checked, without repeats; "all" for what can be told by the measurements.

    Args:
        asked: Names, or a text with commas between them.
        measurements: What will be fitted.

    Raises:
        ModelError: no name is given, or one is unknown.
    """
    return list(every_model(measurements)) if wants_all(asked) else named(asked)


def wants_all(asked: str | Sequence[str]) -> bool:
    """Whether all models are asked for, instead of some by name."""
    return isinstance(asked, str) and asked.strip() == EVERY


def named(asked: str | Sequence[str]) -> list[str]:
    """Model names, checked, without repeats.

    Args:
        asked: Names, or a text with commas between them.

    Raises:
        ModelError: no name is given, or one is unknown.
    """
    parts = asked.split(",") if isinstance(asked, str) else asked
    for part in parts:
        arguments.kind("one of models", part, str)
    names = [normalised(part) for part in parts if part.strip()]
    if not names:
        raise ModelError(f"no model given; try --models {','.join(DEFAULT_MODELS)}.")
    return list(dict.fromkeys(names))


def plan(
    asked: str | Sequence[str],
    measurements: Measurements,
    *,
    fixed: Mapping[str, Any] | None = None,
    priors: Mapping[str, Any] | None = None,
    loss: str = DEFAULT.name,
    masking: str | None = None,
    ior: str | None = None,
    tilt: bool = False,
    dispersion: str | None = None,
    film: str | None = None,
) -> Jobs:
    """What `fit` is to be told of each model.

    Args:
        asked: As in `model_names`.
        measurements: What will be fitted, or a part that stands for it.
        fixed: Parameters to hold in every model that has them; at least one must.
        priors: What is known beforehand, in every model that has the parameter; at least one must.
        loss: What the fits minimise, by name.
        masking: Of the microfacet lobes; None for the models' own.
        ior: Material whose refractive index is held in the models that have one.
        tilt: Whether the sample's normal may lean.
        dispersion: Law of the refractive index in the models that have one.
        film: Material whose index the film has in the models with a film.

    Raises:
        ModelError: a name is unknown, something given concerns no model, or two things given contradict each other.
    """
    names = model_names(asked, measurements)
    if dispersion is not None:
        names = _with_law(names, dispersion, ior)
    prepared = known.prepare_known(names, measurements, ior=ior, tilt=tilt, film=film)
    lawful = [name for name in prepared if dispersion is not None and carrying(name, dispersion)]
    having = {
        name: {e.name for e in entries(located(model(name), measurements.channels))} | _BESIDE for name in prepared
    }
    for name in lawful:
        built = dispersed(model(name), dispersion or "", measurements.channels)
        having[name] = {e.name for e in entries(built)} | _BESIDE
    own = {name: other_names.own(name, has - _BESIDE, fixed or {}) for name, has in having.items()}
    read = {key for found in own.values() for key in (fixed or {}) if key not in found}
    unread = {key: value for key, value in (fixed or {}).items() if key not in read}
    _refuse_foreign("--fix", unread, {name: has - _BESIDE for name, has in having.items()})
    _refuse_foreign("--prior", priors or {}, having)
    for name, held in prepared.items():
        _refuse_known(own[name], held)
    masked = [n for n in prepared if any(LOBES[part].has_masking for part in lobe_names(n))]
    if masking is not None and not masked:
        raise ModelError(f"--masking {masking}: none of {', '.join(prepared)} has a masking to choose.")
    jobs = {
        name: {
            "fixed": {**held, **_of(own[name], having[name] - _BESIDE)},
            "priors": _of(priors, having[name]),
            "loss": loss,
            **({"masking": masking} if masking is not None and name in masked else {}),
            **({"dispersion": dispersion} if name in lawful else {}),
        }
        for name, held in prepared.items()
    }
    for job in jobs.values():
        refuse_idle(job["priors"], job["fixed"], find_loss(loss))
    return jobs


def refuse_unsampled(count: int, most: int, loss: str, *, sampling: bool) -> None:
    """Stop where there will be no draws of which a second sampler could say anything.

    Args:
        count: Values to fit.
        most: Values above which nothing is sampled.
        loss: What the fits minimise, by name.
        sampling: Whether to sample.

    Raises:
        ModelError: says why nothing will be sampled.
    """
    asked, expected = "a second opinion (--check-posterior)", "expected a posterior that is sampled. Leave one out."
    if not sampling:
        raise ModelError(f"{asked} without sampling (--no-mcmc), {expected}")
    if not find_loss(loss).posterior:
        raise ModelError(f"{asked} under the loss {loss} (--loss), which is no likelihood, {expected}")
    if count > most:
        raise ModelError(f"{asked} on {count:,} values, expected at most {most:,}, which are sampled. Leave it out.")


def _with_law(names: Sequence[str], law: str, ior: str | None) -> list[str]:
    """The models as they call themselves where their index follows a law."""
    if ior is not None:
        raise ModelError(
            f"--dispersion {law} beside --ior {ior}, expected one of the two: the material says its index already. "
            "Leave one out."
        )
    found = {name: carrying(name, law) for name in names}
    if not any(found.values()):
        raise ModelError(f"--dispersion {law}: none of {', '.join(names)} has an index that could follow it; use ggx.")
    return list(dict.fromkeys(new or name for name, new in found.items()))


def _of(given: Mapping[str, Any] | None, names: set[str]) -> dict[str, Any]:
    return {key: value for key, value in (given or {}).items() if key in names}


def _refuse_known(fixed: Container[str], held: Iterable[str]) -> None:
    for key in held:
        name = key.rpartition(".")[2]
        if key in fixed and name in (*known.OPTICAL, *known.OF_FILM):
            flag = "--film" if name in known.OF_FILM else "--ior"
            expected = "expected one of the two: the material says it already"
            raise ModelError(f"--fix {key} beside {flag}, {expected}. Leave one out.")


def _refuse_foreign(flag: str, given: Mapping[str, np.ndarray], having: Mapping[str, set[str]]) -> None:
    for key in given:
        if not any(key in has for has in having.values()):
            every = ", ".join(sorted(set().union(*having.values()) - _BESIDE))
            raise ModelError(f"{flag} {key}: no model of {', '.join(having)} has it; they have {every}.")
