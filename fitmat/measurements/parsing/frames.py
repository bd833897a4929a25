"""Frames: a labelled array of the xarray kind → named columns, as `fitmat.read` takes them.

It knows xarray by its shape and never imports it, and it converts no unit.
"""

from collections.abc import Iterator, Mapping
from typing import Any, Protocol, runtime_checkable

import numpy as np

from fitmat.errors import ReadError
from fitmat.measurements.parsing.contents import shown
from fitmat.measurements.parsing.names import VALUES, role
from fitmat.measurements.samples import default_channels


@runtime_checkable
class Labelled(Protocol):
    """An xarray Dataset or DataArray, as far as it is read."""

    @property
    def dims(self) -> Any:
        """Names of the dimensions."""
        ...

    @property
    def coords(self) -> Any:
        """Name → variable of the coordinates."""
        ...


@runtime_checkable
class Several(Labelled, Protocol):
    """An xarray Dataset, as far as it is read."""

    @property
    def data_vars(self) -> Any:
        """Name → variable of the data."""
        ...


def arrays(source: Labelled) -> dict[str, np.ndarray]:
    """One row for each cell of the quantity's dimensions, the last of them fastest; one column for each variable.

    Coordinates (theta_i, theta_o, phi …, wavelength, channel) may be dimensions, lie along some, or be single numbers.
    The quantity is a data variable, or the array, named as a column would be; an array without a name is `value`.
    A dimension `channel` without coordinates gets r, g, b for three, else 1, 2, …

    Raises:
        ReadError: no data, or a variable that cannot be read as an array.
    """
    kind = type(source).__name__
    data = dict(_variables(source.data_vars if isinstance(source, Several) else {_name(source): source}))
    coordinates = dict(_variables(source.coords))
    if not any(np.prod(variable.shape) for variable in data.values()):
        raise ReadError(f"{kind}: no data variable with values, expected one such as brdf. Check how it was made.")
    known = [name for name in data if (found := role(name)) and found.kind in VALUES]
    sizes = {str(dim): size for name in known or data for dim, size in _sizes(data[name]).items()}
    try:
        rows = {
            name: _spread(variable, sizes)
            for name, variable in (coordinates | data).items()
            if _sizes(variable).keys() <= sizes.keys() and not _stacked(variable)
        }
    except (TypeError, ValueError, AttributeError) as error:
        got = f"its variables cannot be read as arrays ({shown(str(error), 200)})"
        raise ReadError(f"{kind}: {got}, expected numbers or texts. Pass a dict of arrays.") from error
    if "channel" in sizes and "channel" not in rows:
        names = np.array(default_channels(sizes["channel"]))
        along = [-1 if dim == "channel" else 1 for dim in sizes]
        rows["channel"] = np.broadcast_to(names.reshape(along), tuple(sizes.values())).ravel()
    return rows


def _variables(named: Mapping[Any, Any]) -> Iterator[tuple[str, Any]]:
    return ((str(name), named[name]) for name in named)


def _name(source: Any) -> str:
    return str(source.name) if source.name is not None else "value"


def _sizes(variable: Any) -> dict[str, int]:
    return {str(dim): size for dim, size in zip(variable.dims, variable.shape, strict=True)}


def _stacked(variable: Any) -> bool:
    """Whether its cells are tuples, as of a multi-index, whose levels are coordinates of their own."""
    return any(isinstance(cell, tuple) for cell in np.asarray(variable.values).flat[:1])


def _spread(variable: Any, sizes: Mapping[str, int]) -> np.ndarray:
    """A variable repeated along the dimensions that it lacks, as one column."""
    own = list(_sizes(variable))
    values = np.asarray(variable.values)
    ordered = values.transpose([own.index(dim) for dim in sizes if dim in own])
    shape = [length if dim in own else 1 for dim, length in sizes.items()]
    return np.broadcast_to(ordered.reshape(shape), tuple(sizes.values())).ravel()
