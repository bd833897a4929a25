"""Tables of a Markdown page that a script remakes: everything between a pair of markers.

Knows nothing of what the tables say.
"""

from collections.abc import Sequence
from pathlib import Path


def to_markdown(headings: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """A Markdown table, numbers to the right of the first column."""
    lines = [headings, ["---", *("---:" for _ in headings[1:])], *rows]
    return "\n".join("| " + " | ".join(line) + " |" for line in lines)


def replace_between(page: Path, marker: str, text: str) -> None:
    """Put text between `<!-- marker -->` and `<!-- /marker -->`; what was there goes.

    Raises:
        ValueError: the page lacks one of the two.
    """
    begin, end = f"<!-- {marker} -->\n", f"<!-- /{marker} -->"
    before, found, rest = page.read_text(encoding="utf-8").partition(begin)
    after = rest.partition(end)
    if not (found and after[1]):
        raise ValueError(f"{page}: no {begin.strip()} … {end}")
    page.write_text(before + begin + text.rstrip() + "\n" + end + after[2], encoding="utf-8")
