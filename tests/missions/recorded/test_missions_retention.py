"""A mission's board forgets what nobody can need: the same decisions, to the byte, in less memory."""

from __future__ import annotations

from pathlib import Path

import pytest

from blackboard.journal import Decision
from blackboard.kinds import Registry
from harvey.simulation.simulated_run import run_mission
from logs.timeline import Timeline
from sim.stage import Stage
from world_models.entries.body import CameraPicture


def test_the_decisions_are_the_same_with_it_and_without(
    short_stage: Stage, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    with_it, without = tmp_path / "with", tmp_path / "without"
    decisions: list[Decision] = []
    run_mission(short_stage, 3, out=with_it, sinks=[decisions.append])
    monkeypatch.setattr(Registry, "marks", lambda _self: {})
    run_mission(short_stage, 3, out=without)
    assert (with_it / "journal.jsonl").read_bytes() == (without / "journal.jsonl").read_bytes()
    first = next(c.entry for d in decisions for c in d.observed if isinstance(c.entry.value, CameraPicture))
    record = Timeline(with_it / "journal.jsonl").entry(str(first.ref))  # out of memory for long, and still there
    assert record is not None and record.fields["number"] == 0 and record.type == "CameraPicture"
