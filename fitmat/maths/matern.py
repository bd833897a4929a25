"""Matérn's correlation of smoothness 3/2, of what varies without steps and has slopes but no second ones."""

import numpy as np


def matern(distance: np.ndarray) -> np.ndarray:
    """(1 + √3 d) exp(−√3 d)."""
    q = np.sqrt(3.0) * distance
    return (1.0 + q) * np.exp(-q)
