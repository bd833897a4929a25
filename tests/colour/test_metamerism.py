"""Metamerism against colour-science, against spectra that are alike by construction, and what has no colour."""

from types import ModuleType

import numpy as np
import pytest

from fitmat.colour import observers
from fitmat.colour.metamerism import metamerism
from fitmat.errors import FitmatError

NM = observers.wavelengths()
GREY = np.full(len(NM), 0.4)


def metamer(illuminant: str = "D65", strength: float = 0.2) -> np.ndarray:
    """The grey, and what no eye sees of a wave under that light: its part across the three matching functions."""
    wave, seen = np.sin(NM / 25.0), observers.seen(illuminant)
    return GREY + strength * (wave - seen @ np.linalg.lstsq(seen, wave, rcond=None)[0])


def test_metamers_are_alike_under_one_light_only() -> None:
    found = metamerism(GREY, metamer(), NM)
    assert found.apart == pytest.approx(0.0, abs=1e-9)
    assert found.index > 1.0
    assert metamerism(GREY, metamer(), NM, illuminant="D65").index == pytest.approx(0.0, abs=1e-9)
    assert metamerism(GREY, metamer("A"), NM, reference="A", illuminant="D65").index > 1.0
    assert "Alike under daylight at noon (D65), ΔE2000 is" in found.sentence
    assert "under an incandescent lamp (A)" in found.sentence


def test_what_differs_under_the_reference_is_made_alike() -> None:
    """A grey half as bright is apart, and no metamer of the other."""
    found = metamerism(GREY, 0.5 * GREY, NM, illuminant="FL11")
    assert found.apart > 10.0
    assert found.index == pytest.approx(0.0, abs=1e-9)
    dimmed = metamerism(GREY, 0.5 * metamer(), NM)
    assert dimmed.index == pytest.approx(metamerism(GREY, metamer(), NM).index, rel=1e-9)


@pytest.mark.parametrize(("illuminant", "observer"), [("A", "2"), ("FL11", "10"), ("LED-B3", "2")])
def test_the_index_is_that_of_colour_science(science: ModuleType, illuminant: str, observer: str) -> None:
    """Tristimulus values, L*a*b* and both differences from there; the correction by hand."""
    long = {"2": "CIE 1931 2 Degree Standard Observer", "10": "CIE 1964 10 Degree Standard Observer"}[observer]
    other = metamer() * (1.0 + 0.1 * np.cos(NM / 90.0))
    xyz = {}
    for light in ("D65", illuminant):
        power = science.SDS_ILLUMINANTS[light]
        lit = np.interp(NM, power.wavelengths, power.values, left=0.0, right=0.0) * science.MSDS_CMFS[long].values.T
        xyz[light] = [lit @ spectrum / lit[1].sum() for spectrum in (GREY, other, np.ones(len(NM)))]
    one, changed, white = xyz[illuminant]
    changed = changed * xyz["D65"][0] / xyz["D65"][1]
    labs = [science.XYZ_to_Lab(colour, science.XYZ_to_xy(white)) for colour in (one, changed)]
    found = metamerism(GREY, other, NM, illuminant=illuminant, observer=observer)
    assert found.index == pytest.approx(float(science.delta_E(*labs, method="CIE 2000")), rel=1e-6)
    assert found.index_ab == pytest.approx(float(science.delta_E(*labs, method="CIE 1976")), rel=1e-6)


@pytest.mark.parametrize("illuminant", observers.ILLUMINANTS)
def test_every_light_has_energy_where_a_spectrum_must_be(illuminant: str) -> None:
    """So that no colour is divided by nothing: lights are known by name only, and all shine from 400 to 700 nm."""
    inside = (NM >= 400) & (NM <= 700)
    assert (observers.seen(illuminant)[inside, 1] > 0.0).all()
    few = np.arange(400.0, 701.0, 50.0)
    assert metamerism(np.ones(7), np.full(7, 0.5), few, illuminant=illuminant).index == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize(
    ("nm", "given", "words"),
    [
        (
            np.linspace(450.0, 650.0, 21),
            {},
            r"450 to 650 nm do not cover what an eye sees under D65, expected 400 to 700",
        ),
        (np.linspace(400.0, 700.0, 4), {}, r"wavelengths 100 nm apart are too coarse for a colour under D65"),
        (np.full(3, 500.0), {}, r"wavelengths is .*, expected at least two different wavelengths"),
        (np.linspace(400.0, 700.0, 31), {"illuminant": "D64"}, r"illuminant is the text 'D64', expected 'D65'"),
        (np.linspace(400.0, 700.0, 31), {"reference": "candle"}, r"reference is the text 'candle', expected 'D65'"),
        (np.linspace(400.0, 700.0, 31), {"observer": "5"}, r"observer is the text '5', expected '2' or '10'"),
    ],
)
def test_what_has_no_colour_is_refused(nm: np.ndarray, given: dict[str, str], words: str) -> None:
    with pytest.raises(FitmatError, match=words):
        metamerism(np.ones(len(nm)), np.ones(len(nm)), nm, **given)
