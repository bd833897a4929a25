"""Concluding: from the ends of all starts to a `Fit`: the best of them, its covariance and the name of the outcome.

It solves nothing.
"""

import numpy as np

from fitmat.fitting.coordinates import coordinates
from fitmat.fitting.discrepancy import best_discrepancy, first_discrepancy
from fitmat.fitting.ends import AGREE, AS_GOOD, Ends, behind, home
from fitmat.fitting.information import covariance, information
from fitmat.fitting.likelihood import Data
from fitmat.fitting.losses import DEFAULT
from fitmat.fitting.result import Fit
from fitmat.fitting.symmetries import nearest
from fitmat.maths.programs import program
from fitmat.measurements.noise import Noise
from fitmat.measurements.samples import Measurements
from fitmat.models.base import AbstractBRDF
from fitmat.models.parameters import with_vector
from fitmat.models.values import at

RESULTS = {
    "converged": "Converged.",
    "at_bound": "A parameter sits on its bound: the data ask for a value outside the model's range. "
    "Its uncertainty is not quoted; consider another model, or fix the parameter.",
    "unidentifiable": "At least one parameter is not determined by these angles: fix it (for example ks=1), "
    "or measure at more incidence angles.",
    "max_steps": "The solver ran out of steps; the numbers are its last iterate. "
    "Raise max_steps or simplify the model.",
    "nonfinite": "The likelihood is not finite for any start: check the data for extreme values.",
}
"""How a fit can end, and what that means."""


def conclude(
    m: Measurements,
    template: AbstractBRDF,
    held: dict[str, np.ndarray],
    given: tuple[Noise, Data],
    ends: Ends,
) -> Fit:
    """Choose the best end, compute the covariance and classify."""
    found_noise, data = given
    apart = behind(ends, data)
    k = int(np.argmin(apart))
    usable = bool(np.isfinite(apart[k]))
    moved = coordinates(template, held)
    values = home(data, moved, ends.values[k])
    best = with_vector(template, values)
    s = float(ends.discrepancy[k])
    on_bound = bool(moved.side(values).any())
    known = information(best, data, s, moved.index)
    spread, undetermined = covariance(best, known, moved, data.told(moved.index))
    others = ends.values[(apart < AS_GOOD) & (np.arange(len(apart)) != k)]
    return Fit(
        name=template.name,
        model=best,
        measurements=m,
        noise=found_noise,
        data=data,
        discrepancy=s,
        held=held,
        result=named_outcome(usable, bool(ends.solved[k]), on_bound, undetermined),
        steps=int(ends.steps[k]),
        n_starts=len(apart),
        n_starts_agreeing=int(np.count_nonzero(apart < AGREE)),
        log_likelihood=float(ends.log_likelihood[k]),
        information=known,
        likelihood_covariance=spread,
        undetermined=undetermined,
        n_values=int(np.count_nonzero(data.weight)),
        misfit=s if data.loss.infers_discrepancy else _misfit(best, data),
        rivals=nearest(best, others, moved),
    )


def _misfit(best: AbstractBRDF, data: Data) -> float:
    plain = data.under(DEFAULT)
    return float(discrepancy_of(at(best, data.wi, data.wo) * data.kappa, plain, first_discrepancy(plain)))


discrepancy_of = program(best_discrepancy)
"""`best_discrepancy` as a program."""


def named_outcome(usable: bool, solved: bool, on_bound: bool, undetermined: tuple[str, ...]) -> str:
    """The key of `RESULTS` that says how a fit ended."""
    if not usable:
        return "nonfinite"
    if undetermined:
        return "unidentifiable"
    if on_bound:
        return "at_bound"
    return "converged" if solved else "max_steps"
