"""Decisions depend on nothing but the view, and an act on nothing but what it read there."""

from __future__ import annotations

from random import Random
from typing import Any

import pytest
from hypothesis import Phase, given, settings
from hypothesis import strategies as st

from harvey.agent import build_agent
from harvey.runner.replay import open_originals, replay
from logs.run_directory import RunDirectory
from logs.run_head import RunHead
from rebuilt_board import rebuild, recorded_act
from world_models.building.changes import element_names
from world_models.building.locale_frame import FrameChange, LocaleFrame
from world_models.frame_building import FrameBuilding


@pytest.mark.parametrize(("name", "acting"), [
    ("told_run", {"model_reviser", "dependency_withdrawer", "goal_sketcher", "motor", "correlator_tracker", "matcher"}),
    ("lost_run", {"localizer", "discrepancy_raiser", "milestone_judge", "med_r_and_t", "plan_adjuster"}),
])
def test_acts_are_the_same_on_a_board_that_is_rebuilt_from_the_journal(
    name: str, acting: set[str], request: pytest.FixtureRequest
) -> None:
    """By a knowledge source made for this act, in a world that was read again: to the byte, with what it read."""
    acted = set[str]()
    for rebuilt, decision in rebuild(request.getfixturevalue(name)):
        assert rebuilt.act_again(decision) == recorded_act(decision), decision.cycle
        acted |= {decision.chosen.source} if decision.chosen else set()
    assert acting <= acted


def test_acts_are_the_same_where_nothing_is_kept_that_was_computed_before(told_run: RunDirectory) -> None:
    for rebuilt, decision in rebuild(told_run):
        for frame in rebuilt.board.view.all(LocaleFrame):
            frame.value.memo.clear()
        assert rebuilt.act_again(decision) == recorded_act(decision), decision.cycle


def test_decisions_are_the_same_where_nothing_is_ever_kept(
    told_run: RunDirectory, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Caches change how long a decision takes, and neither what it makes nor what it is said to have read."""
    cached = FrameBuilding.cached

    def compute_anew(self: FrameBuilding, *more: Any) -> Any:
        self.root_frame().memo.clear()
        return cached(self, *more)

    monkeypatch.setattr(FrameBuilding, "cached", compute_anew)
    agent = build_agent(RunHead.read(told_run.path))
    for decided in replay(told_run, open_originals(told_run, agent.store), agent.scheduler()):
        assert decided.same, decided.recorded.cycle


@given(st.integers(0, 2**32))
@settings(max_examples=3, phases=(Phase.explicit, Phase.generate))
def test_a_revision_of_what_an_act_did_not_read_does_not_change_the_act(told_run: RunDirectory, seed: int) -> None:
    """In the frames that an act did not read: doors are shut, things are gone, landmarks and faces removed."""
    random, revised = Random(seed), 0
    for rebuilt, decision in rebuild(told_run):
        others = [e for e in rebuilt.board.view.all(LocaleFrame) if str(e.ref) not in decision.used]
        changes = [(entry, change) for entry in others for change in _list_changes(entry.value)]
        if not changes:
            continue
        entry, change = random.choice(changes)
        with rebuilt.revised(entry, entry.value.changed(change)):
            assert rebuilt.act_again(decision).made == recorded_act(decision).made, (decision.cycle, change)
        revised += 1
    assert revised > 100


def _list_changes(frame: LocaleFrame) -> list[FrameChange]:
    """What could be believed of a frame beside what is."""
    doors = [FrameChange("shut", doorway.name, "test") for doorway in frame.doorways]
    things = [FrameChange("gone", thing.name, "test") for thing in frame.things]
    return doors + things + [FrameChange("removed", name, "test") for name in sorted(element_names(frame.parts))]
