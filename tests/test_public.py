"""The public names: all there, listed by stage in the page of the library, none of them a wing's."""

import re
from pathlib import Path

import fitmat as fm

ROOT = Path(__file__).parents[1]

NAMES = set(dir(fm))
"""Of a lazily loaded package: what its stub lists."""


def test_every_public_name_is_there() -> None:
    assert all(getattr(fm, name) is not None for name in NAMES)
    assert 25 <= len(NAMES) <= 50


def test_no_public_name_is_a_wings() -> None:
    """Else a function would be hidden by a package, or hide it, whichever is loaded first."""
    wings = {path.parent.name for path in (ROOT / "fitmat").glob("*/__init__.py")}
    assert len(wings) == 13
    assert not wings & NAMES


def test_the_library_page_lists_them_all() -> None:
    text = (ROOT / "docs" / "library.md").read_text(encoding="utf-8")
    section = text.partition("## Public names")[2].partition("\n## ")[0]
    listed = {name for name in re.findall(r"`(\w+)`", section) if name != "fitmat"}
    assert listed == NAMES
