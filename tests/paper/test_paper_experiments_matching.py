"""The matching experiments in their small versions: Figure 12's trace, the matcher's growth, the photographs."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import pairwise
from pathlib import Path
from typing import Any

import pytest

from experiments import trials
from experiments.paper import figure12
from experiments.perception import corridor, matcher
from experiments.perception.photographs import load_corridor
from experiments.shared_data import CORRIDOR, data_path

PNG = b"\x89PNG"
needs_photographs = pytest.mark.skipif(
    not data_path(CORRIDOR).is_dir(), reason="the corridor photographs are not beside the repository"
)


@pytest.fixture(autouse=True)
def kept_elsewhere(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """Write pictures to the test's own folder."""
    monkeypatch.setattr(trials, "RUNS", tmp_path)


def here(work: Callable[[Any], Any], jobs: Sequence[Any], *_: Any) -> list[Any]:
    """Work the jobs in this process; keep nothing."""
    return [work(job) for job in jobs]


def test_figure_12_falls_at_each_step_and_ends_where_the_figure_does() -> None:
    report = figure12.run(quick=True, seed=0)
    ours = [row[-1] for row in report.rows if row[-1] is not None]
    assert all(float(after) < float(before) for before, after in pairwise(ours))
    assert report.rows[-1][1] == "A1 A2 B3 C4 D5 D6" and report.rows[0][4] == "C8 D7"
    assert report.failing == ()


def test_the_matcher_finds_the_truth_as_problems_grow(tmp_path: Path) -> None:
    """Times depend on what else the machine does, so they are not asserted."""
    report = matcher.run(quick=True, seed=0, trials=3)
    sizes = [f"{m} model x {k} data lines" for m, k in matcher.SIZES]
    assert [row[0] for row in report.rows[:-3]] == sizes
    assert [claim for claim in report.failing if "in at most" not in claim] == []
    assert (tmp_path / "experiments" / "matcher" / "quick-0" / "growth.png").read_bytes().startswith(PNG)


def test_the_matcher_s_figures_depend_on_the_seed_only() -> None:
    def figures(seed: int) -> list[list[str]]:
        """All but the times, which are what they are."""
        rows = matcher.run(quick=True, seed=seed, trials=2).rows
        return [[str(cell).split("  ")[0] for cell in row] for row in rows]

    assert figures(1) == figures(1)


@needs_photographs
def test_poses_in_the_photographs_come_back(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setattr(corridor, "run_trials", here)
    assert corridor.run(quick=True, seed=0, seeds=1).failing == ()
    pictures = sorted((tmp_path / "experiments" / "corridor" / "quick-0").glob("frame-*.png"))
    assert len(pictures) == 6 and all(picture.read_bytes().startswith(PNG) for picture in pictures)


def test_without_photographs_the_report_says_so(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setattr(corridor, "load_corridor", lambda: load_corridor(tmp_path))
    report = corridor.run(quick=True, seed=0)
    assert report.rows == () and report.claims == ()
    assert "Nothing was measured" in report.text()
