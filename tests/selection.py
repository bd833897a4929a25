"""Which of many parameters every run tries, and which the study adds; it tests nothing."""

from collections.abc import Container, Iterable
from typing import Any

import pytest


def always(chosen: Container[Any], every: Iterable[Any]) -> list[Any]:
    """Parameters for `parametrize`: the chosen ones in every run, all others in the study."""
    return [one if one in chosen else pytest.param(one, marks=pytest.mark.study) for one in every]
