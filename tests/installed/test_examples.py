"""The examples run as they are, each in a folder of its own."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from elsewhere import ROOT

EXAMPLES = sorted((ROOT / "examples").glob("*.py"))
SAYS = {
    "add_a_knowledge_source": "replayed the same",
    "ask_why": "replayed: every decision is the same",
    "build_a_world": "reached, ",
    "compare_seeds": "drawn in",
    "hearsay": "heard: go to the kitchen\n",
    "own_simulator": "mm from the goal",
    "read_a_run": "the belief was off by",
    "recorded_model": "decided again without the model: the same",
    "revise_a_frame": "reached; replayed the same",
    "run_a_mission": "reached: every milestone",
    "solve_a_pose": "ok: True, 20 of 30 lines agree",
    "sudoku": "4 3 2 1\nin ",
}


def test_there_is_a_word_of_each() -> None:
    assert [path.stem for path in EXAMPLES] == sorted(SAYS)


@pytest.mark.parametrize("example", EXAMPLES, ids=lambda path: path.stem)
def test_an_example_runs_and_says_what_it_should(example: Path, tmp_path: Path) -> None:
    done = subprocess.run([sys.executable, example], cwd=tmp_path, env={**os.environ, "PYTHONPATH": str(ROOT)},
                          capture_output=True, text=True, timeout=900)
    assert done.returncode == 0, done.stderr
    assert SAYS[example.stem] in done.stdout
