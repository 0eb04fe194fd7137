"""Motions that are steered on the move: thirty pictures a second, all through the board, and the same once more."""

from __future__ import annotations

import itertools
from pathlib import Path

import pytest

from harvey.runner.resume import find_remains
from harvey.simulation.simulated_run import resume_mission, run_mission
from logs.run_directory import RunDirectory
from logs.timeline import Timeline
from recorded_runs import cut_off, is_decided_again
from sim.scenario import parse_scenario, with_settings
from sim.stage import Stage, build_stage

SCENARIO = """
world = "research_center"
details = ["research_center_details"]
goal = "(ptrans (hallway (4,4,0)) (hallway (11,4,0)))"
[motion]
continuous = true
"""
KIDNAP = """
[[faults]]
kind = "kidnap"
in_locale = "hallway"
after_ft = 8.0
distance_m = 0.8
turn_deg = 15.0
"""
SEED = 0


@pytest.fixture(scope="module")
def stage() -> Stage:
    return build_stage(parse_scenario(SCENARIO, "on-the-move"))


@pytest.fixture(scope="module")
def run(stage: Stage, tmp_path_factory: pytest.TempPathFactory) -> RunDirectory:
    out = RunDirectory(tmp_path_factory.mktemp("runs") / "move")
    result = run_mission(stage, SEED, out=out.path)
    assert result.outcome == "reached" and result.collisions == 0
    assert result.final_error_m < 0.0254 and result.max_cross_track_m < 0.02
    return out


def test_each_picture_on_the_move_corrects_the_course_and_all_of_it_is_decided_again_to_the_byte(
    run: RunDirectory,
) -> None:
    records = list(Timeline(run.journal).decisions())
    courses = [e for r in records for e in r.made if e.type == "Course"]
    assert courses[0].change == "Posted" and len(courses) > 40
    assert len({e.fields["curvature_per_m"] for e in courses}) > 0.9 * (len(courses) - 2)
    taken = [e.fields["sim_time_s"] for r in records for e in r.observed
             if e.type == "CameraPicture" and e.because[0].startswith("Course-1.")]
    steps = [b - a for a, b in itertools.pairwise(taken)][:-1]
    assert all(abs(step - 1.0 / 30.0) < 1e-9 for step in steps)
    assert is_decided_again(run)


def test_a_run_that_is_cut_off_on_the_move_goes_on(run: RunDirectory, stage: Stage, tmp_path: Path) -> None:
    """The robot has come to a stand by then; what the wheels claim of that is told, and it sets off again."""
    rolling = [r.cycle for r in Timeline(run.journal).decisions() if any(e.type == "Course" for e in r.made)]
    cut = cut_off(run, tmp_path / "cut", rolling[30], tail=0)
    assert resume_mission(cut, find_remains(cut), stage=stage).outcome == "reached"
    told = next(e for r in Timeline(cut.journal).decisions() for e in r.observed if e.type == "Resumed")
    last = Timeline(cut.journal).decision(rolling[30])
    assert told.fields["interrupted"] == [next(e.ref for e in last.made if e.type == "Course")]
    assert is_decided_again(cut)


def test_who_is_carried_off_on_the_move_stops_at_once(tmp_path: Path) -> None:
    farther = SCENARIO.replace("(11,4,0)", "(16,4,0)")  # it rolls only once it has seen the floor before it
    stage = build_stage(parse_scenario(farther + KIDNAP, "carried-off"))
    run = RunDirectory(tmp_path / "run")
    result = run_mission(stage, SEED, out=run.path)
    assert result.outcome == "reached" and result.collisions == 0 and result.milestones["false_accepts"] == 0
    assert result.camera == (), "the camera was not turned: somebody carried the robot"
    records = list(Timeline(run.journal).decisions())
    at = next(i for i, r in enumerate(records) for e in r.made if e.type == "Discrepancy" and e.author
              == "correlator_tracker" and e.fields["magnitude"] in ("inf", float("inf")))
    after = [e for r in records[at + 1: at + 4] for e in r.made if e.type in ("Course", "MotorCommand")]
    assert [(e.type, e.fields["speed_m_per_s"], e.author) for e in after] == [("Course", 0.0, "path_follower")]


def test_it_is_a_setting_like_any_other() -> None:
    plain = parse_scenario(SCENARIO.partition("[motion]")[0], "plain")
    assert not plain.motion.continuous
    assert with_settings(plain, {"motion.continuous": "on"}).motion.continuous
