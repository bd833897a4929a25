"""Meaning: a valid table changed so that its numbers mean something else, over and over; how often is it misread?

Each table is read as it was meant, refused, or warned about; what is none of these is a silent misreading. What a table
means is known here and nowhere in fitmat.

    python tests/measurements/meaning.py --tables 2000 --seed 0
"""

import argparse
import dataclasses
import sys
import tempfile
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

import fitmat as fm
from fitmat.errors import FitmatError

CLOSE = 2e-3
"""Relative: numbers are written with five digits, decibels with three behind the point."""

MINUS = "−"


@dataclasses.dataclass
class Table:
    """What was measured, and how it is written.

    Attributes:
        angles: Column → degrees, (n,); theta_o is signed where there is no phi.
        value: f_r in sr⁻¹, (n,).
        written: Column → cells as they stand in the file.
        quantity: Name of the column of values.
        lost: Rows whose value stands for nothing.
        delimiter: Between cells.
        wavelengths: Of the channels in nm, as text; empty where there is one channel without.
        above: What stands above the header.
        panel: The reflectance factor of the white panel, as its owner says; None where there is none.
    """

    angles: dict[str, np.ndarray]
    value: np.ndarray
    written: dict[str, list[str]]
    quantity: str
    lost: np.ndarray
    delimiter: str = ","
    wavelengths: tuple[str, ...] = ()
    above: str = ""
    panel: float | None = None

    def text(self) -> str:
        """The file."""
        rows = zip(*self.written.values(), strict=True)
        return self.above + "\n".join(self.delimiter.join(row) for row in [tuple(self.written), *rows]) + "\n"


def made(rng: np.random.Generator) -> Table:
    """Readings with noise of a diffuse surface with a lobe, at two to four incidences, with or without azimuths."""
    theta_i = np.sort(rng.choice(np.arange(10, 71, 5), rng.integers(2, 5), replace=False)).astype(float)
    sensor = np.arange(-75.0, 75.1, rng.choice([2.5, 5.0]))
    incidence, signed = (part.ravel() for part in np.meshgrid(theta_i, sensor, indexing="ij"))
    width, height, floor = rng.uniform(4, 12), np.exp(rng.uniform(0, 4)), rng.uniform(0.02, 0.25)
    f = floor + height * np.exp(-(((signed - incidence) / width) ** 2)) * floor
    f = f * (1 + 0.01 * rng.normal(size=f.shape))
    angles = {"theta_i": incidence, "theta_o": signed}
    if rng.random() < 0.5:
        angles = {"theta_i": incidence, "theta_o": np.abs(signed), "phi": np.where(signed >= 0, 180.0, 0.0)}
    quantity = str(rng.choice(["brdf", "reflectance_factor"]))
    number = f if quantity == "brdf" else np.pi * f
    written = {name: [f"{x:g}" for x in part] for name, part in angles.items()}
    return Table(angles, f, written | {quantity: [f"{x:.5g}" for x in number]}, quantity, np.zeros(f.shape, bool))


def numbers(table: Table) -> np.ndarray:
    """The values as the file has them."""
    return table.value if table.quantity == "brdf" else np.pi * table.value


def _angle(table: Table, name: str, cells: np.ndarray, renamed: str | None = None) -> None:
    table.written = {
        (renamed or name) if key == name else key: [f"{x:.6g}" for x in cells] if key == name else part
        for key, part in table.written.items()
    }


def _values(table: Table, cells: list[str], renamed: str | None = None) -> None:
    table.written = {
        (renamed or key) if key == table.quantity else key: cells if key == table.quantity else part
        for key, part in table.written.items()
    }


def azimuth_in_radians(t: Table, rng: np.random.Generator) -> None:
    if "phi" in t.angles:
        _angle(t, "phi", np.deg2rad(t.angles["phi"]))
    else:
        _angle(t, "theta_o", np.deg2rad(t.angles["theta_o"]))


def everything_in_radians(t: Table, rng: np.random.Generator) -> None:
    for name, angle in t.angles.items():
        _angle(t, name, np.deg2rad(angle))


def radians_in_the_header(t: Table, rng: np.random.Generator) -> None:
    name = str(rng.choice(list(t.angles)))
    _angle(t, name, np.deg2rad(t.angles[name]), f"{name} [rad]")


def gon_in_the_header(t: Table, rng: np.random.Generator) -> None:
    name = str(rng.choice(list(t.angles)))
    _angle(t, name, t.angles[name] / 0.9, f"{name} [gon]")


def negative_zenith(t: Table, rng: np.random.Generator) -> None:
    """Beside an azimuth: the same direction as the positive one, half a turn on."""
    turned = rng.random(t.value.shape) < 0.5
    if "phi" in t.angles:
        _angle(t, "theta_o", np.where(turned, -1.0, 1.0) * t.angles["theta_o"])
        _angle(t, "phi", (t.angles["phi"] + 180.0 * turned) % 360.0)
    else:
        light_on_the_negative_side(t, rng)


def a_whole_turn(t: Table, rng: np.random.Generator) -> None:
    if "phi" in t.angles:
        _angle(t, "phi", t.angles["phi"] - 360.0 * (t.angles["phi"] > 0))
    else:
        _angle(t, "theta_o", t.angles["theta_o"] % 360.0)


def elevation_by_name(t: Table, rng: np.random.Generator) -> None:
    if "phi" in t.angles:
        _angle(t, "theta_o", 90.0 - t.angles["theta_o"], "elevation_o")
    _angle(t, "theta_i", 90.0 - t.angles["theta_i"], "elevation_i")


def elevation_of_the_sensor(t: Table, rng: np.random.Generator) -> None:
    """Nobody can tell it of light within 15° of 45°, or where the peak leaves the scan."""
    aside = np.abs(t.angles["theta_i"] - 45.0)
    if "phi" in t.angles and ((aside > 15.0) & (aside <= 25.0)).any():
        _angle(t, "theta_o", 90.0 - t.angles["theta_o"])
    else:
        elevation_by_name(t, rng)


def elevations_of_both(t: Table, rng: np.random.Generator) -> None:
    """Their names say zenith; without an azimuth an elevation has no sign."""
    if "phi" in t.angles:
        _angle(t, "theta_i", 90.0 - t.angles["theta_i"])
        _angle(t, "theta_o", 90.0 - t.angles["theta_o"])
    else:
        elevation_by_name(t, rng)


def light_on_the_negative_side(t: Table, rng: np.random.Generator) -> None:
    if "phi" in t.angles:
        mirrored_azimuth(t, rng)
    else:
        _angle(t, "theta_i", -t.angles["theta_i"])


def mirrored_azimuth(t: Table, rng: np.random.Generator) -> None:
    if "phi" in t.angles:
        _angle(t, "phi", 180.0 - t.angles["phi"])
    else:
        _angle(t, "theta_o", -t.angles["theta_o"])


def turned_azimuth(t: Table, rng: np.random.Generator) -> None:
    if "phi" in t.angles:
        _angle(t, "phi", (t.angles["phi"] + rng.choice([90.0, 270.0])) % 360.0)
    else:
        mirrored_azimuth(t, rng)


def satellite_names(t: Table, rng: np.random.Generator) -> None:
    names = {"theta_i": "SZA", "theta_o": "VZA", "phi": "RAA", "brdf": "BRDF", "reflectance_factor": "BRF"}
    t.written = {names[key]: cells for key, cells in t.written.items()}


def decibels(t: Table, rng: np.random.Generator) -> None:
    _values(t, [f"{x:.3f}" for x in 10 * np.log10(numbers(t))], str(rng.choice([t.quantity, f"{t.quantity} [dB]"])))


def logarithms(t: Table, rng: np.random.Generator) -> None:
    _values(t, [f"{x:.4f}" for x in np.log10(numbers(t))], str(rng.choice([t.quantity, f"log10({t.quantity})"])))


def percent(t: Table, rng: np.random.Generator) -> None:
    t.quantity, before = "reflectance_factor", t.quantity
    cells = [f"{x:.5g}" for x in 100 * np.pi * t.value]
    name = str(rng.choice(["reflectance_factor", "reflectance_factor [%]"]))
    t.written = {name if key == before else key: cells if key == before else part for key, part in t.written.items()}


def thousands(t: Table, rng: np.random.Generator) -> None:
    """Counts of the sample beside those of a white panel, with commas between thousands."""
    t.delimiter = str(rng.choice([",", ";", "\t"]))
    _counts(t, '"{:,.0f}"' if t.delimiter == "," else "{:,.0f}", 50_000.0)


def thousands_with_points(t: Table, rng: np.random.Generator) -> None:
    """As where the comma is the decimal mark; where every count has a point, nobody can tell; some have none."""
    t.delimiter = str(rng.choice([",", ";", "\t"]))
    _counts(t, "{:,.0f}", min(50_000.0, 999.0 / (np.pi * t.value.min())))
    t.written = {key: [cell.replace(",", ".") for cell in cells] for key, cells in t.written.items()}


def _counts(t: Table, written: str, white: float) -> None:
    reference = np.full(t.value.shape, np.floor(white))
    counts = np.round(np.pi * t.value * reference)
    t.value, t.panel = counts / reference / np.pi, 1.0
    del t.written[t.quantity]
    t.written |= {
        name: [written.format(x) for x in part] for name, part in (("signal", counts), ("reference", reference))
    }


def separator_line(t: Table, rng: np.random.Generator) -> None:
    """As a spreadsheet is told by."""
    t.delimiter = str(rng.choice([",", ";", "|", "\t"]))
    t.above = f"sep={t.delimiter}\n"


def decimal_commas(t: Table, rng: np.random.Generator) -> None:
    t.written = {key: [cell.replace(".", ",") for cell in part] for key, part in t.written.items()}
    t.delimiter = ";"


def sentinels(t: Table, rng: np.random.Generator) -> None:
    mark = str(rng.choice(["-999", "-9999", "9999", "-99", "-1e30", "99999", "-999.0"]))
    t.lost = rng.random(t.value.shape) < 0.1
    t.lost[:2] = True
    _values(t, [mark if lost else cell for cell, lost in zip(t.written[t.quantity], t.lost, strict=True)])


def blocked_readings(t: Table, rng: np.random.Generator) -> None:
    """A few neighbours of one curve, all of one tiny value: the dark level of the instrument."""
    first = rng.integers(0, len(t.value) - 12)
    run = np.arange(first, first + rng.integers(3, 13))
    t.lost[run[t.angles["theta_i"][run] == t.angles["theta_i"][run[0]]]] = True
    if t.lost.sum() < 3:
        t.lost[run[0] - 3 : run[0] + 1] = True
    mark = str(rng.choice(["1e-06", "0.00001", "0.0001"]))
    _values(t, [mark if lost else cell for cell, lost in zip(t.written[t.quantity], t.lost, strict=True)])


def words_for_nothing(t: Table, rng: np.random.Generator) -> None:
    """In the first column as well, as spreadsheets write them."""
    mark = str(rng.choice(["NA", "NaN", "#N/A", "#DIV/0!", "", "n/a", "--"]))
    t.lost = rng.random(t.value.shape) < 0.1
    if rng.random() < 0.5:
        t.written = {t.quantity: t.written[t.quantity], **t.written}
    _values(t, [mark if lost else cell for cell, lost in zip(t.written[t.quantity], t.lost, strict=True)])


def typographic_signs(t: Table, rng: np.random.Generator) -> None:
    t.written = {key: [cell.replace("-", MINUS) for cell in part] for key, part in t.written.items()}


def fortran(t: Table, rng: np.random.Generator) -> None:
    _values(t, [f"{x:.5E}".replace("E", "D") for x in numbers(t)])


def units_below(t: Table, rng: np.random.Generator) -> None:
    units = {"theta_i": "deg", "theta_o": "deg", "phi": "deg", "brdf": "1/sr", "reflectance_factor": "1"}
    t.written = {key: [units[key], *cells] for key, cells in t.written.items()}


def quoted(t: Table, rng: np.random.Generator) -> None:
    t.written = {f'"{key}"': [f'"{cell}"' for cell in cells] for key, cells in t.written.items()}


def two_samples(t: Table, rng: np.random.Generator) -> None:
    """In one file, the second at most two thirds as bright: no repeats of one."""
    cells = [f"{float(cell) * rng.uniform(0.2, 0.65):.5g}" for cell in t.written[t.quantity]]
    t.written = {key: [*part, *(cells if key == t.quantity else part)] for key, part in t.written.items()}
    t.written["sample"] = ["A"] * len(cells) + ["B"] * len(cells)


def angle_from_the_mirror(t: Table, rng: np.random.Generator) -> None:
    """Nobody can tell it where the peak lies at the end of the scan."""
    if "phi" in t.angles or np.count_nonzero(np.unique(t.angles["theta_i"]) <= 50.0) < 2:
        two_samples(t, rng)
    else:
        _angle(t, "theta_o", t.angles["theta_o"] - t.angles["theta_i"])


def arm_from_the_horizon(t: Table, rng: np.random.Generator) -> None:
    """90° is the normal, and 180° the other horizon."""
    if "phi" in t.angles:
        two_samples(t, rng)
    else:
        _angle(t, "theta_o", 90.0 + t.angles["theta_o"])


def wavelength_in_micrometres(t: Table, rng: np.random.Generator) -> None:
    """With the unit, or without it."""
    name, length = str(rng.choice(["wavelength", "wavelength [µm]", "lambda"])), int(rng.integers(350, 2500))
    t.written[name] = [f"{1e-3 * length:.3f}"] * len(t.value)
    t.wavelengths = (str(length),)


def wavelength_in_nanometres(t: Table, rng: np.random.Generator) -> None:
    length = int(rng.integers(350, 2500))
    t.written[str(rng.choice(["wavelength", "wavelength [nm]", "lambda"]))] = [str(length)] * len(t.value)
    t.wavelengths = (str(length),)


def wavelengths_in_two_units(t: Table, rng: np.random.Generator) -> None:
    """Every geometry at two of them, one in nm and one in µm."""
    shorter, longer = int(rng.integers(350, 900)), int(rng.integers(950, 2500))
    pair, n = [str(shorter), f"{1e-3 * longer:.3f}"], len(t.value)
    rng.shuffle(pair)
    t.written = {key: [*cells, *cells] for key, cells in t.written.items()}
    name = str(rng.choice(["wavelength", "wavelength [µm]", "wavelength [nm]", "lambda", "channel"]))
    t.written[name] = [pair[0]] * n + [pair[1]] * n
    t.wavelengths = str(shorter), str(longer)


KINDS: tuple[Callable[[Table, np.random.Generator], None], ...] = (
    azimuth_in_radians,
    everything_in_radians,
    radians_in_the_header,
    gon_in_the_header,
    negative_zenith,
    a_whole_turn,
    elevation_by_name,
    elevation_of_the_sensor,
    elevations_of_both,
    light_on_the_negative_side,
    mirrored_azimuth,
    turned_azimuth,
    satellite_names,
    decibels,
    logarithms,
    percent,
    thousands,
    thousands_with_points,
    separator_line,
    decimal_commas,
    sentinels,
    blocked_readings,
    words_for_nothing,
    typographic_signs,
    fortran,
    units_below,
    quoted,
    two_samples,
    angle_from_the_mirror,
    arm_from_the_horizon,
    wavelength_in_micrometres,
    wavelength_in_nanometres,
    wavelengths_in_two_units,
)


def outcome(table: Table, folder: Path) -> str:
    """How a table is read: "right", "refused", "warned" or "misread"."""
    path = folder / "table.csv"
    path.write_text(table.text(), encoding="utf-8")
    try:
        found = fm.read(path, panel=table.panel)
    except FitmatError:
        return "refused"
    if _is_right(table, found):
        return "right"
    return "warned" if found.warnings else "misread"


def _is_right(table: Table, found: fm.Measurements) -> bool:
    meant = fm.read({**table.angles, "brdf": table.value}, forward=None if "phi" in table.angles else "positive")
    if table.wavelengths and found.channels != table.wavelengths:
        return False
    if found.n_samples != meant.n_samples or not np.array_equal(found.valid[:, 0], ~table.lost):
        return False
    kept = ~table.lost
    same = [np.allclose(getattr(found, w)[kept], getattr(meant, w)[kept], atol=1e-5) for w in ("wi", "wo")]
    return all(same) and np.allclose(found.value[kept, 0], table.value[kept], rtol=CLOSE)


def tried(tables: int, seed: int) -> dict[str, Counter[str]]:
    """Outcomes by kind of so many tables, each of one kind after the other; inputs that are misread are printed."""
    counts = {kind.__name__: Counter[str]() for kind in KINDS}
    with tempfile.TemporaryDirectory() as folder:
        for k in range(tables):
            rng, kind = np.random.default_rng([seed, k]), KINDS[k % len(KINDS)]
            table = made(rng)
            kind(table, rng)
            found = outcome(table, Path(folder))
            counts[kind.__name__][found] += 1
            if found == "misread" and counts[kind.__name__][found] == 1:
                print(f"misread: table {k} of seed {seed}, {kind.__name__}\n{table.text()[:300]}")
    return counts


def report(counts: dict[str, Counter[str]]) -> Any:
    """The table of outcomes, and the rate of silent misreadings."""
    outcomes = ("right", "refused", "warned", "misread")
    for kind, found in counts.items():
        print(f"{kind:28}", "  ".join(f"{name} {found[name]:4}" for name in outcomes))
    whole = sum(sum(found.values()) for found in counts.values())
    lost = sum(found["misread"] for found in counts.values())
    print(f"silent misreadings: {lost} of {whole}")
    return lost


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--tables", type=int, default=2000)
    parser.add_argument("--seed", type=int, default=0)
    given = parser.parse_args()
    sys.exit(bool(report(tried(given.tables, given.seed))))
