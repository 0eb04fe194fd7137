"""What somebody tells the robot on the way: a door is shut, a thing is gone; it goes on by what is so now."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from blackboard import Decision, KnowledgeSource, Post
from harvey.agent import build_agent
from harvey.cli import main
from harvey.runner.ports import WorldPort, tell_robot
from harvey.runner.result import MissionResult
from harvey.runner.teller import USER
from harvey.simulation.simulated_run import build_head, run_mission
from harvey.wiring import knowledge_sources
from knowledge_sources.settings import Settings
from sim.scenario import load_scenario
from sim.stage import Stage, build_stage
from two_doors import two_doors
from world_models.building.locale_frame import LocaleFrame
from world_models.entries import Course, PlanSketch, UserReport

SEED = 3
SHUT = (3.0, "north-door", "shut")


def without_watchers(settings: Settings) -> Sequence[KnowledgeSource]:
    """The knowledge sources of a robot that sees neither doors nor what stands on the floor: it believes what is told.

    In these missions what is told is not so, or half of it; who looks sees that.
    """
    watchers = ("floor_watcher", "door_watcher", "shut_door_explainer")
    blind = replace(settings, action=replace(settings.action, keeps_to_seen_floor=False))
    return [source for source in knowledge_sources(blind) if source.name not in watchers]


def drive(stage: Stage) -> tuple[MissionResult, list[Decision]]:
    decisions: list[Decision] = []
    return run_mission(stage, SEED, sources=without_watchers, sinks=[decisions.append]), decisions


def made(decisions: Sequence[Decision], kind: type[Any]) -> list[Any]:
    """The entries of a kind that were made, in order."""
    return [change.entry for decision in decisions for change in decision.made if isinstance(change.entry.value, kind)]


def routes(decisions: Sequence[Decision]) -> list[list[str]]:
    """The doors on the way of each sketch from locale to locale."""
    return [[subgoal.passage for subgoal in entry.value.subgoals if subgoal.passage]
            for entry in made(decisions, PlanSketch) if entry.revision == 0 and not entry.value.path]


def answers(decisions: Sequence[Decision]) -> list[str]:
    return [entry.value.answer for entry in made(decisions, UserReport)]


def test_told_that_a_door_is_shut_it_goes_by_the_other() -> None:
    """It is told before it has come to the hall: who does not look at the floor drives at full speed."""
    scenario = load_scenario("shut-door")
    earlier = replace(scenario, told=tuple(replace(told, at_s=8.0) for told in scenario.told))
    result, decisions = drive(build_stage(earlier))
    assert (result.outcome, result.collisions) == ("reached", 0)
    assert routes(decisions) == [["reception-north-door", "archive-north-door"],
                                 ["reception-south-door", "archive-south-door"]]
    assert answers(decisions) == ["and believes it from now on"]


def test_told_that_a_thing_on_the_way_is_gone_it_goes_where_it_stood(tmp_path: Path) -> None:
    """A table was carried to a corner; who is told does not go round where it was."""
    places: dict[str, Any] = {"start": (2.5, 5.0), "goal": (4.0, 13.0), "heading_deg": 45.0,
                              "more": '[[moved]]\nthing = "study/table-1"\nx_ft = -1.0\ny_ft = 6.3\n'}
    round_it, _ = drive(two_doors(tmp_path, **places))
    across, decisions = drive(two_doors(tmp_path, ((0.05, "study/table-1", "gone"),), **places))
    assert [(result.outcome, result.collisions) for result in (round_it, across)] == [("reached", 0)] * 2
    assert across.path_length_m < round_it.path_length_m - 0.1
    assert [change.sentence() for entry in made(decisions, LocaleFrame) for change in entry.value.changes] == [
        "study/table-1 is gone (user)"]


def test_told_while_it_rolls_it_stops_and_goes_another_way(tmp_path: Path) -> None:
    """Rolling to one door, it is told that it is shut: it stops with the next picture, and goes by the other."""
    stage = two_doors(tmp_path, ((1.5, "north-door", "shut"),), start=(11.0, 3.5), goal=(4.0, 5.0),
                      heading_deg=90.0, more="[motion]\ncontinuous = true\n")
    result, decisions = drive(stage)
    assert (result.outcome, result.collisions) == ("reached", 0)
    assert routes(decisions) == [["north-door"], ["south-door"]]
    told = made(decisions, LocaleFrame)[0].cycle
    courses = [entry for entry in made(decisions, Course) if entry.cycle > told - 4]
    assert [entry.value.is_rolling for entry in courses[:2]] == [True, False] and courses[0].cycle < told
    assert courses[1].cycle <= told + 3


def test_told_nonsense_of_a_room_it_still_asks_for_that_room(tmp_path: Path) -> None:
    """The answer that a room is no door is no answer to what is known of the room."""
    decisions: list[Decision] = []
    head = build_head(two_doors(tmp_path), SEED)
    agent = build_agent(head)
    scheduler = agent.scheduler(ports=[WorldPort(agent.store)], sinks=[decisions.append])
    tell_robot(scheduler, agent.robot)
    for said in (UserReport("parlour", "shut"), head.task()):
        scheduler.post([Post(said)], USER)
        while scheduler.step() is not None:
            pass
    assert not any(decision.refused for decision in decisions)
    assert routes(decisions) == [["north-door"]]


@pytest.mark.parametrize(("telling", "expected"), [
    ('what = "study/table-2"\nstate = "gone"', "study/table-1"),
    ('what = "north"\nstate = "shut"', "north-door"),
    ('what = "study/table-1"\nstate = "shut"', "north-door"),
    ('what = "north-door"\nstate = "ajar"', "shut"),
])
def test_a_scenario_that_tells_of_what_is_not_there_is_refused_with_its_line(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], telling: str, expected: str
) -> None:
    two_doors(tmp_path)
    scenario = tmp_path / "told.toml"
    text = f"""description = "told"
world = "{tmp_path / "two_doors.toml"}"
goal = "(ptrans (study (11.0,13.5,0)) (parlour (4.0,12.0,0)))"
[start]
heading_deg = 60.0
[[told]]
at_s = 1.0
"""
    scenario.write_text(f"{text}{telling}\n")
    assert main(["run", str(scenario), "--out", str(tmp_path / "run")]) == 2
    said = capsys.readouterr().err
    assert f"{scenario.name}:" in said and expected in said
    line = int(said.split(f"{scenario.name}:")[1].split(":")[0])
    assert text.count("\n") - 1 <= line <= text.count("\n") + 2
