"""Kinds: which models are empirical and which are microfacet models, and which two fits can be compared.

It compares none.
"""

import numpy as np

from fitmat.errors import FitmatError
from fitmat.fitting.result import Fit
from fitmat.models.registry import LOBES, lobe_names


def is_empirical(name: str) -> bool:
    """Whether a model name has an empirical specular lobe."""
    return any(LOBES[part].kind == "empirical" for part in lobe_names(name))


def is_microfacet(name: str) -> bool:
    """Whether a model name has a lobe with a Fresnel term."""
    return any(LOBES[part].kind == "microfacet" for part in lobe_names(name))


def refuse_unlike(*fits: Fit) -> None:
    """Stop where two fits are not one of each kind, to the same measurements, and finite.

    Raises:
        FitmatError: they are not.
    """
    one, other = fits if is_empirical(fits[0].name) else fits[::-1]
    if not (is_empirical(one.name) and is_microfacet(other.name)):
        known = ", ".join(name for name, lobe in LOBES.items() if lobe.kind == "empirical")
        raise FitmatError(
            f"compare needs one empirical ({known}) and one microfacet model, got {one.name} and {other.name}."
        )
    for fit in (one, other):
        if not fit.finite:
            raise FitmatError(f"{fit.name}: the fit ended {fit.result}, there is nothing to compare; check the data.")
    first, second = one.measurements, other.measurements
    same = all(np.array_equal(getattr(first, name), getattr(second, name)) for name in ("wi", "wo", "value", "valid"))
    if first is not second and not same:
        got = f"fits to {first.source} ({first.n_samples} samples) and {second.source} ({second.n_samples} samples)"
        raise FitmatError(f"compare needs two fits to the same measurements, got {got}.")
