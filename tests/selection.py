"""Which of many parameters every run tries, and which the study adds; it tests nothing."""

from collections.abc import Container, Iterable
from typing import Any

import pytest

from fitmat.models.registry import LOBES

TRIED = [
    n
    for n, lobe in LOBES.items()
    if not (lobe.fresnel_suffix(n) and any(part in n for part in ("-aniso", "-kc", "-turquin")))
]
"""Lobes whose laws and albedos are tried. Fresnel terms are the same code in every lobe: with isotropic roughness and
without compensation only. All combinations are measured by `fitmat models --check`."""


def always(chosen: Container[Any], every: Iterable[Any]) -> list[Any]:
    """Parameters for `parametrize`: the chosen ones in every run, all others in the study."""
    return [one if one in chosen else pytest.param(one, marks=pytest.mark.study) for one in every]
