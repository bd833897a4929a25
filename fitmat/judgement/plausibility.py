"""Plausibility: which laws of reflection a fitted material breaks, and what else speaks against its parameters.

It weighs no data: a model may be impossible and still predict best. What the instrument and a tilted mount do is left
out; they break laws by right.
"""

import numpy as np

from fitmat.fitting.result import Fit
from fitmat.maths.directions import mirror
from fitmat.models.albedo import albedo
from fitmat.models.around.shown import surface
from fitmat.models.base import AbstractBRDF
from fitmat.models.values import at

ANGLES = np.deg2rad([0.0, 30.0, 60.0, 75.0, 85.0])
"""Incidence angles of the albedo, radians."""

IMPOSSIBLE = 2e-3
"""An albedo is above 1 only if by more than this and more than its error bound."""

PAIRS = 64
"""Pairs of directions that are exchanged."""

ROUNDING = 1e-9
"""Relative gap between the two directions that rounding explains."""


def broken_laws(fit: Fit) -> tuple[str, ...]:
    """Reciprocity and energy at the fitted parameters, in words; empty where both hold.

    Example:
        >>> broken_laws(found)  # doctest: +SKIP
        ('reflects 1.05 of the light at 85°',)
    """
    model, found = surface(fit.model), []
    if not _reciprocal(model):
        found.append("is not reciprocal")
    turns = np.zeros(1) if model.isotropic else np.array([0.0, np.pi / 2])
    theta, phi = (grid.ravel() for grid in np.meshgrid(ANGLES, turns, indexing="ij"))
    reflected = albedo(model, theta, phi)
    above = reflected.value - reflected.error
    if above.max() > 1.0 + IMPOSSIBLE:
        row = int(np.argmax(above.max(axis=1)))
        found.append(f"reflects {reflected.value[row].max():.2f} of the light at {np.rad2deg(theta[row]):.0f}°")
    return tuple(found)


def _reciprocal(model: AbstractBRDF) -> bool:
    """f(ω_i, ω_o) = f(ω_o, ω_i) for directions spread over the hemisphere, half of the pairs near the mirror."""
    k = np.arange(2 * PAIRS) + 0.5
    cos, phi = k / len(k), k * np.pi * (3.0 - np.sqrt(5.0))  # Fibonacci's spiral
    sin = np.sqrt(1.0 - cos**2)
    w = np.stack([sin * np.cos(phi), sin * np.sin(phi), cos], axis=1)
    wi, wo = w[::2], w[1::2].copy()
    wo[::2] = mirror(wi)[::2] + np.array([0.0, 0.0, 0.02])
    wo /= np.linalg.norm(wo, axis=1, keepdims=True)
    there, back = np.split(at(model, np.concatenate([wi, wo]), np.concatenate([wo, wi])), 2)
    return bool(np.all(np.abs(there - back) <= ROUNDING * (np.abs(there) + np.abs(back))))


def doubts(fit: Fit) -> tuple[str, ...]:
    """Parameters not determined or on a bound, and a fit that did not end, in words."""
    found = []
    if fit.undetermined:
        found.append(f"{' and '.join(fit.undetermined)} not determined")
    found += [f"{name} at its {side} bound" for name, side in fit.on_bound.items() if name not in fit.undetermined]
    if fit.result == "max_steps":
        found.append("the fit ran out of steps")
    return tuple(found)
