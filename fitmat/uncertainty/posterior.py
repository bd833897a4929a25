"""Draws of a fit's parameters, and what is quoted of them.

Draws nothing itself; `chains` and `laplace` do.
"""

import dataclasses
import functools
import io
import json
from collections.abc import Collection, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl
from jaxtyping import Float

from fitmat import arguments
from fitmat._types import Progress
from fitmat.errors import ModelError, OutputError
from fitmat.extras import needed
from fitmat.fitting.coordinates import channel_names
from fitmat.fitting.quantities import Quantity, dataframe, named
from fitmat.fitting.result import Fit, by_curvature, quantities
from fitmat.measurements.samples import Measurements
from fitmat.models.parameters import Entry
from fitmat.text import brief, html_table, text_table, with_error
from fitmat.uncertainty.diagnostics import GOOD_PARETO, Diagnostics
from fitmat.uncertainty.estimate import limits


@dataclasses.dataclass(frozen=True, eq=False)
class Posterior:
    """Draws of a fit's parameters.

    Attributes:
        fit: What was sampled.
        method: "laplace" or "emcee".
        drawn: Physical parameter vectors as the density has them, (m, p), fixed parameters included; see `values`.
        discrepancy: s of each draw, (m,).
        chain: For emcee, `drawn` and s before flattening, (steps, walkers, free + 1), physical; else None.
        diagnostics: For emcee; else None.
        interrupted: Whether the user stopped the sampling.
        pareto_k: k̂ of the weights by which Laplace's draws were corrected; None where that was not tried.
    """

    fit: Fit
    method: str
    drawn: Float[np.ndarray, "m p"]
    discrepancy: Float[np.ndarray, " m"]
    chain: np.ndarray | None = None
    diagnostics: Diagnostics | None = None
    interrupted: bool = False
    pareto_k: float | None = None

    __repr__ = brief

    @functools.cached_property
    def values(self) -> Float[np.ndarray, "m p"]:
        """What everything that is quoted rests on: `drawn`, widened as the correlation of the misfit asks, (m, p)."""
        return self.fit.widened(self.drawn)

    @property
    def verdict(self) -> str:
        """A key of `VERDICTS`: one of the first three for chains, one of the next three for Laplace."""
        if not self.fit.finite:
            return "unusable"
        if not self.fit.loss.posterior:
            return "no posterior"
        if self.diagnostics is None:
            if self.pareto_k is None:
                return "not sampled"
            return "approximate" if self.pareto_k > GOOD_PARETO else "corrected"
        return self.diagnostics.verdict

    @property
    def exact(self) -> bool:
        """Whether the draws follow the density itself, so that intervals are taken from them, not from a Gaussian."""
        return self.verdict in ("reliable", "tentative", "corrected")

    @property
    def usable(self) -> bool:
        """Whether intervals may be taken from these draws."""
        return self.verdict not in ("unusable", "no posterior")

    def _rows(self) -> list[tuple[str, str, str]]:
        channels = self.fit.measurements.channels
        sd, interval = self.sd(), self.interval()
        return [
            (
                name,
                with_error(float(self.fit.values[e.place.start + k]), float(sd[e.place.start + k])),
                " – ".join(f"{limit:.4g}" for limit in interval[e.place.start + k]),
            )
            for e in self.fit.entries
            for k, name in enumerate(channel_names(e, channels))
        ]

    def __str__(self) -> str:
        """The verdict and every parameter with its standard deviation and 95 % interval."""
        return text_table(f"{self.fit.name}: posterior {self.verdict}.", self._rows())

    def _repr_html_(self) -> str:
        caption = f"{self.fit.name}: posterior {self.verdict}."
        return html_table(caption, ("parameter", "value ± sd", "95 % interval"), self._rows())

    def quantities(self, undetermined: Collection[str] = ()) -> list[Quantity]:
        """The model's parameters, then the discrepancy s where the loss infers it; an objective gives values only.

        Value: the best fit. Intervals: `estimate.limits` of the draws where these follow the posterior itself;
        otherwise `fitting.result.by_curvature`.

        Args:
            undetermined: Names of parameters, with their channel where there are several, that are not determined
                beside those of the fit.
        """
        found = quantities(self.fit, *self.quoted(), undetermined)
        return [*found, self._discrepancy()] if self.fit.loss.infers_discrepancy else found

    def quoted(self) -> tuple[Float[np.ndarray, " p"], Float[np.ndarray, "p 2"]]:
        """Standard deviations and 95 % intervals of the parameters that `quantities` begins with."""
        sampled = self.exact and self.fit.loss.posterior
        return (self.sd(), self.interval()) if sampled else by_curvature(self.fit)

    def _discrepancy(self) -> Quantity:
        """s; where the best fit has none, its interval is one-sided."""
        best, draws = self.fit.discrepancy, self.discrepancy
        ends = limits(np.asarray(best), draws) if best > 0 else np.array([0.0, np.quantile(draws, 0.95)])
        words = "spread of ∛(f cosθ_i) that the model cannot explain"
        return Quantity(
            *("discrepancy", "s", "sr^(-1/3)", words, np.array([best]), np.array([draws.std()]), ends[None]),
            per_channel=False,
            remarks=("",),
        )

    def __getitem__(self, name: str) -> Quantity:
        """A parameter with its standard deviation and 95 % interval.

        Raises:
            ModelError: the model has none of that name.
        """
        return named(self.quantities(), name, self.fit.name)

    def __iter__(self) -> Iterator[str]:
        return (q.name for q in self.quantities())

    def to_dataframe(self) -> pl.DataFrame:
        """The parameters as a table, one row for each and each channel; the draws are `table`."""
        return dataframe(self.quantities(), self.fit.name, self.fit.measurements.channels)

    def sd(self) -> Float[np.ndarray, " p"]:
        """Standard deviation of each parameter."""
        return self.values.std(axis=0)

    def interval(self, level: float = 0.95) -> Float[np.ndarray, "p 2"]:
        """Interval of each parameter that holds the posterior with a probability, by `estimate.limits`."""
        return limits(self.fit.values, self.values, level).T

    def thinned(self, count: int, *, widened: bool = True) -> tuple[Float[np.ndarray, "k p"], Float[np.ndarray, " k"]]:
        """At most `count` draws spread evenly over the run: parameter vectors and discrepancies.

        Args:
            count: How many.
            widened: Whether to take `values`; else `drawn`, for what asks the density itself.
        """
        chosen = np.linspace(0, len(self.drawn) - 1, min(count, len(self.drawn))).astype(int)
        return (self.values if widened else self.drawn)[chosen], self.discrepancy[chosen]

    def complete(
        self,
        wi: Float[np.ndarray, "m 3"],
        wo: Float[np.ndarray, "m 3"],
        measurements: Measurements | None = None,
        progress: Progress | None = None,
    ) -> Measurements:
        """What was measured, with more rows for directions that were not: the model, and what it misses nearby.

        Args:
            wi: Unit vectors to the light, of the rows to infer.
            wo: Unit vectors to the sensor.
            measurements: All that was measured, where the fit saw a part of it.
            progress: Called now and then with rows done and expected.

        Returns:
            Measured values unchanged, with σ as it was, NaN where it was unknown; inferred ones marked by `inferred`,
            σ their standard deviation.

        Raises:
            FitmatError: not as many unit vectors above the surface of both, no finite fit, or no likelihood.
        """
        from fitmat.fitting.completing import completed  # loads scipy's optimisers

        for name, w in (("wi", wi), ("wo", wo)):
            found = arguments.numbers(name, w)
            if found.ndim != 2 or found.shape[1] != 3 or not (found[:, 2] > 0).all():
                arguments.refuse(name, w, "unit vectors above the surface, (m, 3)")
            arguments.unit_vectors(name, found)
        if len(wi) != len(wo):
            raise ModelError(f"{len(wi)} rows of wi and {len(wo)} of wo, expected as many.")
        arguments.function("progress", progress)
        pair = np.asarray(wi, float), np.asarray(wo, float)
        return completed(self.fit, self.values, *pair, measurements, progress)

    def table(self) -> pl.DataFrame:
        """The draws as a table: chain (walker), draw (step), each free parameter (and channel), discrepancy."""
        free, s = self._free()
        walker, step = (k.ravel() for k in np.indices(s.shape))
        numbers = {name: part.ravel() for entry, part in free for name, part in self._channels(entry, part)}
        return pl.DataFrame({"chain": walker, "draw": step, **numbers, "discrepancy": s.ravel()})

    def description(self) -> dict[str, str]:
        """What a file of the draws says of them: model, method, verdict, units; seed and burn-in; whether widened."""
        known = {"model": self.fit.name, "method": self.method, "verdict": self.verdict}
        if self.fit.correlation.found:
            known["widened"] = f"{self.fit.n_values} readings count as {self.fit.correlation.independent:.3g}"
        if self.diagnostics is not None:
            known |= {"seed": str(self.diagnostics.seed), "burn_in": str(self.diagnostics.burn_in)}
        units = {e.name: e.param.unit for e in self.fit.entries if e.name not in self.fit.held}
        return known | {"units": json.dumps(units, ensure_ascii=False)}

    def to_arviz(self) -> Any:
        """The draws as ArviZ's data tree: group `posterior`, dimensions chain (walker) and draw (step).

        Raises:
            FitmatError: ArviZ is missing.
        """
        arviz = needed("arviz_base", "the posterior in ArviZ's form")
        free, s = self._free()
        variables = {entry.name: part if entry.shape else part[..., 0] for entry, part in free}
        return arviz.from_dict({"posterior": variables | {"discrepancy": s}}, attrs={"posterior": self.description()})

    def save(self, path: str | Path) -> None:
        """Write the draws, in physical units.

        Args:
            path: `.parquet` holds `table`, and `description` as its metadata; `.nc` is ArviZ's netCDF.

        Raises:
            FitmatError: the suffix is another, or a package is missing.
            OSError: the file cannot be written.
        """
        path = Path(path)
        if path.suffix not in (".parquet", ".nc"):
            raise OutputError(f"{path}: draws are written to .parquet or .nc; end the name with one of these.")
        # HDF5 crashes the process where the disk is full, so that Python writes the file.
        memory = io.BytesIO()
        if path.suffix == ".nc":
            needed("h5netcdf", f"writing {path.name}")
            self.to_arviz().to_netcdf(memory, engine="h5netcdf")
        else:
            self.table().write_parquet(memory, metadata=self.description())
        path.write_bytes(memory.getvalue())

    def _free(self) -> tuple[list[tuple[Entry, np.ndarray]], np.ndarray]:
        """Free parameters with their draws, (chains, draws, size), and s, (chains, draws)."""
        free = [e for e in self.fit.entries if e.name not in self.fit.held]
        steps = (len(self.values), 1) if self.chain is None else self.chain.shape[:2]
        values = np.swapaxes(self.values.reshape(*steps, -1), 0, 1)
        return [(e, values[..., e.place]) for e in free], self.discrepancy.reshape(steps).T

    def _channels(self, entry: Entry, part: np.ndarray) -> list[tuple[str, np.ndarray]]:
        """The draws of a parameter channel by channel, each with its name."""
        return list(zip(channel_names(entry, self.fit.measurements.channels), np.moveaxis(part, -1, 0), strict=True))
