"""The name of the program that decides: another whenever what decides is another, and only then."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest

from logs.decided_by import DECIDING, DIGITS, WIRING, deciding_code, read_code_in

ROOT = Path(__file__).parents[3]


@pytest.fixture
def program(tmp_path: Path) -> Path:
    """The same files elsewhere."""
    for name in DECIDING:
        shutil.copytree(ROOT / name, tmp_path / name)
    (tmp_path / WIRING).parent.mkdir()
    shutil.copy(ROOT / WIRING, tmp_path / WIRING)
    return tmp_path


def test_the_same_files_are_the_same_program_wherever_they_are(program: Path) -> None:
    (program / "harvey" / "cli.py").write_text("what tells, and decides nothing")
    (program / "blackboard" / "notes.txt").write_text("no code")
    entry = program / "blackboard" / "entry.py"
    entry.write_bytes(entry.read_bytes().replace(b"\n", b"\r\n"))
    assert read_code_in(program) == deciding_code() == read_code_in(ROOT)
    assert len(deciding_code()) == DIGITS


@pytest.mark.parametrize(
    "name", [
        "knowledge_sources/action/motor.py", "knowledge_sources/methods/verification/verification_weights.toml",
        "blackboard/agenda.py", "world_models/robot.py", WIRING,
    ])
def test_a_changed_file_is_another_program(program: Path, name: str) -> None:
    (program / name).write_text((program / name).read_text(encoding="utf-8") + "# otherwise\n", encoding="utf-8")
    assert read_code_in(program) != deciding_code()


def test_a_file_that_was_renamed_or_is_new_makes_another_program(program: Path) -> None:
    (program / "knowledge_sources" / "action" / "motor.py").rename(program / "knowledge_sources" / "engine.py")
    renamed = read_code_in(program)
    (program / "knowledge_sources" / "gearbox.py").write_text("")
    assert len({renamed, read_code_in(program), deciding_code()}) == 3


def test_a_board_that_was_compiled_of_other_source_is_another_program(program: Path, tmp_path: Path) -> None:
    board = tmp_path / "compiled"
    shutil.copytree(program / "blackboard", board / "blackboard")
    (board / "blackboard" / "agenda.cpython-311-x86_64-linux-gnu.so").write_bytes(b"machine code")
    assert read_code_in(program, board) == deciding_code()
    (board / "blackboard" / "agenda.py").write_text("as it was last week")
    assert read_code_in(program, board) != deciding_code()
