"""The loads of ``harvey experiment agenda``: what they wake, what they leave behind, and peers that are not there."""

from __future__ import annotations

import numpy as np
import pytest

from blackboard import Post, Scheduler
from experiments.scale import agenda, agenda_memory, agenda_peers
from experiments.scale.agenda_load import PART_CYCLES, Speed, Task, Worker, measure


def test_the_load_wakes_one_a_cycle_and_each_comes_to_its_end() -> None:
    scheduler = Scheduler([Worker()])
    scheduler.post([Post(Task.of(int(draw))) for draw in np.random.default_rng(1).integers(1 << 31, size=20)], "user")
    first = scheduler.step()
    decisions = [scheduler.step() for _ in range(500)]
    assert all(d.chosen and not d.refused and len(d.activated) == 1 for d in decisions)
    assert decisions[-1].pending == first.pending


def test_a_measurement_fills_the_agenda_first() -> None:
    few, more = measure([10, 50], 2, 0)
    assert (few.pending, more.pending) == (10, 50)
    assert 0.0 < few.best_s <= few.median_s < 1.0 and 0.0 < more.best_s <= more.median_s < 1.0
    assert PART_CYCLES >= 1000


def test_the_board_stays_small() -> None:
    memory = agenda_memory.long_run(500)
    assert memory.entries < 10 and memory.posted > 400 and memory.early_bytes > 0


def test_a_peer_that_is_not_installed_leaves_its_column_out(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(agenda_peers, "has", lambda _peer: False)
    assert agenda._peers(10) == (None, None)
    rows = agenda._speed_rows([Speed(10, 1e-5, 1e-5)], {10: (None, None)})
    assert [row[2:4] for row in rows] == [(None, None)]
    assert any("py_trees is not installed" in note for note in agenda._notes(1))


@pytest.mark.skipif(not agenda_peers.has("clips"), reason="clipspy is not installed: pip install '.[peers]'")
def test_clips_fires_once_for_each_step() -> None:
    assert 0.0 < agenda_peers.clips_s(10, 50) < 1.0


@pytest.mark.skipif(not agenda_peers.has("py_trees"), reason="py_trees is not installed: pip install '.[peers]'")
def test_py_trees_ticks() -> None:
    assert 0.0 < agenda_peers.py_trees_s(10, 5) < 1.0
