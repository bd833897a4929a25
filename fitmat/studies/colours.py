"""Colours: what a fitted material looks like to an eye in one geometry, and how sure that colour is.

It fits nothing, draws no picture, and knows no other model to compare with; `fitmat.metamerism` compares spectra.
"""

import dataclasses

import numpy as np
from jaxtyping import Float

from fitmat import arguments
from fitmat.colour.channels import colouring_under
from fitmat.colour.differences import delta_e_2000, seen, to_lab
from fitmat.colour.observers import ILLUMINANTS, OBSERVERS, white
from fitmat.colour.spaces import adaptation, to_srgb
from fitmat.errors import ReadError
from fitmat.maths.directions import directions
from fitmat.models.parameters import vector
from fitmat.models.values import surfaces, values
from fitmat.studies.result import Fitted
from fitmat.text import brief

MOST_DRAWS = 1000
"""Of the posterior that are looked at, evenly spread: a quantile of 95 % is known to a hundredth part of them."""

GREY = 1e-6
"""Of a* and b*, below which rounding made them."""

SURE = ("reliable", "corrected")
"""Verdicts on draws whose intervals hold; others are said."""


@dataclasses.dataclass(frozen=True, eq=False)
class Ellipse:
    """Where 95 % of the draws are in the plane of a* and b*: centre + axes[0] cos t + axes[1] sin t.

    It has the shape of their covariance and the size that holds 95 % of them; of a Gaussian posterior the size is
    √χ²₂(0.95) = 2.448 standard deviations.

    Attributes:
        centre: Mean a* and b* of the draws, (2,).
        axes: Semi-axes as vectors, the longer one first, (2, 2).
    """

    centre: Float[np.ndarray, "2"]
    axes: Float[np.ndarray, "2 2"]

    __repr__ = brief


@dataclasses.dataclass(frozen=True, eq=False)
class Colour:
    """The colour of a fitted material in one geometry, the white diffuser being white.

    Attributes:
        name: The model's.
        illuminant: Of the light.
        observer: Who sees it.
        xyz: CIE XYZ of the best fit, white Y = 1, (3,); a highlight may be above white.
        lab: CIE L*a*b* of it, (3,).
        lab_ci95: 95 % interval of each of these, (3, 2); NaN without draws.
        delta_e_95: ΔE2000 from the best fit within which 95 % of the draws are; NaN without draws.
        ellipse: Where 95 % of the draws are in a* and b* together; None without draws, and of a grey.
        draws: CIE L*a*b* of the draws, (m, 3).
        verdict: How far the draws can be trusted, a key of `uncertainty.diagnostics.VERDICTS`.
    """

    name: str
    illuminant: str
    observer: str
    xyz: Float[np.ndarray, "3"]
    lab: Float[np.ndarray, "3"]
    lab_ci95: Float[np.ndarray, "3 2"]
    delta_e_95: float
    ellipse: Ellipse | None
    draws: Float[np.ndarray, "m 3"]
    verdict: str

    __repr__ = brief

    @property
    def srgb(self) -> str:
        """On a display, adapted from this light to its D65 (Bradford), as #rrggbb; clipped to what it can show."""
        shown = to_srgb(self.xyz @ adaptation(white(self.illuminant, self.observer), white()).T)
        return "#" + "".join(f"{round(255 * float(x)):02x}" for x in shown)

    @property
    def grey(self) -> bool:
        """Whether it has a lightness and no hue whatever the values are, as of one channel."""
        return not (np.abs(np.vstack([self.lab, self.draws])[:, 1:]) > GREY).any()

    @property
    def sentence(self) -> str:
        """The colour, its interval, and what an eye sees of it."""
        parts = list(zip(("L*", "a*", "b*"), self.lab, self.lab_ci95, strict=True))[: 1 if self.grey else 3]
        if np.isnan(self.delta_e_95):
            numbers = ", ".join(f"{name} {x:.1f}" for name, x, _ in parts)
            return f"{self._seen}: {numbers}; no draws tell how sure that is."
        numbers = ", ".join(f"{name} {x:.1f} ({low:.1f} to {high:.1f})" for name, x, (low, high) in parts)
        unsure = "" if self.verdict in SURE else f" The draws are {self.verdict}: do not rely on it."
        return (
            f"{self._seen}: {numbers}. 95 % of what the data allow is within "
            f"ΔE2000 = {self.delta_e_95:.2f} of it: {seen(self.delta_e_95)}.{self._together}{unsure}"
        )

    @property
    def _seen(self) -> str:
        return f"{self.name} under {ILLUMINANTS[self.illuminant]}{', a grey' if self.grey else ''}"

    @property
    def _together(self) -> str:
        """The ellipse in words."""
        if self.ellipse is None:
            return ""
        long, short = np.hypot(*self.ellipse.axes.T)
        towards = np.rad2deg(np.arctan2(*self.ellipse.axes[0, ::-1])) % 180.0
        return f" a* and b* together: an ellipse of ±{long:.2g} by ±{short:.2g}, the longer towards hue {towards:.0f}°."


def colour_of(
    fitted: Fitted,
    *,
    theta_i: float = np.pi / 4,
    theta_o: float = 0.0,
    illuminant: str = "D65",
    observer: str = "2",
) -> Colour:
    """The colour of a fitted material, with what the data leave open of it.

    Args:
        fitted: A model of a run, `fitmat.load("run").fitted()`: of a spectrum that covers what an eye sees; of r, g, b
            or x, y, z for D65 and the 2° observer; of one channel, which is a grey.
        theta_i: Incidence in radians, 0 to π/2; 45° and 0° are the CIE's 45°:0°, without the highlight.
        theta_o: Direction of the eye in the plane of incidence, −π/2 to π/2, positive = mirror side.
        illuminant: D65, D50, A, FL2, FL11, LED-B3 or E.
        observer: "2" or "10", the CIE's of 1931 or 1964.

    Raises:
        FitmatError: an argument is out of range, or the channels have no colour under that light.

    Example:
        >>> colour_of(load("run1").fitted()).sentence  # doctest: +SKIP
    """
    arguments.kind("fitted", fitted, Fitted)
    arguments.choice("illuminant", illuminant, ILLUMINANTS)
    arguments.choice("observer", observer, OBSERVERS)
    for name, angle in (("theta_i", theta_i), ("theta_o", theta_o)):
        arguments.numbers(name, angle, single=True)
        arguments.angles(name, angle, arguments.ZENITH, signed=name == "theta_o")
    weights = colouring_under(fitted.channels, illuminant, observer)
    model, best = surfaces(fitted.model, np.asarray(vector(fitted.model), float)[None])
    every = np.concatenate([best, _draws(fitted, best)])
    wi, wo = directions(theta_i), directions(theta_o, np.pi)
    xyz = np.pi * np.broadcast_to(values(model, every, wi, wo)[:, 0], (len(every), len(weights))) @ weights
    lit = white(illuminant, observer)
    labs = to_lab(xyz, lit)
    interval, within, ellipse = np.full((3, 2), np.nan), np.nan, None
    if len(every) > 1:
        interval = np.quantile(labs[1:], [0.025, 0.975], axis=0).T
        within = float(np.quantile(delta_e_2000(xyz[1:], xyz[0], lit), 0.95))
        ellipse = _ellipse(labs[1:, 1:])
    told = (xyz[0], labs[0], interval, within, ellipse, labs[1:])
    return Colour(fitted.name, illuminant, observer, *told, fitted.verdict)


def _ellipse(ab: Float[np.ndarray, "m 2"]) -> Ellipse | None:
    """Of the shape of the draws' covariance, as large as holds 95 % of them; None where they are a line."""
    centre = ab.mean(axis=0)
    variance, axes = np.linalg.eigh(np.cov(ab.T))
    if not variance[0] > GREY**2:
        return None
    sd = np.sqrt(variance)
    size = np.quantile(np.hypot(*((ab - centre) @ axes / sd).T), 0.95)
    return Ellipse(centre, (size * sd * axes).T[::-1])


def _draws(fitted: Fitted, best: Float[np.ndarray, "1 p"]) -> Float[np.ndarray, "m p"]:
    """Parameter vectors of the surface from the posterior; none where a run kept none."""
    try:
        draws = fitted.draws
    except ReadError:
        return best[:0]
    return surfaces(fitted.model, draws[:: max(1, -(-len(draws) // MOST_DRAWS))])[1]
