"""Laws of the view predictor: it predicts what the robot faces, when it faces it, and asks for the picture once."""

from __future__ import annotations

import math

import pytest
from hypothesis import given, settings

from blackboard import Level
from generated_boards import Bench, effect_on, made, poses, reasons, to_world
from harvey.testing import check_source, plain_robot
from knowledge_sources.milestone_selector.view_predictor import ViewPredictor
from knowledge_sources.reads import MAX_LOOK_ERROR_RAD
from world_models.entries import Milestone, Obstruction, PictureRequest
from world_models.frames import Pose2

SOURCE = ViewPredictor()
SMALL = 1e-6
AHEAD = to_world(Pose2(0.0, 0.0, 0.0)).heading_rad


@pytest.mark.parametrize("side", [-1.0, 1.0])
@pytest.mark.parametrize("more", [-SMALL, SMALL])
@pytest.mark.parametrize("doubt", ["none", "before", "after"])
def test_it_looks_when_the_robot_faces_the_milestone_or_is_in_newer_doubt(side: float, more: float, doubt: str) -> None:
    bench = Bench(plain_robot())
    bench.believe()
    if doubt == "before":
        bench.doubt(Level.PLAN)
    milestone = bench.await_milestone(look_heading_rad=AHEAD + side * (MAX_LOOK_ERROR_RAD + more))
    if doubt == "after":
        bench.doubt(Level.PLAN)
    effects = bench.ask(SOURCE, milestone)
    assert (effects is not None) == (more < 0.0 or doubt == "after")
    if effects is not None:
        assert made(effects, PictureRequest) == [PictureRequest("milestone")]
        assert effect_on(effects, Milestone).value.look_heading_rad == pytest.approx(AHEAD)


@settings(max_examples=20, deadline=None)
@given(poses)
def test_the_lines_are_those_that_the_camera_sees_where_it_sees_them(pose: Pose2) -> None:
    """A pinhole, redone by hand: y to the left and x ahead of the robot, the camera tilted down."""
    robot, here = plain_robot(), to_world(pose)
    bench = Bench(robot)
    bench.believe(pose)
    milestone = bench.await_milestone("PlanSketch-1", 1, look_heading_rad=here.heading_rad, tried=(9.0,))
    effects = bench.ask(SOURCE, milestone)
    expected = effect_on(effects, Milestone).value
    assert (expected.status, expected.sketch, expected.index, expected.tried) == (
        "expected", "PlanSketch-1", 1, (9.0,))
    camera, mount = robot.camera, robot.mount
    c, s = math.cos(here.heading_rad), math.sin(here.heading_rad)
    for line, pixels in zip(expected.expected, expected.expected_px, strict=True):
        for (x, y, z), (u, v) in zip(line, pixels, strict=True):
            ahead = c * (x - here.x_m) + s * (y - here.y_m) - mount.forward_m
            left, up = -s * (x - here.x_m) + c * (y - here.y_m), z - mount.height_m
            depth = ahead * math.cos(mount.tilt_rad) - up * math.sin(mount.tilt_rad)
            above = ahead * math.sin(mount.tilt_rad) + up * math.cos(mount.tilt_rad)
            assert (u, v) == pytest.approx(
                (camera.cx - camera.fx * left / depth, camera.cy - camera.fy * above / depth), abs=0.01)
    named = reasons(effect_on(effects, Milestone))
    assert {milestone.id, "Hypothesis-1"} <= named
    assert {bench.view[i].value.__class__.__name__ for i in named} <= {"Milestone", "Hypothesis", "LocaleFrame"}
    assert reasons(effect_on(effects, PictureRequest)) == {"Milestone"}
    bench.apply(*effects or ())
    assert bench.ask(SOURCE, milestone) is None


@pytest.mark.parametrize("is_hidden", [True, False])
def test_what_stands_before_the_camera_is_named(is_hidden: bool) -> None:
    bench = Bench(plain_robot())
    bench.believe()
    if is_hidden:
        bench.put(Obstruction(((0.0, 0.0), (256.0, 0.0), (256.0, 256.0), (0.0, 256.0))))
    effects = bench.ask(SOURCE, bench.await_milestone(look_heading_rad=AHEAD))
    effect = effect_on(effects, Milestone)
    assert ("Obstruction-1" in reasons(effect)) == is_hidden
    assert bool(effect.value.expected) != is_hidden  # it covers the whole picture


def test_it_keeps_the_laws_of_all_sources() -> None:
    bench = Bench(plain_robot())
    bench.believe()
    check_source(SOURCE, bench, bench.await_milestone(look_heading_rad=AHEAD))
