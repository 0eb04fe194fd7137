"""Each room has a budget of lines, as it has a contract of imports: what is added has to make room for itself.

A budget is lowered when a room has become smaller. It is raised only for a feature whose claim holds, with the reason
in the commit.
"""

from __future__ import annotations

import subprocess
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[3]
LINES = {
    "blackboard": 2_200,
    "world_models": 10_220,
    "knowledge_sources": 22_920,
    "sim": 5_945,
    "logs": 7_756,
    "harvey": 11_192,
    "experiments": 11_385,
    "tests": 45_770,
    "extras": 22_460,
}
"""Of Python files, at most."""
BYTES = {"ARCHITECTURE.md": 12_000}


def list_tracked(room: str) -> list[Path]:
    listed = subprocess.run(["git", "ls-files", f"{room}/*.py"], cwd=ROOT, capture_output=True, text=True, check=False)
    if listed.returncode:
        pytest.skip("expected a git checkout, to know which files are the project's")
    return [path for path in map(ROOT.joinpath, listed.stdout.split()) if path.exists()]


@pytest.mark.parametrize("room", sorted(LINES))
def test_a_room_keeps_to_its_budget_of_lines(room: str) -> None:
    lines = {path: path.read_text(encoding="utf-8").count("\n") for path in list_tracked(room)}
    assert lines
    assert sum(lines.values()) <= LINES[room]


@pytest.mark.parametrize("document", sorted(BYTES))
def test_a_document_is_short(document: str) -> None:
    assert len((ROOT / document).read_bytes()) <= BYTES[document]
