"""Laws of the order of belief: what it excludes is not searched, and what it leaves open is found all the same."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from experiments.generated.floors import generated_floor
from knowledge_sources.methods.localization import (
    MIN_P_TRACKED,
    CameraView,
    LocalizationStatus,
    get_visibility_map,
    pose_candidates,
)
from knowledge_sources.methods.localization.global_localization import LocalizationResult, localize
from knowledge_sources.methods.localization.pose_candidates import MIN_SIEVED, VisibilityMap, find_pose_candidates
from knowledge_sources.methods.verification import predict_lines
from world_models.actuator import ActuatorModel
from world_models.building.building import Building
from world_models.camera import Camera, CameraMount
from world_models.frames import Pose2, wrap_angle
from world_models.robot import RobotModel

FLOOR = generated_floor(23, 16, open_share=1.0)
ROBOT = RobotModel(FLOOR.world, Camera.from_field_of_view(math.radians(65.0)), CameraMount(1.0, 0.1), ActuatorModel())
ROOMS = list(FLOOR.world.rooms)
SURE, DOUBTED = 0.98, 0.5 * MIN_P_TRACKED
LOOKS = (0.0, math.pi, 0.5 * math.pi)
places = st.tuples(st.sampled_from(FLOOR.rooms), st.integers(0, 10_000))


def draw_pose(place: tuple[str, int]) -> Pose2:
    room, seed = place
    rng = np.random.default_rng(seed)
    spots = get_visibility_map(FLOOR.world, room, 1.0).positions
    x_m, y_m = spots[int(rng.integers(len(spots)))]
    return Pose2(x_m, y_m, rng.uniform(-math.pi, math.pi))


def look_from(pose: Pose2, seed: int) -> list[CameraView]:
    """What a line finder would find all round: nine in ten of the model's lines, a third of a pixel off."""
    rng, views = np.random.default_rng(seed), []
    now = pose @ Pose2(0.0, 0.0, LOOKS[-1])
    for turn in LOOKS:
        there = pose @ Pose2(0.0, 0.0, turn)
        lines = predict_lines(ROBOT, there).segments_px
        lines = lines[rng.random(len(lines)) > 0.1]
        views.append(
            CameraView(lines + rng.normal(0.0, 0.3, lines.shape), now.inverse() @ there, np.diag([1e-5, 1e-5, 1e-4]))
        )
    return views


def nearest_first(pose: Pose2) -> list[str]:
    return sorted(ROOMS, key=lambda room: float(np.min(np.hypot(*(FLOOR.world.outline(room) - pose.position).T))))


def search(views: list[CameraView], guess: tuple[str, Pose2], p_guess: float) -> tuple[LocalizationResult, set[str]]:
    """The result, and the rooms whose floor was searched."""
    searched: set[str] = set()
    plain = get_visibility_map

    def note(building: Building, room: str, eye_m: float) -> VisibilityMap:
        searched.add(room)
        return plain(building, room, eye_m)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(pose_candidates, "get_visibility_map", note)
        result = localize(ROBOT, views, nearest_first(guess[1]), guess=guess, p_guess=p_guess)
    return result, searched


@settings(deadline=None, max_examples=3)
@given(place=places)
def test_what_the_belief_excludes_is_not_searched(place: tuple[str, int]) -> None:
    """A robot that is where it was believed to be is found there, and few rooms but the nearest are looked at."""
    pose = draw_pose(place)
    now, views = pose @ Pose2(0.0, 0.0, LOOKS[-1]), look_from(pose, place[1])
    alone, everywhere = localize(ROBOT, views, ROOMS), search(views, (place[0], now), DOUBTED)[1]
    result, searched = search(views, (place[0], now), SURE)
    assert everywhere == set(ROOMS)
    if alone.status is LocalizationStatus.FOUND:
        assert result.status is LocalizationStatus.FOUND
        assert result.candidates[0].world_from_robot.distance_to(now) < 0.05
        assert len(searched) <= len(ROOMS) // 2


@settings(deadline=None, max_examples=3)
@given(place=places, believed=places)
def test_a_belief_that_the_looks_do_not_bear_out_excludes_nothing(
    place: tuple[str, int], believed: tuple[str, int]
) -> None:
    """However sure it was: a robot that was kidnapped is found as one is that nobody told anything."""
    pose, views = draw_pose(place), look_from(draw_pose(place), place[1])
    guess = believed[0], draw_pose(believed)
    alone = localize(ROBOT, views, nearest_first(guess[1]))
    told, _ = search(views, guess, SURE)
    if alone.status is LocalizationStatus.FOUND and guess[1].distance_to(pose) > 2.0:
        assert told.status is LocalizationStatus.FOUND
        best, other = alone.candidates[0].world_from_robot, told.candidates[0].world_from_robot
        assert best.distance_to(other) < 0.05 and abs(wrap_angle(best.heading_rad - other.heading_rad)) < 0.02


def test_the_sieve_keeps_what_the_whole_grid_finds() -> None:
    """In nine of ten places the best of a search without a sieve is among the best of one with it."""
    kept = 0
    for seed in range(10):
        place = str(np.random.default_rng([seed, 3]).choice(FLOOR.rooms)), seed
        views = look_from(draw_pose(place), seed)
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(pose_candidates, "MIN_SIEVED", 10**9)
            best = find_pose_candidates(ROBOT, views, ROOMS, 1)[0].world_from_robot
        sieved = find_pose_candidates(ROBOT, views, ROOMS, 3)
        assert sum(4 * len(get_visibility_map(FLOOR.world, room, 1.0).positions) for room in ROOMS) > 2 * MIN_SIEVED
        kept += any(best.distance_to(c.world_from_robot) < 0.11 for c in sieved)
    assert kept >= 9
