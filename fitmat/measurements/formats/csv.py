"""CSV: measurements as a table of text that `fitmat.read` reads.

It touches no file, and refuses a channel's name that would not be read back.
"""

from collections.abc import Iterable, Sequence

import numpy as np
from jaxtyping import Shaped

from fitmat.errors import OutputError, ReadError
from fitmat.measurements.parsing import cells, contents
from fitmat.measurements.parsing.names import Role, role
from fitmat.measurements.samples import Measurements, default_channels
from fitmat.text import visible

FLAT = 1e-6
"""Radians; an azimuth this close to 0 or π is written as the sign of theta_o."""

INFERRED, INFERRED_SD = "inferred", "inferred_sd"
"""The columns that tell what was inferred from what was measured, and how well it is known."""

CHANNEL = "channel"
"""The column that names the channel of each row, where the header cannot."""


def columns(measurements: Measurements) -> dict[str, Shaped[np.ndarray, " n"]]:
    """Angles in degrees, BRDF and σ in sr⁻¹, by the names under which they are read.

    theta_i, theta_o, brdf (brdf_r, … for several channels) and, where known, sigma; in the plane of incidence theta_o
    is signed, positive on the mirror side, else phi follows it, or phi_i and phi_o where the light does not always come
    from azimuth 0. Masked values are NaN. Where a channel's name would not be known again behind brdf_ or sigma_, each
    row is one value, and a column `channel` says of which channel. Where values were inferred, a column `inferred` has
    1 for these and 0 for what was measured, or one for each channel where they differ; `inferred_sd` is the standard
    deviation of these, and sigma the noise of what was measured, where it is known.
    """
    angles = {name: np.rad2deg(angle) for name, angle in _angles(measurements).items()}
    m, names = measurements, measurements.channels
    numbers = {kind: np.where(m.valid, number, np.nan) for kind, number in _numbers(m).items()}
    if m.inferred is not None and (m.inferred == m.inferred[:, :1]).all():
        angles |= {INFERRED: m.inferred[:, 0].astype(float)}
    elif m.inferred is not None:
        numbers |= {INFERRED: m.inferred.astype(float)}
    if names == default_channels(1):
        return angles | {kind: number[:, 0] for kind, number in numbers.items()}
    known = all(names) and all(
        role(f"{kind}_{name}") == Role(kind, name) for kind in ("brdf", "sigma") for name in names
    )
    if known and len(set(names)) == len(names):
        wide = ((kind, k) for kind in numbers for k in range(len(names)))
        return angles | {f"{kind}_{names[k]}": numbers[kind][:, k] for kind, k in wide}
    repeated = {name: np.repeat(angle, len(names)) for name, angle in angles.items()}
    labels = np.tile(np.array(names, dtype=object), m.n_samples)
    return repeated | {kind: number.ravel() for kind, number in numbers.items()} | {CHANNEL: labels}


def _numbers(m: Measurements) -> dict[str, Shaped[np.ndarray, "n c"]]:
    """Values, σ of what was measured where it is known, and that of what was inferred."""
    sigma = {} if m.sigma is None else {"sigma": m.sigma}
    if m.sigma is not None and m.inferred is not None:
        sigma = {"sigma": np.where(m.inferred, np.nan, m.sigma)} if m.sigma_given else {}
        sigma |= {INFERRED_SD: np.where(m.inferred, m.sigma, np.nan)}
    return {"brdf": m.value, **sigma}


def _angles(measurements: Measurements) -> dict[str, Shaped[np.ndarray, " n"]]:
    """The angles that are written, in radians."""
    m = measurements
    theta_i, theta_o, phi, phi_i = m.theta_i, m.theta_o, m.phi, m.phi_i
    aside = np.minimum(phi, np.pi - phi)
    flat = bool(np.all((aside < FLAT) | (theta_i < FLAT) | (theta_o < FLAT)))
    turned = bool(np.any(np.abs((phi_i + np.pi) % (2 * np.pi) - np.pi) > FLAT))
    angles = {"theta_i": theta_i, "theta_o": m.signed_theta_o if flat and not turned else theta_o}
    if turned:
        angles |= {"phi_i": phi_i, "phi_o": np.arctan2(m.wo[:, 1], m.wo[:, 0]) % (2 * np.pi)}
    elif not flat:
        angles |= {"phi": phi}
    return angles


def dump(measurements: Measurements, comments: Iterable[str] = ()) -> str:
    """The table of `columns` as text, masked values as nan.

    Values have 7 digits, angles 10⁻⁶ degrees, so that the same measurements give the same bytes.

    Args:
        measurements: What to write.
        comments: Lines to go before the header, each behind a #.

    Raises:
        OutputError: a channel's name would not be read back from a line of text.
    """
    table = columns(measurements)
    if CHANNEL in table:
        refuse_lost(measurements, [_read_back(name) for name in measurements.channels])
        table[CHANNEL] = np.array([_cell(name) for name in table[CHANNEL]], dtype=object)
    angles = [name for name in table if name.startswith(("theta", "phi"))]
    rounded = {name: np.round(column, 6) + 0.0 if name in angles else column for name, column in table.items()}
    line = ",".join(
        "%.9g" if name in angles or _counts(name) else "%s" if name == CHANNEL else "%.6e" for name in table
    )
    rows = [line % row for row in zip(*(column.tolist() for column in rounded.values()), strict=True)]
    return "\n".join([*(f"# {comment}" for comment in comments), ",".join(table), *rows, ""])


def _counts(name: str) -> bool:
    """Whether a column is 1 or 0."""
    return name.startswith(INFERRED) and not name.startswith(INFERRED_SD)


def refuse_lost(measurements: Measurements, back: Sequence[str | None]) -> None:
    """Stop at a channel's name that does not come back.

    Args:
        measurements: What is written.
        back: What would be read of each channel's name, None where nothing.

    Raises:
        OutputError: one of them differs, or two channels have one name.
    """
    names = measurements.channels
    for k, name in enumerate(names):
        same = "the name of two channels" if name in names[:k] else ""
        if got := same or (
            "" if name and back[k] == name else "a channel's name that would not be read back from such a file"
        ):
            expected = "expected names of letters, digits and signs, each once"
            raise OutputError(f"{measurements.source}: {visible(repr(name))} is {got}, {expected}. Rename the channel.")


def _read_back(name: str) -> str | None:
    """What is read of a channel's name where it is a cell of a row like all others."""
    rows = f"theta_i,theta_o,brdf,{CHANNEL}\n0,0,{1:.6e},{_cell(name)}\n"
    try:
        table = cells.parse(contents.decoded(rows.encode(), "")[0], "", ())
    except (ReadError, UnicodeEncodeError):
        return None
    return str(table.words(3)[0]) if len(table.names) == 4 and len(table.lines) == 1 else None


def _cell(name: str) -> str:
    """A name as a cell of a line."""
    doubled = name.replace('"', '""')
    return name if name.isalnum() else f'"{doubled}"'
