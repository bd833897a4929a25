"""Result: what a run left on disk, read back: every model with its values, its intervals and its draws.

It holds no measurements: what asks for these begins with the study itself. Nothing is fitted here.
"""

import dataclasses
import functools
import json
import os
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import equinox as eqx
import numpy as np
import polars as pl
from jaxtyping import Float

from fitmat import arguments
from fitmat.errors import ModelError, ReadError
from fitmat.fitting.coordinates import channel_names
from fitmat.fitting.dispersed import dispersed, located
from fitmat.fitting.quantities import Quantity, dataframe, named
from fitmat.models.base import AbstractBRDF
from fitmat.models.parameters import entries, vector, with_vector
from fitmat.models.registry import LOBES, lobe_names
from fitmat.models.registry import model as built
from fitmat.text import brief, visible

FORMAT = 1
"""Of the record; it grows when what an older one says would be misread."""

RECORD, POSTERIOR, FIGURES = "fit.json", "posterior-{}.parquet", "figures.json"
"""Files of a run: the record, the draws of each model, and what a page draws."""

BATCH = "batch.json"
"""The record in the folder of a batch, which has no runs."""

DRAWN = 1
"""Format of the figures; it grows when what older ones say would be misread."""

FIXED = "fixed"
"""Remark on a parameter that was held."""


@dataclasses.dataclass(frozen=True, eq=False)
class Fitted:
    """One model of a result.

    Attributes:
        name: The model's.
        model: With the best parameters, on its tilted mount where that was fitted, and without the instrument.
        channels: Names of its channels.
        parameters: As the report says them, those of instrument and noise and the discrepancy included.
        result: How the fit ended, a key of `fitting.concluding.RESULTS`.
        verdict: How far the draws can be trusted, a key of `uncertainty.diagnostics.VERDICTS`.
        doubts: What speaks against the intervals, as sentences.
        file: Where the draws lie.
    """

    name: str
    model: AbstractBRDF
    channels: tuple[str, ...]
    parameters: tuple[Quantity, ...]
    result: str
    verdict: str
    doubts: tuple[str, ...]
    file: Path

    __repr__ = brief

    def __getitem__(self, name: str) -> Quantity:
        """One of the `parameters`.

        Raises:
            ModelError: the model has none of that name.
        """
        return named(self.parameters, name, self.name)

    def __iter__(self) -> Iterator[str]:
        return (q.name for q in self.parameters)

    def to_dataframe(self) -> pl.DataFrame:
        """The parameters as a table, one row for each and each channel."""
        return dataframe(self.parameters, self.name, self.channels)

    @functools.cached_property
    def draws(self) -> Float[np.ndarray, "m p"]:
        """Parameter vectors of `model` from the posterior, as `parameters.vector` has them, held ones included.

        Raises:
            ReadError: the file of draws is not there, cannot be read, or lacks a parameter.
        """
        try:
            table = pl.read_parquet(self.file)
        except (OSError, pl.exceptions.PolarsError) as error:
            raise ReadError(f"{self.file}: the draws cannot be read ({_first_line(error)}). Fit again.") from error
        held = {q.name for q in self.parameters if FIXED in q.remarks}
        found = np.tile(np.asarray(vector(self.model), float), (len(table), 1))
        for entry in entries(self.model):
            if entry.name in held:
                continue
            for k, name in enumerate(channel_names(entry, self.channels)):
                if name not in table.columns:
                    raise ReadError(f"{self.file} has no draws of {name!r}: it is of another run. Fit again.")
                found[:, entry.place.start + k] = table[name].to_numpy()
        return found


@dataclasses.dataclass(frozen=True, eq=False)
class Result:
    """What a run left on disk.

    Attributes:
        file: The record.
        record: All that it says, as JSON types.
        fits: Every model that has values, in the order of the run.
    """

    file: Path
    record: Mapping[str, Any]
    fits: tuple[Fitted, ...]

    __repr__ = brief

    @property
    def source(self) -> str:
        """The name of the measurements."""
        return str(self.record["file"])

    def fitted(self, name: str | None = None) -> Fitted:
        """The model of that name, or the one that the data prefer.

        Raises:
            ModelError: no such model has values here; or none is named, there are several, and none is preferred.
        """
        by_name = {one.name: one for one in self.fits}
        if name is not None and name in by_name:
            return by_name[name]
        listed = ", ".join(by_name)
        if name is not None or not by_name:
            every = [str(fit["model"]) for fit in self.record["fits"]]
            why = " it ended without values" if name in every or name is None else f" it has {listed}"
            raise ModelError(f"{self.file}: no values of {name or 'any model'}, expected one of its models;{why}.")
        ranked = [str(c["model"]) for c in (self.record["choice"] or {"candidates": []})["candidates"]]
        best = next((one for one in ranked if one in by_name), None)
        if best is None and len(by_name) > 1:
            raise ModelError(f"{self.file} prefers none of its models, expected the name of one: {listed}.")
        return by_name[best] if best is not None else self.fits[0]


def load(folder: str | os.PathLike[str]) -> Result:
    """What a run left on disk: its models with their values, intervals and draws, and all that its report says.

    Args:
        folder: Of `fitmat fit` or `fitmat.report`, or the `fit.json` in it.

    Raises:
        ReadError: there is no record, it is damaged, or of another format than this version's.

    Example:
        >>> load("run1").fitted("lambert+ggx").model  # doctest: +SKIP
    """
    arguments.kind("folder", folder, str, os.PathLike)
    path = Path(folder)
    file = path / RECORD if path.is_dir() else path
    record = _read(file)
    try:
        if lacking := sorted({"file", "choice"} - record.keys()):
            raise KeyError(lacking[0])
        return Result(file, record, tuple(_fits(record, file.parent)))
    except ModelError as error:
        raise ReadError(f"{file} is damaged: {error} Fit again.") from error
    except (KeyError, TypeError, ValueError, AttributeError) as error:
        what = f"no {error}" if isinstance(error, KeyError) else _first_line(error)
        raise ReadError(f"{file} is damaged ({what}), expected what `fitmat fit` writes. Fit again.") from error


def drawn(result: Result) -> dict[str, Any]:
    """What a page draws of a run.

    Raises:
        ReadError: it is not there, is damaged, or of another format than this version's.
    """
    file = result.file.with_name(FIGURES)
    try:
        found = json.loads(file.read_text(encoding="utf-8"))
        got = found["format"]
    except OSError as error:
        why = f"{error.strerror or error}; the run is older than pages that can be made again"
        raise ReadError(f"{file}: {why}. Fit again.") from error
    except (ValueError, RecursionError, LookupError, TypeError) as error:
        raise ReadError(f"{file} is damaged ({_first_line(error)}), expected what is drawn. Fit again.") from error
    if got != DRAWN:
        raise ReadError(f"{file} is of format {json.dumps(got)[:20]}, expected {DRAWN}. Fit again with this version.")
    return found


def masking(model: AbstractBRDF) -> str | None:
    """What `fitmat.model` is told so that a model is built as it is; None where each lobe keeps its own."""
    chosen = set(_maskings(model))
    return chosen.pop() if len(chosen) == 1 and _can_choose(model.name) else None


def _can_choose(name: str) -> bool:
    return any(LOBES[part].has_masking for part in lobe_names(name))


def _maskings(module: eqx.Module) -> Iterator[str]:
    for field in dataclasses.fields(module):
        value = getattr(module, field.name)
        if field.name == "masking":
            yield value
        for part in value if isinstance(value, tuple) else (value,):
            if isinstance(part, eqx.Module):
                yield from _maskings(part)


def _read(file: Path) -> dict[str, Any]:
    """The record of a run in this version's format."""
    if not file.exists() and (file.parent / BATCH).exists():
        got = f"{file.parent} is the folder of a batch, which keeps one table (or arrays) of all, and no runs"
        remedy = "Fit the file that you mean by itself, fitmat fit FILE --out DIR, and give that folder"
        raise ReadError(f"{got}; expected the folder of a run. {remedy}.")
    try:
        found = json.loads(file.read_text(encoding="utf-8"))
    except OSError as error:
        raise ReadError(f"{file}: {error.strerror or error}; expected the folder of a run, with {RECORD}.") from error
    except (ValueError, RecursionError) as error:
        if file.name != RECORD:
            expected = "expected the folder that `fitmat fit` wrote. If it holds measurements, fit them first."
            raise ReadError(f"{file} is no record of a run, {expected}") from error
        raise ReadError(f"{file} is damaged ({_first_line(error)}), expected the JSON of a run. Fit again.") from error
    if not isinstance(found, dict) or not {"fitmat", "fits"} <= found.keys():
        raise ReadError(f"{file} is no record of a run, expected what `fitmat fit` writes as {RECORD}.")
    if (got := found.get("format")) != FORMAT or isinstance(got, bool):
        which = "of no format" if got is None else f"of format {json.dumps(got)[:20]}"
        by, command = visible(str(found["fitmat"])[:20]), found.get("command")
        again = f": {visible(command)}" if isinstance(command, str) else "."
        raise ReadError(
            f"{file} was written by another version (fitmat {by}) and is {which}, expected format {FORMAT}. "
            f"Fit the measurements again with this version{again}"
        )
    return found


def _fits(record: Mapping[str, Any], folder: Path) -> Iterator[Fitted]:
    channels = tuple(str(name) for name in record["channels"])
    for fit in record["fits"]:
        name, told = str(fit["model"]), fit["parameters"]
        lobes = lobe_names(name)
        known = {key for part in lobes for key in LOBES[part].defaults()}
        values = {key: q["value"] for key, q in told.items() if key.rpartition(".")[2] in known}
        if any(one is None for value in values.values() for one in np.ravel(np.array(value, object))):
            continue
        model = located(built(name, masking=fit["masking"], **values), channels)
        if (law := fit.get("dispersion")) is not None:
            model = dispersed(model, law, channels)
            numbers = [np.ravel(told[e.name]["value"]) for e in entries(model) if e.name in told]
            model = with_vector(model, np.concatenate(numbers).astype(float))
        if missing := [entry.name for entry in entries(model) if entry.name not in told]:
            raise ValueError(f"no value of {missing[0]}")
        meant = {entry.name: entry.param.doc for entry in entries(model)}
        parameters = tuple(_quantity(key, q, meant.get(key, "")) for key, q in told.items())
        ended, verdict = str(fit["result"]), str(fit["posterior"]["verdict"])
        file = folder / POSTERIOR.format(name)
        yield Fitted(name, model, channels, parameters, ended, verdict, tuple(map(str, fit["doubts"])), file)


def _quantity(name: str, told: Mapping[str, Any], doc: str) -> Quantity:
    """A quantity as the record has it; what is null there is NaN."""
    per_channel = isinstance(told["value"], list)
    value, sd, ci95 = (np.array(told[key], float) for key in ("value", "sd", "ci95"))
    remarks = told["remark"] if per_channel else [told["remark"]]
    return Quantity(
        *(name, str(told["symbol"]), str(told["unit"]), doc),
        np.atleast_1d(value),
        np.broadcast_to(sd, np.shape(np.atleast_1d(value))),
        np.reshape(ci95, (-1, 2)),
        per_channel=per_channel,
        remarks=tuple(map(str, remarks)),
    )


def _first_line(error: Exception) -> str:
    return str(getattr(error, "strerror", None) or error).partition("\n")[0]
