"""Prospects: which parameters a file could determine, by the Fisher information of its own angles and noise.

It looks at no measured value but for the noise; what the sample is, it does not know.
"""

import dataclasses
from collections.abc import Sequence
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from fitmat.fitting.coordinates import coordinates
from fitmat.fitting.information import UNDETERMINED, inverse_information, limits
from fitmat.maths.programs import program
from fitmat.measurements.samples import Measurements
from fitmat.models.base import AbstractBRDF, evaluate_pairs
from fitmat.models.parameters import entries, vector
from fitmat.models.registry import model

ROWS = 2048
"""Rows that are looked at, evenly chosen and weighted up; always as many, so that all files share one program."""

WEAK = 0.1
"""Relative standard deviation above which a parameter is determined weakly."""

ASSUMED = (0.02, 1e-3)
"""Relative and absolute noise (sr⁻¹) where that of the file is not known."""

GLOSSES: dict[str, dict[str, dict[str, Any]]] = {
    "lambert+ggx": {
        "dull": {"kd": 0.3, "ks": 1.0, "alpha": 0.4, "eta": 1.5},
        "satin": {"kd": 0.3, "ks": 1.0, "alpha": 0.15, "eta": 1.5},
        "glossy": {"kd": 0.3, "ks": 1.0, "alpha": 0.05, "eta": 1.5},
    },
    "lambert+blinn-phong": {
        "dull": {"kd": 0.3, "ks": 0.05, "exponent": 10.5},
        "satin": {"kd": 0.3, "ks": 0.05, "exponent": 87.0},
        "glossy": {"kd": 0.3, "ks": 0.05, "exponent": 798.0},
    },
}
"""Grey plastics whose parameters are asked for; the exponents are 2/α² − 2."""


@dataclasses.dataclass(frozen=True)
class Prospect:
    """What the angles of a file say about one parameter of one assumed material.

    Attributes:
        model: Name of the model.
        gloss: Which material of `GLOSSES`.
        name: Of the parameter.
        symbol: Its letter.
        value: The assumed value.
        sd: Relative standard deviation of one channel's fit; None where not determined.
        verdict: "determined", "weakly determined" or "not determined".
    """

    model: str
    gloss: str
    name: str
    symbol: str
    value: float
    sd: float | None
    verdict: str


def prospects(m: Measurements, laws: Sequence[tuple[float, float] | None]) -> tuple[Prospect, ...]:
    """The standard deviations that fits to such a file would have if the sample were one of `GLOSSES`.

    From I = Jᵀ Σ⁻¹ J at the true parameters (the Cramér–Rao bound), in natural coordinates, for the channel with most
    valid samples. Limits of "not determined" are those of a fit, `result.UNDETERMINED`.

    Args:
        m: Gives the directions.
        laws: a (sr⁻¹) and b of the noise σ² = a² + (b f)² per channel; None where it is unknown, for `ASSUMED`.
    """
    channel = int(m.valid.sum(axis=0).argmax())
    rows = np.flatnonzero(m.valid[:, channel])
    if len(rows) == 0:
        return ()
    absolute, relative = laws[channel] or ASSUMED[::-1]
    kept = rows[np.unique(np.linspace(0, len(rows) - 1, ROWS).round().astype(int))]
    blank = ROWS - len(kept)
    wi, wo = (np.concatenate([part[kept], np.tile([0.0, 0.0, 1.0], (blank, 1))]) for part in (m.wi, m.wo))
    weight = np.concatenate([np.full(len(kept), len(rows) / len(kept)), np.zeros(blank)])
    found = []
    arrays = [np.asarray(part, float) for part in (wi, wo, weight, absolute, relative)]
    for name, glosses in GLOSSES.items():
        for gloss, values in glosses.items():
            truth = model(name, channels=1, **values)
            found += _verdicts(truth, gloss, np.asarray(_information(truth, *arrays)))
    return tuple(found)


@program
def _information(
    truth: AbstractBRDF, wi: Array, wo: Array, weight: Array, absolute: Array, relative: Array
) -> Float[Array, "p p"]:
    """JᵀJ in natural coordinates, residuals in units of noise."""
    every, values = coordinates(truth), vector(truth)

    def predicted(t: Array) -> Array:
        return evaluate_pairs(every.model(truth, values, t), wi, wo)[:, 0]

    at = every.natural(values)
    root = jnp.sqrt(weight) / jnp.hypot(absolute, relative * predicted(at))
    jacobian = jax.jacfwd(predicted)(at) * root[:, None]
    return jacobian.T @ jacobian


def _verdicts(truth: AbstractBRDF, gloss: str, information: np.ndarray) -> list[Prospect]:
    every, values = coordinates(truth), np.asarray(vector(truth))
    sd = np.sqrt(np.diagonal(inverse_information(information, every.span)))
    loose = ~(sd <= limits(every))
    relative = sd / np.where(every.ratio, 1.0, values)
    found = []
    for entry in entries(truth):
        k = entry.place.start
        # A weight known to no better than itself may be absent, whatever its range is.
        lost = bool(loose[k] or relative[k] > UNDETERMINED["log"])
        verdict = "not determined" if lost else "weakly determined" if relative[k] > WEAK else "determined"
        sd_given = None if lost else float(relative[k])
        found.append(Prospect(truth.name, gloss, entry.name, entry.param.symbol, float(values[k]), sd_given, verdict))
    return found
