"""Every notebook runs from top to bottom, and is stored with the pictures that it makes, small.

`jupyter execute --inplace notebooks/*.ipynb` stores them anew.
"""

from pathlib import Path
from typing import Any

import nbformat
import pytest
from nbclient import NotebookClient

FOLDER = Path(__file__).parents[1] / "notebooks"

NOTEBOOKS = pytest.mark.parametrize("path", sorted(FOLDER.glob("*.ipynb")), ids=lambda path: path.stem)

CONCLUDES = {"04_colour_of_metals": "just noticeable"}
"""What a notebook says that compares no two models of a file."""

LARGEST, LONGEST = 400_000, 2_000
"""Bytes of a file, and characters of what a result shows as plain text."""


def code(notebook: Any) -> list[Any]:
    return [cell for cell in notebook.cells if cell.cell_type == "code"]


def shown(notebook: Any) -> list[str]:
    """What the cells show, each as the text of its data."""
    return [str(output.get("data", {})) for cell in code(notebook) for output in cell.outputs]


@NOTEBOOKS
def test_is_stored_as_it_ran(path: Path) -> None:
    """Each cell once, in order, without an error or a path of a machine, with pictures that a code host shows."""
    notebook = nbformat.read(path, as_version=4)
    assert path.stat().st_size <= LARGEST
    assert [cell.execution_count for cell in code(notebook)] == list(range(1, len(code(notebook)) + 1))
    outputs = [output for cell in code(notebook) for output in cell.outputs]
    assert not any(output.output_type == "error" or output.get("name") == "stderr" for output in outputs)
    assert sum("image/png" in text for text in shown(notebook)) >= 4
    assert all(len(output.get("data", {}).get("text/plain", "")) <= LONGEST for output in outputs)
    assert str(FOLDER.parents[1]) not in path.read_text(encoding="utf-8")


@pytest.mark.study
@NOTEBOOKS
def test_runs(path: Path) -> None:
    notebook = nbformat.read(path, as_version=4)
    NotebookClient(notebook, timeout=300, resources={"metadata": {"path": str(FOLDER)}}).execute()
    assert CONCLUDES.get(path.stem, "hemisphere") in str([cell.outputs for cell in code(notebook)])
    assert sum("image/png" in text for text in shown(notebook)) >= 4
