"""Material files of the RGL-EPFL database (`.bsdf`), RGB or spectral: their own grid as measurements, and as a model.

It resamples nothing: a row is a number of the file, at the directions that the published evaluation code gives it.
"""

import os
from collections.abc import Mapping

import numpy as np
import polars as pl

from fitmat.errors import ReadError
from fitmat.measurements.parsing import contents, tensor
from fitmat.measurements.parsing.recording import HORIZON, Recording
from fitmat.measurements.parsing.tensor import claims as claims
from fitmat.measurements.warped_grid import Nodes, RGLMaterial, Warp

RANKS = {"theta_i": 1, "phi_i": 1, "ndf": 2, "sigma": 2, "vndf": 4, "luminance": 4}
"""Fields of float32 that every material has → number of dimensions."""

_BYTES = ("description", "jacobian")
_ROUNDING = 1e-3
_TEXT = 200
_DIGITS = 5
# Of directions: neighbours of a grid are further apart, roundings of float32 are not.

_BELOW = "node of the file's grid whose direction is at or below the horizon"
_EMPTY = "incidence at which the file's distribution of visible normals is zero"
_DARK = "node that the file marks as not measured (luminance 0)"
_TWICE = "node in the direction of an earlier one: its half vector is the normal, or its azimuth has come full circle"
_NO_AREA = "incidence at which the file's projected area sigma is zero"


def load(path: str | os.PathLike[str]) -> Recording:
    """The nodes of a material file, one row for each, in f_r.

    Raises:
        ReadError: it is no tensor file, or its arrays are not those of a material.
    """
    source = contents.name(path)
    fields = tensor.parsed(contents.contents(path), source)
    made = _build(fields, source)
    nodes = made.nodes()
    shape = nodes.value.shape
    doubts = {
        _EMPTY: nodes.empty,
        _BELOW: nodes.wo[:, 2] <= HORIZON,
        _NO_AREA: nodes.unseen,
        _DARK: fields["luminance"].reshape(-1) == 0,
    }
    doubts[_TWICE] = _again(nodes, ~np.logical_or.reduce([*doubts.values()]))
    return Recording(
        source=source,
        wi=nodes.wi,
        wo=nodes.wo,
        value=nodes.value,
        quantity="brdf",
        channels=made.channels,
        doubts={reason: np.broadcast_to(bad[:, None], shape) for reason, bad in doubts.items() if bad.any()},
        notes=tuple(_notes(made)),
    )


def _again(nodes: Nodes, usable: np.ndarray) -> np.ndarray:
    """Which usable nodes have the directions of an earlier one, (n,): they are one measurement."""
    places = np.round(np.concatenate([nodes.wi, nodes.wo], axis=1)[usable], _DIGITS) + 0.0
    found = np.zeros(len(usable), bool)
    found[usable] = ~pl.DataFrame(places).select(first=pl.struct(pl.all()).is_first_distinct())["first"].to_numpy()
    return found


def material(path: str | os.PathLike[str]) -> RGLMaterial:
    """The material of a file, to be evaluated for any directions.

    Raises:
        ReadError: it is no tensor file, or its arrays are not those of a material.
    """
    source = contents.name(path)
    return _build(tensor.parsed(contents.contents(path), source), source)


def _notes(made: RGLMaterial) -> list[str]:
    """What the rows are, by which conventions."""
    slices, height, width, _ = made.values.shape
    azimuths = "isotropic" if made.isotropic else f"{len(made.phi_i)} azimuths of incidence"
    text = "".join(letter if letter.isprintable() else " " for letter in made.description[: 4 * _TEXT])
    text = " ".join(text.split())
    if len(text) > _TEXT:
        text = f"{text[:_TEXT]}…"
    return [
        *([f"Described as: {text}."] if text else []),
        f"RGL material, {azimuths}: {slices} incidences with {height}×{width} nodes each, placed by the warp of Dupuy "
        "& Jakob 2018.",
        "The file holds f_r cos θ_o, its theta_i and phi_i being the light's; divided by cos θ_o.",
    ]


def _build(fields: Mapping[str, np.ndarray], source: str) -> RGLMaterial:
    spectral = "wavelengths" in fields
    table, ranks = ("spectra" if spectral else "rgb"), dict(RANKS)
    ranks |= {table: 5, **({"wavelengths": 1} if spectral else {})}
    _refuse_other_fields(fields, ranks, source)
    _refuse_unlike_shapes(fields, table, source)
    _refuse_numbers(fields, source)
    channels = tuple(map(_number, fields["wavelengths"])) if spectral else ("r", "g", "b")
    values, vndf = fields[table], fields["vndf"]
    made = RGLMaterial(
        theta_i=fields["theta_i"].astype(float),
        phi_i=fields["phi_i"].astype(float),
        ndf=fields["ndf"].astype(float),
        sigma=fields["sigma"].astype(float),
        vndf=Warp.of(vndf.reshape(-1, *vndf.shape[2:])),
        values=np.ascontiguousarray(values.transpose(0, 1, 3, 4, 2)).reshape(-1, *values.shape[3:], len(channels)),
        channels=channels,
        jacobian=bool(fields["jacobian"][0]),
        description=fields["description"].tobytes().decode("utf-8", "replace"),
    )
    start, end = np.rad2deg(made.phi_i[[0, -1]])
    if made.symmetry not in (1, 2, 4) or (made.symmetry > 1 and abs(start + 180) > 1):
        expected = "expected a circle, or 180 or 90 degrees from −180. Is the file damaged?"
        raise ReadError(f"{source}: phi_i runs from {start:.4g} to {end:.4g} degrees, {expected}")
    return made


def _number(wavelength: np.float32) -> str:
    """With as many digits as tell it from its neighbours: 360, 363.3."""
    return np.format_float_positional(wavelength, trim="-")


def _refuse_other_fields(fields: Mapping[str, np.ndarray], ranks: Mapping[str, int], source: str) -> None:
    """Fields that are missing, or of another type or number of dimensions."""
    wanted = {name: (np.dtype("<f4"), rank) for name, rank in ranks.items()}
    wanted |= {name: (np.dtype("u1"), 1) for name in _BYTES}
    if missing := [name for name in wanted if name not in fields]:
        expected = "expected a material of the RGL database. Is it a tensor file of another kind?"
        raise ReadError(f"{source}: a tensor file without {', '.join(missing)}, {expected}")
    for name, (dtype, rank) in wanted.items():
        got = fields[name]
        if got.dtype != dtype or got.ndim != rank:
            found = f"{name} is {got.dtype.name} of {got.ndim} dimensions"
            raise ReadError(f"{source}: {found}, expected {dtype.name} of {rank}. Is it a file of another kind?")


def _refuse_unlike_shapes(fields: Mapping[str, np.ndarray], table: str, source: str) -> None:
    """Arrays that do not belong together, or have too few nodes to interpolate between."""
    incidences = len(fields["phi_i"]), len(fields["theta_i"])
    channels = len(fields["wavelengths"]) if table == "spectra" else 3
    grid = fields["luminance"].shape[2:]
    wanted = {
        "vndf": (*incidences, *fields["vndf"].shape[2:]),
        "luminance": (*incidences, *grid),
        table: (*incidences, channels, *grid),
        "jacobian": (1,),
    }
    for name, shape in wanted.items():
        if fields[name].shape != shape:
            found, expected = ("×".join(map(str, extent)) for extent in (fields[name].shape, shape))
            raise ReadError(f"{source}: {name} is {found}, expected {expected} as the others. Is the file damaged?")
    for name in ("ndf", "sigma", "vndf", table):
        if min(fields[name].shape[-2:]) < 2 or fields[name].size == 0:
            found = "×".join(map(str, fields[name].shape))
            raise ReadError(f"{source}: {name} is {found}, expected at least 2×2 nodes. Is the file damaged?")


def _refuse_numbers(fields: Mapping[str, np.ndarray], source: str) -> None:
    """Numbers that no density, area or axis can have."""
    for name in ("theta_i", "phi_i", "ndf", "sigma", "vndf", *(["wavelengths"] if "wavelengths" in fields else [])):
        if not np.isfinite(fields[name]).all():
            raise ReadError(f"{source}: {name} holds NaN or infinity, expected numbers. Is the file damaged?")
    if (fields["vndf"] < 0).any():
        raise ReadError(f"{source}: vndf has negative densities, expected none. Is the file damaged?")
    _refuse_axis(fields["theta_i"], (0.0, np.pi / 2), f"{source}: theta_i", "radians, 0 to π/2")
    _refuse_axis(fields["phi_i"], (-2 * np.pi, 2 * np.pi), f"{source}: phi_i", "radians, −2π to 2π")
    if "wavelengths" in fields:
        _refuse_axis(fields["wavelengths"], (1.0, 1e6), f"{source}: wavelengths", "nm, 1 to 10⁶")


def _refuse_axis(axis: np.ndarray, limits: tuple[float, float], place: str, unit: str) -> None:
    """Nodes that do not increase or are out of range."""
    if not (axis[1:] > axis[:-1]).all():
        raise ReadError(f"{place} does not increase, expected {unit}, in increasing order. Is the file damaged?")
    if axis[0] < limits[0] or axis[-1] > limits[1] + _ROUNDING:
        raise ReadError(f"{place} runs from {axis[0]:g} to {axis[-1]:g}, expected {unit}. Is the file damaged?")
