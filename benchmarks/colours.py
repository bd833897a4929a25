"""Remakes the tables of docs/colour.md: Fresnel in RGB against the spectrum, metals, and the oxides of titanium.

Run: pip install -e '.[materials]', then python benchmarks/colours.py
"""

import re
from pathlib import Path

import numpy as np

from fitmat.colour import observers
from fitmat.colour.differences import to_lab
from fitmat.colour.spaces import to_srgb
from fitmat.models import spectral
from fitmat.models.in_rgb import WAYS, InRgb, fresnel_in_rgb, published
from fitmat.models.refractive_index import MATERIALS
from fitmat.models.terms.film import film

PAGE = Path(__file__).parents[1] / "docs" / "colour.md"
METALS, DIELECTRICS = ("Au", "Ag", "Cu", "Al", "Fe", "Cr", "Ti", "W"), ("N-BK7", "SF11", "diamond", "water")

OXIDES = {
    **{0: "grey metal", 25: "yellow", 41: "purple", 50: "blue", 62: "light blue", 82: "silver", 118: "yellow"},
    **{138: "pink", 150: "violet", 163: "cobalt", 193: "green", 212: "greenish yellow", 245: "pink"},
}
"""Thickness in nm → colour of anodised titanium as it is published, in the order of rising voltage."""


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


def oxide(nm: int, word: str) -> str:
    """A row: the colour of titanium under so much of its oxide, at normal incidence under D65."""
    um = 1e-3 * observers.wavelengths()
    xyz = film(1.0, um, float(nm), 2.2 + 0.06 / um**2 + 0j, spectral.indices("Ti")) @ observers.seen()
    light, a, b = to_lab(xyz)
    shown = "#" + "".join(f"{round(255 * float(x)):02x}" for x in to_srgb(xyz))
    return (
        f"| {nm} | {word} | {shown} | {light:.0f} | {np.hypot(a, b):.0f} | {np.rad2deg(np.arctan2(b, a)) % 360:.0f}° |"
    )


def main() -> None:
    """Writes each table between its marks."""
    head = f"| | {' | '.join(WAYS)} |\n|---|{'---:|' * len(WAYS)}"
    tables = {
        illuminant: "\n".join([head, *(errors(fresnel_in_rgb(name, illuminant)) for name in METALS + DIELECTRICS)])
        for illuminant in ("D65", "A")
    }
    head = "| | F0, linear sRGB | edge tint | measured by | ΔE2000 of the furthest dataset |\n|---|---|---|---|---|"
    tables["metals"] = "\n".join([head, *map(colours, METALS)])
    head = "| oxide, nm | published | sRGB | L* | C* | h |\n|---:|---|---|---:|---:|---:|"
    tables["oxides"] = "\n".join([head, *(oxide(*row) for row in OXIDES.items())])
    text = PAGE.read_text(encoding="utf-8")
    for mark, table in tables.items():
        text = re.sub(rf"(<!-- {mark} -->\n).*?(<!-- /{mark} -->)", rf"\g<1>{table}\n\g<2>", text, flags=re.DOTALL)
    PAGE.write_text(text, encoding="utf-8")
    print(f"{PAGE}: {len(tables)} tables.")


if __name__ == "__main__":
    main()
