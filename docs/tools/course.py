"""The notebooks of the course: made from ``docs/course/*.md``, executed, and written with and without the solutions.

``python -m docs.tools.course [FOLDER]`` writes them to a folder, ``build/course``.
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import jupytext
import nbformat
from nbclient import NotebookClient

COURSE = Path(__file__).parents[1] / "course"
NAMES = ("blackboard", "projection", "matching", "servoing", "lost", "measuring")
SOLUTION, TASK = "solution", "# your solution"
CELL_S = 300
"""A cell that takes longer is given up."""


def read(path: Path) -> Any:
    """A notebook from its Markdown. Solutions are folded."""
    notebook = jupytext.read(path, fmt="md")
    for cell in notebook.cells:
        if SOLUTION in cell.metadata.get("tags", ()):
            cell.metadata["jupyter"] = {"source_hidden": True}
    notebook.metadata["kernelspec"] = {"name": "python3", "display_name": "Python 3", "language": "python"}
    return notebook


def execute(notebook: Any, folder: Path) -> Any:
    """Execute it in a folder; it has its output then. Raises CellExecutionError where a cell fails."""
    return NotebookClient(notebook, timeout=CELL_S, resources={"metadata": {"path": str(folder)}}).execute()


def without_solutions(notebook: Any) -> Any:
    """The same with empty cells in place of the solutions."""
    left = nbformat.from_dict(notebook)
    for cell in left.cells:
        if SOLUTION in cell.metadata.get("tags", ()):
            cell.source, cell.outputs, cell.metadata = TASK, [], {}
    return left


def main(folder: Path) -> None:
    """Write all of them."""
    folder.mkdir(parents=True, exist_ok=True)
    for number, name in enumerate(NAMES, 1):
        notebook = execute(read(COURSE / f"{name}.md"), folder)
        nbformat.write(notebook, folder / f"{number}-{name}.ipynb")
        nbformat.write(without_solutions(notebook), folder / f"{number}-{name}-exercises.ipynb")
        print(folder / f"{number}-{name}.ipynb", flush=True)


if __name__ == "__main__":
    main(Path(sys.argv[1] if len(sys.argv) > 1 else "build/course"))
