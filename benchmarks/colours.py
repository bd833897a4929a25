"""Remakes the tables of docs/colour.md: Fresnel in RGB against the spectrum, for eight metals and four dielectrics.

Run: pip install -e '.[materials]', then python benchmarks/colours.py
"""

import re
from pathlib import Path

from fitmat.models.in_rgb import WAYS, InRgb, fresnel_in_rgb, published
from fitmat.models.refractive_index import MATERIALS

PAGE = Path(__file__).parents[1] / "docs" / "colour.md"
METALS, DIELECTRICS = ("Au", "Ag", "Cu", "Al", "Fe", "Cr", "Ti", "W"), ("N-BK7", "SF11", "diamond", "water")


def errors(found: InRgb) -> str:
    """A row: the largest ΔE2000 of each way and where."""
    cells = ["{:.1f} ({:.0f}°)".format(*found.worst(way)) for way in WAYS]
    return f"| {found.material} | {' | '.join(cells)} |"


def colours(name: str) -> str:
    """A row: F0 and edge tint of a metal, and the furthest dataset."""
    found, others = fresnel_in_rgb(name), published(name)
    f0, tint = (" ".join(f"{value:.3f}" for value in values) for values in (found.f0, found.tint))
    who = MATERIALS[name].doc.rpartition(";")[2].strip().rstrip(".")
    far = f"{others.delta_e_2000:.1f} ({others.furthest.rpartition('/')[2]}, of {others.datasets})"
    return f"| {name} | {f0} | {tint} | {who} | {far} |"


def main() -> None:
    """Writes each table between its marks."""
    head = f"| | {' | '.join(WAYS)} |\n|---|{'---:|' * len(WAYS)}"
    tables = {
        illuminant: "\n".join([head, *(errors(fresnel_in_rgb(name, illuminant)) for name in METALS + DIELECTRICS)])
        for illuminant in ("D65", "A")
    }
    head = "| | F0, linear sRGB | edge tint | measured by | ΔE2000 of the furthest dataset |\n|---|---|---|---|---|"
    tables["metals"] = "\n".join([head, *map(colours, METALS)])
    text = PAGE.read_text(encoding="utf-8")
    for mark, table in tables.items():
        text = re.sub(rf"(<!-- {mark} -->\n).*?(<!-- /{mark} -->)", rf"\g<1>{table}\n\g<2>", text, flags=re.DOTALL)
    PAGE.write_text(text, encoding="utf-8")
    print(f"{PAGE}: {len(tables)} tables.")


if __name__ == "__main__":
    main()
