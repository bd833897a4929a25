"""ALTA: text data of the ALTA library, in the parametrisations that determine both directions; read and written.

It fits none of ALTA's own functions, and refuses its binary data and what it cannot turn into directions, by name.

The layout is that of ALTA's manual, "Data File Formats" (L. Belcour, R. Pacanowski et al.): header lines `#KEY value`,
of which `#DIM N P`, `#PARAM_IN` and `#PARAM_OUT` are needed, then lines of N coordinates, P values and, with `#VS` 1 or
2, one or two bounds for each value. Other lines that begin with # are comments. Angles are radians; the coordinates are
turned into directions as `params::to_cartesian` of `core/params.cpp` does.
"""

import os
import re
from collections.abc import Callable, Iterator, Mapping

import numpy as np
import polars as pl
from jaxtyping import Float

from fitmat.errors import OutputError, ReadError
from fitmat.maths.directions import from_angles, zenith
from fitmat.measurements.parsing import blocks, contents
from fitmat.measurements.parsing.recording import Recording
from fitmat.measurements.samples import Measurements, default_channels
from fitmat.text import visible

Directions = Float[np.ndarray, "n 3"]
Pair = tuple[Directions, Directions]

OUTPUTS = {
    "INV_STERADIAN": "brdf",
    "INV_STERADIAN_COSINE_FACTOR": "brdf_cos",
    "RGB_COLOR": "brdf",
    "XYZ_COLOR": "brdf",
}
"""#PARAM_OUT → quantity."""

_CHANNELS: dict[str, tuple[str, ...]] = {"RGB_COLOR": ("r", "g", "b"), "XYZ_COLOR": ("x", "y", "z")}
_LARGEST = 2 * np.pi + 1e-6
_OFF_UNIT = 0.01
_WRITTEN = "SPHERICAL_TL_PL_TV_PV"
_HEADER = re.compile(r"^#([A-Za-z]\w*)[ \t]+(\S.*)$", re.MULTILINE)
_DIM = re.compile(r"([1-9]\d{0,3})\s+([1-9]\d{0,3})")


def claims(head: bytes, size: int) -> bool:
    """Whether header lines #DIM and #PARAM_IN are there."""
    return blocks.begins(head, rb"#DIM[ \t]", rb"#PARAM_IN[ \t]")


def load(path: str | os.PathLike[str]) -> Recording:
    """One row for each line.

    Raises:
        ReadError: a header line is missing, a parametrisation is unknown, or a line has too few or too many numbers.
    """
    source, raw = contents.name(path), contents.contents(path)
    if blocks.begins(raw[: contents.HEAD], rb"#FORMAT[ \t]+binary"):
        got = "#FORMAT binary, expected ALTA's text data"
        raise ReadError(f"{source}: {got}. Convert it with ALTA's data2data to a text file.")
    text, notes = contents.decoded(raw, source)
    entries = _HEADER.findall(re.sub(r"\r\n?", "\n", text))
    header = {key: value.strip() for key, value in reversed(entries)}
    given, values, known, output = _layout(header, source)
    body = blocks.lines(text, source)
    number, bounds = _numbers(body, header, given + values)
    for row in np.flatnonzero((np.abs(number[:, :given]) > _LARGEST).any(axis=1))[:1]:
        got = f"coordinates {', '.join(f'{x:g}' for x in number[row, :given])}"
        expected = f"none beyond ±{_LARGEST:.4g}, since ALTA's angles are radians"
        raise ReadError(f"{body.where(row)}: {got}, expected {expected}. Convert them.")
    wi, wo = map(blocks.placed, PARAMETRISATIONS[known][1](number[:, :given]))
    channels = _CHANNELS.get(output, default_channels(values))
    if len(named := header.get("CHANNELS", "").split()) == values == len(set(named)):
        channels = tuple(named)
    return Recording(
        source=source,
        wi=wi,
        wo=wo,
        value=number[:, given:],
        quantity=OUTPUTS[output],
        channels=channels,
        notes=(*notes, *_conventions(known, output, bounds)),
    )


def dump(measurements: Measurements) -> str:
    """The text of a file with every sample that is valid in all channels, angles and values exact; see `losses`.

    Raises:
        OutputError: there is none.

    Example:
        >>> from fitmat.measurements.samples import from_arrays
        >>> dump(from_arrays([0.5], [0.25], [0.125])).splitlines()[-1].replace(chr(9), " ")
        '0.5 0.0 0.25 3.141592653589793 0.125'
    """
    kept = measurements.rows(np.flatnonzero(measurements.valid.all(axis=1)))
    if not kept.n_samples:
        got = "no sample that is valid in all channels, expected at least one"
        raise OutputError(f"{measurements.source}: {got}. Check what is masked.")
    output = {channels: name for name, channels in _CHANNELS.items()}.get(kept.channels, "INV_STERADIAN")
    head = [f"# {visible(kept.source)}, written by fitmat", f"#DIM 4 {len(kept.channels)}"]
    head += [f"#PARAM_IN  {_WRITTEN}", f"#PARAM_OUT {output}"]
    if _nameable(kept.channels):
        head.append(f"#CHANNELS {' '.join(kept.channels)}")
    azimuths = [np.arctan2(w[:, 1], w[:, 0]) for w in (kept.wi, kept.wo)]
    columns = [zenith(kept.wi), azimuths[0], zenith(kept.wo), azimuths[1], *kept.value.T]
    table = pl.DataFrame({str(k): column for k, column in enumerate(columns)})
    return "\n".join(head) + "\n" + table.write_csv(separator="\t", include_header=False)


def losses(measurements: Measurements) -> tuple[str, ...]:
    """What `dump` does not keep, in sentences with counts; empty where all comes back."""
    return tuple(_losses(measurements))


def _losses(measurements: Measurements) -> Iterator[str]:
    whole, some = measurements.valid.all(axis=1), measurements.valid.any(axis=1)
    if masked := np.count_nonzero(~some):
        yield f"{masked} masked samples not written."
    if partly := np.count_nonzero(some & ~whole):
        yield f"{partly} samples not written that are valid in some channels only: ALTA has no mark for that."
    if measurements.sigma is not None:
        yield "sigma not written: the bounds of an ALTA file are no standard deviations."
    if not _nameable(measurements.channels):
        yield "Names of channels not written: they are empty, hold white space or control characters, or are alike."


def _nameable(channels: tuple[str, ...]) -> bool:
    """Whether the names are distinct words that text can hold."""
    words = all(name and name.isprintable() and " " not in name for name in channels)
    return words and len(set(channels)) == len(channels)


def _layout(header: Mapping[str, str], source: str) -> tuple[int, int, str, str]:
    """Coordinates, values, parametrisation and output of the header."""
    if "FUNC" in header:
        raise ReadError(f"{source}: a fitted function of ALTA, expected its data. Name the file of the measurement.")
    dim = _DIM.fullmatch(header.get("DIM", ""))
    known, output = header.get("PARAM_IN", "(none)"), header.get("PARAM_OUT", "(none)")
    if not dim:
        got = f"#DIM {blocks.shown(header.get('DIM', '(none)'))}, expected two counts, as in #DIM 4 1"
        raise ReadError(f"{source}: {got}. Correct the line.")
    if known not in PARAMETRISATIONS:
        remedy = "Convert it with ALTA's data2data --param SPHERICAL_TL_PL_TV_PV"
        got = f"#PARAM_IN {blocks.shown(known)}, expected one of {', '.join(PARAMETRISATIONS)}"
        raise ReadError(f"{source}: {got}. {remedy}.")
    if output not in OUTPUTS:
        got = f"#PARAM_OUT {blocks.shown(output)}, expected one of {', '.join(OUTPUTS)}"
        raise ReadError(f"{source}: {got}. Write what the values are.")
    given, values = int(dim[1]), int(dim[2])
    wanted = PARAMETRISATIONS[known][0], len(_CHANNELS.get(output, ())) or values
    if (given, values) != wanted:
        got = f"#DIM {given} {values} with {known} and {output}"
        raise ReadError(f"{source}: {got}, expected #DIM {wanted[0]} {wanted[1]}. Correct the header.")
    return given, values, known, output


def _numbers(body: blocks.Lines, header: Mapping[str, str], wanted: int) -> tuple[Float[np.ndarray, "n m"], int]:
    """The coordinates and values, and how many bounds follow them on each line."""
    bounds = header.get("VS", "0").split()
    if not bounds or not set(bounds) <= {"0", "1", "2"}:
        got = f"#VS {blocks.shown(header.get('VS', ''))}, expected 0, 1 or 2 for each value"
        raise ReadError(f"{body.source}: {got}. Correct the line.")
    number, count = body.numbers()
    each = [int(bound) for bound in bounds]
    extra = {sum(each), each[0] * (wanted - int(header["DIM"].split()[0]))} if len(each) == 1 else {sum(each)}
    for width in (wanted + more for more in sorted(extra)):
        if len(count) and (count == width).all():
            return number.reshape(-1, width)[:, :wanted], width - wanted
    expected = wanted + max(extra)
    for row in np.flatnonzero(count != expected)[:1]:
        got = f"{count[row]} numbers, expected {expected} (#DIM {header['DIM']}, #VS {' '.join(bounds)})"
        raise ReadError(f"{body.where(row)}: {got}. Was the file cut off?")
    raise ReadError(f"{body.source}: no line of numbers, expected at least one. Is the file complete?")


def _conventions(known: str, output: str, bounds: int) -> Iterator[str]:
    yield f"ALTA coordinates {known}, in radians."
    if known in _REDUCED:
        yield f"{known} leaves directions open; placed as ALTA does: {_REDUCED[known]}."
    if output in _CHANNELS:
        yield f"{output} taken as f_r in sr⁻¹ for each channel."
    if bounds:
        yield "The bounds (#VS) are no standard deviations and were not read as sigma."


def _spherical(x: Float[np.ndarray, "n 4"]) -> Pair:
    return from_angles(x[:, 0], x[:, 1]), from_angles(x[:, 2], x[:, 3])


def _projected(theta_i: Float[np.ndarray, " n"], x: Float[np.ndarray, " n"], y: Float[np.ndarray, " n"]) -> Pair:
    return from_angles(theta_i, np.zeros(len(x))), from_angles(np.hypot(x, y), np.arctan2(y, x))


def _cartesian(x: Float[np.ndarray, "n 6"]) -> Pair:
    """View, then light; NaN where a vector is not of unit length, but for its rounding."""
    pair = x.reshape(-1, 2, 3)
    length = np.linalg.norm(pair, axis=-1, keepdims=True)
    unit = pair / np.where(np.abs(length - 1.0) < _OFF_UNIT, length, np.nan)
    return unit[:, 1], unit[:, 0]


def _rusinkiewicz(theta_h: np.ndarray, phi_h: np.ndarray, theta_d: np.ndarray, phi_d: np.ndarray) -> Pair:
    """ALTA's difference direction is that of the view, not of the light."""
    wo, wi = blocks.from_half(theta_h, phi_h, theta_d, phi_d)
    return wi, wo


def _retro(x: Float[np.ndarray, "n 3"]) -> Pair:
    r"""[θ_L, θ_VL cos φ, θ_VL sin φ]: the view about the light, φ = 0 towards the normal."""
    zero = np.zeros(len(x))
    wo = blocks.around(-x[:, 0], zero, np.hypot(x[:, 1], x[:, 2]), np.arctan2(x[:, 2], x[:, 1]) + np.pi)
    return from_angles(x[:, 0], zero), wo


def _acos(x: Float[np.ndarray, " n"]) -> Float[np.ndarray, " n"]:
    """Angles of cosines; NaN beyond ±1."""
    return np.arccos(np.where(np.abs(x) <= 1, x, np.nan))


PARAMETRISATIONS: dict[str, tuple[int, Callable[[Float[np.ndarray, "n d"]], Pair]]] = {
    "SPHERICAL_TL_PL_TV_PV": (4, _spherical),
    "CARTESIAN": (6, _cartesian),
    "RUSIN_TH_PH_TD_PD": (4, lambda x: _rusinkiewicz(*x.T)),
    "RUSIN_TH_TD_PD": (3, lambda x: _rusinkiewicz(x[:, 0], 0 * x[:, 0], x[:, 1], x[:, 2])),
    "ISOTROPIC_TV_TL_DPHI": (3, lambda x: (from_angles(x[:, 1], x[:, 2]), from_angles(x[:, 0], 0 * x[:, 0]))),
    "ISOTROPIC_TL_TV_PROJ_DPHI": (3, lambda x: _projected(*x.T)),
    "ISOTROPIC_TV_PROJ_DPHI": (2, lambda x: _projected(0 * x[:, 0], *x.T)),
    "RETRO_TL_TVL_PROJ_DPHI": (3, _retro),
    "RUSIN_TH_TD": (2, lambda x: _rusinkiewicz(x[:, 0], 0 * x[:, 0], x[:, 1], 0 * x[:, 0] + np.pi / 2)),
    "COS_TH_TD": (2, lambda x: _rusinkiewicz(_acos(x[:, 0]), 0 * x[:, 0], _acos(x[:, 1]), 0 * x[:, 0])),
    "COS_TH": (1, lambda x: _rusinkiewicz(_acos(x[:, 0]), 0 * x[:, 0], 0 * x[:, 0], 0 * x[:, 0])),
}
"""#PARAM_IN → how many coordinates it has, and how they become directions to the light and to the sensor."""

_REDUCED = {
    "RUSIN_TH_TD": "light and view at right angles to the plane of normal and half vector",
    "COS_TH_TD": "light and view in the plane of normal and half vector",
    "COS_TH": "light and view both along the half vector",
    "ISOTROPIC_TV_PROJ_DPHI": "the light along the normal",
}
