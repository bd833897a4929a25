"""Horizon: readings at θ_o = 90°, which are masked, and kept for objectives that publications define with them.

A detector there sees the surface edge-on, so that no likelihood counts them; the objectives of the literature compare
BRDFs, need no cosθ_o, and their authors count every row.
"""

import dataclasses

import numpy as np

from fitmat.measurements.parsing.recording import HORIZON, Recording, mask
from fitmat.measurements.samples import Measurements


def along(recording: Recording) -> np.ndarray:
    """Which values are masked for no other reason than that θ_o is 90°, (n, c)."""
    flat = (np.abs(recording.wo[:, 2]) <= HORIZON) & (recording.wi[:, 2] > HORIZON)
    if not flat.any():
        return np.zeros(recording.value.shape, bool)
    return mask(dataclasses.replace(recording, wo=lifted(recording.wo)))[0] & flat[:, None]


def lifted(wo: np.ndarray) -> np.ndarray:
    """Directions along the surface a trace above it, where a model has its limit; all others as they are."""
    flat = np.abs(wo[:, 2:]) <= HORIZON
    return np.where(flat, np.concatenate([wo[:, :2], np.full((len(wo), 1), 2.0 * HORIZON)], axis=1), wo)


def with_horizon(m: Measurements, sigma: np.ndarray) -> tuple[Measurements, np.ndarray]:
    """The measurements with the values at θ_o = 90° as valid ones, in rows after all others, and σ in that order."""
    if m.horizontal is None:
        return m, sigma
    kept = np.isfinite(m.horizontal)
    order = np.argsort(kept.any(axis=1) & ~m.valid.any(axis=1), kind="stable")
    value = np.where(kept, m.horizontal, m.value)
    found = dataclasses.replace(m, wo=lifted(m.wo), value=value, valid=m.valid | kept, horizontal=None)
    return found.rows(order), sigma[order]
