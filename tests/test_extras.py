"""Extras: what the sentence about a missing package tells to install is what the project declares."""

import sys
import tomllib
from pathlib import Path

import pytest

from fitmat.errors import FitmatError
from fitmat.extras import EXTRAS, needed

DECLARED = tomllib.loads((Path(__file__).parents[1] / "pyproject.toml").read_text())["project"]


@pytest.mark.parametrize("package", EXTRAS)
def test_every_optional_package_is_in_its_extra_alone(package: str) -> None:
    def listed(requirements: list[str]) -> bool:
        return any(text.partition(">=")[0] == package.replace("_", "-") for text in requirements)

    assert listed(DECLARED["optional-dependencies"][EXTRAS[package]])
    assert not listed(DECLARED["dependencies"])


@pytest.mark.parametrize("package", EXTRAS)
def test_a_missing_package_is_said_with_its_remedy(monkeypatch: pytest.MonkeyPatch, package: str) -> None:
    monkeypatch.setitem(sys.modules, package, None)
    told = rf"^this needs the package {package}, .*; install it with pip install 'fitmat\[{EXTRAS[package]}\]'\.$"
    with pytest.raises(FitmatError, match=told):
        needed(package, "this")
