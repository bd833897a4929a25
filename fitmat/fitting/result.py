"""What a fit found: the noun `Fit`, its covariance and its parameters as people read them.

Finds nothing itself; `fitting` does.
"""

import dataclasses
import functools
import math
from collections.abc import Collection, Iterator

import numpy as np
import polars as pl
from jaxtyping import Float

from fitmat.fitting.coordinates import Coordinates, channel_names, coordinates
from fitmat.fitting.correlation import Correlation, correlate
from fitmat.fitting.information import FOLLOWS, MISSES, inverse_information, unknown_spread, wide
from fitmat.fitting.likelihood import Data
from fitmat.fitting.linear import Linear, linearise
from fitmat.fitting.losses import Loss
from fitmat.fitting.quantities import BOUND, SEVERAL, UNDETERMINED, Quantity, dataframe, named
from fitmat.maths.normal import Z95
from fitmat.measurements.noise import Noise
from fitmat.measurements.samples import Measurements
from fitmat.models.base import AbstractBRDF
from fitmat.models.parameters import Entry, entries, vector
from fitmat.models.values import at
from fitmat.text import brief, html_table, text_table, with_error


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
        result: Key of `concluding.RESULTS`.
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

    @functools.cached_property
    def entries(self) -> tuple[Entry, ...]:
        """The model's parameters, in the order of `values`."""
        return entries(self.model)

    @functools.cached_property
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
    def predicted(self) -> Float[np.ndarray, "n c"]:
        """f cosθ_i of the best fit, rows as in `data`."""
        return at(self.model, self.data.wi, self.data.wo) * self.data.kappa

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
            return f"follows the data within the measurement noise{' on the whole' if shared else ''}{shared}"
        if ratio < MISSES:
            return f"follows the data to about the measurement noise (misfit {ratio:.1f} × noise){shared}"
        return f"inadequate: misses the data by {ratio:.0f} × the measurement noise"

    @functools.cached_property
    def parameters(self) -> tuple[Quantity, ...]:
        """Every parameter with its standard deviation and 95 % interval, by the curvature at the best fit."""
        return tuple(quantities(self, *by_curvature(self)))

    def __getitem__(self, name: str) -> Quantity:
        """One of the `parameters`; `print(fit["alpha"])` says `alpha (α) = 0.15027 ± 0.00040 (95 % 0.1495 – 0.1511)`.

        Raises:
            ModelError: the model has none of that name.
        """
        return named(self.parameters, name, self.name)

    def __iter__(self) -> Iterator[str]:
        return (q.name for q in self.parameters)

    def to_dataframe(self) -> pl.DataFrame:
        """The parameters as a table, one row for each and each channel."""
        return dataframe(self.parameters, self.name, self.measurements.channels)

    def _rows(self) -> list[tuple[str, str, str]]:
        each = ((n, q, k) for q in self.parameters for k, n in enumerate(q.labels(self.measurements.channels)))
        return [(name, q.symbol, with_error(float(q.value[k]), float(q.sd[k]))) for name, q, k in each]

    def __str__(self) -> str:
        """The outcome and every parameter with its standard deviation."""
        return text_table(self._caption, self._rows())

    def _repr_html_(self) -> str:
        return html_table(self._caption, ("parameter", "symbol", "value ± sd"), self._rows())

    @property
    def _caption(self) -> str:
        return f"{self.name}: {self.result}, {self.n_starts_agreeing} of {self.n_starts} starts agree; {self.adequacy}."

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


def by_curvature(fit: Fit) -> tuple[Float[np.ndarray, " p"], Float[np.ndarray, "p 2"]]:
    """Standard deviations and 95 % intervals by Laplace; in the logarithm for parameters whose scale is log.

    Both are NaN where the loss is an objective.
    """
    few = unknown_spread(fit.noise.known, fit.n_values, len(fit.free))
    sd = np.sqrt(few * np.diagonal(fit.covariance)) if fit.loss.posterior else np.full(len(fit.values), np.nan)
    return sd, coordinates(fit.model).interval(fit.values, sd)


def quantities(
    fit: Fit, sd: Float[np.ndarray, " p"], ci95: Float[np.ndarray, "p 2"], undetermined: Collection[str] = ()
) -> list[Quantity]:
    """The model's parameters; an interval also holds the optima elsewhere that are as good.

    Args:
        fit: Their fit.
        sd: Standard deviations.
        ci95: Intervals.
        undetermined: Names of parameters, with their channel where there are several, that are not determined beside
            those of the fit and those whose interval is `wide`.
    """
    moved, lost = coordinates(fit.model), wide(fit.model, fit.data.prior, ci95)
    inside = np.isin(moved.index, fit.free) & (moved.side(fit.values) == 0)
    ci95, sure, undetermined = np.array(ci95), np.where(inside, sd, np.nan), {*undetermined}
    for name, place in zip(fit.coordinates.names, fit.coordinates.places, strict=True):
        others = fit.elsewhere.get(name, ())
        ci95[place] = min(ci95[place, 0], *others, np.inf), max(ci95[place, 1], *others, -np.inf)
        sure[place] = np.nan if others else sure[place]
        undetermined |= {name} if lost[place] else set()
    result = []
    for entry in fit.entries:
        p, names = entry.param, channel_names(entry, fit.measurements.channels)
        result.append(
            Quantity(
                *(entry.name, p.symbol, p.unit, p.doc, fit.values[entry.place], sure[entry.place], ci95[entry.place]),
                per_channel=bool(entry.shape),
                remarks=tuple(_remark(fit, entry, name, undetermined) for name in names),
            )
        )
    return result


def _remark(fit: Fit, entry: Entry, name: str, undetermined: Collection[str]) -> str:
    if name in undetermined or entry.name in fit.undetermined:
        return UNDETERMINED
    if name in fit.elsewhere:
        return SEVERAL
    if entry.name in fit.on_bound:
        return f"at its {fit.on_bound[entry.name]}{BOUND}"
    return "fixed" if entry.name in fit.held else ""
