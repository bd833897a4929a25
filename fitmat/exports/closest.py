"""Closest: the material that a target can hold, found by imitation over the hemisphere, and how far it is.

No parameter is renamed: those of the target's own model are found that come closest, whatever they are called.
"""

import dataclasses
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from jaxtyping import ArrayLike, Float

from fitmat.errors import ModelError
from fitmat.exports.material import Chosen
from fitmat.match.appearance.spheres import perceived
from fitmat.match.carried import carried
from fitmat.match.distances import measure_distances
from fitmat.match.imitation import Imitation, imitate
from fitmat.measurements.samples import default_channels
from fitmat.models.base import AbstractBRDF
from fitmat.models.metrics import Weight
from fitmat.models.parameters import entries, vector
from fitmat.models.values import at
from fitmat.text import brief

METRIC = "cube-root"
"""What is minimised: the metric closest to what eyes judge."""

WEIGHTS: tuple[Weight, ...] = ("solid", "projected")
"""Of directions: each alike, or as light arrives and is seen; of the two that counts whose lit spheres look closer."""

NEARLY = 1.05
"""Of several ways in which a target may hold a material the first counts whose distance is so many times the least."""

SAME = 1e-3
"""Relative distance up to which a target holds a model."""


@dataclasses.dataclass(frozen=True, eq=False)
class Closest:
    """The closest that a target comes to a material.

    Attributes:
        model: The target's own model with the parameters found.
        of: Name of the model that is exported.
        relative: Relative BRDF distance over the hemisphere, weighted as light is.
        albedo_gap: The largest difference of the directional albedos, signed: positive where the target is brighter.
        albedo_gap_deg: At which incidence.
        delta_e: Mean ΔE2000 of the two lit spheres.
        delta_e_worst: What 5 % of the spheres' area exceed.
        ci95: Parameter → 95 % interval of each of its values, (k, 2); without those on a bound; empty without draws.
        converged: Whether the imitation ended at a minimum.
    """

    model: AbstractBRDF
    of: str
    relative: float
    albedo_gap: float
    albedo_gap_deg: float
    delta_e: float
    delta_e_worst: float
    ci95: Mapping[str, Float[np.ndarray, "k 2"]]
    converged: bool

    __repr__ = brief

    @property
    def values(self) -> dict[str, Float[np.ndarray, " k"]]:
        """Name → values of the target's model."""
        every = np.asarray(vector(self.model), float)
        return {e.name: every[e.place] for e in entries(self.model)}

    @property
    def same(self) -> bool:
        """Whether the target holds the model itself."""
        return self.relative <= SAME

    @property
    def words(self) -> list[str]:
        """How far it is, as sentences in ASCII."""
        if self.same:
            return []
        ended = "" if self.converged else " The search for them did not come to rest."
        return [
            f"The target has another model: its own parameters were found that come closest to {self.of} over the "
            f"hemisphere (least squares of the cube root of radiance); none is renamed.{ended}",
            f"What is left: relative BRDF distance {100 * self.relative:.2g} %, albedo {self.albedo_gap:+.3f} at "
            f"{self.albedo_gap_deg:.0f} degrees, DeltaE2000 on a lit sphere {self.delta_e:.2f} on average, "
            f"{self.delta_e_worst:.2f} in the worst twentieth.",
        ]

    @property
    def intervals(self) -> list[str]:
        """95 % intervals of the target's parameters as lines, where they are known."""
        lines = [
            f"  {name} " + ", ".join(f"{low:.4g} to {high:.4g}" for low, high in ends)
            for name, ends in self.ci95.items()
        ]
        return ["95 % intervals of the target's parameters:", *lines] if lines else []

    @property
    def facts(self) -> dict[str, Any]:
        """What the record of an export says of it."""
        numbers = ("of", "relative", "albedo_gap", "albedo_gap_deg", "delta_e", "delta_e_worst", "converged")
        told = {name: getattr(self, name) for name in numbers}
        return {"closest": told | {"model": self.model.name, "values": self.values, "ci95": dict(self.ci95)}}


def closest(chosen: Chosen, into: AbstractBRDF, ways: Sequence[Mapping[str, ArrayLike]] = ({},)) -> Closest:
    """The parameters of a target's model with which it comes closest to a material.

    Args:
        chosen: What is exported.
        into: The target's model, with as many channels.
        ways: Parameters of it that are held, one set for each way in which it may be meant, as a metal or as a
            dielectric; the first counts that is within `NEARLY` of the best.
    """
    tried = [_imitated(chosen, into, ways, weight) for weight in WEIGHTS]
    seen = [judged(chosen, found.model) for found, _ in tried]
    k = int(np.argmin([one.delta_e for one in seen]))
    found, held = tried[k]
    return dataclasses.replace(seen[k], ci95=_intervals(found, chosen, held), converged=found.converged)


def _imitated(
    chosen: Chosen, into: AbstractBRDF, ways: Sequence[Mapping[str, ArrayLike]], weight: Weight
) -> tuple[Imitation, frozenset[str]]:
    """The first way that is nearly as close as the best, and what is held in it."""
    found = [imitate(chosen.model, into, METRIC, fixed=held, weight=weight) for held in ways]
    enough = NEARLY * min(one.distance for one in found)
    first = next(k for k, one in enumerate(found) if one.distance <= enough)
    return found[first], frozenset(ways[first])


def judged(chosen: Chosen, model: AbstractBRDF) -> Closest:
    """How far a target's material is from another, wherever its parameters come from.

    Args:
        chosen: What is exported.
        model: Of the target, with its parameters.
    """
    pair = vector(model)[None], vector(chosen.model)[None]
    apart = measure_distances(model, chosen.model, pair, np.zeros(1))
    gaps = apart.albedos[0, 0] - apart.albedos[1, 0]
    worst = int(np.argmax(np.abs(gaps)))
    count = channels(chosen)
    names = chosen.channels if len(chosen.channels) == count else default_channels(count)
    seen = perceived(model, chosen.model, pair, names, pictures=False).delta_e_2000
    return Closest(
        model=model,
        of=chosen.model.name,
        relative=apart.whole["relative"].value,
        albedo_gap=float(gaps[worst]),
        albedo_gap_deg=float(np.rad2deg(apart.theta_i[worst])),
        delta_e=seen.mean.value,
        delta_e_worst=seen.worst_twentieth.value,
        ci95={},
        converged=True,
    )


def channels(chosen: Chosen) -> int:
    """How many channels the material's values have."""
    up = np.array([[0.0, 0.0, 1.0]])
    return at(chosen.model, up, up).shape[1]


def coloured(chosen: Chosen, whose: str) -> int:
    """The same for a target with colours.

    Raises:
        ModelError: neither 1 nor 3.
    """
    count = channels(chosen)
    if count not in (1, 3):
        raise ModelError(f"there are {count} channels, expected 1 or 3: the colours of {whose} are three.")
    return count


def _intervals(found: Imitation, chosen: Chosen, held: frozenset[str]) -> dict[str, Float[np.ndarray, "k 2"]]:
    """The central 95 % of the posterior, carried over."""
    draws = chosen.drawn()
    if not len(draws):
        return {}
    moved = carried(found, chosen.model, draws)
    ends = np.quantile(moved, [0.025, 0.975], axis=0).T
    return {
        e.name: ends[e.place]
        for e in entries(found.model)
        if e.name not in held and (np.ptp(ends[e.place], axis=1) > 0.0).any()
    }
