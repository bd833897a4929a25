"""Textures: an atlas fitted tile by tile, each tile kept when it is done, and the arrays of all points.

What was done before is not done again. The fits are `fitmat.fit_many`'s, and all points are smoothed together.
"""

import dataclasses
import hashlib
import io
import json
import os
from collections.abc import Mapping, Sequence
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np

from fitmat import arguments, files
from fitmat._types import Progress
from fitmat.batches import record
from fitmat.batches.atlas import UNREADABLE, ZARR, Atlas, read_atlas, unpacked
from fitmat.batches.maps import MAPS, maps
from fitmat.batches.photographs import TABLE, read_photographs
from fitmat.batches.record import PARTS
from fitmat.extras import needed
from fitmat.fitting.losses import DEFAULT, loss
from fitmat.fitting.many.concluding import OUTCOMES
from fitmat.fitting.many.fits import Fits
from fitmat.fitting.many.fitting_many import fit_many, shared_by_all
from fitmat.fitting.many.sharing import refuse_idle, sharing, told_together
from fitmat.maths.parts import slices
from fitmat.text import brief

RESULTS = ("texture.npz", f"texture{ZARR}")
"""Names of the file of all points."""

TILE = 16384
"""Points that are fitted, and kept, at a time."""

KEPT = ("values", "sd", "outcome", "discrepancy", "log_likelihood", "steps", "n_values")
"""Fields of `Fits` that a tile keeps."""


@dataclasses.dataclass(frozen=True, eq=False)
class Texture:
    """What was found of a texture.

    Attributes:
        file: The arrays on disk: each parameter by its name, `NAME_sd`, `outcome` with the `outcomes` that its numbers
            mean, `discrepancy`, `n_values`, and the names of the `channels`; of what was smoothed `NAME_smooth`,
            `NAME_smooth_sd` and `NAME_inferred`.
        maps: Pictures of the parameters, and a glTF and a MaterialX material that bind them; see `maps`.
        fits: The arrays.
        earlier: Points that an earlier run had fitted.
    """

    file: Path
    maps: tuple[Path, ...]
    fits: Fits
    earlier: int

    __repr__ = brief

    def __str__(self) -> str:
        """How many ended how."""
        return f"{self.fits}{f' {self.earlier} known from an earlier run.' if self.earlier else ''}"


def fit_texture(
    source: str | os.PathLike[str],
    folder: str | os.PathLike[str],
    model: str = "lambert+ggx",
    *,
    smooth: str | Sequence[str] | None = None,
    force: bool = False,
    progress: Progress | None = None,
    **told: Any,
) -> Texture:
    """Fit a model to every point of an atlas.

    Args:
        source: The atlas, as `read_atlas` takes it, or the table of lights of pictures, as `read_photographs` does.
        folder: For `texture.npz` or `texture.zarr`, and what is kept to go on after an interruption.
        model: Name of the model.
        smooth: As in `fitmat.fit_many`; of a texture that is done nothing is fitted again.
        force: Replace the results of something else in the folder.
        progress: Called with what is done, how many points are done, and how many there are.
        **told: `fixed`, `loss`, `masking`, `starts`, `max_steps`, `threads` and `precision` of `fitmat.fit_many`.

    Raises:
        FitmatError: the atlas cannot be read, the arguments do not fit, nothing could be smoothed, results would
            be lost and `force` is off, another run writes there, or the disk refuses.

    Example:
        >>> fit_texture("atlas.npz", "out").fits["alpha"]  # doctest: +SKIP
    """
    arguments.kind("source", source, str, os.PathLike)
    arguments.kind("folder", folder, str, os.PathLike)
    arguments.kind("model", model, str)
    names = sharing(None, smooth)
    suffix, target, say = Path(source).suffix.lower(), Path(folder), progress or (lambda *_: None)
    atlas = read_photographs(Path(source)) if suffix == TABLE else read_atlas(Path(source))
    given = told.get("fixed") or {}, loss(told.get("loss", DEFAULT.name)), told.get("masking")
    shared, held = shared_by_all([atlas.wi, atlas.wo], len(atlas.channels), model, *given)
    axes, count = atlas.points, int(np.prod(atlas.points))
    refuse_idle(names, shared, held, axes)
    name = RESULTS[suffix == ZARR]
    with files.alone(target):
        keys = [_key(atlas, *atlas.tile(part), model, told) for part in slices(count, TILE)]
        of = {name: record.digest([axes, atlas.channels, keys, *([sorted(names.smooth)] if names.smooth else [])])}
        claim = record.claimed(target, of, (*RESULTS, *MAPS), force=force)
        each, words = [], f"fitting {count} points"
        say(words, 0, count)
        for part, key in zip(slices(count, TILE), keys, strict=True):
            each.append(_fitted(atlas, part, target / PARTS / f"{key}.npz", model, told))
            say(words, part.stop, count)
        whole = {field: np.concatenate([tile[field] for tile, _ in each]) for field in KEPT}
        shaped: dict[str, Any] = {field: part.reshape(*axes, *part.shape[1:]) for field, part in whole.items()}
        fits = told_together(names, Fits(shared.template, atlas.channels, held, **shaped), progress)
        drawn = maps(fits)
        claim.renew((name, *drawn), [f"{key}.npz" for key in keys])
        file = _written(target / name, _arrays(fits))
        pictures = tuple(files.write_bytes(target / picture, content) for picture, content in drawn.items())
        return Texture(file, pictures, fits, sum(len(tile["outcome"]) for tile, known in each if known))


def _fitted(
    atlas: Atlas, part: slice, kept: Path, model: str, told: Mapping[str, Any]
) -> tuple[dict[str, np.ndarray], bool]:
    """The fits of a tile, which are kept, and whether an earlier run left them."""
    value, sigma = atlas.tile(part)
    if (tile := _read(kept, len(value))) is not None:
        return tile, True
    fitted = fit_many(atlas.wi, atlas.wo, value, model, sigma=sigma, **told)
    tile = {name: getattr(fitted, name) for name in KEPT}
    files.write_bytes(kept, _packed(tile))
    return tile, False


def _key(atlas: Atlas, value: np.ndarray, sigma: np.ndarray | float | None, model: str, told: Mapping[str, Any]) -> str:
    """The name under which a tile is kept: of what is fitted, how, and by which fitmat."""
    how = {name: given for name, given in told.items() if name != "threads"} | {"model": model}
    if how.get("precision") == "double":
        del how["precision"]  # as where none is told
    words = json.dumps([how, version("fitmat"), value.shape], sort_keys=True, default=str)
    found = hashlib.sha256(words.encode())
    for part in (value, np.zeros(0) if sigma is None else np.asarray(sigma), atlas.wi, atlas.wo):
        found.update(np.ascontiguousarray(part, float).tobytes())
    return found.hexdigest()[:32]


def _read(kept: Path, count: int) -> dict[str, np.ndarray] | None:
    """A tile that an earlier run left; None where there is none that is whole."""
    try:
        tile = unpacked(kept)
        return tile if all(len(tile[name]) == count for name in KEPT) else None
    except UNREADABLE:
        return None


def _packed(arrays: Mapping[str, np.ndarray]) -> bytes:
    memory, named = io.BytesIO(), dict[str, Any](arrays)
    np.savez_compressed(memory, **named)
    return memory.getvalue()


def _written(path: Path, arrays: Mapping[str, np.ndarray]) -> Path:
    """The arrays as a .npz file, or as a Zarr group with words as attributes, in the place of what a run left there."""
    if path.suffix != ZARR:
        return files.write_bytes(path, _packed(arrays))
    words = {name: part.tolist() for name, part in arrays.items() if part.dtype.kind == "U"}
    with files.replaced(path) as draft:
        group = needed("zarr", f"{path}: a Zarr group").open_group(str(draft), mode="w")
        group.attrs.update(words)
        for name in arrays.keys() - words.keys():
            group.create_array(name, data=arrays[name])
    return path


def _arrays(fits: Fits) -> dict[str, np.ndarray]:
    """What the file of all points holds."""
    found: dict[str, np.ndarray] = {}
    for entry in fits.entries:
        found |= {entry.name: fits[entry.name], f"{entry.name}_sd": fits.sd_of(entry.name)}
    found |= {"outcome": fits.outcome, "outcomes": np.array(list(OUTCOMES)), "channels": np.array(fits.channels)}
    for name, part in fits.smoothed.items():
        if np.isfinite(part.value).any():
            found |= {f"{name}_smooth": part.value, f"{name}_smooth_sd": part.sd, f"{name}_inferred": part.inferred}
    return found | {"discrepancy": fits.discrepancy, "n_values": fits.n_values}
