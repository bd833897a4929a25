"""colour-science, which the tests of this wing are compared with."""

import importlib
import warnings
from types import ModuleType

import pytest


@pytest.fixture(scope="session")
def science() -> ModuleType:
    """colour-science, which sets filters for warnings."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return importlib.import_module("colour")
