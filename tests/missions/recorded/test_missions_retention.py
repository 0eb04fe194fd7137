"""A mission's board forgets what nobody can need: the same decisions, to the byte, in less memory."""

from __future__ import annotations

from pathlib import Path

import pytest

from blackboard import Registry
from harvey.simulation.simulated_run import run_mission
from logs.timeline import Timeline
from recorded_runs import Recorded
from sim.stage import Stage


def test_the_decisions_are_the_same_with_it_and_without(
    recorded: Recorded, short_stage: Stage, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    with_it, left = recorded("office"), set[str]()
    monkeypatch.setattr(Registry, "marks", lambda _self: {})
    run_mission(short_stage, 3, out=tmp_path, sinks=[lambda decision: left.update(map(str, decision.left))])
    assert with_it.journal.read_bytes() == (tmp_path / "journal.jsonl").read_bytes() and not left
    record = Timeline(with_it.journal).entry("CameraPicture-1.0")  # out of memory for long, and still there
    assert record is not None and record.fields["number"] == 0 and record.type == "CameraPicture"
