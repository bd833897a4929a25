"""Energies: what a fitted highlight loses in colour where a renderer scatters light once, or compensates for it.

It compares with a random walk on the same facets, and changes no fit.
"""

import dataclasses
from typing import Any

import numpy as np
from jaxtyping import ArrayLike, Float

from fitmat import arguments
from fitmat.colour.channels import colouring_under
from fitmat.colour.differences import delta_e_2000, seen
from fitmat.colour.observers import ILLUMINANTS, white
from fitmat.errors import ModelError
from fitmat.maths.directions import directions
from fitmat.models.albedo import albedo
from fitmat.models.around.shown import surface
from fitmat.models.base import AbstractBRDF, Sum
from fitmat.models.lobes.kulla_conty import KullaConty
from fitmat.models.lobes.microfacet import AbstractMicrofacet, Microfacet
from fitmat.models.lobes.turquin import Turquin
from fitmat.models.multiple_scattering.random_walk import albedo_walk
from fitmat.models.multiple_scattering.surface import Surface
from fitmat.models.terms.distributions import Isotropic
from fitmat.studies.result import Fitted
from fitmat.text import brief

WAYS = {"single": "single scattering", "kulla-conty": "Kulla–Conty's lobe", "turquin": "Turquin's factor"}
"""How renderers compute a rough highlight; name → in words."""

ALPHAS = (0.1, 0.3, 0.6, 1.0)
"""Roughnesses of a table, beside the fitted one."""

ANGLES = np.deg2rad([0.0, 30.0, 60.0, 80.0])
SAMPLES = 20_000


@dataclasses.dataclass(frozen=True, eq=False)
class Energy:
    """The colour of a highlight under light from everywhere, by each way, against every order of scattering.

    Attributes:
        name: Of the lobe.
        alpha: Its slope parameter.
        theta: Angles of view in radians, (a,).
        delta_e_2000: `WAYS` → colour difference from the walk, (a,).
        error: By how much chance moves these, ΔE2000 of one standard error of the walk, (a,).
    """

    name: str
    alpha: float
    theta: Float[np.ndarray, " a"]
    delta_e_2000: dict[str, Float[np.ndarray, " a"]]
    error: Float[np.ndarray, " a"]

    __repr__ = brief

    @property
    def sentence(self) -> str:
        """What a renderer will lose, and where most."""
        worst = int(np.argmax(self.delta_e_2000["single"]))
        most, angle = float(self.delta_e_2000["single"][worst]), np.rad2deg(self.theta[worst])
        others = (f"{words} {self.delta_e_2000[way][worst]:.1f}" for way, words in WAYS.items() if way != "single")
        return (
            f"What your renderer will lose of {self.name} (alpha {self.alpha:.3g}): with single scattering "
            f"ΔE2000 = {most:.1f} at {angle:.0f}°, {seen(most)}; with {' and '.join(others)}."
        )


def energy_of(
    fitted: Fitted,
    *,
    theta: ArrayLike = ANGLES,
    alpha: float | None = None,
    illuminant: str = "D65",
    samples: int = SAMPLES,
    seed: int = 0,
) -> Energy:
    """How wrong the colour of a fitted highlight becomes by what a renderer does with multiple scattering.

    Seen under uniform light from everywhere: the lobe's albedo towards the viewer as single scattering, as Kulla &
    Conty and as Turquin compensate it, each with the fitted Fresnel term and ks, against Heitz's random walk. Masking
    is height-correlated, as the walk's.

    Args:
        fitted: A model of a run with one isotropic lobe of GGX or Beckmann normals; channels as of `colour_of`.
        theta: Angles of view in radians, 0 to π/2, (a,).
        alpha: Slope parameter, 0.0001 to 1; None for the fitted one.
        illuminant: D65, D50, A, FL2, FL11, LED-B3 or E.
        samples: Paths of the walk for each angle.
        seed: Of the walk.

    Raises:
        FitmatError: an argument is out of range, the model has no such lobe, or its channels have no colour.

    Example:
        >>> energy_of(load("run1").fitted()).sentence  # doctest: +SKIP
    """
    arguments.kind("fitted", fitted, Fitted)
    arguments.choice("illuminant", illuminant, ILLUMINANTS)
    angles = np.atleast_1d(arguments.angles("theta", theta, arguments.ZENITH))
    arguments.whole("samples", samples, 2)
    arguments.whole("seed", seed)
    if alpha is not None:
        arguments.numbers("alpha", alpha, 1e-4, 1.0, single=True)
    weights = colouring_under(fitted.channels, illuminant)
    lobe = _highlight(fitted)
    slope = float(np.asarray(lobe.roughness.slopes[0]) if alpha is None else alpha)
    rough: Any = np.asarray(slope)
    parts = (lobe.ks, Isotropic(rough), lobe.fresnel, lobe.distribution)
    single = albedo(Microfacet(*parts), angles).value
    walked = albedo_walk(
        Surface(lobe.distribution, slope, lobe.fresnel), directions(angles), samples=samples, seed=seed
    )
    ks = np.asarray(lobe.ks)
    truth = ks * walked.reflected.value

    def xyz(values: np.ndarray) -> np.ndarray:
        return np.broadcast_to(values, (len(angles), len(weights))) @ weights

    ways = {
        "single": single,
        "kulla-conty": albedo(KullaConty(*parts), angles).value,
        "turquin": single * np.asarray(Turquin(*parts).gain(np.cos(angles)[:, None])),
    }
    lit = white(illuminant)
    apart = {way: delta_e_2000(xyz(values), xyz(truth), lit) for way, values in ways.items()}
    error = delta_e_2000(xyz(truth + ks * walked.reflected.standard_error), xyz(truth), lit)
    return Energy(lobe.name, slope, angles, apart, error)


def highlights(fitted: Fitted) -> tuple[AbstractMicrofacet, ...]:
    """The isotropic lobes of facets of a fitted model, covered ones left out."""
    model: AbstractBRDF = surface(fitted.model)
    lobes = model.lobes if isinstance(model, Sum) else (model,)
    return tuple(one for one in lobes if isinstance(one, AbstractMicrofacet) and isinstance(one.roughness, Isotropic))


def _highlight(fitted: Fitted) -> AbstractMicrofacet:
    """The only one.

    Raises:
        ModelError: there is none, or several.
    """
    if len(found := highlights(fitted)) == 1:
        return found[0]
    raise ModelError(
        f"{fitted.name} has {len(found)} isotropic lobes of facets, expected one, as lambert+ggx, whose multiple "
        "scattering can be followed."
    )
