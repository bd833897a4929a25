"""Metamerism: two spectra that look alike under one light, and how different they look under another.

It knows no material: spectra are what was measured, or what a model reflects.
"""

import dataclasses

import numpy as np
from jaxtyping import ArrayLike, Float

from fitmat import arguments
from fitmat.colour.channels import tristimulus, unseen
from fitmat.colour.differences import delta_e_2000, seen, to_lab
from fitmat.colour.observers import ILLUMINANTS, OBSERVERS, white
from fitmat.errors import FitmatError
from fitmat.text import brief


@dataclasses.dataclass(frozen=True, eq=False)
class Metamerism:
    """How different two spectra look under a light, of which they are made to look alike under another.

    Attributes:
        reference: Illuminant under which they are alike.
        illuminant: The other one.
        apart: ΔE2000 under the reference, before they are made alike.
        index: ΔE2000 under the other illuminant: the special index of metamerism.
        index_ab: The same as ΔE*ab, by which the CIE defines it.
    """

    reference: str
    illuminant: str
    apart: float
    index: float
    index_ab: float

    __repr__ = brief

    @property
    def sentence(self) -> str:
        """What an eye sees when the light changes."""
        return (
            f"Alike under {ILLUMINANTS[self.reference]}, ΔE2000 is {self.index:.2f} under "
            f"{ILLUMINANTS[self.illuminant]}: {seen(self.index)}."
        )


def metamerism(
    one: ArrayLike,
    other: ArrayLike,
    wavelengths: ArrayLike,
    *,
    reference: str = "D65",
    illuminant: str = "A",
    observer: str = "2",
) -> Metamerism:
    """The special metamerism index of two reflectance spectra, change in illuminant.

    CIE 15:2018, sec. 9.2: the colour difference under the test illuminant. What still differs under the reference is
    made alike first, each of X, Y and Z of the other spectrum times the ratio of the two there.

    Args:
        one: Reflectance factors, 1 for the white diffuser (π times a BRDF), (c,).
        other: Those of the other, (c,).
        wavelengths: In nm, (c,), in any order, that cover what an eye sees in steps of at most 50 nm.
        reference: Illuminant under which they shall be alike: D65, D50, A, FL2, FL11, LED-B3 or E.
        illuminant: Under which they are compared.
        observer: "2" or "10", the CIE's of 1931 or 1964.

    Raises:
        FitmatError: an illuminant or observer is not known, spectra and wavelengths are not as many, or they show no
            colour under one of the lights.

    Example:
        >>> import numpy as np
        >>> nm = np.arange(380.0, 781.0, 10.0)
        >>> round(metamerism(np.full(41, 0.4), 0.4 + 0.1 * np.sin(nm / 20.0), nm).index, 2)
        3.76
    """
    for name, light in (("reference", reference), ("illuminant", illuminant)):
        arguments.choice(name, light, ILLUMINANTS)
    arguments.choice("observer", observer, OBSERVERS)
    nm = arguments.numbers("wavelengths", wavelengths, 0.0)
    if nm.ndim != 1 or len(np.unique(nm)) != nm.size or nm.size < 2 or not np.isfinite(nm).all():
        arguments.refuse("wavelengths", nm, "at least two different wavelengths in nm, (c,)")
    pair = np.stack([_spectrum("one", one, nm), _spectrum("other", other, nm)])
    found = {}
    for light in (reference, illuminant):
        if (why := unseen(nm, light, observer)) is not None:
            raise FitmatError(f"{why} under {light}, expected 400 to 700 nm or more, every 50 nm or closer.")
        found[light] = pair @ tristimulus(nm, light, observer)
    ratio = found[reference][0] / found[reference][1]
    apart = float(delta_e_2000(found[reference][0], found[reference][1], white(reference, observer)))
    same, changed = found[illuminant][0], found[illuminant][1] * ratio
    lit = white(illuminant, observer)
    index_ab = float(np.linalg.norm(to_lab(same, lit) - to_lab(changed, lit)))
    return Metamerism(reference, illuminant, apart, float(delta_e_2000(same, changed, lit)), index_ab)


def _spectrum(name: str, given: ArrayLike, nm: np.ndarray) -> Float[np.ndarray, " c"]:
    """A spectrum of the wavelengths."""
    found = arguments.numbers(name, given)
    if found.shape != nm.shape or not np.isfinite(found).all() or not (found.mean() > 0.0):
        arguments.refuse(name, given, f"{nm.size} finite numbers, a reflectance at each wavelength")
    return found
