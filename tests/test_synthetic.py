"""Synthetic measurements: the noise is what it claims, the files can be made again, and every truth is recovered."""

import dataclasses
import json
import pathlib

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from fitmat.brdf import AbstractBRDF, evaluate, model
from fitmat.errors import FitmatError, ModelError, OutputError
from fitmat.fitting import fit
from fitmat.formats import read
from fitmat.measurement import from_arrays
from fitmat.outcome import Fit
from fitmat.synthetic import MATERIALS, Material, simulate, write_catalogue, write_csv

FOLDER = pathlib.Path(__file__).parents[1] / "data" / "synthetic"
NAMES = {material.name: material for material in MATERIALS}

SIZE_LIMIT = 60_000
"""Bytes; the files live in the repository."""

DIGITS = 5e-7
"""Relative rounding of 7 written digits."""

FOUR_SIGMA = 4.0
"""Bound on a statistic in its own standard errors: a correct program fails in 1 of 16,000 seeds."""

REPEATS = 500
MEAN_Z = 0.15
"""3.4 standard errors 1/√500 of a mean z."""

COVERAGE = (0.92, 0.98)
"""0.95 ± 3.1 standard errors √(0.95 · 0.05/500)."""


def gloss() -> AbstractBRDF:
    return model("lambert+ggx", kd=0.3, ks=1.0, alpha=0.3, eta=1.5)


def standardised(found: Fit, material: Material) -> dict[str, np.ndarray]:
    """(estimate − truth)/sd for each parameter, in the logarithm where the scale is log."""
    sd, scores = np.sqrt(np.diag(found.covariance)), {}
    for entry in found.entries:
        value, truth = found.values[entry.place], np.asarray(material.parameters[entry.name])
        log = entry.param.scale == "log"
        difference = value * np.log(value / truth) if log else value - truth
        scores[entry.name] = difference / sd[entry.place]
    return scores
