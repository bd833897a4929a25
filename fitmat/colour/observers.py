"""Observers and illuminants of the CIE, as tables of 1 nm: what light becomes three numbers for an eye.

Nothing is interpolated beyond the tables and no illuminant is made up; the tables come from colour-science
(`benchmarks/observer.py`), which no run needs.
"""

import functools
from pathlib import Path

import numpy as np
from jaxtyping import Float

from fitmat import arguments

FILE = Path(__file__).with_name("observers.npz")
"""`wavelength` in nm, (n,); the observers' colour-matching functions, (n, 3); the illuminants' relative power, (n,)."""

OBSERVERS = {"2": "CIE 1931 2° observer", "10": "CIE 1964 10° observer"}
"""Name → in words."""

ILLUMINANTS = {
    "D65": "daylight at noon (D65)",
    "D50": "warm daylight (D50)",
    "A": "an incandescent lamp (A)",
    "FL2": "a cool white fluorescent lamp (FL2)",
    "FL11": "a narrow-band fluorescent lamp (FL11)",
    "LED-B3": "a white LED (LED-B3)",
    "E": "equal energy (E)",
}
"""Name → in words."""


@functools.cache
def wavelengths() -> Float[np.ndarray, " n"]:
    """The grid of all tables: 360 to 830 nm in steps of 1 nm."""
    return _table("wavelength")


@functools.cache
def seen(illuminant: str = "D65", observer: str = "2") -> Float[np.ndarray, "n 3"]:
    """What 1 nm of a white surface adds to X, Y and Z: S(λ) x̄(λ)/∫ S ȳ dλ, at `wavelengths`.

    XYZ = R @ seen of a reflectance R(λ) (CIE 15:2018, sec. 7.1), so that Y of white is 1.

    Args:
        illuminant: A key of `ILLUMINANTS`. D50, D65 and the lamps are linear between the nodes of their tables, as the
            CIE says; beyond them 0.
        observer: A key of `OBSERVERS`.

    Raises:
        FitmatError: either is not known.
    """
    arguments.choice("illuminant", illuminant, ILLUMINANTS)
    arguments.choice("observer", observer, OBSERVERS)
    products = _table(f"observer {observer}") * _table(illuminant)[:, None]
    return products / products[:, 1].sum()


@functools.cache
def white(illuminant: str = "D65", observer: str = "2") -> Float[np.ndarray, "3"]:
    """CIE XYZ of a surface that reflects everything, Y = 1."""
    return seen(illuminant, observer).sum(axis=0)


def _table(name: str) -> np.ndarray:
    with np.load(FILE) as arrays:
        return arrays[name]
