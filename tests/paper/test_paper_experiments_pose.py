"""Tables 2 and 3 and the times of a pose, in their small versions."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import pytest

from experiments.paper import pose_speed, table2, table3


def here(work: Callable[[Any], Any], jobs: Sequence[Any], *_: Any) -> list[Any]:
    """Work the jobs in this process; keep nothing."""
    return [work(job) for job in jobs]


def test_r_and_t_beats_r_then_t_and_both_grow_as_in_table_2() -> None:
    report = table2.run(quick=True, seed=0, samples=30)
    assert report.failing == ()
    assert len(report.claims) == 10 and len(report.rows) == 3 * len(table2.PAPER) + 6


def test_med_r_and_t_holds_where_r_and_t_is_off_by_feet(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """And Trunc R and T beyond half of the lines wrong; the peer, if it is there, stays behind."""
    monkeypatch.setattr(table3, "run_trials", here)
    monkeypatch.setattr(table3, "campaign_folder", lambda *_, **__: tmp_path)
    report = table3.run(quick=True, seed=0, samples=20)
    assert report.failing == ()
    assert len(report.claims) >= 4 + 3 + 3


def test_times_are_reported_beside_the_peer_s() -> None:
    """Times depend on what else the machine does, so they are not asserted."""
    report = pose_speed.run(quick=True, seed=0, trials=1)
    assert [row[3] for row in report.rows if not isinstance(row[3], float)] == []
