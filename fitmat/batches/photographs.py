"""Photographs: linear pictures of a flat sample under one light each, and the table of the lights, as an atlas.

The pictures lie upon each other, pixel by pixel. It finds no light, no normal and no lens, and fits nothing.
"""

import contextlib
import dataclasses
import io
import os
import warnings
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl
from jaxtyping import Float

from fitmat.batches.atlas import Atlas, refuse_radians
from fitmat.batches.doubts import Pictures, doubts
from fitmat.batches.jobs import read_table
from fitmat.errors import Doubt, ReadError
from fitmat.extras import needed
from fitmat.maths.directions import directions
from fitmat.measurements.samples import default_channels
from fitmat.text import brief, visible

TABLE = ".csv"
"""How the name of a table of lights ends."""

COLUMNS = ("picture", "theta_i", "phi_i", "irradiance")
"""Columns that a table of lights must have."""

CAMERA = ("theta_o", "phi_o")
"""Columns that it may have, 0 if not: where the camera is."""

NOISE, FULL = "sigma", "saturation"
"""Columns that it may have: the standard deviation of the picture's radiances, and at and above which it has none."""

LAYERS = (("R", "G", "B"), ("Y",))
"""Channels of a picture, in the order of preference."""

CHROMA = {"RY", "BY"}
"""Channels beside Y that hold colour."""


@dataclasses.dataclass(frozen=True, eq=False)
class Stack:
    """Pictures as an array of BRDF values, (rows, columns, n, c), computed where it is sliced.

    Attributes:
        pictures: n arrays of radiances as they are in the files, (c, rows, columns).
        factor: What makes radiances values of the BRDF, 1/(E cosθ_i) in sr⁻¹ per unit of radiance, (n,).
        full: Radiances at and above which the camera shows no more, (n,).
    """

    pictures: tuple[np.ndarray, ...]
    factor: Float[np.ndarray, " n"]
    full: Float[np.ndarray, " n"]

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
        """Some of the rows; NaN where a radiance is not finite, or the camera is full."""
        every = zip((picture[:, part] for picture in self.pictures), self.factor, self.full.tolist(), strict=True)
        with np.errstate(over="ignore"):  # in the picture's own precision, which full may exceed
            found = np.stack([np.where(some >= full, np.nan, some.astype(float) * each) for some, each, full in every])
        found[~np.isfinite(found)] = np.nan
        return found.transpose(2, 3, 0, 1)


@dataclasses.dataclass(frozen=True, eq=False)
class Noise:
    """One standard deviation for all values of a picture, as an array of the values' shape.

    Attributes:
        shape: (rows, columns, n, c).
        each: In sr⁻¹, (n,).
    """

    shape: tuple[int, ...]
    each: Float[np.ndarray, " n"]

    __repr__ = brief

    @property
    def dtype(self) -> Any:
        """As of a NumPy array."""
        return self.each.dtype

    def __getitem__(self, part: slice, /) -> Float[np.ndarray, "r w n c"]:
        """Of some of the rows."""
        rows = len(range(*part.indices(self.shape[0])))
        return np.broadcast_to(self.each[:, None], (rows, *self.shape[1:]))


def read_photographs(table: Path) -> Atlas:
    """Pictures as an atlas, f = L/(E cosθ_i), whose noise is that of L, over the same.

    Args:
        table: CSV with the columns `picture`, an OpenEXR file relative to the table's folder; `theta_i` and `phi_i`,
            degrees, where its light is, far away, phi from the right side of the picture towards its upper one; and
            `irradiance` E of a surface that faces the light, in radiances of the picture times sr: π L of white that
            faces it. If need be `theta_o` and `phi_o` of the camera, which is above the sample if not; `sigma`, the
            standard deviation of a picture's radiances; and `saturation`, at and above which they are masked. Lines
            that begin with # are comments.

    Raises:
        FitmatError: the table or a picture cannot be read, a number is not possible, or pictures do not fit together;
            the package OpenEXR is missing.

    Warns:
        Doubt: lights graze the sample, many radiances are below 0, or a picture looks saturated.
    """
    rows = _rows(table)
    names = rows["picture"].to_list()
    for k, name in enumerate(names):
        if name is None:
            raise ReadError(f"{table}: row {k + 1} has no picture, expected the name of an OpenEXR file in each.")
        if name in names[:k]:
            got = f"{visible(name)} stands in rows {names.index(name) + 1} and {k + 1}"
            raise ReadError(f"{table}: {got}, expected a picture of its own in each.")
    known = [name for name in (NOISE, FULL) if name in rows.columns]
    told = {name: _numbers(table, rows, name) for name in (*COLUMNS[1:], *CAMERA, *known)}
    _refuse_impossible(table, told)
    if "phi_o" not in rows.columns and told["theta_o"].any():
        raise ReadError(f"{table}: theta_o without phi_o, expected both: where the camera is.")
    pictures = [_picture(table.parent / name) for name in names]
    for name, picture in zip(names, pictures, strict=True):
        if picture.words != pictures[0].words:
            got = f"{picture.words}, expected {pictures[0].words} as in {visible(names[0])}"
            raise ReadError(f"{table.parent / name}: {got}: they lie upon each other.")
    factor = 1.0 / (told["irradiance"] * np.cos(np.deg2rad(told["theta_i"])))
    wi, wo = (directions(told[f"theta_{end}"], told[f"phi_{end}"], degrees=True) for end in ("i", "o"))
    layers, full = tuple(picture.layers for picture in pictures), told.get(FULL, np.full(len(rows), np.inf))
    for words in doubts(Pictures(table, names, layers, full, told["theta_i"])):
        warnings.warn(words, Doubt, stacklevel=2)
    value = Stack(layers, factor, full)
    noise = Noise(value.shape, told[NOISE] * factor) if NOISE in told else None
    return Atlas(str(table), value, noise, wi, wo, default_channels(value.shape[-1]))


def _rows(table: Path) -> pl.DataFrame:
    """The table as texts without spaces around them, None where there are none; rows of nothing are left out."""
    found = read_table(table, "lights", f"the columns {', '.join(COLUMNS)}", infer_schema=False)
    names = [name.strip() for name in found.columns]
    odd = sorted(set(names) - {*COLUMNS, *CAMERA, NOISE, FULL})
    if odd or not set(COLUMNS) <= set(names) or len(set(names)) < len(names):
        got = f"a column {visible(odd[0])!r}" if odd else f"columns {', '.join(map(visible, names))}"
        more = ", ".join((*CAMERA, NOISE, FULL))
        raise ReadError(f"{table}: {got}, expected {', '.join(COLUMNS)}, and if need be {more}.")
    texts = found.rename(dict(zip(found.columns, names, strict=True))).with_columns(pl.all().str.strip_chars())
    texts = texts.with_columns(pl.all().replace("", None)).filter(~pl.all_horizontal(pl.all().is_null()))
    if not len(texts):
        raise ReadError(f"{table}: no row, expected {', '.join(COLUMNS)} of each picture.")
    return texts


def _numbers(table: Path, rows: pl.DataFrame, name: str) -> Float[np.ndarray, " n"]:
    """A column of finite numbers; 0 where the table has not that of the camera."""
    if name not in rows.columns:
        return np.zeros(len(rows))
    found = rows[name].cast(pl.Float64, strict=False).fill_null(np.nan).to_numpy()
    if not np.isfinite(found).all():
        k = int(np.argmin(np.isfinite(found)))
        got = "nothing" if rows[name][k] is None else repr(visible(str(rows[name][k])))
        raise ReadError(f"{table}: row {k + 1}: {name} is {got}, expected a number.")
    return found


def _refuse_impossible(table: Path, told: dict[str, np.ndarray]) -> None:
    """Directions that are none, or below the horizon, light or noise that is none, and degrees like radians."""
    possible = {name: (told[name] >= 0) & (told[name] < 90) for name in ("theta_i", "theta_o")}
    possible |= {name: np.abs(told[name]) <= 360 for name in ("phi_i", "phi_o")}
    with np.errstate(over="ignore", divide="ignore"):
        possible["irradiance"] = (told["irradiance"] > 0) & np.isfinite(1.0 / told["irradiance"])
    possible |= {name: told[name] > 0 for name in (NOISE, FULL) if name in told}
    expected: dict[str, str] = dict.fromkeys(("irradiance", NOISE, FULL), "above 0")
    expected |= dict.fromkeys(("phi_i", "phi_o"), "-360 to 360 degrees")
    for name, fine in possible.items():
        if not fine.all():
            k = int(np.argmin(fine))
            what = expected.get(name, "0 to below 90 degrees")
            raise ReadError(f"{table}: row {k + 1}: {name} is {told[name][k]:g}, expected {what}.")
    refuse_radians(table, "theta_i", [told["theta_i"]], "Convert them.")


@dataclasses.dataclass(frozen=True, eq=False)
class _Picture:
    """A picture; what must be the same of all is in words.

    Attributes:
        layers: Radiances, (c, rows, columns).
        words: Its size, its place in the window of the lens, and its channels.
    """

    layers: np.ndarray
    words: str

    __repr__ = brief


def _picture(path: Path) -> _Picture:
    if path.suffix.lower() != ".exr":
        raise ReadError(
            f"{path}: expected an OpenEXR picture (.exr), whose values are linear in radiance. Develop it so."
        )
    if not path.is_file():
        raise ReadError(f"{path}: no such file, expected a picture of the table.")
    reader = needed("OpenEXR", f"{path}: a picture")
    try:
        with _unheard(), reader.File(str(path), separate_channels=True) as file:
            parts, (corner, _) = len(file.parts), file.header()["dataWindow"]
            found = {layer: np.array(channel.pixels) for layer, channel in file.channels().items()}
    except (OSError, RuntimeError, ValueError) as error:
        raise ReadError(f"{path}: no picture can be read ({visible(str(error))}). Is it whole?") from error
    if parts > 1:
        raise ReadError(f"{path}: {parts} pictures in one file, expected one. Write each into a file of its own.")
    layers = next((every for every in LAYERS if set(every) <= found.keys()), None)
    if layers is None or len({found[layer].shape for layer in layers}) > 1 or found.keys() & CHROMA:
        got = ", ".join(map(visible, sorted(found))) or "none"
        raise ReadError(f"{path}: channels {got}, expected R, G and B, or Y alone, each of every pixel.")
    every = np.stack([found[layer] for layer in layers])
    if (alpha := found.get("A")) is not None:
        every = np.where(alpha < 1.0, np.nan, every)
    corner = " × ".join(str(int(at)) for at in corner)
    return _Picture(every, f"{every.shape[2]} × {every.shape[1]} pixels of {', '.join(layers)} from {corner} on")


@contextlib.contextmanager
def _unheard() -> Iterator[None]:
    """Nothing is printed of what OpenEXR says of damaged files, by Python and by itself; it has no option for that."""
    with contextlib.redirect_stdout(io.StringIO()), open(os.devnull, "w") as nowhere:
        stderr = os.dup(2)
        try:
            os.dup2(nowhere.fileno(), 2)
            yield
        finally:
            os.dup2(stderr, 2)
            os.close(stderr)
