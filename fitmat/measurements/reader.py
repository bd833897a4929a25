"""Reader: a file of any format, or a table from anywhere → `Measurements`, with every assumption in its notes.

It repairs nothing and drops nothing; what it cannot know it asks for.
"""

import dataclasses
import os
from collections.abc import Iterator, Mapping, Sequence
from typing import Any, Protocol, cast, runtime_checkable

import numpy as np
import polars as pl

from fitmat import arguments
from fitmat.errors import ReadError
from fitmat.measurements import inferred, joining, recognition
from fitmat.measurements.blocked import without_blocked
from fitmat.measurements.horizon import along
from fitmat.measurements.instrument import IDEAL, Instrument
from fitmat.measurements.options import Options
from fitmat.measurements.parsing import contents, frames, tabular
from fitmat.measurements.parsing.recording import Recording, mask
from fitmat.measurements.parsing.table import Table, from_arrays
from fitmat.measurements.peak_side import with_peak_side
from fitmat.measurements.plausible_values import refuse_implausible, with_doubts
from fitmat.measurements.quantity import factor, note
from fitmat.measurements.samples import Measurements
from fitmat.measurements.scale import of_unknown_scale

EXCHANGED = "theta_i=phi_i,phi_i=theta_i,theta_o=phi_o,phi_o=theta_o"

UP = np.array([0.0, 0.0, 1.0])

_DIGITS = 9


@runtime_checkable
class Frame(Protocol):
    """A pandas or polars data frame, as far as it is read."""

    @property
    def columns(self) -> Any:
        """Names of the columns."""
        ...

    def __getitem__(self, name: Any, /) -> Any:
        """One column."""
        ...


Source = str | os.PathLike[str] | Mapping[str, Any] | Frame


def read(
    source: Source | Sequence[Source],
    *,
    columns: str | Mapping[str, str | int] | None = None,
    quantity: str | None = None,
    angle_unit: str | None = None,
    forward: str | None = None,
    specular_azimuth: int | None = None,
    intensity: float | None = None,
    distance: float | None = None,
    where: str | None = None,
    panel: float | None = None,
    unknown_scale: bool = False,
    scale: str | None = None,
    constants: Mapping[str, float] | None = None,
    instrument: Instrument = IDEAL,
) -> Measurements:
    """Read BRDF measurements from a file or several, a data frame, an xarray object or a dict of arrays.

    Files of `fitmat.measurements.formats` are recognised by their content and say what they hold. Of text tables,
    Parquet files and the rest the columns are recognised, in any letter case
    (`fitmat.measurements.parsing.names.ALIASES` has more names):

    - theta_i, theta_o, and phi = φ_o − φ_i or phi_i and phi_o, in degrees; the mirror side is φ = 180.
      Without azimuth, theta_o is signed: positive is forward, the mirror side.
    - The quantity: brdf, brdf_cos (= f_r cos θ_o), reflectance_factor (= π f_r), radiance, panel_ratio, or signal and
      reference (readings of the sample and of a white panel). One column; one for each channel, as brdf_r or brdf_550;
      or one row for each channel, beside a column wavelength (nm) or channel.
    - Where known: sigma, or sigma_r …, in the unit of the quantity (and sigma_reference); valid, or flag.

    Args:
        source: Path of a file or of a stream, such as a pipe; pandas or polars data frame, xarray object, or name →
            array of n numbers. Or a list of these: one measurement of one sample, each read by its own header, and
            joined as `fitmat.measurements.joining.join` does.
        columns: Our name → name or number (from 1) in the file; or as text, "theta_i=Zenith,theta_o=3".
        quantity: What a column called value holds: "brdf", "brdf_cos", "reflectance_factor", "radiance" or
            "panel_ratio".
        angle_unit: "degrees", "radians" or "gon", or of single columns, "phi=radians"; None for degrees, refused where
            the range looks like radians.
        forward: Sign of theta_o on the mirror side of a positive theta_i where there is no azimuth: "positive" (the
            default; asked for where theta_i is negative) or "negative".
        specular_azimuth: Relative azimuth of the mirror side in the file, 180 (the default), 0, 90 or 270.
        intensity: Of the point source that lit the sample, W/sr, where radiances in W/(m² sr) were read.
        distance: Of that source from the sample, m.
        where: Read only rows in which a column has this value, "material=Alu".
        panel: Reflectance factor of the white panel to which readings were compared.
        unknown_scale: Whether the values are known but for a common factor. They are divided by one that gives a
            typical curve an albedo of about 0.4 (`fitmat.measurements.scale`), and the scale is fitted.
        scale: How the values and their σ are written: "linear", "percent", "db" (10 log₁₀), "log10" or "ln"; None for
            linear, refused where they look like percent or logarithms.
        constants: What is the same in every row and has no column, {"theta_i": 30}: angles in the file's unit, or a
            wavelength in nm. Comments above the rows, as "# theta_i = 30 deg", are read so too.
        instrument: Apertures, calibration and dark signal of what took them.

    Returns:
        All rows, in sr⁻¹ without cosine; what cannot be used is masked (value 0, sigma 1) and counted.

    Raises:
        ReadError: what is wrong, where, what was expected, and what to do.

    Example:
        >>> read({"theta_i": [30, 30], "theta_o": [-30, 30], "brf": [1.0, 2.0]}).value.round(2).T
        array([[0.32, 0.64]])
    """
    arguments.kind("columns", columns, str, Mapping, optional=True)
    arguments.kind("instrument", instrument, Instrument)
    options = Options(
        *(quantity, angle_unit, forward, specular_azimuth, intensity, distance, where, panel, unknown_scale, scale),
        constants or {},
    )
    several = isinstance(source, list | tuple)
    sources: Sequence[Any] = source if several else [source]
    joining.refuse_twice(sources)
    parts = [_part(one, columns, options, name) for one, name in zip(sources, joining.tails(sources), strict=True)]
    found = joining.join([dataclasses.replace(part, instrument=instrument) for part, _ in parts])
    distinct = len(parts) == 1 and parts[0][1]
    found = dataclasses.replace(found, notes=(*found.notes, *_oddities(found, distinct)))
    return of_unknown_scale(found) if unknown_scale else found


def _part(
    source: Source, columns: str | Mapping[str, str | int] | None, options: Options, name: str | None
) -> tuple[Measurements, bool]:
    """What one source holds, called by that name if there is one, and whether no geometry can occur twice in it."""
    try:
        recording = _recording(source, columns, options)
        found = measured(recording, options)
        _refuse_all_masked(found)
        refuse_implausible(found, recording.quantity, options)
        found = with_doubts(with_peak_side(found, recording.unsaid_side))
    except ReadError as error:
        if name is None or not str(error).startswith(own := contents.name(name)):
            raise
        raise ReadError(name + str(error).removeprefix(own)) from error
    return found if name is None else dataclasses.replace(found, source=name), recording.distinct


def _refuse_all_masked(found: Measurements) -> None:
    if found.valid.any():
        return
    listed = ", ".join(f"{count} {reason}" for reason, count in found.masked.items())
    expected = "expected at least one value that can be used. Check the columns and units"
    if found.masked.get("at or below the horizon") == found.n_samples:
        expected += f'; where phi is the zenith angle, pass columns="{EXCHANGED}" (--columns)'
    raise ReadError(f"{found.source}: every row is masked ({listed}), {expected}.")


def measured(recording: Recording, options: Options) -> Measurements:
    """A recording in sr⁻¹ without cosine; what cannot be used is masked (value 0, sigma 1) and counted."""
    valid, masked = mask(recording)
    wi, wo = (np.where(np.isnan(w), UP, w) for w in (recording.wi, recording.wo))
    try:
        scale = factor(recording.quantity, wi, wo, options)
    except ReadError as error:
        raise ReadError(f"{recording.source}: {error}") from error
    with np.errstate(over="ignore", invalid="ignore"):
        value = recording.value * scale
        sigma = None if recording.sigma is None else recording.sigma * scale
    usable = np.isfinite(value) if sigma is None else np.isfinite(value) & np.isfinite(sigma) & (sigma > 0)
    flat = along(recording) & (recording.quantity != "brdf_cos")  # whose value at 90° is 0/0
    extreme = valid & ~usable
    if extreme.any():
        masked |= {"too large or too small a number in sr⁻¹": int(extreme.any(axis=1).sum())}
        valid = valid & ~extreme
    found = Measurements(
        wi=wi,
        wo=wo,
        value=np.where(valid, value, 0.0),
        sigma=None if sigma is None else np.where(valid, sigma, 1.0),
        valid=valid,
        channels=recording.channels,
        source=recording.source,
        masked=masked,
        notes=(note(recording.quantity, options), *recording.notes),
        stated=recording.stated,
        warnings=recording.warnings,
        horizontal=np.where(flat & np.isfinite(value), value, np.nan) if flat.any() else None,
    )
    return without_blocked(found)


def measurements_of(given: object) -> Measurements:
    """Measurements, or those that a path leads to; what completes them is masked.

    Raises:
        FitmatError: as `read`, or it is neither.
    """
    if isinstance(given, str | os.PathLike):
        return read(given)
    arguments.kind("measurements", given, Measurements, str, os.PathLike)
    return inferred.measured_only(cast(Measurements, given))


def _recording(source: Source, columns: str | Mapping[str, str | int] | None, options: Options) -> Recording:
    if not isinstance(source, str | os.PathLike):
        return tabular.recording(_table(source), columns, options)
    with contents.on_disk(source) as path:
        return recognition.recording(path, columns, options)


def _table(source: Mapping[str, Any] | Frame) -> Table:
    kind = type(source).__name__
    if isinstance(source, frames.Labelled):
        return from_arrays(frames.arrays(source), kind)
    if isinstance(source, Mapping):
        return from_arrays(source, kind)
    if not isinstance(source, Frame):
        raise ReadError(f"{kind}: not measurements, expected a path, a data frame or a dict of arrays. Pass one.")
    try:
        arrays = {name: np.asarray(source[name]) for name in source.columns}
    except (TypeError, ValueError, LookupError, AttributeError) as error:
        got = f"its columns cannot be read as arrays ({contents.shown(str(error))})"
        raise ReadError(f"{kind}: {got}, expected one array each. Pass a dict of arrays.") from error
    return from_arrays(arrays, kind)


def _oddities(measured: Measurements, distinct: bool) -> Iterator[str]:
    """What a user should know of the rows that are kept."""
    if not distinct and (repeats := _repeats(measured)):
        yield f"Rows that repeat an earlier geometry, all kept: {repeats}."
    if negatives := np.count_nonzero(measured.value < 0):
        yield f"Negative values kept as noise: {negatives}."


def _repeats(measured: Measurements) -> int:
    used = measured.rows(np.flatnonzero(measured.valid.any(axis=1)))
    angles = used.rotation, used.theta_i, used.theta_o, used.signed_phi
    rotation, theta_i, theta_o, phi = (np.round(angle, _DIGITS) for angle in angles)
    phi = np.where(phi == -np.round(np.pi, _DIGITS), -phi, phi)
    phi = np.where((theta_i == 0) | (theta_o == 0), 0.0, phi)
    return used.n_samples - pl.DataFrame([rotation, theta_i, theta_o, phi]).n_unique()
