"""The board compiled is the same board: its laws hold, and it writes the same journal, byte for byte."""

from __future__ import annotations

import os
import shlex
import shutil
import subprocess
import sys
import sysconfig
from pathlib import Path

import pytest

from elsewhere import ROOT, SEED, drive_elsewhere
from harvey.compiled import CannotCompileError, compile_board
from harvey.simulation.run import run_mission
from sim.stage import Stage

LAWS = ("agenda", "board", "journal", "retention", "scheduler", "servoing")
PROGRAM = """
import sys
import pytest
from blackboard import scheduler
assert not scheduler.__file__.endswith(".py")
sys.exit(pytest.main(["-p", "no:cacheprovider", *sys.argv[1:]]))
"""


@pytest.fixture(scope="module")
def path(tmp_path_factory: pytest.TempPathFactory) -> dict[str, str]:
    """What takes the compiled board instead of the source."""
    compiler = shlex.split(os.environ.get("CC") or sysconfig.get_config_var("CC") or "cc")[0]
    if shutil.which(compiler) is None or not Path(sysconfig.get_path("include"), "Python.h").exists():
        pytest.skip("no C compiler, or no headers of Python, are here")
    folder = tmp_path_factory.mktemp("compiled")
    compile_board(folder)
    return {"PYTHONPATH": str(folder)}


def test_the_compiled_board_writes_the_same_journal(short_stage: Stage, path: dict[str, str], tmp_path: Path) -> None:
    here, there = tmp_path / "here", tmp_path / "there"
    run_mission(short_stage, SEED, out=here)
    assert drive_elsewhere(sys.executable, there, path).startswith(path["PYTHONPATH"])
    assert (here / "journal.jsonl").read_bytes() == (there / "journal.jsonl").read_bytes()


def test_the_laws_of_the_board_hold_for_it(path: dict[str, str]) -> None:
    files = [f"tests/laws/test_laws_{name}.py" for name in LAWS]
    done = subprocess.run(
        [sys.executable, "-P", "-c", PROGRAM, *files], cwd=ROOT, env={**os.environ, **path}, capture_output=True,
        text=True, check=False,
    )
    assert done.returncode == 0, done.stdout + done.stderr


def test_a_folder_with_something_else_in_it_is_left_alone(tmp_path: Path) -> None:
    (tmp_path / "blackboard").mkdir()
    (tmp_path / "blackboard" / "mine.py").write_text("mine")
    with pytest.raises(CannotCompileError, match="expected a folder of its own, but blackboard is in it"):
        compile_board(tmp_path)
    assert (tmp_path / "blackboard" / "mine.py").read_text() == "mine"


def test_without_a_compiler_it_says_so(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("CC", "no-such-compiler")
    with pytest.raises(CannotCompileError, match=r"gave up.*no-such-compiler"):
        compile_board(tmp_path)
    assert not list(tmp_path.iterdir())
