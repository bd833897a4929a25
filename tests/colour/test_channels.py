"""Channels against published chromaticities; what has no colour; and what is not loaded."""

import subprocess
import sys

import numpy as np
import pytest

from fitmat.colour.channels import colouring
from fitmat.colour.spaces import to_srgb

ROUNDED = 2e-4
"""XYZ and chromaticities; sRGB's matrix has four digits, CIE's white point five."""

WHITE = np.array([0.3127 / 0.3290, 1.0, (1 - 0.3127 - 0.3290) / 0.3290])


def test_red_green_and_blue_have_the_primaries_of_srgb() -> None:
    """IEC 61966-2-1: the chromaticities, D65 as white, and the encoding of a grey card, 1.055·0.18^(1/2.4) − 0.055."""
    weights = colouring(("b", "R", "g")).weights[[1, 2, 0]]
    expected = [[0.64, 0.33], [0.30, 0.60], [0.15, 0.06]]
    np.testing.assert_allclose((weights / weights.sum(axis=1, keepdims=True))[:, :2], expected, atol=ROUNDED)
    np.testing.assert_allclose(weights.sum(axis=0), WHITE, atol=ROUNDED)
    np.testing.assert_allclose(to_srgb(0.18 * weights.sum(axis=0)), 1.055 * 0.18 ** (1 / 2.4) - 0.055, atol=1e-4)


def test_a_flat_spectrum_is_white_and_a_line_has_its_own_colour() -> None:
    """CIE 15:2018: white of D65 is 95.04, 100, 108.88; chromaticity of light of 520 nm is 0.0743, 0.8338."""
    names = tuple(f"{w:g}nm" for w in np.arange(780, 379, -10))
    weights = colouring(names).weights
    np.testing.assert_allclose(weights.sum(axis=0), [0.9504, 1.0, 1.0888], atol=ROUNDED)
    np.testing.assert_allclose(colouring(names[::-1]).weights[::-1], weights, rtol=1e-12)  # in any order
    fine = tuple(str(w) for w in range(380, 781))
    green = colouring(fine).weights[fine.index("520")]
    np.testing.assert_allclose(green[:2] / green.sum(), [0.0743, 0.8338], atol=ROUNDED)


@pytest.mark.parametrize(
    ("channels", "words"),
    [
        (("value",), "one channel, drawn grey"),
        (("1", "2"), "1 to 2 nm do not cover what an eye sees: drawn grey, from the mean of the channels"),
        (("450", "550", "650"), "450 to 650 nm do not cover what an eye sees: drawn grey"),
        (("400", "500", "600", "700"), "wavelengths 100 nm apart are too coarse for a colour: drawn grey"),
        (("s", "p"), "channels s, p have no known colour: drawn grey, from their mean"),
        (("500", "500"), "channels 500, 500 have no known colour"),
    ],
)
def test_what_has_no_colour_is_grey_and_says_so(channels: tuple[str, ...], words: str) -> None:
    found = colouring(channels)
    assert found.words.startswith(words)
    np.testing.assert_allclose(found.weights, np.tile(WHITE / len(channels), (len(channels), 1)), atol=ROUNDED)


def test_tristimulus_values_are_taken_as_they_are() -> None:
    np.testing.assert_array_equal(colouring(("y", "x", "z")).weights, np.eye(3)[[1, 0, 2]])


def test_no_colour_library_is_loaded() -> None:
    code = """
import sys
import numpy as np
from fitmat.colour import channels, differences, spaces
spectrum = channels.colouring(tuple(map(str, range(380, 781, 10)))).weights
differences.delta_e_2000(spectrum, spectrum[::-1]), differences.delta_e_itp(spectrum, spectrum[::-1])
spaces.shown(spectrum), spaces.to_srgb(channels.colouring(("r", "g", "b")).weights)
assert not {"colour", "scipy"} & set(sys.modules)
"""
    done = subprocess.run([sys.executable, "-W", "error", "-c", code], capture_output=True, text=True, check=False)
    assert (done.returncode, done.stdout, done.stderr) == (0, "", "")
