"""Laws of range sensors: an echo is the nearest thing in the cone, what does not come back is none, seeds decide."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from blackboard import Blackboard, Post, Posted
from box_rooms import box_room
from harvey.runner.ports import BodyPort
from sim.body.collision import ROBOT_RADIUS_M
from sim.body.faulty_body import FaultyBody
from sim.body.senses import RangeRing, find_echo
from sim.body.simulated_body import SimulatedBody
from sim.body.simulated_building import SimulatedBuilding
from world_models.camera import Camera, CameraMount
from world_models.entries import CameraPicture, Course, MotorCommand, PictureRequest, Ranges
from world_models.frames import Pose2

CAMERA = Camera.from_field_of_view(math.radians(65.0), 64, 64)
BUILDING = SimulatedBuilding.of_faces(box_room(), samples=1)
PLACES = st.builds(Pose2, st.floats(0.6, 3.4), st.floats(0.6, 3.4), st.floats(-math.pi, math.pi))
POINTS = st.tuples(st.floats(-5.0, 5.0), st.floats(-5.0, 5.0))
SEGMENTS = st.lists(st.tuples(POINTS, POINTS), min_size=1, max_size=6).map(lambda found: np.array(found, float))
HALF_BEAMS = st.floats(0.05, 1.0)


@settings(deadline=None)
@given(SEGMENTS, st.builds(Pose2, st.floats(-2, 2), st.floats(-2, 2), st.floats(-math.pi, math.pi)), HALF_BEAMS)
def test_an_echo_is_the_nearest_point_in_the_cone(segments: np.ndarray, sensor: Pose2, half_beam: float) -> None:
    """Against many points of each segment."""
    found_m, incidence_rad = find_echo(segments, sensor, half_beam)
    t = np.linspace(0.0, 1.0, 4001)[:, None, None]
    points = (segments[:, 0] + t * (segments[:, 1] - segments[:, 0])).reshape(-1, 2) - sensor.position
    bearings = np.arctan2(points[:, 1], points[:, 0]) - sensor.heading_rad
    inside = np.abs(np.remainder(bearings + np.pi, 2.0 * np.pi) - np.pi) <= half_beam
    away = np.hypot(points[:, 0], points[:, 1])
    step_m = float(np.hypot(*(segments[:, 1] - segments[:, 0]).T).max()) / 4000.0
    if inside.any():
        assert found_m <= away[inside].min() + 1e-9
    wider = np.abs(np.remainder(bearings + np.pi, 2.0 * np.pi) - np.pi) <= half_beam + 1e-6
    near = away[wider | (away < 1e-6)]
    if math.isfinite(found_m) and len(near):  # a part of a segment between two points may be all that is in the cone
        assert found_m >= away.min() - step_m
    assert 0.0 <= incidence_rad <= math.pi / 2.0


@given(st.floats(0.2, 5.0), st.floats(-1.2, 1.2))
def test_a_wall_is_heard_along_its_normal_where_the_cone_holds_it(away_m: float, turned_rad: float) -> None:
    wall, half_beam = np.array([[[away_m, -50.0], [away_m, 50.0]]]), 0.3
    found_m, incidence_rad = find_echo(wall, Pose2(0.0, 0.0, turned_rad), half_beam)
    off_rad = max(0.0, abs(turned_rad) - half_beam)
    assert found_m == pytest.approx(away_m / math.cos(off_rad), rel=1e-6)
    assert incidence_rad == pytest.approx(off_rad, abs=1e-6)


@given(PLACES, st.integers(1, 24))
def test_without_noise_no_echo_is_nearer_than_the_nearest_wall(pose: Pose2, sensors: int) -> None:
    ring = RangeRing(sensors=sensors, sigma_m=0.0, dropout=0.0)
    ranges = ring.measure(BUILDING.obstacles.segments_world, pose, np.random.default_rng(0), 1.0)
    assert ranges is not None and len(ranges.distances_m) == sensors == len(ranges.echoes)
    nearest_m = min(distance for _, distance in ranges.echoes)
    assert nearest_m >= BUILDING.obstacles.clearance_m(pose, 0.0) - 1e-9


@given(PLACES, st.floats(0.1, 5.0))
def test_what_is_out_of_reach_is_no_echo(pose: Pose2, reach_m: float) -> None:
    segments = BUILDING.obstacles.segments_world
    near, far = (RangeRing(24, reach_m=reach, sigma_m=0.0, dropout=0.0).measure(
        segments, pose, np.random.default_rng(0), 0.0) for reach in (reach_m, 50.0))
    assert near is not None and far is not None
    for short, long in zip(near.distances_m, far.distances_m, strict=True):
        assert long is not None and short == (long if long - ROBOT_RADIUS_M <= reach_m else None)


@given(PLACES, st.integers(0, 10**6), st.floats(0.0, 1.0))
def test_only_slanted_echoes_fail_and_the_seed_decides_which(pose: Pose2, seed: int, dropout: float) -> None:
    segments, ring = BUILDING.obstacles.segments_world, RangeRing(24, dropout=dropout)
    first, again = (ring.measure(segments, pose, np.random.default_rng(seed), 0.0) for _ in range(2))
    whole = RangeRing(24, dropout=0.0).measure(segments, pose, np.random.default_rng(seed), 0.0)
    assert first == again and first is not None and whole is not None
    for number, (some, always) in enumerate(zip(first.distances_m, whole.distances_m, strict=True)):
        sensor = pose @ Pose2(0.0, 0.0, math.tau * number / 24) @ Pose2(ROBOT_RADIUS_M, 0.0, 0.0)
        slanted = find_echo(segments, sensor, ring.half_beam_rad)[1] > ring.specular_rad - 1e-9
        assert some == always or (some is None and slanted)


@settings(deadline=None, max_examples=10)
@given(st.integers(0, 10**6), st.integers(0, 24))
def test_ranges_come_with_each_picture_and_with_nothing_else(seed: int, sensors: int) -> None:
    robot = SimulatedBody(BUILDING, Pose2(2.0, 2.2, 0.3), CAMERA, CameraMount(1.0, 0.1), seed=seed,
                          ranges=RangeRing(sensors))
    port, board = BodyPort(FaultyBody(robot)), Blackboard()
    for request in (
        PictureRequest("track"), MotorCommand(0.3, 0.2), Course("Leg-1", 0.2, 0.0), PictureRequest("probe")
    ):
        (asked,) = board.apply([Post(request)], author="motor", cycle=1)
        entries = [change.entry for change in board.apply(port.answer(Posted(asked.entry)), author="body", cycle=1)]
        ranges = [entry for entry in entries if isinstance(entry.value, Ranges)]
        frames = [entry for entry in entries if isinstance(entry.value, CameraPicture)]
        assert len(ranges) == (len(frames) if sensors else 0)
        for entry, frame in zip(ranges, frames, strict=False):
            assert entry.because == frame.because and entry.value.when_s == frame.value.sim_time_s
            assert len(entry.value.distances_m) == sensors


def test_a_ring_changes_nothing_else_of_a_run() -> None:
    commands = [MotorCommand(0.4, 0.5), MotorCommand(-1.0, 0.3)]
    tracks = []
    for sensors in (0, 24):
        robot = SimulatedBody(BUILDING, Pose2(2.0, 2.2, 0.3), CAMERA, CameraMount(1.0, 0.1), seed=5,
                              ranges=RangeRing(sensors))
        for command in commands:
            robot.execute(command)
            robot.ranges()
        tracks.append((robot.track, robot.look().jpeg))
    assert tracks[0] == tracks[1]


def test_ranges_need_a_distance_for_each_direction() -> None:
    with pytest.raises(ValueError, match="a distance for each of 2 directions, got 1"):
        Ranges((0.0, 1.0), (None,), 0.01, 0.2, 5.0, 0.0)
    assert Ranges((0.0,), (None,), 0.01, 0.2, 5.0, 0.0).sentence().startswith("0 of 1 range sensor")
    assert "0.80 m away, 57.3 degrees left of ahead" in Ranges((1.0,), (0.8,), 0.01, 0.2, 5.0, 0.0).sentence()
