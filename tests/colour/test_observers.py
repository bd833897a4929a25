"""Observers and illuminants against colour-science, the CIE's printed numbers, and Planck's law."""

from types import ModuleType

import numpy as np
import pytest

from fitmat.colour import observers
from fitmat.errors import FitmatError

LONG = {"2": "CIE 1931 2 Degree Standard Observer", "10": "CIE 1964 10 Degree Standard Observer"}


@pytest.mark.parametrize("observer", observers.OBSERVERS)
@pytest.mark.parametrize("illuminant", observers.ILLUMINANTS)
def test_tables_are_those_of_colour_science(science: ModuleType, observer: str, illuminant: str) -> None:
    """Multiplied at 1 nm, illuminants interpolated between their nodes."""
    matching, light = science.MSDS_CMFS[LONG[observer]], science.SDS_ILLUMINANTS[illuminant]
    power = np.interp(matching.wavelengths, light.wavelengths, light.values, left=0.0, right=0.0)
    expected = matching.values * power[:, None]
    np.testing.assert_array_equal(observers.wavelengths(), matching.wavelengths)
    np.testing.assert_allclose(
        observers.seen(illuminant, observer), expected / expected[:, 1].sum(), rtol=1e-12, atol=1e-18
    )


@pytest.mark.parametrize(
    ("illuminant", "observer", "printed"),
    [
        ("D65", "2", (95.047, 100.0, 108.883)),
        ("D50", "2", (96.422, 100.0, 82.521)),
        ("A", "2", (109.850, 100.0, 35.585)),
        ("D65", "10", (94.811, 100.0, 107.304)),
        ("A", "10", (111.144, 100.0, 35.200)),
        ("FL2", "2", (99.186, 100.0, 67.393)),
        ("FL11", "2", (100.962, 100.0, 64.350)),
    ],
)
def test_whites_are_those_that_astm_printed(
    illuminant: str, observer: str, printed: tuple[float, float, float]
) -> None:
    """ASTM E308-01, table 5. Lines of fluorescent lamps, drawn out between 5 nm, move their white by up to 0.09."""
    atol = 0.1 if illuminant.startswith("FL") else 0.02
    np.testing.assert_allclose(100.0 * observers.white(illuminant, observer), printed, atol=atol)


def test_the_lamp_is_planckian() -> None:
    """CIE 15:2018, eq. 4.1: illuminant A, 2848 K with c₂ = 1.435e-2 m K, relative to 560 nm.

    S E = seen(E), so that the ratio of the two is S up to a factor.
    """
    nm = np.array([400.0, 500.0, 560.0, 650.0, 700.0])
    at = np.searchsorted(observers.wavelengths(), nm)
    ratio = observers.seen("A")[at, 0] / observers.seen("E")[at, 0]
    planck = (560.0 / nm) ** 5 * np.expm1(1.435e7 / (2848.0 * 560.0)) / np.expm1(1.435e7 / (2848.0 * nm))
    np.testing.assert_allclose(ratio / ratio[2], planck, rtol=1e-5)


def test_what_is_not_known_is_refused() -> None:
    with pytest.raises(FitmatError, match="illuminant is the text 'D64', expected 'D65' or 'D50' or"):
        observers.seen("D64")
    with pytest.raises(FitmatError, match="observer is the text '5', expected '2' or '10'"):
        observers.seen("D65", "5")
