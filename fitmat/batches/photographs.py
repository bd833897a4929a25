"""Photographs: linear pictures of a flat sample under one light each, and the table of the lights, as an atlas.

The pictures lie upon each other, pixel by pixel. It finds no light, no normal and no lens, and fits nothing.
"""

import dataclasses
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl
from jaxtyping import Float

from fitmat.batches.atlas import Atlas
from fitmat.errors import ReadError
from fitmat.extras import needed
from fitmat.maths.directions import directions
from fitmat.measurements.parsing.angles import DOUBTFUL
from fitmat.measurements.samples import default_channels
from fitmat.text import brief, visible

TABLE = ".csv"
"""How the name of a table of lights ends."""

COLUMNS = ("picture", "theta_i", "phi_i", "irradiance")
"""Columns that a table of lights must have."""

CAMERA = ("theta_o", "phi_o")
"""Columns that it may have, 0 if not: where the camera is."""

LAYERS = (("R", "G", "B"), ("Y",))
"""Channels of a picture, in the order of preference."""


@dataclasses.dataclass(frozen=True, eq=False)
class Stack:
    """Pictures as an array of BRDF values, (rows, columns, n, c), computed where it is sliced.

    Attributes:
        pictures: n arrays of radiances as they are in the files, (c, rows, columns).
        factor: What makes radiances values of the BRDF, 1/(E cosθ_i) in sr⁻¹ per unit of radiance, (n,).
    """

    pictures: tuple[np.ndarray, ...]
    factor: Float[np.ndarray, " n"]

    __repr__ = brief

    @property
    def shape(self) -> tuple[int, ...]:
        """As of a NumPy array."""
        count, *size = self.pictures[0].shape
        return *size, len(self.pictures), count

    @property
    def dtype(self) -> Any:
        """As of a NumPy array."""
        return np.dtype(float)

    def __getitem__(self, part: slice, /) -> Float[np.ndarray, "r w n c"]:
        """Some of the rows; NaN where a radiance is not finite."""
        pairs = zip(self.pictures, self.factor, strict=True)
        found = np.stack([picture[:, part].astype(float) * factor for picture, factor in pairs])
        found[~np.isfinite(found)] = np.nan
        return found.transpose(2, 3, 0, 1)


def read_photographs(table: Path) -> Atlas:
    """Pictures as an atlas, f = L/(E cosθ_i).

    Args:
        table: CSV with the columns `picture`, an OpenEXR file relative to the table's folder; `theta_i` and `phi_i`,
            degrees, where its light is, far away, phi from the right side of the picture towards its upper one; and
            `irradiance` E of a surface that faces the light, in radiances of the picture times sr: π L of white that
            faces it. If need be `theta_o` and `phi_o` of the camera, which is above the sample if not.

    Raises:
        FitmatError: the table or a picture cannot be read, a number is not possible, or pictures do not fit together;
            the package OpenEXR is missing.
    """
    try:
        rows = pl.read_csv(table, comment_prefix="#")
    except (OSError, pl.exceptions.PolarsError) as error:
        first = str(getattr(error, "strerror", None) or error).partition("\n")[0]
        expected = f"Write CSV with the columns {', '.join(COLUMNS)}."
        raise ReadError(f"{table}: no table of lights can be read ({visible(first)}). {expected}") from error
    odd = sorted(set(rows.columns) - {*COLUMNS, *CAMERA})
    if odd or not set(COLUMNS) <= set(rows.columns) or not len(rows):
        got = f"a column {visible(odd[0])!r}" if odd else f"columns {', '.join(map(visible, rows.columns))}"
        got = got if len(rows) else "no row"
        raise ReadError(f"{table}: {got}, expected {', '.join(COLUMNS)}, and if need be {' and '.join(CAMERA)}.")
    told = {name: _numbers(table, rows, name) for name in (*COLUMNS[1:], *CAMERA)}
    _refuse_impossible(table, told)
    pictures, layers = zip(*(_picture(table, name) for name in rows["picture"].to_list()), strict=True)
    for name, picture, layer in zip(rows["picture"], pictures, layers, strict=True):
        if (picture.shape, layer) != (pictures[0].shape, layers[0]):
            got, expected = (
                f"{of.shape[2]} × {of.shape[1]} pixels of {', '.join(what)}"
                for of, what in ((picture, layer), (pictures[0], layers[0]))
            )
            first = visible(str(rows["picture"][0]))
            raise ReadError(
                f"{table.parent / name}: {got}, expected {expected} as in {first}: they lie upon each other."
            )
    factor = 1.0 / (told["irradiance"] * np.cos(np.deg2rad(told["theta_i"])))
    wi, wo = (directions(told[f"theta_{end}"], told[f"phi_{end}"], degrees=True) for end in ("i", "o"))
    return Atlas(str(table), Stack(pictures, factor), None, wi, wo, default_channels(len(layers[0])))


def _numbers(table: Path, rows: pl.DataFrame, name: str) -> Float[np.ndarray, " n"]:
    """A column of finite numbers; 0 where the table has not that of the camera."""
    if name not in rows.columns:
        return np.zeros(len(rows))
    found = rows[name].cast(pl.Float64, strict=False).to_numpy()
    if not np.isfinite(found).all():
        k = int(np.argmin(np.isfinite(found)))
        got = "nothing" if rows[name][k] is None else repr(visible(str(rows[name][k])))
        raise ReadError(f"{table}: row {k + 1}: {name} is {got}, expected a number.")
    return found


def _refuse_impossible(table: Path, told: dict[str, np.ndarray]) -> None:
    """Directions below the horizon, light that is none, and degrees that look like radians."""
    possible = {name: (told[name] >= 0) & (told[name] < 90) for name in ("theta_i", "theta_o")}
    possible["irradiance"] = told["irradiance"] > 0
    for name, fine in possible.items():
        if not fine.all():
            k = int(np.argmin(fine))
            expected = "above 0" if name == "irradiance" else "0 to below 90 degrees"
            raise ReadError(f"{table}: row {k + 1}: {name} is {told[name][k]:g}, expected {expected}.")
    if DOUBTFUL[0] < (most := float(told["theta_i"].max())) <= DOUBTFUL[1]:
        got = f"no theta_i exceeds {most:.3g}, expected degrees; they look like radians"
        raise ReadError(f"{table}: {got}. Convert them.")


def _picture(table: Path, name: Any) -> tuple[np.ndarray, tuple[str, ...]]:
    """Radiances of a picture, (c, rows, columns), and the names of its layers."""
    if not isinstance(name, str):
        raise ReadError(f"{table}: a row without a picture, expected the name of an OpenEXR file in each.")
    path = table.parent / name
    if path.suffix.lower() != ".exr":
        raise ReadError(
            f"{path}: expected an OpenEXR picture (.exr), whose values are linear in radiance. Develop it so."
        )
    reader = needed("OpenEXR", f"{path}: a picture")
    try:
        with reader.File(str(path), separate_channels=True) as file:
            found = {layer: np.array(channel.pixels) for layer, channel in file.channels().items()}
    except (OSError, RuntimeError, ValueError) as error:
        raise ReadError(f"{path}: no picture can be read ({visible(str(error))}). Is it there, and whole?") from error
    layers = next((every for every in LAYERS if set(every) <= found.keys()), None)
    if layers is None or len({found[layer].shape for layer in layers}) > 1:
        got = ", ".join(map(visible, sorted(found))) or "none"
        raise ReadError(f"{path}: channels {got}, expected R, G and B, or Y, each of every pixel.")
    return np.stack([found[layer] for layer in layers]), layers
