"""The world moves while it thinks: acts are charged, and the same run is the same again."""

from __future__ import annotations

from pathlib import Path

import pytest
from people_here import body_among, people_of, person

from harvey.simulation.simulated_run import redraw, run_mission
from harvey.wiring import KNOWLEDGE_SOURCES, foreign_sources
from harvey_people.simulated.charged import CHARGED_S, OTHERS_S
from harvey_people.simulated.walkers import WALKERS
from logs.explain.questions_in_words import answers
from logs.run_directory import RunDirectory
from logs.timeline import Timeline
from sim.scenario import parse_scenario
from sim.stage import build_stage
from world_models.entries import Course
from world_models.frames import Pose2
from world_models.plugins import GUESTS_GROUP

MISSION = 'world = "research_center"\ngoal = "(ptrans (hallway (4,4,0)) (hallway (9,4,0)))"\n[ranges]\nsensors = 24\n'
WALKER = ('[[walkers]]\nname = "anna"\nlocale = "hallway"\n'
          "way = [{x_ft = 26.0, y_ft = 4.4}, {x_ft = 1.5, y_ft = 4.4}]\n")


def test_every_source_that_is_charged_for_itself_is_there() -> None:
    assert set(CHARGED_S) <= {source.called() for source in KNOWLEDGE_SOURCES} | set(foreign_sources(GUESTS_GROUP))
    assert WALKERS.charge("localizer") == CHARGED_S["localizer"] and WALKERS.charge("goal_closer") == OTHERS_S


def test_what_is_charged_passes_with_the_next_act_and_people_walk_in_it() -> None:
    thinks, waits = (body_among(person([(-4.0, 0.0), (4.0, 0.0)]), at=Pose2(0.0, -3.0, 0.0)) for _ in range(2))
    thinks.charge(0.5)
    thinks.charge(0.5)
    assert thinks.time_s == 0.0
    thinks.look()
    waits.wait(1.0)
    waits.look()
    assert thinks.time_s == pytest.approx(waits.time_s)
    assert people_of(thinks)["people/0"] == pytest.approx(people_of(waits)["people/0"])


def test_wheels_roll_while_a_robot_on_the_move_thinks() -> None:
    rolls = body_among(at=Pose2(-4.0, 0.0, 0.0))
    for _ in range(20):
        rolls.steer(Course("leg-1", 0.4, 0.0))
    before = rolls.truth.world_from_robot.x_m
    rolls.charge(0.5)
    rolls.steer(Course("leg-1", 0.4, 0.0))
    assert rolls.truth.world_from_robot.x_m - before == pytest.approx(0.2, rel=0.1)


def test_a_mission_with_people_is_charged_and_its_body_does_the_same_again(tmp_path: Path) -> None:
    alone = run_mission(build_stage(parse_scenario(MISSION)), 0)
    among = run_mission(build_stage(parse_scenario(MISSION + WALKER)), 0, out=tmp_path / "run")
    assert alone.outcome == among.outcome == "reached" and among.sim_time_s > alone.sim_time_s + 0.5
    assert redraw(RunDirectory(tmp_path / "run")) == among.decisions
    history = Timeline(RunDirectory(tmp_path / "run").journal)
    who, why = (list(answers(history, question)) for question in ("who was in the way?", "why did it wait there?"))
    assert who and all("mover-" in story.headline for story in who), "each of them is told by name"
    assert all(story.headline == "It waited for nobody." or "it waited for mover-" in story.headline for story in why)
    told = [step.text for story in who for step in story.steps]
    assert any("risk of a touch" in text for text in told)
