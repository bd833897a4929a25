"""What many fits found: the noun `Fits`, arrays with one entry for each surface.

Finds nothing itself; `fitting_many` does.
"""

import dataclasses
from collections.abc import Mapping

import numpy as np
from jaxtyping import Float, Int

from fitmat.errors import ModelError
from fitmat.fitting.many.concluding import OUTCOMES
from fitmat.fitting.pooling import Pooled
from fitmat.fitting.smoothing import Smoothed
from fitmat.models.base import AbstractBRDF
from fitmat.models.parameters import Entry, entries, with_vector
from fitmat.text import brief


@dataclasses.dataclass(frozen=True, eq=False)
class Fits:
    """Many fits of one model; … stands for the axes of the surfaces, as (rows, columns) of a texture.

    Attributes:
        template: The model; its values are those of what was fixed.
        channels: Names of the c channels.
        held: Fixed parameters by name.
        values: Best parameters in the order of the model's vector, (…, p); NaN where nothing was fitted.
        sd: Their standard deviations by Laplace, (…, p), each sample's misfit counted as its own: 0 of what is fixed;
            NaN on a bound, where nothing was fitted, and where the loss is an objective.
        outcome: Places in the names of outcomes, (…); `result` has the names.
        discrepancy: s, the spread of ∛(f cosθ_i) that the model cannot explain, in sr^(−1/3), (…).
        log_likelihood: At the optimum, (…); of an objective −½ Σ residual².
        steps: Levenberg–Marquardt iterations of the best start, (…).
        n_values: Values that were fitted, (…).
        pooled: Parameters that were pooled, by name, with their channel where each has its own.
        smoothed: Parameters that were smoothed, by name.
    """

    template: AbstractBRDF
    channels: tuple[str, ...]
    held: Mapping[str, np.ndarray]
    values: Float[np.ndarray, "... p"]
    sd: Float[np.ndarray, "... p"]
    outcome: Int[np.ndarray, "..."]
    discrepancy: Float[np.ndarray, "..."]
    log_likelihood: Float[np.ndarray, "..."]
    steps: Int[np.ndarray, "..."]
    n_values: Int[np.ndarray, "..."]
    pooled: Mapping[str, Pooled] = dataclasses.field(default_factory=dict)
    smoothed: Mapping[str, Smoothed] = dataclasses.field(default_factory=dict)

    __repr__ = brief

    @property
    def name(self) -> str:
        """The model's name."""
        return self.template.name

    @property
    def entries(self) -> tuple[Entry, ...]:
        """The model's parameters, in the order of `values`."""
        return entries(self.template)

    @property
    def result(self) -> np.ndarray:
        """The name of every outcome, (…): those of a `Fit`, and "too_few" of a surface with too few valid samples."""
        return np.array(list(OUTCOMES))[self.outcome]

    @property
    def counts(self) -> dict[str, int]:
        """Outcome → how many fits ended so; the ones that occur, the most frequent first."""
        numbers = np.bincount(self.outcome.ravel(), minlength=len(OUTCOMES)).tolist()
        found = sorted(zip(numbers, OUTCOMES, strict=True), key=lambda pair: -pair[0])
        return {name: number for number, name in found if number}

    def __getitem__(self, name: str) -> Float[np.ndarray, "..."]:
        """The values of one parameter, (…), or (…, c) where every channel has its own.

        Raises:
            ModelError: the model has none of that name.
        """
        return self._of(self.values, name)

    def sd_of(self, name: str) -> Float[np.ndarray, "..."]:
        """The standard deviations of one parameter, as its values.

        Raises:
            ModelError: the model has none of that name.
        """
        return self._of(self.sd, name)

    def _of(self, every: np.ndarray, name: str) -> np.ndarray:
        known = {e.name: e for e in self.entries}
        if name not in known:
            raise ModelError(f"{self.name} has no parameter {name!r}, expected one of {', '.join(known)}.")
        part = every[..., known[name].place]
        return part if known[name].shape else part[..., 0]

    def model(self, *place: int) -> AbstractBRDF:
        """The model of one surface, by its place: `fits.model(3, 5)` of a texture."""
        return with_vector(self.template, self.values[place])

    def __str__(self) -> str:
        """How many ended how."""
        ended = ", ".join(f"{number} {name}" for name, number in self.counts.items())
        together = map(str, (*self.pooled.values(), *self.smoothed.values()))
        return "\n".join([f"{self.outcome.size} fits of {self.name}: {ended}.", *together])
