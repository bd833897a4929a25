"""Remakes the CIE observers and illuminants that come with fitmat from colour-science.

`fitmat/colour/observers.npz` holds `wavelength`, 360 to 830 nm in steps of 1 nm, (n,), the colour-matching functions of
the observers, (n, 3), and the relative power of the illuminants, (n,): linear between the nodes of their tables (CIE
15:2018 interpolates D65 so), and 0 beyond. `tests/colour/test_observers.py` compares the file with colour-science.

Run: pip install colour-science, then python benchmarks/observer.py
"""

import colour
import numpy as np

from fitmat.colour.observers import FILE, ILLUMINANTS

OBSERVERS = {"2": "CIE 1931 2 Degree Standard Observer", "10": "CIE 1964 10 Degree Standard Observer"}


def main() -> None:
    """Writes the file."""
    matching = {name: colour.MSDS_CMFS[long] for name, long in OBSERVERS.items()}
    grid = matching["2"].wavelengths
    tables = {"wavelength": grid} | {f"observer {name}": found.values for name, found in matching.items()}
    for name in ILLUMINANTS:
        light = colour.SDS_ILLUMINANTS[name]
        tables[name] = np.interp(grid, light.wavelengths, light.values, left=0.0, right=0.0)
    np.savez_compressed(FILE, **tables)
    print(f"{FILE}: {len(grid)} wavelengths, {len(tables)} tables, {FILE.stat().st_size} bytes.")


if __name__ == "__main__":
    main()
