"""Frames: xarray datasets and arrays give the measurements that the same numbers in a dict give."""

import itertools
from typing import Any

import numpy as np
import pytest
import xarray as xr

from fitmat.errors import ReadError
from fitmat.measurements.parsing import frames
from fitmat.measurements.reader import read

THETA_I, THETA_O, PHI = np.array([10.0, 50.0]), np.array([0.0, 30.0, 80.0]), np.array([0.0, 90.0, 180.0, 250.0])
GRID = {"theta_i": THETA_I, "theta_o": THETA_O, "phi": PHI}


def values(*shape: int) -> np.ndarray:
    return np.random.default_rng(1).uniform(0.1, 1.0, shape)


def same(one: dict[str, np.ndarray], other: dict[str, Any]) -> None:
    """Read both and compare everything."""
    first, second = read(one), read(other)
    for name in ("wi", "wo", "value", "valid", "channels", "masked", "notes"):
        assert np.array_equal(getattr(first, name), getattr(second, name)), name
    assert (first.sigma is None) == (second.sigma is None)
    if first.sigma is not None and second.sigma is not None:
        assert np.array_equal(first.sigma, second.sigma)


def nested(*axes: np.ndarray) -> dict[str, np.ndarray]:
    """Columns of all combinations by a plain loop, the last axis fastest."""
    return dict(zip(GRID, np.array(list(itertools.product(*axes))).T, strict=False))


def test_a_grid_gives_one_row_for_each_combination():
    brdf = values(2, 3, 4)
    array = xr.DataArray(brdf, coords=GRID, dims=list(GRID), name="brdf")
    expected = {**nested(*GRID.values()), "brdf": [brdf[i, o, p] for i in range(2) for o in range(3) for p in range(4)]}
    same(frames.arrays(array), expected)
    same(frames.arrays(array.to_dataset()), expected)
    assert isinstance(array, frames.Labelled)
    assert isinstance(array.to_dataset(), frames.Labelled)


def test_rows_agree_with_those_of_xarray_itself():
    """Oracle: `Dataset.to_dataframe`, whatever the order of the dimensions of each variable."""
    data = xr.Dataset(
        {
            "brdf": (("phi", "theta_i", "theta_o"), values(4, 2, 3)),
            "sigma": (("theta_o", "phi"), values(3, 4)),
            "valid": (("theta_i",), [True, False]),
        },
        coords=GRID,
    )
    table = data.to_dataframe(dim_order=["phi", "theta_i", "theta_o"]).reset_index()
    same(frames.arrays(data), {str(name): table[name].to_numpy() for name in table})


@pytest.mark.parametrize("dimension", ["wavelength", "channel"])
def test_wavelengths_and_channels_become_channels(dimension):
    brdf = values(2, 3, 2)
    labels = [450.0, 650.0] if dimension == "wavelength" else ["b", "a"]
    coords = {"theta_i": THETA_I, "theta_o": THETA_O, dimension: labels}
    array = xr.DataArray(brdf, coords=coords, dims=list(coords), name="brdf")
    measured = read(frames.arrays(array))
    assert measured.channels == (("450", "650") if dimension == "wavelength" else ("b", "a"))
    assert np.array_equal(measured.value, brdf.reshape(6, 2))


def test_a_channel_without_names_gets_the_usual_ones():
    brdf = values(3, 5)
    data = xr.Dataset(
        {"brdf": (("channel", "point"), brdf)},
        coords={"theta_i": 30.0, "theta_o": ("point", np.arange(5.0) * 10), "wavelength_note": "broad"},
    )
    measured = read(frames.arrays(data))
    assert measured.channels == ("r", "g", "b")
    assert np.array_equal(measured.value, brdf.T)
    assert np.rad2deg(measured.theta_i) == pytest.approx(30.0)


def test_a_single_wavelength_is_one_channel_and_nan_is_masked():
    array = xr.DataArray([1.0, np.nan], dims="point", name="reflectance_factor")
    array = array.assign_coords(theta_i=30.0, theta_o=("point", [10.0, 20.0]), wavelength=550.0)
    measured = read(frames.arrays(array))
    assert measured.channels == ("550",)
    assert measured.masked == {"value missing or NaN": 1}


def test_other_variables_do_not_multiply_the_rows():
    data = xr.Dataset(
        {"brdf": (("theta_i", "theta_o"), values(2, 3)), "lamp": (("time",), np.ones(1000))},
        coords={"theta_i": THETA_I, "theta_o": THETA_O, "time": np.arange(1000)},
    )
    assert read(frames.arrays(data)).n_samples == 6


def test_a_stacked_dataset_is_read_by_its_levels():
    array = xr.DataArray(values(2, 3), coords={"theta_i": THETA_I, "theta_o": THETA_O}, name="brdf")
    assert np.array_equal(
        read(frames.arrays(array.stack(point=("theta_i", "theta_o")))).value, read(frames.arrays(array)).value
    )


def test_an_array_without_a_name_must_say_its_quantity():
    array = xr.DataArray(values(2, 3), coords={"theta_i": THETA_I, "theta_o": THETA_O})
    with pytest.raises(ReadError, match="the column value does not say what it holds"):
        read(frames.arrays(array))
    assert read(frames.arrays(array), quantity="brdf").n_valid == 6


@pytest.mark.parametrize("empty", [xr.Dataset(), xr.Dataset(coords=GRID), xr.DataArray(np.zeros((0, 2)), name="brdf")])
def test_no_data_is_refused(empty):
    with pytest.raises(ReadError, match=r"Data\w+: no data variable with values, expected one such as brdf"):
        frames.arrays(empty)


class Broken:
    """Looks like an array and gives no numbers."""

    dims, shape, coords, name, values = ("point",), (2,), {}, "brdf", np.zeros((3, 1))


def test_a_variable_that_is_no_array_is_refused():
    with pytest.raises(ReadError, match="Broken: its variables cannot be read as arrays"):
        frames.arrays(Broken())
