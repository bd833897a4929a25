"""Differences of colours against published numbers, the formulas of the standards, and colour-science."""

from types import ModuleType

import numpy as np
import pytest

from fitmat.colour import differences
from fitmat.colour.differences import delta_e_2000, delta_e_itp, greys_2000, greys_itp

PRINTED = 5e-5
"""ΔE2000; Sharma's table has four digits after the point."""

ROUNDING = 1e-9
"""Differences, absolute: the power of 78.8 in the perceptual quantiser takes five digits."""

OBSERVER, ILLUMINANT = "CIE 1931 2 Degree Standard Observer", "D65"

STANDARD = 1e-3
"""ΔE_ITP, relative; the matrix of BT.2020 from its chromaticities here, rounded to four digits by some."""

WHITE = np.array([0.3127 / 0.3290, 1.0, (1 - 0.3127 - 0.3290) / 0.3290])

SHARMA = np.array(
    """50 2.6772 -79.7751 50 0 -82.7485 2.0425; 50 3.1571 -77.2803 50 0 -82.7485 2.8615
    50 2.8361 -74.02 50 0 -82.7485 3.4412; 50 -1.3802 -84.2814 50 0 -82.7485 1.0
    50 -1.1848 -84.8006 50 0 -82.7485 1.0; 50 -0.9009 -85.5211 50 0 -82.7485 1.0
    50 0 0 50 -1 2 2.3669; 50 -1 2 50 0 0 2.3669
    50 2.49 -0.001 50 -2.49 0.0009 7.1792; 50 2.49 -0.001 50 -2.49 0.0011 7.2195
    50 2.49 -0.001 50 -2.49 0.0012 7.2195; 50 -0.001 2.49 50 0.0009 -2.49 4.8045
    50 -0.001 2.49 50 0.0011 -2.49 4.7461; 50 2.5 0 50 0 -2.5 4.3065
    50 2.5 0 73 25 -18 27.1492; 50 2.5 0 61 -5 29 22.8977
    50 2.5 0 56 -27 -3 31.9030; 50 2.5 0 58 24 15 19.4535
    50 2.5 0 50 3.1736 0.5854 1.0; 50 2.5 0 50 3.2972 0 1.0
    50 2.5 0 50 1.8634 0.5757 1.0; 50 2.5 0 50 3.2592 0.335 1.0
    60.2574 -34.0099 36.2677 60.4626 -34.1751 39.4387 1.2644; 63.0109 -31.0961 -5.8663 62.8187 -29.7946 -4.0864 1.2630
    61.2901 3.7196 -5.3901 61.4292 2.2480 -4.9620 1.8731; 35.0831 -44.1164 3.7933 35.0232 -40.0716 1.5901 1.8645
    22.7233 20.0904 -46.6940 23.0331 14.9730 -42.5619 2.0373; 36.4612 47.8580 18.3852 36.2715 50.5065 21.2231 1.4146
    90.8027 -2.0831 1.4410 91.1528 -1.6435 0.0447 1.4441; 90.9257 -0.5406 -0.9208 88.6381 -0.8985 -0.7239 1.5381
    6.7747 -0.2908 -2.4247 5.8714 -0.0985 -2.2286 0.6377; 2.0776 0.0795 -1.1350 0.9033 -0.0636 -0.5514 0.9082
    """.replace(";", " ").split(),
    float,
).reshape(-1, 7)
"""Sharma, Wu & Dalal 2005, table 1: two colours in L*a*b* and their ΔE2000.

Left out are pairs 10 and 14: opposite hues to the last digit, where the formula jumps and rounding decides.
"""

JUMPS = np.array([[50, 2.49, -0.001, 50, -2.49, 0.001, 7.1792], [50, -0.001, 2.49, 50, 0.001, -2.49, 4.8045]])
"""Pairs 10 and 14, which only L*a*b* itself holds to the last digit."""


def to_xyz(lab: np.ndarray) -> np.ndarray:
    """CIE 15:2018, the inverse of eqs. 8.3–8.8, white at Y = 1."""
    f = (lab[:, :1] + 16) / 116 + np.stack([lab[:, 1] / 500, 0 * lab[:, 1], -lab[:, 2] / 200], axis=1)
    return WHITE * np.where(f > 6 / 29, f**3, 3 * (6 / 29) ** 2 * (f - 4 / 29))


def test_greys_are_colours_without_chroma() -> None:
    """By the formulas for any colour; up to where Z would be clipped, 44 times brighter than white."""
    one, other = np.meshgrid([0.0, 1e-4, 0.005, 0.18, 0.9, 1.0, 30.0, 40.0], [0.0, 2e-4, 0.2, 1.0, 3.0])
    of_any = [function(one[..., None] * WHITE, other[..., None] * WHITE) for function in (delta_e_2000, delta_e_itp)]
    np.testing.assert_allclose(greys_2000(one, other), of_any[0], rtol=ROUNDING, atol=ROUNDING)
    np.testing.assert_allclose(greys_itp(one, other), of_any[1], rtol=ROUNDING, atol=ROUNDING)


def test_colour_differences_are_those_that_sharma_printed() -> None:
    assert len(SHARMA) == 32
    pairs = np.concatenate([SHARMA, JUMPS])
    np.testing.assert_allclose(differences.ciede2000(pairs[:, :3], pairs[:, 3:6]), pairs[:, 6], atol=PRINTED)
    found = delta_e_2000(to_xyz(SHARMA[:, :3]), to_xyz(SHARMA[:, 3:6]))
    np.testing.assert_allclose(found, SHARMA[:, 6], atol=PRINTED)


def test_itp_differences_follow_the_recommendations() -> None:
    """BT.2100-2, table 4 (PQ) and table 7 (LMS, ICtCp), BT.2124-0, annex 1; white has 203 cd/m²."""
    primaries = np.array([[0.708, 0.292], [0.170, 0.797], [0.131, 0.046]])
    columns = np.stack([primaries[:, 0] / primaries[:, 1], np.ones(3), (1 - primaries.sum(axis=1)) / primaries[:, 1]])
    to_rgb = np.linalg.inv(columns * np.linalg.solve(columns, WHITE))
    to_lms = np.array([[1688, 2146, 262], [683, 2951, 462], [99, 309, 3688]]) / 4096
    to_ictcp = np.array([[2048, 2048, 0], [6610, -13613, 7003], [17933, -17390, -543]]) / 4096

    def ictcp(xyz: np.ndarray) -> np.ndarray:
        y = (203.0 * xyz @ to_rgb.T @ to_lms.T / 10_000) ** (2610 / 16384)
        return ((3424 / 4096 + 2413 / 128 * y) / (1 + 2392 / 128 * y)) ** (2523 / 32) @ to_ictcp.T

    rng = np.random.default_rng(1)
    one = np.abs(WHITE * rng.uniform(0.01, 2.0, (50, 1)) * (1 + 0.1 * rng.normal(size=(50, 3))))
    other = one * (1 + 0.05 * rng.normal(size=(50, 3)))
    apart = ictcp(one) - ictcp(other)
    expected = 720 * np.sqrt(apart[:, 0] ** 2 + (apart[:, 1] / 2) ** 2 + apart[:, 2] ** 2)
    np.testing.assert_allclose(delta_e_itp(one, other), expected, rtol=STANDARD)
    assert delta_e_itp(60.0 * WHITE[None], 70.0 * WHITE[None]).item() == pytest.approx(0.0, abs=1e-6)  # both at the top


def light(seed: int, top: float) -> tuple[np.ndarray, np.ndarray]:
    """Pairs of colours within BT.2020, XYZ: any, some alike, black and greys."""
    rng = np.random.default_rng(seed)
    rgb = rng.uniform(0.0, top, (2, 2000, 3))
    rgb[1, :1000] = rgb[0, :1000] * (1.0 + 0.02 * rng.normal(size=(1000, 3)))
    rgb[0, -3:] = [[0.0, 0.0, 0.0], [top, top, top], [0.0, 0.0, 0.0]]
    rgb[1, -2:] = [[top / 2, top / 2, top / 2], [0.0, 0.0, 0.0]]
    one, other = rgb @ differences._from_bt2020().T
    return one, other


@pytest.mark.parametrize("top", [0.01, 1.0, 40.0])
def test_differences_are_those_of_colour_science(science: ModuleType, top: float) -> None:
    one, other = light(2, top)
    labs = [science.XYZ_to_Lab(xyz, science.CCS_ILLUMINANTS[OBSERVER][ILLUMINANT]) for xyz in (one, other)]
    np.testing.assert_allclose(differences.to_lab(one), labs[0], rtol=0, atol=ROUNDING)
    np.testing.assert_allclose(delta_e_2000(one, other), science.delta_E(*labs, method="CIE 2000"), atol=ROUNDING)
    # Where one XYZ is clipped at the top the other two are not: what is left may be no light at all.
    dim = np.maximum(one, other).max(axis=1) < 10_000.0 / 203.0
    assert dim.mean() > 0.5
    pairs = [science.XYZ_to_ICtCp(203.0 * xyz[dim]) for xyz in (one, other)]
    np.testing.assert_allclose(delta_e_itp(one, other)[dim], science.delta_E(*pairs, method="ITP"), atol=ROUNDING)


def test_what_no_light_can_be_has_a_finite_difference() -> None:
    """X or Z alone, to which some cones would respond less than not at all; I, T and P end at 1, 1.7 and 4.4."""
    imaginary = np.eye(3)[[0, 2]]
    lms = imaginary @ np.linalg.inv(differences._from_bt2020()).T @ differences.RGB_TO_LMS.T
    assert (lms.min(axis=1) < 0.0).all()
    found = delta_e_itp(imaginary, np.tile(WHITE, (2, 1)))
    assert np.all((found > 1.0) & (found < 720.0 * np.sqrt(1.0 + 1.7**2 + 4.4**2)))


def test_words_for_what_an_eye_sees_are_those_of_mokrzycki_and_tatol() -> None:
    """Not noticed below 1, by the experienced below 2, by others below 3.5, clear below 5, then two colours."""
    said = (
        "not visible",
        "for trained eyes",
        "just visible",
        "clearly visible",
        "different colours",
        "different colours",
    )
    assert tuple(map(differences.seen, (0.99, 1.0, 2.0, 3.5, 5.0, np.inf))) == said
