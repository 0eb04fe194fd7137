"""A mission's board forgets what nobody can need: the same decisions, to the byte, in less memory."""

from __future__ import annotations

from pathlib import Path

import pytest

import harvey.agent
from blackboard.archive import Archive
from blackboard.journal import Decision
from harvey.retention import RETENTION
from harvey.simulation.run import run_mission
from sim.stage import Stage
from world_models.entries.body import Frame


def test_the_decisions_are_the_same_with_it_and_without(
    short_stage: Stage, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    with_it, without = tmp_path / "with", tmp_path / "without"
    decisions: list[Decision] = []
    run_mission(short_stage, 3, out=with_it, sinks=[decisions.append])
    monkeypatch.setattr(harvey.agent, "RETENTION", ())
    run_mission(short_stage, 3, out=without)
    assert (with_it / "journal.jsonl").read_bytes() == (without / "journal.jsonl").read_bytes()
    first = next(c.entry for d in decisions for c in d.observed if isinstance(c.entry.value, Frame))
    with Archive(with_it / "journal.jsonl") as archive:  # long forgotten, and still to be read
        told = archive.read(str(first.ref))
    assert told is not None and told["value"]["number"] == 0 and told["type"] == "Frame"


def test_every_rule_is_for_a_type_of_its_own_and_keeps_the_newest() -> None:
    kinds = [rule.kind for rule in RETENTION]
    assert len(set(kinds)) == len(kinds) and all(rule.keep >= 1 for rule in RETENTION)
