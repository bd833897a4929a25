"""Inferred: what completes measurements, left out where they are fitted or examined.

It fills nothing.
"""

import dataclasses

import numpy as np

from fitmat.measurements.samples import Measurements

REASON = "inferred, not measured"
"""Why what completes measurements is masked: a fit to it would find the model that filled it."""


def measured_only(m: Measurements) -> Measurements:
    """The measurements with what was inferred masked and counted, as it is where a file of them is read."""
    if m.inferred is None:
        return m
    valid = m.valid & ~m.inferred
    return dataclasses.replace(
        m,
        value=np.where(valid, m.value, 0.0),
        sigma=np.where(valid, m.sigma, 1.0) if m.sigma is not None and m.sigma_given else None,
        valid=valid,
        masked={**m.masked, REASON: int(m.inferred.any(axis=1).sum())},
        inferred=None,
    )


def rows(m: Measurements) -> int:
    """How many are masked because they hold what was inferred; of joined files, of all."""
    return sum(count for reason, count in m.masked.items() if reason.endswith(REASON))
