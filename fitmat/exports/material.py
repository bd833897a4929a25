"""Materials: what is exported, of whatever holds one: a model, a fit, a study, or the result of a run.

It translates nothing.
"""

import dataclasses
from collections.abc import Callable
from typing import TYPE_CHECKING, TypeAlias

import numpy as np
from jaxtyping import Float

from fitmat import arguments
from fitmat.errors import ModelError, ReadError
from fitmat.fitting.quantities import Quantity
from fitmat.models.around.shown import surface
from fitmat.models.base import AbstractBRDF
from fitmat.models.values import surfaces
from fitmat.studies.result import Result
from fitmat.text import brief

if TYPE_CHECKING:
    from fitmat.fitting.result import Fit
    from fitmat.studies.study import Study

Material: TypeAlias = "AbstractBRDF | Fit | Study | Result"


@dataclasses.dataclass(frozen=True, eq=False)
class Chosen:
    """What is exported: a model's material, where it comes from, and how sure it is where that is known.

    Attributes:
        model: The surface, without instrument and mount.
        source: Name of the measurements; "" where there are none.
        channels: Names of the channels; () where there are none.
        parameters: With their intervals.
        drawn: Gives parameter vectors of `model` from the posterior, (m, p), or none, (0, p).
    """

    model: AbstractBRDF
    source: str = ""
    channels: tuple[str, ...] = ()
    parameters: tuple[Quantity, ...] = ()
    drawn: Callable[[], Float[np.ndarray, "m p"]] = lambda: np.zeros((0, 0))

    __repr__ = brief


def chosen(material: Material, name: str | None = None) -> Chosen:
    """The material of a model, a fit, a study or a result.

    Args:
        material: What holds it.
        name: Which model of a study or a result; None for the one that the data prefer.

    Raises:
        FitmatError: it is none of these, or has no such model.
    """
    arguments.kind("model", name, str, optional=True)
    if isinstance(material, Result):
        one = material.fitted(name)

        def drawn() -> np.ndarray:
            try:
                return surfaces(one.model, one.draws)[1]
            except ReadError:  # a record without its draws still has its values
                return np.zeros((0, 0))

        return Chosen(surface(one.model), material.source, one.channels, one.parameters, drawn)
    if not isinstance(material, AbstractBRDF):
        return _of_study(material, name)
    if name is not None:
        raise ModelError(f"model {name!r} beside one model, expected it with a study or a result. Leave it out.")
    return Chosen(surface(material))


def _of_study(material: "Fit | Study", name: str | None) -> Chosen:
    """A model of a study, or a fit; what makes these is loaded only where somebody has one."""
    from fitmat.fitting.result import Fit
    from fitmat.studies.study import Study

    arguments.kind("material", material, AbstractBRDF, Fit, Study, Result)
    if isinstance(material, Study):
        named = {found.name: found for found in material.findings}
        best = material.choice.best.name if material.choice is not None else None
        wanted = name or best or (next(iter(named)) if len(named) == 1 else None)
        if wanted not in named:
            raise ModelError(f"model is {wanted!r}, expected one of the study: {', '.join(named)}.")
        found = named[wanted]
        fit, parameters = found.fit, found.parameters
        draws = found.posterior.values
    else:
        fit, parameters, draws = material, (), np.zeros((0, 0))
        if name not in (None, fit.name):
            raise ModelError(f"model is {name!r}, expected that of the fit, {fit.name}. Leave it out.")

    def drawn() -> np.ndarray:
        return surfaces(fit.model, draws)[1] if len(draws) else draws

    return Chosen(surface(fit.model), fit.measurements.source, fit.measurements.channels, parameters, drawn)
