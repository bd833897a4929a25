"""What a fit found: the noun `Fit`, its covariance, and the name of its outcome.

Finds nothing itself; `fitting` does.
"""

import dataclasses
import functools
import math

import numpy as np
from jaxtyping import Float

from fitmat.fitting.coordinates import Coordinates, coordinates
from fitmat.fitting.correlation import Correlation, correlate
from fitmat.fitting.ends import AGREE, AS_GOOD, Ends, behind, home
from fitmat.fitting.information import FOLLOWS, MISSES, covariance, information, inverse_information
from fitmat.fitting.likelihood import Data, best_discrepancy, first_discrepancy
from fitmat.fitting.linear import Linear, linearise
from fitmat.fitting.losses import DEFAULT, Loss
from fitmat.fitting.symmetries import nearest
from fitmat.maths.normal import Z95
from fitmat.maths.programs import program
from fitmat.measurements.noise import Noise
from fitmat.measurements.samples import Measurements
from fitmat.models.base import AbstractBRDF
from fitmat.models.parameters import Entry, entries, vector, with_vector
from fitmat.models.values import at
from fitmat.text import brief, html_table, text_table, with_error

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


@dataclasses.dataclass(frozen=True, eq=False)
class Fit:
    """A fitted model.

    Attributes:
        name: The model's name.
        model: The model with the best parameters.
        measurements: What was fitted.
        noise: The measurement noise, given or estimated.
        data: The samples as the likelihood sees them.
        discrepancy: s, the spread of ∛(f cosθ_i) that the model cannot explain, in sr^(−1/3).
        held: Fixed parameters by name.
        result: Key of `RESULTS`.
        steps: Levenberg–Marquardt iterations of the best start.
        n_starts: How many starts were refined.
        n_starts_agreeing: How many of them found the best optimum.
        log_likelihood: At the optimum, what the prior adds included.
        information: Of the natural coordinates (logarithm where the scale is log), (p, p).
        likelihood_covariance: Of all physical parameters, if every sample's misfit were its own, (p, p); 0 for fixed
            ones, NaN for those on a bound.
        undetermined: Names of parameters that these data do not determine.
        n_values: Values that were fitted; more than `measurements` holds where these are a part of a large file.
        misfit: The same spread of ∛(f cosθ_i) by the default likelihood, whatever the loss.
        discrepancy_sd: Standard deviation of s where it is known from all values of a large file; else None.
        rivals: Other ends of starts that are as good, in the form that is nearest to the best, (m, p).
    """

    name: str
    model: AbstractBRDF
    measurements: Measurements
    noise: Noise
    data: Data
    discrepancy: float
    held: dict[str, np.ndarray]
    result: str
    steps: int
    n_starts: int
    n_starts_agreeing: int
    log_likelihood: float
    information: Float[np.ndarray, "p p"]
    likelihood_covariance: Float[np.ndarray, "p p"]
    undetermined: tuple[str, ...]
    n_values: int
    misfit: float
    discrepancy_sd: float | None = None
    rivals: Float[np.ndarray, "m p"] = dataclasses.field(default_factory=lambda: np.zeros((0, 0)))

    __repr__ = brief

    @property
    def entries(self) -> tuple[Entry, ...]:
        """The model's parameters, in the order of `values`."""
        return entries(self.model)

    @property
    def values(self) -> Float[np.ndarray, " p"]:
        """Best parameters, physical units."""
        return np.asarray(vector(self.model))

    @functools.cached_property
    def coordinates(self) -> Coordinates:
        """Of the parameters that were fitted."""
        return coordinates(self.model, self.held, self.measurements.channels)

    @property
    def free(self) -> np.ndarray:
        """Indices of the parameters that were fitted."""
        return self.coordinates.index

    @functools.cached_property
    def linear(self) -> Linear | None:
        """Residuals and slopes at the optimum; None where there are none."""
        return linearise(self.model, self.data, self.discrepancy, self.coordinates, self.information, self.n_values)

    @functools.cached_property
    def correlation(self) -> Correlation:
        """How alike the misfits of neighbouring geometries are, and what follows for everything that is quoted."""
        known = self.model, self.data, self.discrepancy, self.linear, self.coordinates, self.n_values
        return correlate(*known, self.noise.rho)

    @functools.cached_property
    def covariance(self) -> Float[np.ndarray, "p p"]:
        """Of all physical parameters, the misfit's correlation included; 0 for fixed ones, NaN for those on a bound."""
        found, moved = np.array(self.likelihood_covariance), self.coordinates
        if not (self.finite and self.correlation.found):
            return found
        inside = moved.side(self.values) == 0
        slope, place = moved.slope(self.values)[inside], moved.index[inside]
        stretch = self.correlation.stretch[np.ix_(inside, inside)] * np.divide.outer(slope, slope)
        found[np.ix_(place, place)] = stretch @ found[np.ix_(place, place)] @ stretch.T
        return found

    def widened(self, values: Float[np.ndarray, "m p"]) -> Float[np.ndarray, "m p"]:
        """Draws from the likelihood, physical, as far from the best fit as the correlation of the misfit asks."""
        if not self.correlation.found:
            return values
        moved = self.coordinates
        centre = moved.natural(self.values)
        away = (moved.natural(values) - centre) @ self.correlation.stretch.T
        return moved.filled(self.values, moved.folded(centre + away))

    @functools.cached_property
    def elsewhere(self) -> dict[str, tuple[float, ...]]:
        """Names of fitted parameters, with their channel where there are several → values of optima as good.

        Only those that lie outside of the 95 % interval that the curvature at the best fit promises.
        """
        moved = self.coordinates
        if not (self.finite and len(self.rivals) and moved.count):
            return {}
        known = self.information[np.ix_(self.free, self.free)] + np.diag(12.0 / moved.extent**2)
        stretch = self.correlation.stretch
        sd = np.sqrt(np.diagonal(stretch @ inverse_information(known, moved.span) @ stretch.T))
        away = np.abs(moved.natural(self.rivals) - moved.natural(self.values)) > Z95 * sd
        found = zip(moved.names, moved.places, away.T, strict=True)
        return {name: tuple(self.rivals[outside, k].tolist()) for name, k, outside in found if outside.any()}

    @functools.cached_property
    def on_bound(self) -> dict[str, str]:
        """Names of fitted parameters that sit on a bound → "lower" or "upper"."""
        sides = dict(zip(self.coordinates.places, self.coordinates.side(self.values).tolist(), strict=True))
        found = {e.name: [sides.get(k, 0) for k in range(e.place.start, e.place.stop)] for e in self.entries}
        first = {name: next((side for side in part if side), 0) for name, part in found.items()}
        return {name: "lower" if side < 0 else "upper" for name, side in first.items() if side}

    @property
    def loss(self) -> Loss:
        """What was minimised."""
        return self.data.loss

    @property
    def finite(self) -> bool:
        """Whether there is an optimum to sample around."""
        return bool(np.isfinite(self.log_likelihood) and np.isfinite(self.values).all())

    @property
    def n_inferred(self) -> int:
        """Free parameters, and the discrepancy where the loss infers it."""
        return len(self.free) + self.loss.infers_discrepancy

    @property
    def misfit_ratio(self) -> float:
        """Discrepancy over measurement noise for the typical sample: the adequacy of the model."""
        return self.misfit / max(float(self.data.typical), 1e-300)

    @property
    def adequacy(self) -> str:
        """The misfit in words."""
        ratio = self.misfit_ratio
        if not self.finite:
            return "cannot be judged: nothing finite was found"
        if not self.noise.known:
            return "adequacy unknown: the noise is not known"
        if self.n_values > 1 and np.ptp(self.measurements.value[self.measurements.valid]) == 0:
            return "adequacy unknown: all values are identical"
        shared = f", but {self.correlation.shared}" if self.correlation.shared else ""
        if ratio < FOLLOWS:
            whole = " on the whole" if shared else ""
            return f"follows the data within the measurement noise{whole}{shared}"
        if ratio < MISSES:
            return f"follows the data to about the measurement noise (misfit {ratio:.1f} × noise){shared}"
        return f"inadequate: misses the data by {ratio:.0f} × the measurement noise"

    def _rows(self) -> list[tuple[str, str, str]]:
        sd = np.sqrt(np.diagonal(self.covariance))
        names = coordinates(self.model, channels=self.measurements.channels).names
        symbols = [e.param.symbol for e in self.entries for _ in range(e.size)]
        rows = zip(names, symbols, self.values, sd, strict=True)
        return [(name, symbol, with_error(float(value), float(error))) for name, symbol, value, error in rows]

    def __str__(self) -> str:
        """The outcome and every parameter with its standard deviation."""
        return text_table(self._caption, self._rows())

    def _repr_html_(self) -> str:
        return html_table(self._caption, ("parameter", "symbol", "value ± sd"), self._rows())

    @property
    def _caption(self) -> str:
        agreeing = f"{self.n_starts_agreeing} of {self.n_starts} starts agree"
        return f"{self.name}: {self.result}, {agreeing}; {self.adequacy}."

    @property
    def aicc(self) -> float:
        """Akaike's criterion with the small-sample correction (Hurvich & Tsai 1989); NaN of an objective."""
        if not self.loss.posterior:
            return math.nan
        n, k = self.n_values, self.n_inferred
        return 2 * k - 2 * self.log_likelihood + 2 * k * (k + 1) / max(n - k - 1, 1)

    @property
    def bic(self) -> float:
        """Schwarz's criterion; NaN of an objective."""
        if not self.loss.posterior:
            return math.nan
        return self.n_inferred * np.log(self.n_values) - 2 * self.log_likelihood


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
