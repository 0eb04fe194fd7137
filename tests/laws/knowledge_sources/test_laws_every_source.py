"""Laws of every knowledge source, on the boards of recorded runs: without trouble, with faults, touched, told, resumed.

A few acts of each source and run are decided again on the board as the act saw it, changed by what a law says.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from typing import Any, NamedTuple

import pytest

from acting import answer
from blackboard import (
    Blackboard,
    Change,
    Effect,
    Entry,
    KnowledgeSource,
    Level,
    MissingEntryError,
    Post,
    Ref,
    Retract,
    Retracted,
    Revise,
    StaleError,
)
from blackboard.effect import type_of
from harvey.replay.why_not_again import tell_of_trigger
from harvey.runner.resume import find_remains
from harvey.simulation.simulated_run import resume_mission
from harvey.wiring import KNOWLEDGE_SOURCES, build
from hidden_reasons import HidingView, describe, find_named, list_unnamed
from knowledge_sources.settings import DEFAULT
from logs.records import ref_of
from logs.run_directory import RunDirectory
from logs.timeline import Timeline
from rebuilt_board import CHANGES, SOURCES, copy_of, rebuild
from recorded_runs import Recorded, cut_off
from sim.stage import Stage
from world_models.entries import (
    BodyFault,
    CameraPicture,
    CameraState,
    Discrepancy,
    Goal,
    Hypothesis,
    Milestone,
    MotorCommand,
    Outcome,
    Place,
    PlanSketch,
    Subgoal,
    Travel,
)

pytestmark = pytest.mark.slow

RUNS = ("two doors", "shut door", "box", "resumed", "office", "hallway", "kidnap", "hard bump")
ACTS_EACH = 4
"""So many acts of each source are asked again, at most: of each run the first, and one from its midst."""
SLOW = {"localizer"}
"""Of these only one act, as it takes seconds, and with one entry hidden."""
MAX_HIDDEN = 4
"""So many entries are hidden, one at a time, for each act."""
ABROAD = {
    "correction_monitor", "detour_finder", "door_toucher", "elevator_rider", "floor_changer", "goal_changer",
    "halt_explainer", "lens_monitor", "lookout_planner", "obstruction_finder", "path_follower", "range_watcher",
    "rival_weigher", "sense_judge", "shut_door_explainer", "thing_mover", "touch_finder", "view_updater"}
"""They act in none of these runs: on one floor, of nothing touched or before the camera, without range sensors,
with stops, and with senses that do not lie."""


class Act(NamedTuple):
    """One act of a run, as a new source decides it.

    Attributes:
        board: as the act saw it, a copy; trigger: what woke the source.
        earlier: the revision of the trigger's entry before this one, if it was on the board.
        effects: of the act; None where it lacked an entry, and asked for it.
    """

    where: str
    source: KnowledgeSource
    board: Blackboard
    trigger: Change
    earlier: Entry[Any] | None
    effects: tuple[Effect, ...] | None


def list_acts(name: str, run: RunDirectory, left: Counter[str]) -> Iterator[Act]:
    """Two acts of each source of which any are ``left`` to ask for."""
    by_source: dict[str, list[int]] = {}
    for decision in Timeline(run.journal).decisions():
        if decision.chosen is not None:
            by_source.setdefault(decision.chosen.source, []).append(decision.cycle)
    asked = {cycles[k * len(cycles) // 2] for cycles in by_source.values() for k in range(2)}
    for rebuilt, decision in rebuild(run):
        chosen = decision.chosen
        if chosen is None or decision.cycle not in asked or left[chosen.source] <= 0:
            continue
        source, entry = build(SOURCES[chosen.source], DEFAULT), rebuilt.entries[ref_of(chosen.trigger)]
        trigger, board = CHANGES[chosen.kind](entry), copy_of(rebuilt.board)
        earlier = rebuilt.entries.get(Ref(entry.id, entry.revision - 1))
        try:
            effects = answer(source, board.view, trigger)
            left[chosen.source] -= ACTS_EACH if chosen.source in SLOW else 1
        except MissingEntryError:
            effects = None
        yield Act(f"{name}, cycle {decision.cycle}: {source.name}", source, board, trigger, earlier, effects)


@pytest.fixture(scope="module")
def resumed(recorded: Recorded, short_stage: Stage, tmp_path_factory: pytest.TempPathFactory) -> RunDirectory:
    """A run that was cut off while a motor command was under way, and went on."""
    whole = recorded("office")
    commands = [d.cycle for d in Timeline(whole.journal).decisions() if any(e.type == "MotorCommand" for e in d.made)]
    run = cut_off(whole, tmp_path_factory.mktemp("resumed") / "run", commands[2])
    run.recording.write_bytes(whole.recording.read_bytes()[:5000])
    assert resume_mission(run, find_remains(run), stage=short_stage).outcome == "reached"
    return run


@pytest.fixture(scope="module")
def acts(recorded: Recorded, resumed: RunDirectory) -> list[Act]:
    """The acts of all runs."""
    left = Counter(dict.fromkeys(SOURCES, ACTS_EACH))
    return [act for name in RUNS
            for act in list_acts(name, resumed if name == "resumed" else recorded(name), left)]


def test_all_sources_act_here(acts: list[Act]) -> None:
    """A source that acts in none of the runs is named, so that none is left out unseen."""
    seen = {act.source.name for act in acts if act.effects is not None}
    assert {source.called() for source in KNOWLEDGE_SOURCES} - seen - ABROAD == set()


def test_it_writes_only_what_it_says(acts: list[Act]) -> None:
    for act in acts:
        assert {type_of(effect) for effect in act.effects or ()} <= set(act.source.writes), act.where


def test_a_trigger_that_is_overtaken_makes_nothing_else(acts: list[Act]) -> None:
    """Asked for an earlier revision of what woke it, it does the same, or nothing, or what the board refuses, or it
    names what it was asked for.
    """
    asked = 0
    for act in acts:
        stale = None if act.earlier is None else type(act.trigger)(act.earlier)
        if stale is None or act.effects is None or not any(watch.sees(stale) for watch in act.source.on):
            continue
        asked += 1
        again = answer(act.source, act.board.view, stale)
        if again is None or describe(again) == describe(act.effects) or any(
                stale.entry in effect.because for effect in again):
            continue
        with pytest.raises(StaleError):
            copy_of(act.board).apply(again, author="test", cycle=10**6)
            pytest.fail(f"{act.where} does otherwise for {stale.entry.ref} than for {act.trigger.entry.ref}")
    assert asked > 10


def test_what_it_did_not_name_changes_nothing(acts: list[Act]) -> None:
    """What was read, is not named and is hidden: without it the act makes the same, or more, or nothing."""
    unnamed: list[str] = []
    for act in acts:
        if act.effects is None:
            continue
        seen = HidingView(act.board)
        made = describe(answer(act.source, seen, act.trigger) or ())
        assert made == describe(act.effects), f"{act.where} decides otherwise on the same board"
        named = find_named(act.board, act.trigger, act.effects)
        for entry in list_unnamed(seen, named, 1 if act.source.name in SLOW else MAX_HIDDEN):
            try:
                again = describe(answer(act.source, HidingView(act.board, {entry.id}), act.trigger) or ())
            except MissingEntryError:
                again = []  # it asks for what was hidden
            except (LookupError, AttributeError):
                again = ["it cannot decide"]
            if again and not set(made) <= set(again):
                unnamed.append(f"{act.where} does not name {entry.ref}")
    assert not unnamed, "\n".join(unnamed)


def close(kind: type[Any], **fields: Any) -> Callable[[Blackboard], list[Effect]]:
    """Revises all entries of a kind."""
    return lambda board: [Revise(entry, replace(entry.value, **fields)) for entry in board.view.all(kind)]


def withdraw(kind: type[Any]) -> Callable[[Blackboard], list[Effect]]:
    return lambda board: [Retract(entry) for entry in board.view.all(kind)]


def post(value: Any) -> Callable[[Blackboard], list[Effect]]:
    return lambda board: [Post(value)]


DOUBT = Discrepancy(Level.PLAN, "by a law", None, (5.0, 30.0), "px")
LOST = replace(DOUBT, level=Level.GOAL)
RIDE = Subgoal(Place("car-1", 0.0, 0.0), Place("car-2", 0.0, 0.0), primitive=False, passage="lift")
BROKEN: Mapping[str, Callable[[Blackboard], list[Effect]]] = {
    "not given up": post(Outcome("stopped", "by a law")),
    "not over": post(Outcome("stopped", "by a law")),
    "a belief": close(Hypothesis, status="candidate"),
    "a picture": withdraw(CameraPicture),
    "belief up to date": post(MotorCommand(0.1, 0.0)),
    "standing": post(MotorCommand(0.1, 0.0)),
    "no doubt": post(DOUBT),
    "no unmeasured doubt": post(DOUBT),
    "not lost": post(LOST),
    "no doubt above": post(LOST),
    "lost": close(Discrepancy, status="corrected"),
    "a known floor": post(PlanSketch("Goal-9", (), "", (RIDE,), 1)),
    "no fault": post(BodyFault("base", "stalled", "by a law", "MotorCommand-1", 1.0)),
    "a milestone awaited": close(Milestone, status="withdrawn"),
    "no milestone awaited": post(Milestone("", 0, "by a law", 0.0)),
    "a goal": close(Goal, status="abandoned"),
    "a sketch": close(PlanSketch, status="done"),
    "not ended": post(Outcome("stopped", "by a law")),
    "an unmeasured doubt": close(Discrepancy, status="corrected"),
    "a doubt at the plan level": close(Discrepancy, status="corrected"),
    "a camera": withdraw(CameraState),
    "a way since a known place": withdraw(Travel),
}
"""What makes a condition false on a board on which it holds."""


def test_without_one_of_its_conditions_it_has_no_case_and_says_which_it_needs(
    acts: list[Act]
) -> None:
    for act in acts:
        assert act.source.find_unmet(act.board.view) is None, act.where
        for need in act.source.needs:
            board = copy_of(act.board)
            board.apply(BROKEN[need.name](board), author="test", cycle=10**6)
            assert need.find(board.view) in (None, False), f"{act.where}: {need.name}"
            assert act.source.find_case(board.view, act.trigger) is None, f"{act.where}: {need.name}"
            first = act.source.find_unmet(board.view)
            assert first is not None and first.tell_otherwise(board.view)
            trigger = type(act.trigger)(board.view.get(act.trigger.entry.id) or act.trigger.entry)
            told = " ".join(tell_of_trigger(act.source, board, trigger))
            assert isinstance(trigger, Retracted) or f"It needs: {first.name}; " in told or "withdrawn already" in told
            others = [n for n in act.source.needs if n is not need and n.find(board.view) in (None, False)]
            assert first is need or first in others


def test_every_condition_that_a_source_declares_is_broken_here() -> None:
    assert {need.name for source in KNOWLEDGE_SOURCES for need in source.needs} == set(BROKEN)
