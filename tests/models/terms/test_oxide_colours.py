"""Colours of anodised titanium in the order in which they are published, from the film and the observer alone.

Published as words: 0 to 140 V give yellow, purple, blue, light blue, silver, yellow, pink, violet, cobalt, green,
greenish yellow, pink (Carlesso, Titanium, carlesso.net/en/materials/titanium); titanium is purple at 15 V and bronze at
50 V (E. Gaul, Coloring titanium and related metals by electrochemical oxidation, J. Chem. Educ. 70, 176, 1993). The
oxide grows in proportion to the voltage; its index is that of amorphous TiO2, 2.4 at 550 nm.
"""

from collections.abc import Callable

import numpy as np
import pytest

from fitmat.colour import observers
from fitmat.colour.differences import to_lab
from fitmat.models.spectral import indices
from fitmat.models.terms.film import film

PUBLISHED = (
    *("yellow", "purple", "blue", "light blue", "silver", "yellow", "pink", "violet", "cobalt", "green"),
    *("greenish yellow", "pink"),
)

WORDS: dict[str, Callable[[float, float, float], bool]] = {
    "silver": lambda light, chroma, hue: light > 75 and chroma < 12,
    "yellow": lambda light, chroma, hue: chroma > 25 and 75 <= hue < 102,
    "greenish yellow": lambda light, chroma, hue: chroma > 25 and 102 <= hue < 127,
    "green": lambda light, chroma, hue: chroma > 25 and 127 <= hue < 205,
    "light blue": lambda light, chroma, hue: light > 55 and chroma > 12 and 205 <= hue < 265,
    "blue": lambda light, chroma, hue: light < 55 and chroma > 25 and 265 <= hue < 300,
    "cobalt": lambda light, chroma, hue: light < 60 and chroma > 25 and 265 <= hue < 308,
    "purple": lambda light, chroma, hue: light < 40 and chroma > 25 and 300 <= hue < 340,
    "violet": lambda light, chroma, hue: chroma > 25 and 308 <= hue < 330,
    "pink": lambda light, chroma, hue: light > 55 and chroma > 25 and (hue >= 330 or hue < 25),
}
"""Lightness, chroma and hue of CIELAB that a word may mean, sectors chosen here: red is near 25° there, yellow near
90°, green near 160°, blue near 270°."""

NM = np.arange(0.0, 271.0)

PROPORTIONAL = 0.2
"""Relative; purple is 38 to 44 nm and yellow 110 to 127 nm, and 2 to 5 nm are there before any voltage."""


def colours(thickness: np.ndarray, eta: float = 2.2, b: float = 0.06) -> np.ndarray:
    """L*, C* and h under D65, light and eye at normal incidence, (n, 3)."""
    um = 1e-3 * observers.wavelengths()
    reflected = film(1.0, um, thickness[:, None], eta + b / um**2 + 0j, indices("Ti"))
    light, a, b_star = to_lab(reflected @ observers.seen()).T
    return np.stack([light, np.hypot(a, b_star), np.rad2deg(np.arctan2(b_star, a)) % 360.0], axis=1)


def named(found: np.ndarray) -> list[float | None]:
    """The first thickness in nm of each published colour, beyond that of the one before; None where it never comes."""
    at, seen = 0, []
    for word in PUBLISHED:
        at = next((k for k in range(at, len(found)) if WORDS[word](*found[k].tolist())), len(found))
        seen.append(float(NM[at]) if at < len(found) else None)
    return seen


def test_anodised_titanium_goes_through_the_published_colours() -> None:
    """All twelve in their order, and purple and the second yellow, bronze, as thick as their voltages say."""
    seen = named(colours(NM))
    assert None not in seen
    every = dict(zip(NM, colours(NM), strict=True))
    purple, bronze = (
        np.mean([d for d, c in every.items() if low < d < high and WORDS[word](*c.tolist())])
        for word, low, high in (("purple", 20.0, 60.0), ("yellow", 90.0, 140.0))
    )
    assert purple / bronze == pytest.approx(15.0 / 50.0, rel=PROPORTIONAL)


@pytest.mark.parametrize(("eta", "b"), [(1.45, 0.004), (1.66, 0.01)])
def test_another_oxide_has_other_colours(eta: float, b: float) -> None:
    """Of silica and alumina on titanium some of the colours never come: the index is too low."""
    assert None in named(colours(NM, eta, b))
