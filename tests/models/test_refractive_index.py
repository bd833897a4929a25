"""Refractive indices against printed tables, catalogue values and Mitsuba's data; channels; and what is refused."""

from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

from fitmat.errors import ModelError
from fitmat.models.refractive_index import EFFECTIVE_NM, MATERIALS, channel_wavelengths, index
from fitmat.models.terms.fresnel import conductor, f0_from_ior

HC = 1239.84
"""eV nm; the photon energies of the tables have three digits."""

TABLE = 0.03
"""Absolute; at 2.26 eV the printed energy is rounded to 0.005 eV, 1.2 nm, over which κ of silver grows by 0.01."""

CATALOGUE = 5e-5
"""Absolute; glass catalogues print n_d to five decimals, the papers on silica and sapphire to five."""

PLASTIC = 1e-3
"""Absolute; batches of a polymer differ in the third decimal."""

MITSUBA = {
    "W": 0.005,
    "Al": 0.01,
    "Mo": 0.02,
    "main/Cu/Hagemann": 0.01,
    "Cu": 0.05,
    "Au": 0.07,
    "Ag": 0.07,
    "main/Cr/Rakic-BB": 0.05,
    "Cr": 0.15,
}
"""Absolute, in F0: the same data of tungsten read twice; for the rest other samples, of which films differ most."""

CENTROID = 3.0
"""nm; the analytic observer of Wyman et al. is within 1 % of the CIE's, its tails matter most for red."""


@pytest.mark.parametrize(
    ("metal", "at_188", "at_226"),
    [("Cu", (0.22, 3.747), (1.02, 2.577)), ("Ag", (0.05, 4.483), (0.06, 3.586)), ("Au", (0.14, 3.697), (0.43, 2.455))],
)
def test_noble_metals_are_johnson_and_christys_table(
    metal: str, at_188: tuple[float, float], at_226: tuple[float, float]
) -> None:
    """P. B. Johnson & R. W. Christy, Phys. Rev. B 6, 4370 (1972), table I: 1.88 and 2.26 eV."""
    for energy, printed in ((1.88, at_188), (2.26, at_226)):
        value = index(metal, HC / energy)
        np.testing.assert_allclose((np.real(value), np.imag(value)), printed, atol=TABLE)


@pytest.mark.parametrize(
    ("material", "nm", "printed", "tolerance"),
    [
        ("N-BK7", 587.5618, 1.51680, CATALOGUE),
        ("SF11", 587.5618, 1.78472, CATALOGUE),
        ("fused-silica", 587.5618, 1.45846, CATALOGUE),
        ("sapphire", 587.5618, 1.76817, CATALOGUE),
        ("diamond", 589.29, 2.4173, 2e-4),
        ("water", 589.29, 1.3325, 2e-4),
        ("ice", 589.29, 1.3098, 2e-4),
        ("air", 589.29, 1.00027716, 1e-7),
        ("PMMA", 587.5618, 1.4914, PLASTIC),
        ("PS", 587.5618, 1.5916, PLASTIC),
        ("PC", 587.5618, 1.5847, PLASTIC),
    ],
)
def test_transparent_materials_have_their_catalogue_index(
    material: str, nm: float, printed: float, tolerance: float
) -> None:
    """SCHOTT's n_d; Malitson 1965; Malitson & Dodge 1972; CRC Handbook; Kasarova et al. 2007 for plastics.

    Kasarova: Opt. Mater. 29, 1481. The Handbook of Chemistry and Physics gives water at 25 °C, ice, diamond and air.
    """
    value = index(material, nm)
    assert np.real(value) == pytest.approx(printed, abs=tolerance)
    assert 0 <= np.imag(value) < 1e-5


@pytest.mark.parametrize("name", MITSUBA)
def test_reflectance_is_near_that_of_mitsubas_spectra(mitsuba: ModuleType, name: str) -> None:
    """The conductor files that Mitsuba ships (luxpop.com), wavelengths inside the visible."""
    metal = name.split("/")[-2] if "/" in name else name
    folder = Path(str(mitsuba.__file__)).parent / "data" / "ior"
    nm = np.linspace(450.0, 650.0, 21)
    eta, kappa = (np.interp(nm, *np.loadtxt(folder / f"{metal}.{part}.spd").T) for part in ("eta", "k"))
    ours = index(name, nm)
    np.testing.assert_allclose(f0_from_ior(np.real(ours), np.imag(ours)), f0_from_ior(eta, kappa), atol=MITSUBA[name])


def test_every_name_has_an_index_in_the_visible() -> None:
    for name, material in MATERIALS.items():
        value = index(name, [441.0, 550.0, 642.0])
        assert value.shape == (3,)
        assert np.isfinite(value).all(), name
        assert np.array_equal(index(material.dataset, [441.0, 550.0, 642.0]), value), name


def test_names_are_read_in_any_case_and_in_words() -> None:
    for name in ("au", "AU", " Au ", "gold", "Gold", "main/Au/Johnson"):
        assert index(name, 600.0) == index("Au", 600.0)
    assert index("fused silica", 600.0) == index("Fused-Silica", 600.0)
    assert index("Au", 600.0).shape == ()
    assert index("Au", np.full((2, 3), 600.0)).shape == (2, 3)


def test_many_threads_read_the_same_numbers() -> None:
    """Datasets that no other test has loaded, each asked for by several threads at once."""
    names = [f"main/{metal}/Werner-DFT" for metal in ("Au", "Cu", "Fe", "Mo", "Ni", "Pb", "Pt", "Ti", "W", "Zn")] * 4
    with ThreadPoolExecutor(8) as pool:
        values = list(pool.map(lambda name: complex(index(name, 600.0)), names))
    assert values == [complex(index(name, 600.0)) for name in names]


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("silvr", "material 'silvr' is not known. Did you mean Ag.* shelf/book/page, for example main/Au/Johnson"),
        ("kryptonite", "material 'kryptonite' is not known. The names are Au, Ag"),
        ("main/Au/Jonson", "dataset 'main/Au/Jonson' is not in .* close are main/Au/Johnson"),
        ("x/y/z", "dataset 'x/y/z' is not in .* see https://refractiveindex.info"),
        ("main/H2O/Wang", "dataset 'main/H2O/Wang' has no usable refractive index"),
    ],
)
def test_unknown_materials_are_refused_with_what_to_do(name: str, message: str) -> None:
    with pytest.raises(ModelError, match=message):
        index(name, 600.0)


@pytest.mark.parametrize("nm", [400.0, 2000.0, np.nan])
def test_wavelengths_outside_the_dataset_are_refused(nm: float) -> None:
    with pytest.raises(ModelError, match=f"'PMMA' at {nm:g} nm: dataset organic/.* covers 436.8 to 1052 nm; name"):
        index("PMMA", [500.0, nm])


def test_channels_are_wavelengths_or_rgb() -> None:
    assert channel_wavelengths(("450", "633.5")).tolist() == [450.0, 633.5]
    assert channel_wavelengths(("value",)).tolist() == [550.0]
    assert channel_wavelengths(("B", "g", "r")).tolist() == [441.0, 543.0, 642.0]


@pytest.mark.parametrize("name", ["x", "-550", "nan", "inf", ""])
def test_other_channels_are_refused(name: str) -> None:
    with pytest.raises(ModelError, match=f"channel '{name}': no wavelength known; name the channels r, g, b"):
        channel_wavelengths(("r", name))


D65 = np.array([
    82.75, 91.49, 93.43, 86.68, 104.86, 117.01, 117.81, 114.86, 115.92, 108.81, 109.35, 107.80, 104.79, 107.69, 104.41,
    104.05, 100.00, 96.33, 95.79, 88.69, 90.01, 89.60, 87.70, 83.29, 83.70, 80.03, 80.21, 82.28, 78.28, 69.72, 71.61,
])  # fmt: skip
"""CIE standard illuminant D65, 400 to 700 nm in steps of 10 (ISO 11664-2)."""

NM = np.arange(400.0, 701.0, 10.0)


def _rgb_response() -> np.ndarray:
    """Weights of linear sRGB at `NM`, each channel summing to 1.

    C. Wyman, P.-P. Sloan & P. Shirley, Simple analytic approximations to the CIE XYZ color matching functions, JCGT
    2(2), 2013, eq. 4, and the matrix of IEC 61966-2-1.
    """

    def lobe(mean: float, left: float, right: float) -> np.ndarray:
        return np.exp(-0.5 * ((NM - mean) * np.where(mean > NM, left, right)) ** 2)

    x = 1.056 * lobe(599.8, 1 / 37.9, 1 / 31.0) + 0.362 * lobe(442.0, 1 / 16.0, 1 / 26.7)
    x -= 0.065 * lobe(501.1, 1 / 20.4, 1 / 26.2)
    y = 0.821 * lobe(568.8, 1 / 46.9, 1 / 40.5) + 0.286 * lobe(530.9, 1 / 16.3, 1 / 31.1)
    z = 1.217 * lobe(437.0, 1 / 11.8, 1 / 36.0) + 0.681 * lobe(459.0, 1 / 26.0, 1 / 13.8)
    to_rgb = np.array([[3.2406, -1.5372, -0.4986], [-0.9689, 1.8758, 0.0415], [0.0557, -0.2040, 1.0570]])
    weights = to_rgb @ (np.stack([x, y, z]) * D65)
    return weights / weights.sum(axis=1, keepdims=True)


def test_effective_wavelengths_are_the_centroids_of_srgb() -> None:
    np.testing.assert_allclose(_rgb_response() @ NM, [EFFECTIVE_NM[c] for c in "rgb"], atol=CENTROID)


@pytest.mark.parametrize(
    ("metal", "stated"), [("Au", (0.09, 0.03, 0.04)), ("Cu", (0.01, 0.01, 0.01)), ("Ag", (0.001, 0.001, 0.001))]
)
def test_rgb_is_as_far_from_spectral_as_the_docstring_says(metal: str, stated: tuple[float, ...]) -> None:
    """The exact spectral reflectance integrated to linear sRGB, against F at the effective wavelengths."""
    cos = np.cos(np.deg2rad(np.arange(0.0, 90.0, 1.0)))[:, None]
    spectral, at = index(metal, NM), index(metal, channel_wavelengths(("r", "g", "b")))
    integrated = conductor(cos, np.real(spectral), np.imag(spectral)) @ _rgb_response().T
    error = np.abs(conductor(cos, np.real(at), np.imag(at)) - integrated).max(axis=0)
    np.testing.assert_allclose(error, stated, atol=0.01)
