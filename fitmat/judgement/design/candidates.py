"""Candidates: the directions that a next measurement could take, and those that an instrument cannot.

Judges none of them; `design` does.
"""

import dataclasses
from typing import Literal

import numpy as np
from jaxtyping import Bool, Float

from fitmat.fitting.result import Fit
from fitmat.judgement.prediction import sections
from fitmat.maths.directions import from_angles
from fitmat.models.values import widths
from fitmat.text import brief

Measured = Literal["sample", "curve"]
"""A single sample, or one incidence with a scan of theta_o."""

STEP = 5.0
"""Degrees between zenith angles."""

AZIMUTHS = (150.0, 120.0, 90.0, 60.0, 30.0)
"""Relative azimuths outside the plane of incidence, degrees."""

FLANK = (0.5, 1.0, 1.5, 2.0)
"""Distances of samples from the mirror direction, in widths of the lobe."""

TURNS = (0.0, 45.0, 90.0, 135.0)
"""Azimuths of incidence, degrees, for anisotropic models."""

SCAN = 41
"""A curve has room for so many samples; of a file's longer ones an evenly spread part is proposed."""


@dataclasses.dataclass(frozen=True)
class Limits:
    """What an instrument cannot do.

    Attributes:
        steepest: Largest zenith angle of light and sensor, degrees.
        retro: The sensor stands in the light within this angle of it, degrees.
        in_plane: Whether the sensor stays in the plane of incidence.
    """

    steepest: float = 85.0
    retro: float = 5.0
    in_plane: bool = False


@dataclasses.dataclass(frozen=True, eq=False)
class Candidates:
    """k measurements of up to m samples each.

    Attributes:
        theta_i: Incidence, radians, (k,).
        phi_i: Its azimuth, radians, (k,).
        theta_o: Signed, positive on the side of `phi`, radians, (k, m).
        phi: Relative azimuth of positive theta_o, radians, (k,).
        used: Which samples there are, (k, m).
    """

    theta_i: Float[np.ndarray, " k"]
    phi_i: Float[np.ndarray, " k"]
    theta_o: Float[np.ndarray, "k m"]
    phi: Float[np.ndarray, " k"]
    used: Bool[np.ndarray, "k m"]

    __repr__ = brief

    def directions(self) -> tuple[Float[np.ndarray, "k m 3"], Float[np.ndarray, "k m 3"]]:
        """Unit vectors to the light and to the sensor."""
        phi_i, phi = self.phi_i[:, None], self.phi[:, None]
        light, turn = np.broadcast_arrays(self.theta_i[:, None], phi_i, self.theta_o)[:2]
        wo = from_angles(np.abs(self.theta_o), phi_i + phi + np.where(self.theta_o < 0, np.pi, 0.0))
        return from_angles(light, turn), wo

    def near(self, chosen: list[int], degrees: float) -> Bool[np.ndarray, " k"]:
        """Which are within `degrees` of a chosen one, light and all samples alike."""
        found = np.zeros(len(self.theta_i), bool)
        for at in chosen:
            apart = [np.arccos(np.clip((w * w[at]).sum(axis=-1), -1.0, 1.0)).max(axis=1) for w in self.directions()]
            found |= np.maximum(*apart) < np.deg2rad(degrees)
        return found


def proposed(fit: Fit, kind: Measured, limits: Limits) -> Candidates:
    """Every candidate that the limits allow; the azimuth of incidence is turned where the model is anisotropic.

    Args:
        fit: Gives the width of the lobe and the curves of the file.
        kind: Single samples or whole curves.
        limits: Of the instrument.
    """
    steepest = np.deg2rad(limits.steepest)
    zenith = np.deg2rad(np.arange(0.0, 90.0, STEP))
    zenith = zenith[zenith <= steepest + 1e-9]
    turns = np.deg2rad((0.0,) if fit.model.isotropic else TURNS)
    made = _samples(fit, zenith) if kind == "sample" else _scans(fit, zenith)
    turned = [dataclasses.replace(made, phi_i=np.full(len(made.theta_i), turn)) for turn in turns]
    parts = {f.name: np.concatenate([getattr(t, f.name) for t in turned]) for f in dataclasses.fields(made)}
    every = Candidates(**parts)
    wi, wo = every.directions()
    cosine = np.clip(np.einsum("kmi,kmi->km", wi, wo), -1.0, 1.0)
    allowed = every.used & (np.abs(every.theta_o) <= steepest + 1e-9)
    allowed &= np.arccos(cosine) >= np.deg2rad(limits.retro) - 1e-9
    if limits.in_plane:
        allowed &= np.abs(np.sin(every.phi))[:, None] < 1e-9
    kept = allowed.any(axis=1)
    parts["used"] = allowed
    return Candidates(**{name: part[kept] for name, part in parts.items()})


def _samples(fit: Fit, zenith: np.ndarray) -> Candidates:
    """A grid in the plane of incidence and outside of it, with more points on the flanks of the lobe."""
    aside = np.concatenate([-np.array(FLANK[::-1]), FLANK]) * 2.0 * float(widths(fit.model, fit.values[None])[0])
    found = [(i, o, np.pi) for i in zenith for o in np.unique(np.concatenate([-zenith, zenith]))]
    found += [(i, i + a, np.pi) for i in zenith for a in aside]
    found += [(i, o, phi) for i in zenith[1:] for o in zenith[1:] for phi in np.deg2rad(AZIMUTHS)]
    theta_i, theta_o, phi = np.array(found).T
    count = len(theta_i)
    return Candidates(theta_i, np.zeros(count), theta_o[:, None], phi, np.ones((count, 1), bool))


def _scans(fit: Fit, zenith: np.ndarray) -> Candidates:
    """The plane of incidence and the one across it, with the theta_o of the file's longest curve."""
    curves = sections(fit.measurements)
    longest = max(
        (np.unique(np.round(c.theta_o, 6)) for c in curves), key=len, default=np.deg2rad(np.arange(-80, 81, 5))
    )
    scan = longest[np.unique(np.linspace(0, len(longest) - 1, SCAN).astype(int))]
    light, phi = (part.ravel() for part in np.meshgrid(zenith, [np.pi, np.pi / 2], indexing="ij"))
    used = np.tile(np.arange(SCAN) < len(scan), (len(light), 1))
    theta_o = np.tile(np.r_[scan, np.zeros(SCAN - len(scan))], (len(light), 1))
    return Candidates(light, np.zeros(len(light)), theta_o, phi, used)
