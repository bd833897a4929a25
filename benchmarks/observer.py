"""Remakes the CIE observer and daylight that come with fitmat from colour-science.

`fitmat/match/appearance/observer.npz` holds `wavelength`, 360 to 830 nm in steps of 1 nm, (n,), and `seen`, the
colour-matching functions of the CIE 1931 2° standard observer times the relative power of D65, (n, 3): CIE interpolates
D65 linearly (CIE 15:2018), and beyond its table it is 0. `tests/match/appearance/test_colour.py` compares the file with
colour-science.

Run: pip install colour-science, then python benchmarks/observer.py
"""

import colour
import numpy as np

from fitmat.match.appearance.colour import FILE

OBSERVER, ILLUMINANT = "CIE 1931 2 Degree Standard Observer", "D65"


def main() -> None:
    """Writes the file."""
    matching, light = colour.MSDS_CMFS[OBSERVER], colour.SDS_ILLUMINANTS[ILLUMINANT]
    power = np.interp(matching.wavelengths, light.wavelengths, light.values, right=0.0)
    np.savez_compressed(FILE, wavelength=matching.wavelengths, seen=matching.values * power[:, None])
    print(f"{FILE}: {len(matching.wavelengths)} wavelengths, {FILE.stat().st_size} bytes.")


if __name__ == "__main__":
    main()
