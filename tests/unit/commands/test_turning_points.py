"""Turning points: lost and found, faults and collisions with cycle and place, in summary, progress and ``why``."""

from __future__ import annotations

import io
import json
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import pytest

from blackboard import Blackboard, Decision, Effect, Level, Post, Revise, decision_line
from harvey.campaign.summary import ProgressLine, format_result
from harvey.errors import BadInput
from harvey.runner.result import MissionResult, RunCounts
from harvey.simulation.happenings import ContactWatch
from logs.explain.phrases import describe_decision, headline
from logs.explain.story import HAPPENED, levels_off, tell_part
from logs.explain.turning_points import (
    Collision,
    Happening,
    TurningPoint,
    TurningPointFinder,
    read_turning_points,
    turn_lines,
)
from logs.explain.why import story
from logs.records import DecisionRecord, decision_of
from logs.run_directory import RunDirectory
from memory_timeline import MemoryTimeline
from scripted_mission import house
from scripted_turns import HELD, decisions
from sim.body.simulated_body import SimulatedBody
from sim.truth import Truth
from world_models.entries import (
    BodyFault,
    Contact,
    Difference,
    Discrepancy,
    DoorPicture,
    DoorState,
    Evidence,
    Obstacle,
    Outcome,
    PlanSketch,
    Recovery,
    Rival,
)
from world_models.entries.difference import SURE
from world_models.frames import Pose2


def records() -> list[DecisionRecord]:
    return [decision_of(json.loads(decision_line(decision))) for decision in decisions()]


def test_what_must_be_told_is_found_with_cycle_and_place() -> None:
    finder = TurningPointFinder()
    points = [point for decision in decisions() for point in finder.find(decision) if point.is_main]
    assert [(point.cycle, point.kind, point.text) for point in points] == [
        (2, "refuted", "M2 of the route: 1 of 9 lines"),
        (4, "lost", "kitchen (1.00, 2.00) m by its belief; M2 is refuted"),
        (5, "found", "kitchen (3.00, 1.00) m; it knows again where it is"),
        (6, "fault", "camera: camera unplugged"),
    ]


def test_read_back_from_the_journal_they_are_the_same() -> None:
    finder = TurningPointFinder()
    assert list(read_turning_points(MemoryTimeline(records()))) == [
        point for decision in decisions() for point in finder.find(decision)]


def test_a_door_and_a_thing_are_told_when_they_change_and_not_each_time_that_they_are_seen() -> None:
    box = Obstacle("hallway/obstacle-1", "hallway", (), 0.05, 0.2, 0.3, 0.5, status="suspected")
    picture = DoorPicture("CameraPicture-3", (10.0, 20.0, 30.0, 40.0), 0.0, 0.0, 0.0, 3.0, "a leaf")
    door = DoorState("library-door", ("hallway", "library"), "unknown", 0.6, 1.0, 1, picture, 5.0)
    board, found, finder = Blackboard(), list[TurningPoint](), TurningPointFinder()
    states = (("suspected", "unknown"), ("there", "shut"), ("there", "shut"), ("gone", "open"), ("gone", "open"))
    for cycle, (thing, leaf) in enumerate(states, 1):
        values = replace(box, status=cast(Any, thing)), replace(door, state=cast(Any, leaf))
        entries = [board.view.get("Obstacle-1"), board.view.get("DoorState-1")]
        effects: list[Effect] = [Post(value) if entry is None else Revise(entry, value)
                                 for entry, value in zip(entries, values, strict=True)]
        made = board.apply(effects, author="source", cycle=cycle)
        found += finder.find(Decision(cycle, (), (), Level.ACTION, (), (), None, None, 0, made, ""))
    assert [(point.cycle, point.kind) for point in found] == [(2, "thing"), (2, "door"), (4, "thing"), (4, "door")]
    assert [point.text.partition(":")[0].partition(",")[0] for point in found if point.kind == "door"] == [
        "library-door is shut", "library-door is open"]
    assert [point.text for point in found if point.kind == "thing"] == [
        "something 0.5 m wide at (0.20, 0.30) m of hallway is in the way (hallway/obstacle-1)",
        "something 0.5 m wide at (0.20, 0.30) m of hallway is gone (hallway/obstacle-1)"]


def test_what_differs_is_told_when_a_rival_becomes_sure_or_another_leads() -> None:
    board, found, finder = Blackboard(), list[TurningPoint](), TurningPointFinder()
    odds = (("chance", 0.9), ("lens", 0.6), ("lens", 0.7), ("lens", 0.96), ("lens", 0.97), ("dirt", 0.4), ("wall", 0.8))
    seen = Evidence("camera", "lines", (), 0.0, 0.0, 0.0, 1.0, 1.0, 2.0)
    for cycle, (kind, p) in enumerate(odds, 1):
        rivals = Rival(cast(Any, kind), kind, 1.0, p), Rival("wheels", "wheels", 0.0, 1.0 - p)
        value, known = Difference("camera", rivals, (seen,), 2.0), board.view.get("Difference-1")
        assert ("told apart" in value.sentence()) == (p < SURE)  # what would tell the two likeliest
        made = board.apply([Post(value) if known is None else Revise(known, value)], author="a", cycle=cycle)
        found += finder.find(Decision(cycle, (), (), Level.ACTION, (), (), None, None, 0, made, ""))
    assert [(point.cycle, point.kind, point.text) for point in found] == [
        (2, "differs", "camera: lens 60%, wheels 40%"), (4, "differs", "camera: lens 96%, wheels 4%"),
        (7, "differs", "camera: wall 80%, wheels 20%")]


def test_a_contact_is_told_with_the_place_where_it_believed_to_be() -> None:
    board, finder = Blackboard(), TurningPointFinder()
    made = board.apply([Post(HELD), Post(Contact("bumper", 0.0, 0.1, 3.5))], author="body", cycle=1)
    (point,) = finder.find(Decision(1, made, made, Level.ACTION, (), (), None, None, 0, (), ""))
    assert (point.kind, point.time_s) == ("contact", 3.5)
    where = "at kitchen (1.00, 2.00) m by its belief"
    assert point.text == f"the bumper touched something straight ahead (+-5.7 degrees), {where}"


def test_a_short_account_tells_them_with_the_collisions_that_the_simulator_knows_of() -> None:
    contact = {"cycle": 3, "locale": "kitchen", "x_m": 1.5, "y_m": 2.0}
    told = list(turn_lines(MemoryTimeline(records()), {"collisions": 1, "contacts": [contact]}))
    assert told == [
        "On the way:",
        "  cycle 2  refuted    M2 of the route: 1 of 9 lines",
        "  cycle 3  collision  something, at kitchen (1.50, 2.00) m, as only the simulator knows",
        "  cycle 4  lost       kitchen (1.00, 2.00) m by its belief; M2 is refuted",
        "  cycle 5  found      kitchen (3.00, 1.00) m; it knows again where it is",
        "  cycle 6  fault      camera: camera unplugged",
    ]
    lines = list(turn_lines(MemoryTimeline(records()[:1]), {"collisions": 2}))
    assert lines[-1] == "  2 collisions; this run does not say where"
    assert "Nothing went wrong on the way" in next(turn_lines(MemoryTimeline(records()[:1]), {}))


def test_what_the_simulator_did_is_told_as_that() -> None:
    happened = [{"cycle": 3, "what": "somebody kidnaps the robot"}]
    lines = list(turn_lines(MemoryTimeline(records()), {"happened": happened}))
    assert lines[2] == "  cycle 3  simulator  somebody kidnaps the robot, as only the simulator knows"
    told = tell_part(MemoryTimeline(records()), HAPPENED, {"happened": happened})
    assert [(one.cycle, one.text) for one in told.steps] == [
        (3, "Somebody kidnaps the robot, as only the simulator knows.")]
    (nothing,) = tell_part(MemoryTimeline(records()), HAPPENED, {"happened": []}).steps
    (unknown,) = tell_part(MemoryTimeline(records()), HAPPENED, {}).steps
    assert nothing.text == "The simulator did nothing to it." and "nobody recorded" in unknown.text


@pytest.mark.parametrize("record", [{"cycle": 3}, {"cycle": 99, "what": "a bump"}, {"cycle": 3, "what": 7}, 7, "x"])
def test_a_happening_that_is_none_is_one_error(record: Any) -> None:
    with pytest.raises(BadInput, match=r"result\.json: happened: expected"):
        list(turn_lines(MemoryTimeline(records()), {"happened": [record]}))


def test_of_a_run_that_was_cut_off_it_is_not_said_that_nothing_went_wrong() -> None:
    (line,) = turn_lines(MemoryTimeline(records()[:1]), {}, is_whole=False)
    assert line == "Nothing had gone wrong when the run was cut off: what would have come of it nobody knows."


def test_a_plan_that_is_withdrawn_on_all_its_levels_is_replanned_once() -> None:
    board, counts = Blackboard(), RunCounts()
    first = PlanSketch("Goal-1", (), "", ())

    def act(cycle: int, *effects: Effect, author: str = "source") -> None:
        made = board.apply(list(effects), author=author, cycle=cycle)
        counts(Decision(cycle, (), (), Level.ACTION, (), (), None, None, 0, made, ""))

    act(1, Post(first), Post(replace(first, path=(0,), locale="hallway")))
    assert counts.replans == 0
    act(2, *(Revise(board.view[f"PlanSketch-{k}"], replace(board.view[f"PlanSketch-{k}"].value, status="superseded"))
             for k in (1, 2)))
    act(3, Post(first))
    assert (counts.replans, counts.sketches) == (1, 3)
    act(4, Revise(board.view["PlanSketch-3"], replace(first, adjustments=1, verified=True)), author="milestone_passer")
    act(5, Revise(board.view["PlanSketch-3"], replace(first, adjustments=1, at=1)))
    assert counts.replans == 2


@pytest.mark.parametrize("contact", [{"cycle": 3}, {"cycle": "3", "locale": "", "x_m": 0.0, "y_m": 0.0}, 7, {},
                                     {"cycle": 99, "locale": "", "x_m": 0.0, "y_m": 0.0},
                                     {"cycle": 3, "locale": "", "x_m": "here", "y_m": 0.0}])
def test_a_collision_that_is_none_is_one_error(contact: Any) -> None:
    with pytest.raises(BadInput, match=r"result\.json: contacts: expected"):
        list(turn_lines(MemoryTimeline(records()), {"contacts": [contact]}))


def test_the_time_of_a_decision_is_in_the_clock_of_the_run_also_while_a_fault_lasts() -> None:
    fault = BodyFault("camera", "camera unplugged", "no such device", "PictureRequest-1", 7.0)
    recovery = Recovery("BodyFault-1", "PictureRequest-1", 7.0, 2.0, tries=9, waited_s=31.8, status="still failing")
    board = Blackboard()
    seen = board.apply([Post(fault), Post(recovery)], author="body", cycle=1)
    made = board.apply([Post(Outcome("failed", "camera unplugged"))], author="fault_handler", cycle=1)
    line = decision_line(Decision(1, seen, seen, Level.ACTION, (), (), None, None, 0, made, ""))
    history = MemoryTimeline([decision_of(json.loads(line))])
    outcome = history.entry("Outcome-1.0")
    assert outcome is not None
    assert describe_decision(history, outcome) == "Decided in cycle 1, 38.8 s into the run, by the fault handler."
    assert "since 7.0 s into the run" in fault.sentence()


def test_finding_itself_is_headed_as_that() -> None:
    history = MemoryTimeline(records())
    found = history.entry("Hypothesis-1.1")
    assert found is not None
    assert headline(found).startswith("It found out where it is: at (3.00, 1.00) m of kitchen")
    assert story(history, found).headline == headline(found)


def test_a_level_that_was_off_is_said(tmp_path: Path) -> None:
    head: dict[str, Any] = {"servo": {"action": True, "plan": True, "goal": False}, "constants": []}
    (tmp_path / "run.json").write_text(json.dumps(head))
    assert list(levels_off(RunDirectory(tmp_path))) == [
        "The goal level of servoing was off in this run: a robot that is lost does not look for where it is."]
    head["constants"] = [["servo.goal", "on"], ["servo.plan", "off"]]
    (tmp_path / "run.json").write_text(json.dumps(head))
    assert [line.split()[1] for line in levels_off(RunDirectory(tmp_path))] == ["plan"]
    (tmp_path / "run.json").unlink()
    assert list(levels_off(RunDirectory(tmp_path))) == []


def test_the_summary_tells_them_and_the_result_keeps_them() -> None:
    contacts, points = (Collision(3, "kitchen", 1.5, 2.0, 0.38),), (TurningPoint(4, "lost", "here; nothing fits"),)
    known = MissionResult(
        scenario="s", seed=0, outcome="reached", reason="so it was", goal="(ptrans)", final_error_m=0.01,
        final_heading_error_rad=0.0, path_length_m=20.0, sim_time_s=90.0, wall_time_s=10.0, frames=9, decisions=400,
        milestones={"verified": 5, "refuted": 1, "not_testable": 0, "false_accepts": 0}, replans=2, relocalizations=0,
        sketches=3, collisions=1, max_cross_track_m=1.0, contacts=contacts, turning_points=points,
        happened=(Happening(4, "the lights go off for 2 s"),))
    text = format_result(known, None)
    assert "collisions    1\n" in text
    assert format_result(known, None, ("On the way:", "  cycle 4  lost")).endswith("\n\nOn the way:\n  cycle 4  lost")
    assert MissionResult.of_record(json.loads(json.dumps(known.record()))) == replace(known, amiss=[], starved=[])


def test_progress_says_that_it_is_lost_and_found() -> None:
    stage = SimpleNamespace(world=house(), goal_world=Pose2(0.0, 0.0, 0.0), start_world=Pose2(4.0, 0.0, 0.0))
    out = io.StringIO()
    progress, lost = ProgressLine(cast(Any, stage), out), list[bool]()
    for decision in decisions():
        progress(decision)
        lost.append(progress.is_lost)
    assert lost == [False, False, False, True, False, False, False, False]
    assert "cycle 4: lost: kitchen (1.00, 2.00) m by its belief; M2 is refuted\n" in out.getvalue()
    assert "cycle 5: found: kitchen (3.00, 1.00) m; it knows again where it is\n" in out.getvalue()


@pytest.mark.parametrize("locale", ["kitchen", ""])
def test_a_contact_is_found_once_where_the_robot_truly_was(locale: str) -> None:
    moments = [Truth(Pose2(x, 1.0, 0.0), collisions=n, locale=locale) for x, n in ((1.0, 0), (2.0, 1), (3.0, 1))]
    body = SimpleNamespace(truth=moments[0], track=tuple(moments[:1]), building=SimpleNamespace(added=(), floor_m=0.0))
    watch = ContactWatch(house(), cast(SimulatedBody, body))
    assert watch.new_contacts() == ()
    body.truth, body.track = moments[2], tuple(moments)
    (contact,) = watch.new_contacts()
    assert (contact.place.locale, contact.place.x_m, contact.speed_m_per_s) == (locale, 2.0, 0.0)
    assert contact.thing == ("kitchen/south-wall" if locale else "")
    assert watch.new_contacts() == ()
    body.truth = replace(moments[2], collisions=2, contact_m_per_s=0.3)
    assert [(contact.place.x_m, contact.speed_m_per_s) for contact in watch.new_contacts()] == [(3.0, 0.3)]


def test_it_is_lost_at_the_place_that_it_believes_by_the_same_decision() -> None:
    board, finder = Blackboard(), TurningPointFinder()
    doubt = Discrepancy(Level.PLAN, "M2 is refuted", 99.0, (9.0, 30.0), "px")
    first = board.apply([Post(HELD), Post(doubt)], author="source", cycle=1)
    finder.find(Decision(1, (), (), Level.ACTION, (), (), None, None, 0, first, ""))
    there = replace(HELD, locale_from_robot=Pose2(5.0, 4.0, 0.0))
    made = board.apply([Revise(board.view["Hypothesis-1"], there), Revise(
        board.view["Discrepancy-1"], replace(doubt, status="escalated"))], author="source", cycle=2)
    (lost,) = finder.find(Decision(2, (), (), Level.ACTION, (), (), None, None, 0, made, ""))
    assert (lost.kind, lost.text.partition(" m")[0]) == ("lost", "kitchen (5.00, 4.00)")
