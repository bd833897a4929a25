"""Characteristic matrices of a layer, M. Born & E. Wolf, Principles of Optics, 7th ed., sec. 1.6.2–1.6.4, as printed.

Complex angles by Snell's law, one matrix a layer and polarisation, for waves e^{−iωt} and indices n + ik; it shares no
step with Airy's sum.
"""

from collections.abc import Sequence

import numpy as np


def reflectance(theta: float, nm: float, layers: Sequence[tuple[complex, float]], base: complex) -> tuple[float, float]:
    """|r|² of light polarised across the plane of incidence (TE) and in it (TM), from vacuum.

    Args:
        theta: Angle of incidence, radians.
        nm: Wavelength in vacuum.
        layers: Index and thickness in nm of each, the outermost first.
        base: Index of what lies below.
    """
    found = []
    for transverse_electric in (True, False):

        def slope(n: complex, electric: bool = transverse_electric) -> complex:
            """P = n cosθ of TE, q = cosθ/n of TM (eqs. 51 and 55, μ = 1)."""
            return n * _cos(n, theta) if electric else _cos(n, theta) / n

        matrix = np.eye(2, dtype=complex)
        for n, thickness in layers:
            delta, p = 2.0 * np.pi / nm * n * thickness * _cos(n, theta), slope(n)
            matrix = matrix @ np.array(
                [[np.cos(delta), -1j / p * np.sin(delta)], [-1j * p * np.sin(delta), np.cos(delta)]]
            )
        (m11, m12), (m21, m22) = matrix
        first, last = slope(1.0), slope(base)
        above, below = (m11 + m12 * last) * first, m21 + m22 * last
        found.append(float(np.abs((above - below) / (above + below)) ** 2))
    return found[0], found[1]


def _cos(n: complex, theta: float) -> complex:
    """Of the complex angle inside, from n sinθ' = sinθ, the wave that decays."""
    root = np.sqrt(complex(1.0 - (np.sin(theta) / n) ** 2))
    return complex(root if (n * root).imag >= 0.0 else -root)
