"""Laws of a place that was found: how far off it may be, whom the search asks, and how much work it is."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from knowledge_sources.methods.localization import CameraView, Search, get_visibility_map, place_search, protect_place
from knowledge_sources.methods.localization.global_localization import (
    MAX_CANDIDATES,
    MAX_REFINED_VIEWS,
    MIN_CANDIDATES,
    REFUTING_LOG_RATIO,
    LocalizationResult,
    LocalizationStatus,
    PlaceCandidate,
    count_refined,
)
from knowledge_sources.methods.localization.refinement import PoseLikelihood, refine_pose
from knowledge_sources.methods.pose import Rests
from knowledge_sources.methods.pose.solution_separation import _measure_lines
from knowledge_sources.methods.verification import predict_lines
from world_models.actuator import ActuatorModel
from world_models.camera import Camera, CameraMount
from world_models.files.world_files import WORLDS, load_world
from world_models.frames import Pose2
from world_models.robot import RobotModel

ROBOT = RobotModel(load_world(WORLDS / "research_center.toml"), Camera.from_field_of_view(math.radians(65.0)),
                   CameraMount(1.0, 0.1), ActuatorModel())
KNOWN = np.diag(np.square([3e-4, 3e-4, 3e-4, 0.0015, 0.001, 0.2, 0.2]))
FOUND, PROBE = LocalizationStatus.FOUND, LocalizationStatus.PROBE
seeds = st.integers(0, 10_000)


def look_round(seed: int, turns: tuple[float, ...]) -> tuple[Pose2, list[CameraView]]:
    """A place in a room, and what is seen from it in these directions, a third of a pixel off."""
    rng = np.random.default_rng(seed)
    x, y = rng.choice(get_visibility_map(ROBOT.world, "robot-laboratory", 1.0).positions)
    first = Pose2(float(x), float(y), float(rng.uniform(-3.0, 3.0)))
    now = first @ Pose2(0.0, 0.0, turns[-1])
    views = []
    for there in (first @ Pose2(0.0, 0.0, turn) for turn in turns):
        lines = predict_lines(ROBOT, there).segments_px
        views.append(CameraView(lines + rng.normal(0.0, 0.3, lines.shape), now.inverse() @ there, 1e-6 * np.eye(3)))
    return now, views


@settings(deadline=None, max_examples=8)
@given(seed=seeds, dx=st.floats(-0.05, 0.05), dy=st.floats(-0.05, 0.05))
def test_a_found_place_is_within_its_protection_level(seed: int, dx: float, dy: float) -> None:
    now, views = look_round(seed, (1.5, 3.0, 0.0))
    pose, covariance = refine_pose(ROBOT, views, Pose2(now.x_m + dx, now.y_m + dy, now.heading_rad))
    level = protect_place(ROBOT, views, pose, covariance, KNOWN)
    assert pose.distance_to(now) <= level.place_m < 1.0
    assert abs(math.remainder(pose.heading_rad - now.heading_rad, math.tau)) <= level.heading_rad


@settings(deadline=None, max_examples=20)
@given(seed=seeds, step=st.tuples(*[st.floats(-1e-4, 1e-4)] * 3))
def test_what_earlier_looks_saw_moves_with_the_pose(seed: int, step: tuple[float, float, float]) -> None:
    """By finite differences, and from elsewhere than where the robot is."""
    rng = np.random.default_rng(seed)
    pose, back = Pose2(5.0, 1.0, 0.3), Pose2(*rng.uniform(-1.0, 1.0, 3))
    lines = predict_lines(ROBOT, pose @ back)

    def measure(at: Pose2) -> Any:
        rests = Rests(lines.lines_world, lines.segments_px, [], ROBOT.camera, ROBOT.mount, np.zeros(7), at, KNOWN,
                      KNOWN, KNOWN, [at @ back] * len(lines))
        return _measure_lines(at, rests)

    (before, slopes), (after, _) = measure(pose), measure(Pose2(*(pose.vector + step)))
    assert after == pytest.approx(before + slopes[..., :3] @ np.array(step), abs=2e-2)


def place(k: int, log: float, *, accepted: bool) -> PlaceCandidate:
    return PlaceCandidate("a", Pose2(float(k), 0.0, 0.0), np.eye(3), PoseLikelihood(9, 9, log, 1.0), accepted)


@given(logs=st.lists(st.floats(0.0, 90.0), min_size=1, max_size=4), accepted=st.booleans(), looks=st.integers(1, 4),
       same=st.booleans())
def test_a_floor_is_searched_once_and_what_two_buildings_tell_otherwise_is_not_found(
    logs: list[float], accepted: bool, looks: int, same: bool
) -> None:
    searched: list[int] = []
    asked: list[int] = []
    fits = [LocalizationResult(FOUND if accepted else PROBE, (place(0 if same else k, log, accepted=accepted),))
            for k, log in enumerate(logs)]

    def answer(robot: Any, *_: Any, is_searched: bool) -> LocalizationResult:
        asked.append(robot)
        searched.extend([robot] * is_searched)
        return fits[robot]

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(place_search, "localize", answer)
        patch.setattr(place_search, "decide", lambda _, kept, *__: LocalizationResult(PROBE, tuple(kept)))
        view: Any = CameraView(np.zeros((0, 2, 2)), Pose2(0.0, 0.0, 0.0), np.zeros((3, 3)))
        robots: Any = range(len(logs))
        result, which = place_search.search(robots, Search([view] * looks, ["a"], ("a", Pose2(0.0, 0.0, 0.0)), []))
    assert searched == (asked if not accepted else [0]) and asked == ([0] if looks < 2 and not accepted else [*robots])
    assert logs[which] == max(logs[k] for k in asked)
    close = sum(logs[which] - log < REFUTING_LOG_RATIO for log in logs)
    if accepted:
        assert (result.status is FOUND) == (same or close == 1)
        assert sum(c.weight for c in result.candidates) == pytest.approx(1.0)


@given(st.integers(1, 60))
def test_the_work_of_a_search_is_bounded_however_often_it_looks(looks: int) -> None:
    most = count_refined(looks)
    assert MIN_CANDIDATES <= count_refined(looks + 1) <= most <= MAX_CANDIDATES
    assert most == MIN_CANDIDATES or most * looks <= MAX_REFINED_VIEWS
    said = place_search.describe(LocalizationResult(PROBE, ()), is_far=False, looks=looks)
    assert ("only the best" in said) == (most < MAX_CANDIDATES)
