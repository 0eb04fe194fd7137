"""Questions after a run: ``harvey why`` answers as deciding again does, and what answers wrongly is found out."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from experiments import trials
from experiments.scale import questions, questions_asked
from experiments.scale.questions_asked import KINDS, ask
from logs.run_directory import RunDirectory


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("questions")


def test_why_answers_as_deciding_again_does(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(trials, "RUNS", folder)
    report = questions.run(quick=True, seed=0)
    assert report.holds, report.text()
    record = report.record()
    *kinds, total = record["rows"]
    assert [row["what"] for row in kinds] == list(KINDS) and all(row["asked"] >= 3 for row in kinds)
    assert total["peer"] == {"peer: people": "98", "peer: best language model": "61"} and total["paper"] is None


def test_a_wrong_answer_is_found_out(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Were why to take every knowledge source that it was not told of for one that could have acted, it would show."""
    run = RunDirectory(next(folder.glob("experiments/questions/quick-0/office-0")))
    monkeypatch.setattr(questions_asked, "why_absent", lambda *_: ["it could have acted"])
    monkeypatch.setattr(questions_asked, "KINDS", ("why not",))
    found = list(ask(run, 6, np.random.default_rng(1)))
    assert len(found) == 6 and not all(one.agrees for one in found)
