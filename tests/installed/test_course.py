"""The notebooks of the course: each is executed, solutions included, and a cell that fails is a failure."""

from __future__ import annotations

from pathlib import Path

import pytest

pytest.importorskip("jupytext", reason="the extra 'course' is not installed")
pytest.importorskip("nbclient", reason="the extra 'course' is not installed")
import nbformat
from nbclient.exceptions import CellExecutionError

from docs.tools.course import COURSE, NAMES, TASK, execute, read, without_solutions


@pytest.mark.parametrize("name", NAMES)
def test_a_notebook_runs_to_its_end_with_pictures_and_solutions(name: str, tmp_path: Path) -> None:
    notebook = execute(read(COURSE / f"{name}.md"), tmp_path)
    outputs = [output for cell in notebook.cells for output in cell.get("outputs", ())]
    assert any("image/png" in output.get("data", {}) for output in outputs)
    solutions = [cell for cell in notebook.cells if "solution" in cell.metadata.get("tags", ())]
    assert len(solutions) == 3 and all("assert " in cell.source for cell in solutions)
    left = without_solutions(notebook)
    assert [cell.source for cell in left.cells].count(TASK) == 3
    assert not any(cell.source in [one.source for one in left.cells] for cell in solutions)


def test_the_first_notebook_drives_asks_and_shows(tmp_path: Path) -> None:
    notebook = execute(nbformat.read(COURSE.parent / "notebooks" / "first-run.ipynb", 4), tmp_path)
    said = str([cell.get("outputs") for cell in notebook.cells])
    assert "srcdoc" in said and "image/png" in said and "the same decisions again: True" in said


def test_a_cell_that_fails_is_a_failure(tmp_path: Path) -> None:
    (tmp_path / "wrong.md").write_text("# Wrong\n\n```python\nassert 1 == 2\n```\n", encoding="utf-8")
    with pytest.raises(CellExecutionError, match="AssertionError"):
        execute(read(tmp_path / "wrong.md"), tmp_path)


def test_the_index_names_each_of_them() -> None:
    index = (COURSE / "index.md").read_text(encoding="utf-8")
    assert [line for line in index.splitlines() if line in NAMES] == list(NAMES)
    assert {path.stem for path in COURSE.glob("*.md")} == {*NAMES, "index"}
