"""Faulty objects for the fuzz suite: dicts, frames and xarray datasets with arrays of odd types, shapes and values.

It reads and judges nothing (`fuzz` does).
"""

import datetime
import decimal
from collections.abc import Callable
from typing import Any

import numpy as np
import pandas as pd
import polars as pl
import xarray as xr

Make = Callable[[np.random.Generator, int], Any]

NAMES = (
    *("theta_i", "theta_o", "phi", "phi_i", "phi_o", "brdf", "brdf_r", "brdf_g", "brdf_550", "value", "brdf_cos"),
    *("signal", "reference", "sigma", "wavelength", "channel", "valid", "flag", "reflectance_factor"),
    *("panel_ratio", "", " ", "a\nb", "θ_i", "\u2028", "x" * 300, "brdf (1/sr)", "\x1b[2J", "%s", "{0}", "../x"),
)
ODD = (np.nan, np.inf, -np.inf, 1e308, -1e308, 5e-324, -0.0, 0.0, -1.0, 90.0, 180.0, 400.0)
TEXT = ("", "nan", "1", "1,5", "−3", "1e999", "x", "true", "\x00", "١٢", "a\nb", "1" * 500, " 2 ", "\ud800", "NaT")


def _angles(rng: np.random.Generator, n: int) -> np.ndarray:
    return rng.uniform(0, 89, n)


def _odd(rng: np.random.Generator, n: int) -> np.ndarray:
    found = rng.uniform(0, 89, n)
    found[rng.random(n) < 0.4] = rng.choice(ODD)
    return found


def _text(rng: np.random.Generator, n: int) -> np.ndarray:
    return np.array([TEXT[k] for k in rng.integers(len(TEXT), size=n)])


def _objects(rng: np.random.Generator, n: int) -> np.ndarray:
    choices = [
        1,
        2.5,
        None,
        "3",
        True,
        1 + 2j,
        b"4",
        10**400,
        decimal.Decimal("5"),
        datetime.date(2026, 1, 1),
        [1],
        (),
        {},
        np.nan,
    ]
    found = np.empty(n, object)
    found[:] = [choices[k] for k in rng.integers(len(choices), size=n)]
    return found


def _masked(rng: np.random.Generator, n: int) -> Any:
    return np.ma.array(_odd(rng, n), mask=rng.random(n) < 0.5)


def _typed(rng: np.random.Generator, n: int) -> np.ndarray:
    kinds = ("i1", "u8", "i8", ">f8", "f2", "f4", "g", "c8", "c16", "?", "S3", "U3", "M8[D]", "m8[s]", "V4", "O", ">i2")
    with np.errstate(all="ignore"):
        return rng.integers(0, 90, n).astype(kinds[rng.integers(len(kinds))])


def _shaped(rng: np.random.Generator, n: int) -> Any:
    made = (
        np.float64(3.0),
        np.ones((n, 1)),
        np.ones((1, n)),
        np.ones((n, 2, 2)),
        [[1.0], [2.0, 3.0]],
        None,
        "30",
        7,
        (),
    )
    return made[rng.integers(len(made))]


def _listed(rng: np.random.Generator, n: int) -> Any:
    made = (
        list(rng.uniform(0, 80, n)),
        range(n),
        pd.Series(_odd(rng, n)),
        pl.Series(_odd(rng, n)),
        iter(range(n)),
        {1, 2},
    )
    return made[rng.integers(len(made))]


def _strided(rng: np.random.Generator, n: int) -> np.ndarray:
    wide = rng.uniform(0, 89, 3 * n)
    return (wide[::3], wide[:n][::-1], np.broadcast_to(wide[:1], (n,)))[rng.integers(3)]


def _record(rng: np.random.Generator, n: int) -> np.ndarray:
    return np.zeros(n, [("a", float), ("b", int)])


MAKERS: tuple[Make, ...] = (_odd, _text, _objects, _masked, _typed, _shaped, _listed, _strided, _record)


def _column(rng: np.random.Generator, n: int) -> Any:
    if rng.integers(3):
        return _angles(rng, n)
    return MAKERS[rng.integers(len(MAKERS))](rng, n if rng.integers(20) else int(rng.integers(0, 9)))


def _dict(rng: np.random.Generator) -> dict[Any, Any]:
    n = int(rng.integers(0, 9)) if rng.integers(10) == 0 else int(rng.integers(1, 9))
    names = [*NAMES[:2], *([NAMES[5]] if rng.integers(5) else [])]
    names += [NAMES[k] for k in rng.integers(len(NAMES), size=rng.integers(0, 4))]
    found: dict[Any, Any] = {name: _column(rng, n) for name in names}
    if rng.integers(30) == 0:
        found[(None, 3, b"x", ("a", 1))[rng.integers(4)]] = _angles(rng, n)
    if rng.integers(20) == 0:
        del found[names[rng.integers(len(names))]]
    return found


def arrays(rng: np.random.Generator) -> Any:
    """A dict of arrays, or a pandas or polars frame where one can be made of it."""
    found, kind = _dict(rng), rng.integers(4)
    if kind < 2:
        return found
    try:
        return _turned(pd.DataFrame(found), rng) if kind == 2 else pl.DataFrame(found)
    except Exception:
        return found


def _turned(frame: pd.DataFrame, rng: np.random.Generator) -> pd.DataFrame:
    """The frame, at times with rows for columns, a column as its index, or every name twice."""
    made = (frame.T, frame.set_index(frame.columns[0]), pd.concat([frame, frame], axis=1))
    return made[rng.integers(3)] if rng.integers(10) == 0 else frame


def labelled(rng: np.random.Generator) -> Any:
    """An xarray Dataset or DataArray on a small grid; of odd types, names and dimensions where one can be made."""
    dims = [
        "theta_i",
        "theta_o",
        *(["phi"] if rng.integers(2) else []),
        *(["wavelength"] if rng.integers(3) == 0 else []),
    ]
    dims += [str(rng.choice(["channel", "x", "theta", "sigma", "brdf"]))] if rng.integers(4) == 0 else []
    sizes = {dim: int(rng.integers(1, 4)) if rng.integers(12) else 0 for dim in dims}
    coords: dict[str, Any] = {}
    for dim, size in sizes.items():
        if rng.integers(8):
            fault = MAKERS[rng.integers(4)] if rng.integers(6) == 0 else _angles
            coords[dim] = (dim, fault(rng, size))
    if rng.integers(6) == 0:
        coords[NAMES[rng.integers(len(NAMES))]] = float(rng.choice(ODD))
    fault = MAKERS[rng.integers(4)] if rng.integers(5) == 0 else _angles
    total = int(np.prod(list(sizes.values())))
    try:
        values = np.asarray(fault(rng, total)).reshape(tuple(sizes.values()))
        name = NAMES[rng.integers(len(NAMES))] if rng.integers(5) == 0 else "brdf"
        one = xr.DataArray(values, coords=coords, dims=dims, name=None if rng.integers(20) == 0 else name)
        if rng.integers(2):
            return one
        data: dict[str, Any] = {name: one}
        if rng.integers(3) == 0:
            data[NAMES[rng.integers(len(NAMES))]] = (dims[:1], _column(rng, sizes[dims[0]]))
        made = xr.Dataset(data)
        return made.stack(point=dims[:2]) if rng.integers(8) == 0 else made
    except Exception:
        return xr.Dataset({"brdf": ("n", _angles(rng, 3))}, {"theta_i": ("n", _angles(rng, 3)), "theta_o": 30.0})
