"""The README and the pages of `docs/`: every link leads somewhere, and what the README tells to type works."""

import re
import shlex
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]

PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md")), *sorted((ROOT / "benchmarks").glob("*.md"))]


def blocks(language: str) -> list[str]:
    """The README's blocks of code in a language, in order."""
    text = (ROOT / "README.md").read_text(encoding="utf-8")
    return re.findall(rf"^```{language}\n(.*?)^```", text, re.MULTILINE | re.DOTALL)


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_links_lead_to_files(page: Path) -> None:
    text = page.read_text(encoding="utf-8")
    links = [link for link in re.findall(r"\]\(([^)\s]+)\)", text) if "://" not in link]
    headings = {re.sub(r"[^\w\- ]", "", h.lower()).replace(" ", "-") for h in re.findall(r"^#+ (.+)$", text, re.M)}
    for link in links:
        path, _, anchor = link.partition("#")
        assert (page.parent / path).exists(), link
        assert path or anchor in headings, link


@pytest.mark.study
def test_what_it_tells_to_type_works(tmp_path: Path) -> None:
    """The commands in their order, but for pip and pytest, and the notebook's lines."""
    shutil.copytree(ROOT / "data", tmp_path / "data", ignore=shutil.ignore_patterns("*-fitmat*"))
    lines = "".join(blocks("sh")).replace(".venv/bin/", "").splitlines()
    commands = [part.strip() for line in lines for part in line.split("&&") if part.strip().startswith("fitmat ")]
    assert len(commands) >= 6
    for command in commands:
        told = [sys.executable, "-m", "fitmat", *shlex.split(command)[1:]]
        ended = subprocess.run(told, cwd=tmp_path, capture_output=True, text=True)
        assert ended.returncode == 0, f"{command}: {ended.stdout[-500:]}{ended.stderr[-500:]}"
    for block in blocks("python"):
        ended = subprocess.run([sys.executable, "-c", block], cwd=tmp_path, capture_output=True, text=True)
        assert ended.returncode == 0, ended.stderr
        promised = [line.partition("#")[2].strip() for line in block.splitlines() if line.startswith("print(")]
        assert ended.stdout.splitlines() == promised
