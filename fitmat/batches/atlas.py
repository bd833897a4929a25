"""Atlas: a texture's measurements in a .npz file or a Zarr group, the same directions at every point, checked.

Values of a Zarr group are read when they are asked for, some points at a time. It fits nothing.
"""

import dataclasses
import zipfile
import zlib
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Protocol

import numpy as np
from jaxtyping import Float

from fitmat import arguments
from fitmat.errors import ReadError
from fitmat.extras import needed
from fitmat.maths.directions import directions
from fitmat.measurements.parsing.angles import DOUBTFUL
from fitmat.measurements.samples import default_channels
from fitmat.text import brief, visible

ZARR = ".zarr"
"""How the name of a Zarr group ends."""

SUFFIXES = (".npz", ZARR)
"""How the names of atlases end."""

ANGLES = ("theta_i", "theta_o", "phi_i", "phi_o")
"""Arrays of angles in degrees, in place of wi and wo."""

KNOWN = ("value", "sigma", "wi", "wo", *ANGLES, "channels")
"""Arrays that an atlas may hold."""


UNREADABLE = (OSError, ValueError, EOFError, KeyError, zipfile.BadZipFile, zlib.error)
"""What `unpacked` may raise of a damaged file."""


class Sliced(Protocol):
    """An array in memory, or one that is read where it is sliced."""

    @property
    def shape(self) -> tuple[int, ...]:
        """As of a NumPy array."""
        ...

    @property
    def dtype(self) -> Any:
        """As of a NumPy array."""
        ...

    def __getitem__(self, part: slice, /) -> Any:
        """Some of the first axis, as a NumPy array."""
        ...


@dataclasses.dataclass(frozen=True, eq=False)
class Atlas:
    """A texture's measurements.

    Attributes:
        source: Where it is from.
        value: BRDF in sr⁻¹, (rows, columns, n, c) or (points, n, c).
        sigma: Standard deviation of its noise, one number or as `value`; None where unknown.
        wi: Unit vectors to the light, (n, 3).
        wo: Unit vectors to the sensor, (n, 3).
        channels: c names.
    """

    source: str
    value: Sliced
    sigma: Sliced | float | None
    wi: Float[np.ndarray, "n 3"]
    wo: Float[np.ndarray, "n 3"]
    channels: tuple[str, ...]

    __repr__ = brief

    @property
    def points(self) -> tuple[int, ...]:
        """How many there are: rows and columns, or points."""
        return self.value.shape[:-2]

    def tile(self, part: slice) -> tuple[Float[np.ndarray, "m n c"], np.ndarray | float | None]:
        """The values and the noise of some points, counted row by row.

        Raises:
            ReadError: they cannot be read, or a sigma is not positive.
        """
        try:
            value, sigma = _some(self.value, part), self.sigma
            sigma = sigma if sigma is None or isinstance(sigma, float | int) else _some(sigma, part)
        except (*UNREADABLE, RuntimeError) as error:
            where = f"{self.source}: points {part.start + 1} to {part.stop}"
            raise ReadError(f"{where} cannot be read ({visible(str(error))}). Write it again.") from error
        if sigma is not None and (np.asarray(sigma) <= 0).any():
            raise ReadError(f"{self.source}: sigma of {np.nanmin(sigma):g}, expected above 0, or NaN to mask a value.")
        return value, sigma


def _some(every: Sliced, part: slice) -> Float[np.ndarray, "m n c"]:
    if len(every.shape) == 3:
        return np.asarray(every[part], float)
    columns = every.shape[1]
    first = part.start // columns
    rows = np.asarray(every[slice(first, -(-part.stop // columns))], float)
    return rows.reshape(-1, *every.shape[-2:])[part.start - first * columns : part.stop - first * columns]


def unpacked(path: Path) -> dict[str, np.ndarray]:
    """Every array of a .npz file; nothing is unpickled."""
    with path.open("rb") as file:
        archive = np.load(file, allow_pickle=False)
        if isinstance(archive, np.ndarray):
            raise ValueError("it is a single array")
        return {name: archive[name] for name in archive.files}


def opened(path: Path) -> dict[str, Any]:
    """Every array of a Zarr group: `value` and `sigma` unread, the others in memory; `channels` may be an attribute.

    Raises:
        FitmatError: the package zarr is missing.
    """
    group = needed("zarr", f"{path}: a Zarr group").open_group(str(path), mode="r")
    found = {name: group[name] for name in group.array_keys()}
    whole = {name: array if name in ("value", "sigma") and array.shape else array[...] for name, array in found.items()}
    return {**({"channels": np.array(group.attrs["channels"])} if "channels" in group.attrs else {}), **whole}


def read_atlas(path: Path) -> Atlas:
    """The arrays of a file, checked.

    Args:
        path: A .npz file, or a Zarr group whose name ends in .zarr, with `value`, the directions `wi` and `wo` (n, 3),
            or `theta_i`, `theta_o` and if need be `phi_i` (else 0) and `phi_o` (else 180) in degrees, (n,) each or one
            number; and if need be `sigma`, and `channels`, their names.

    Raises:
        ReadError: it cannot be read, something is missing, or shapes do not fit.
    """
    zarr = path.suffix.lower() == ZARR
    try:
        every = opened(path) if zarr else unpacked(path)
    except UNREADABLE as error:
        remedy = "zarr.create_group" if zarr else "numpy.savez"
        raise ReadError(f"{path}: no atlas can be read ({visible(str(error))}). Write it with {remedy}.") from error
    found = {name: part for name, part in every.items() if name in KNOWN}
    odd = sorted(set(every) - set(KNOWN))
    if odd or "value" not in found:
        got = f"an array {visible(odd[0])!r}" if odd else f"no array value, but {', '.join(found) or 'none'}"
        raise ReadError(f"{path}: {got}, expected value and any of {', '.join(KNOWN[1:])}.")
    value = _numbers(f"value of {path}", found["value"])
    if len(value.shape) not in (3, 4) or 0 in value.shape:
        raise ReadError(
            f"{path}: value has shape {value.shape}, expected (rows, columns, samples, channels) or "
            f"(points, samples, channels), none of them 0."
        )
    wi, wo = _directions(path, found)
    if len(wi) != value.shape[-2]:
        raise ReadError(f"{path}: {len(wi)} pairs of directions for {value.shape[-2]} samples, expected as many.")
    sigma = None if "sigma" not in found else _numbers(f"sigma of {path}", found["sigma"])
    if sigma is not None and sigma.shape not in ((), value.shape):
        raise ReadError(f"{path}: sigma has shape {sigma.shape}, expected one number, or {value.shape} as value.")
    if sigma is not None and not sigma.shape:
        sigma = float(np.asarray(sigma))
    return Atlas(str(path), value, sigma, wi, wo, _channels(path, found, value.shape[-1]))


def _numbers(name: str, given: Sliced) -> Sliced:
    """The array, if it holds real numbers."""
    if isinstance(given, np.ndarray):
        return arguments.numbers(name, given)
    if np.dtype(given.dtype).kind not in "fiu":
        arguments.refuse(name, given, "real numbers")
    return given


def _directions(path: Path, found: Mapping[str, np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
    vectors, angles = [name for name in ("wi", "wo") if name in found], [name for name in ANGLES if name in found]
    if len(vectors) == 2 and not angles:
        wi, wo = (arguments.numbers(f"{name} of {path}", found[name]) for name in vectors)
        for name, w in (("wi", wi), ("wo", wo)):
            if w.ndim != 2 or w.shape[1] != 3:
                raise ReadError(f"{path}: {name} of shape {w.shape}, expected (n, 3) unit vectors.")
            arguments.unit_vectors(f"{name} of {path}", w)
        if len(wi) != len(wo):
            raise ReadError(f"{path}: {len(wi)} rows of wi and {len(wo)} of wo, expected as many.")
        return wi, wo
    if vectors or not {"theta_i", "theta_o"} <= set(angles):
        got = ", ".join([*vectors, *angles]) or "none"
        raise ReadError(f"{path}: directions {got}, expected wi and wo, or theta_i and theta_o (degrees).")
    zeniths = [found[name] for name in ("theta_i", "theta_o")]
    refuse_radians(path, "zenith angle", zeniths, "Convert them, or give wi and wo.")
    told = {"phi_i": np.zeros(()), "phi_o": np.full((), 180.0)} | {name: found[name] for name in angles}
    try:
        theta_i, theta_o, phi_i, phi_o = np.broadcast_arrays(*(np.atleast_1d(told[name]) for name in ANGLES))
    except ValueError:
        shapes = ", ".join(f"{name} {told[name].shape}" for name in ANGLES)
        raise ReadError(f"{path}: angles of shapes {shapes}, expected (n,) or one number each.") from None
    return directions(theta_i, phi_i, degrees=True), directions(theta_o, phi_o, degrees=True)


def refuse_radians(path: Path, name: str, angles: Sequence[np.ndarray], remedy: str) -> None:
    """Stop where angles that should be degrees are all as small as radians would be.

    Raises:
        ReadError: they are.
    """
    most = max(float(np.nanmax(np.abs(angle), initial=0.0)) for angle in angles)
    if DOUBTFUL[0] < most <= DOUBTFUL[1]:
        raise ReadError(f"{path}: no {name} exceeds {most:.3g}, expected degrees; they look like radians. {remedy}")


def _channels(path: Path, found: Mapping[str, np.ndarray], count: int) -> tuple[str, ...]:
    if "channels" not in found:
        return default_channels(count)
    names = tuple(str(name) for name in np.atleast_1d(found["channels"]).ravel())
    if len(names) != count or len(set(names)) != count:
        got = f"channels {', '.join(map(visible, names))} for {count} columns of values"
        raise ReadError(f"{path}: {got}, expected one name each, all different.")
    return names
