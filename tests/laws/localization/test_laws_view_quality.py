"""Laws of choosing a view and of what is expected in it: the clearest lines, and none of the car that was ridden in."""

from __future__ import annotations

import math

import numpy as np
import pytest

from generated_boards import Bench, effect_on
from harvey.testing import plain_robot
from knowledge_sources.methods.verification import (
    MAX_SIGMA_PART,
    MAX_SIGMA_RAD,
    MIN_LINES,
    choose_heading,
    predict_lines,
    predict_milestone,
    view_quality,
)
from knowledge_sources.methods.verification.line_check import ViewQuality
from knowledge_sources.methods.verification.view_quality import (
    MAX_COUNTED_CONTRAST,
    MAX_COUNTED_LENGTH_PX,
    is_good_view,
)
from knowledge_sources.milestone_selector.view_predictor import ViewPredictor
from knowledge_sources.milestone_selector.view_updater import view_updater
from towers import tower
from world_models.entries import Milestone, Obstruction, Place, PlanSketch, Subgoal
from world_models.files.toml.source import Source
from world_models.files.world_files import WORLDS, load_world, read_world
from world_models.frames import Pose2

ROBOT = plain_robot(load_world(WORLDS / "two_ways.toml"))
HERE = Place("reception", 3.4, 2.2).in_world(ROBOT.world)
SMALL = 1e-9


@pytest.mark.parametrize("most", [5, 12, 30])
@pytest.mark.parametrize("heading", [0.4, 1.9, -2.0])
def test_the_lines_that_are_expected_are_the_clearest(most: int, heading: float) -> None:
    """By length times contrast, both up to what makes a line no clearer; redone one by one."""
    pose = Pose2(HERE.x_m, HERE.y_m, heading)
    every = predict_lines(ROBOT, pose)
    clear = [min(math.dist(*px), MAX_COUNTED_LENGTH_PX) * min(contrast, MAX_COUNTED_CONTRAST)
             for px, contrast in zip(every.segments_px.tolist(), every.contrast.tolist(), strict=True)]
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(view_quality, "MAX_EXPECTED_LINES", most)
        expected = predict_milestone(ROBOT, pose, Milestone("", -1, "", 0.0))
    kept = [every.lines_world.tolist().index(np.array(line).tolist()) for line in expected.expected]
    assert len(kept) == min(most, len(clear)) and kept == sorted(kept)
    left = set(range(len(clear))) - set(kept)
    assert not left or min(clear[k] for k in kept) >= max(clear[k] for k in left) - SMALL
    assert np.allclose(expected.expected_px, every.segments_px[kept])
    names = [every.marks[int(every.landmark[k])].name for k in kept]
    assert [expected.landmarks[i] for i in expected.landmark_of] == names


@pytest.mark.parametrize(("sigma_m", "sigma_rad", "lines", "good"), [
    (1.0, 1.0, MIN_LINES, True), (1.0 + SMALL, 1.0, MIN_LINES, False), (1.0, 1.0 + SMALL, MIN_LINES, False),
    (0.5, 0.5, MIN_LINES - 1, False), (0.1, 0.1, 60, True)])
@pytest.mark.parametrize("tolerance_m", [0.01, 0.15])
def test_a_view_is_good_up_to_each_bound(
    sigma_m: float, sigma_rad: float, lines: int, good: bool, tolerance_m: float
) -> None:
    quality = ViewQuality(sigma_m * MAX_SIGMA_PART * tolerance_m, sigma_rad * MAX_SIGMA_RAD, lines)
    assert is_good_view(quality, tolerance_m) is good


GOOD, VAGUE, VAGUER = ViewQuality(1e-4, 1e-4, 40), ViewQuality(0.2, 1e-3, MIN_LINES), ViewQuality(0.3, 1e-3, 50)
FEW = ViewQuality(0.1, 1e-3, MIN_LINES - 1)


@pytest.mark.parametrize(("views", "chosen"), [
    ((GOOD, VAGUE), 0), ((VAGUE, GOOD, GOOD), 1), ((VAGUER, VAGUE), 1), ((FEW, VAGUER), 1), ((FEW, VAGUER, VAGUE), 2),
    ((VAGUE, VAGUE), 0), ((FEW,), 0)])
def test_the_first_good_view_is_taken_else_the_surest_of_those_with_enough_lines(
    views: tuple[ViewQuality, ...], chosen: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    headings = [0.5 * k for k in range(len(views))]

    def rate(_: object, pose: Pose2, *__: object) -> ViewQuality:
        assert (pose.x_m, pose.y_m) == (1.0, 2.0)  # from where the robot stands
        return views[headings.index(pose.heading_rad)]

    monkeypatch.setattr(view_quality, "_compute_quality", rate)
    assert choose_heading(ROBOT, Pose2(1.0, 2.0, 9.0), headings, 0.1) == headings[chosen]


TOWER = read_world(Source.parse(tower(2, turn_deg=20.0), "tower.toml"))
IN_CAR = Place("car-2", 1.05, 1.0, math.pi / 2)
"""It looks out into the hall."""


@pytest.mark.parametrize("before", ["a ride", "a drive", "nothing"])
def test_after_a_ride_nothing_is_expected_of_the_car_as_it_looks_the_same_on_every_floor(before: str) -> None:
    robot = plain_robot(TOWER)
    bench = Bench(robot)
    pose = IN_CAR.in_world(TOWER)
    belief = bench.believe(Pose2(IN_CAR.x_m, IN_CAR.y_m, IN_CAR.heading_rad or 0.0), locale="car-2")
    goal = bench.pursue(Place("hall-2", 4.0, 1.3))
    step = Subgoal(Place("car-1", 1.05, 1.0), IN_CAR, before != "a ride", "elevator" if before == "a ride" else "")
    on = Subgoal(IN_CAR, goal.value.destination, primitive=True)
    sketch = bench.put(PlanSketch(goal.id, (), "", (step, on), 1), goal)
    milestone = bench.await_milestone(sketch.id if before != "nothing" else "", 1, look_heading_rad=pose.heading_rad)
    seen = predict_lines(robot.on_floor_of("car-2"), pose)
    marks = [seen.marks[int(i)] for i in seen.landmark]
    of_car = np.array(["car-2" in (mark.locale, mark.neighbour) for mark in marks])
    assert of_car.any() and not of_car.all()
    wanted = seen.lines_world[~of_car] if before == "a ride" else seen.lines_world
    expected = bench.apply(effect_on(bench.ask(ViewPredictor(), milestone), Milestone))[0].entry
    assert np.allclose(expected.value.expected, wanted)
    hidden = bench.put(Obstruction(((-30.0, 0.0), (-20.0, 0.0), (-20.0, 9.0), (-30.0, 9.0))))
    again = effect_on(bench.ask(view_updater, hidden), Milestone).value
    assert np.allclose(again.expected, wanted) and belief.value.is_held
