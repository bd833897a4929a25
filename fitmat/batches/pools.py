"""Pools: a parameter of all files of a batch, pooled: its columns in the rows, and what the files tell of it together.

It fits nothing, and reads only what the rows say.
"""

from collections.abc import Collection, Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from fitmat.batches.jobs import Job
from fitmat.errors import ModelError
from fitmat.fitting import asking, pooling
from fitmat.fitting.quantities import BOUND
from fitmat.models.parameters import Param, entries
from fitmat.models.registry import model
from fitmat.studies.plan import named, wants_all

ENDINGS = "_pooled", "_pooled_sd", "_pooled_low", "_pooled_high"
"""Of the columns, after the name of the parameter."""

Row = dict[str, Any]
Done = Mapping[int, list[Row]]
"""Place of a job → its rows."""


def refuse_idle(names: Sequence[str], jobs: Sequence[Job], told: Mapping[str, Any]) -> None:
    """Stop before anything is fitted where nothing could be pooled.

    Args:
        names: Of the parameters.
        jobs: All of them.
        told: Arguments of `fitmat.study` for every file.

    Raises:
        ModelError: a parameter is held, has a prior, or no model has it; or there are too few files.
    """
    if not names:
        return
    asking.refuse_idle("pool", names, len(jobs), "file", told.get("fixed") or (), told.get("priors") or ())
    asked = [job.studying["models"] for job in jobs]
    if not any(wants_all(one) for one in asked) and not (told.get("dispersion") or told.get("tilt")):
        _refuse_foreign(names, dict.fromkeys(name for one in asked for name in _known(one)))


def _known(asked: Any) -> list[str]:
    """The models of a job; one that names no model is a row that says so."""
    try:
        return named(asked)
    except ModelError:
        return []


def _refuse_foreign(names: Sequence[str], models: Collection[str]) -> None:
    if models:
        asking.refuse_foreign("pool", names, {of: _parameters(of) for of in models})


def _parameters(of: str) -> dict[str, Param]:
    return {entry.name: entry.param for entry in entries(model(of))}


def pool_rows(names: Sequence[str], done: Done) -> tuple[dict[int, list[Row]], tuple[pooling.Pooled, ...]]:
    """The rows with the columns NAME_pooled, NAME_pooled_sd, _low and _high; and each parameter of each model, pooled.

    Jobs of the same rows are one file, which counts once.

    Raises:
        ModelError: no model that was fitted has a parameter.
    """
    every = {id(row): row for found in done.values() for row in found if row.get("model")}
    models = dict.fromkeys(row["model"] for row in every.values())
    _refuse_foreign(names, models)
    more: dict[int, Row] = {}
    told = []
    for of in models:
        those = {key: row for key, row in every.items() if row["model"] == of}
        for label, param in _labels(names, of, those.values()):
            low, high = np.array([_ends(row, label) for row in those.values()]).T
            found = pooling.pooled(f"{label} of {of}", param, low, high)
            told.append(found)
            for k, key in enumerate(those):
                if np.isfinite(found.value[k]):
                    numbers = found.value[k], found.sd[k], *found.ci95[k]
                    columns = zip(ENDINGS, map(float, numbers), strict=True)
                    more[key] = {**more.get(key, {}), **{f"{label}{end}": number for end, number in columns}}
    return {k: [{**row, **more.get(id(row), {})} for row in found] for k, found in done.items()}, tuple(told)


def _labels(names: Sequence[str], of: str, those: Collection[Row]) -> Iterator[tuple[str, Param]]:
    """The columns of each parameter, one for each channel where every channel has its own."""
    known = _parameters(of)
    for name in names:
        columns = dict.fromkeys(column for row in those for column in row if f"{column}_low" in row)
        for label in columns:
            if name in known and (label == name or label.startswith(f"{name} ")):
                yield label, known[name]


def _ends(row: Row, label: str) -> tuple[float, float]:
    """The interval of a file that takes part; NaN of one that is held or on a bound."""
    low, high, remark = (row.get(f"{label}{end}") for end in ("_low", "_high", "_remark"))
    if low is None or high is None or remark == "fixed" or str(remark).endswith(BOUND):
        return np.nan, np.nan
    return low, high
