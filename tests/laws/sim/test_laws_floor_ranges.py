"""Laws of ranged floor: nothing solid is in what is called free, and what the model lacks is found where it stands."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st

from experiments.generated.floors import generated_floor
from knowledge_sources.methods.arrays import Floats
from knowledge_sources.methods.floor import FloorMap, see_ranges
from knowledge_sources.methods.floor.ranges import RANGE_SIGMAS
from sim.body.collision import Obstacles
from sim.body.senses import RangeRing
from world_models.actuator import ActuatorModel
from world_models.camera import Camera, CameraMount
from world_models.entries import FreeFloor
from world_models.frames import Pose2
from world_models.robot import RobotModel

FLOOR = generated_floor(3, 4)
WORLD = FLOOR.world
ROBOT = RobotModel(WORLD, Camera.from_field_of_view(math.radians(65.0)), CameraMount(1.0, 0.1), ActuatorModel())
SOLID = Obstacles.of_faces(face for part in WORLD.parts for _, face in part.faces)
SIGMA_M = 0.02


def box(x_m: float, y_m: float, side_m: float, turn_rad: float) -> Floats:
    corners = Pose2(x_m, y_m, turn_rad).lifted().apply(
        [(side_m / 2 * a, side_m / 2 * b, 0.0) for a, b in ((1, 1), (-1, 1), (-1, -1), (1, -1))])[:, :2]
    return np.stack([corners, np.roll(corners, -1, axis=0)], axis=1)


def place(room: int, x_part: float, y_part: float, heading_rad: float = 0.0) -> tuple[str, Pose2]:
    name = FLOOR.rooms[room % len(FLOOR.rooms)]
    low, high = WORLD.outline(name).min(axis=0), WORLD.outline(name).max(axis=0)
    x, y = low + 0.5 + (high - low - 1.0) * (x_part, y_part)
    return name, Pose2(float(x), float(y), heading_rad)


def read(solid: Floats, pose: Pose2, seed: int, dropout: float) -> FreeFloor | None:
    """What is ranged at a pose with noise of up to three standard deviations."""
    rng = np.random.default_rng(seed)
    exact = RangeRing(24, sigma_m=0.0, dropout=dropout).measure(solid, pose, rng, 1.0)
    assert exact is not None
    noisy = tuple(None if d is None else d + SIGMA_M * float(np.clip(rng.standard_normal(), -2.99, 2.99))
                  for d in exact.distances_m)
    locale = WORLD.locale_at(pose.position)
    if locale is None:
        return None
    reading = type(exact)(exact.directions_rad, noisy, SIGMA_M, exact.half_beam_rad, exact.max_range_m, 1.0)
    return see_ranges(ROBOT, locale, pose, 0.02, 0.005, reading, ())


def free_area(floor: FreeFloor) -> shapely.Geometry:
    """All of what it calls free: each bearing's interval, half a step to either side.

    What begins at the rim ends where something is next to it: by one echo, so to its three deviations.
    """
    half, parts = 0.5 * math.tau / (len(floor.bearings_rad) - 1), []
    for bearing, near, heard in zip(floor.bearings_rad, floor.near_m, floor.far_m, strict=True):
        far = heard - RANGE_SIGMAS * SIGMA_M if near == ROBOT.radius_m else heard
        if far > near:
            angles = bearing + np.linspace(-half, half, 5)
            rim = np.stack([np.cos(angles), np.sin(angles)], axis=-1)
            corners = np.concatenate([near * rim, far * math.cos(half / 4) * rim[::-1]])
            parts.append(shapely.Polygon(corners + np.array([floor.x_m, floor.y_m])))
    return shapely.union_all(parts)


@settings(deadline=None, max_examples=60)
@given(st.integers(0, 10**6), st.integers(0, 9), st.tuples(*[st.floats(0.0, 1.0)] * 4), st.floats(-3.1, 3.1),
       st.floats(0.05, 1.0), st.sampled_from([0.0, 0.5, 1.0]))
def test_nothing_solid_is_where_the_floor_is_ranged_free(
    seed: int, room: int, parts: tuple[float, ...], turn_rad: float, side_m: float, dropout: float
) -> None:
    _, pose = place(room, parts[0], parts[1], turn_rad)
    _, at = place(room, parts[2], parts[3])
    stands = box(at.x_m, at.y_m, side_m, turn_rad)
    solid = np.concatenate([SOLID.segments_world, stands])
    if Obstacles(solid).clearance_m(pose) < 0.0 or shapely.Polygon(stands[:, 0]).contains(shapely.Point(pose.position)):
        return  # no robot stands in a thing
    floor = read(solid, pose, seed, dropout)
    if floor is not None:
        free = shapely.buffer(free_area(floor), -1e-3)
        assert not shapely.intersects(free, shapely.linestrings(solid)).any()


@settings(deadline=None, max_examples=60)
@given(st.integers(0, 10**6), st.integers(0, 9), st.tuples(*[st.floats(0.0, 1.0)] * 2), st.floats(-3.1, 3.1))
def test_where_the_model_is_right_nothing_is_lacking(
    seed: int, room: int, parts: tuple[float, float], turn_rad: float
) -> None:
    _, pose = place(room, *parts, turn_rad)
    if SOLID.clearance_m(pose) >= 0.0:
        floor = read(SOLID.segments_world, pose, seed, 0.5)
        assert floor is None or (not floor.things and "thing" not in floor.ends)


@settings(deadline=None, max_examples=60)
@given(st.integers(0, 10**6), st.integers(0, 9), st.floats(-3.1, 3.1), st.floats(0.6, 1.4), st.floats(0.2, 0.6),
       st.floats(-3.1, 3.1))
def test_what_the_model_lacks_is_found_where_it_stands(
    seed: int, room: int, turn_rad: float, away_m: float, side_m: float, bearing_rad: float
) -> None:
    name, pose = place(room, 0.5, 0.5, turn_rad)
    x, y = pose.x_m + away_m * math.cos(bearing_rad), pose.y_m + away_m * math.sin(bearing_rad)
    lacking = box(x, y, side_m, turn_rad)
    clear = min(Obstacles(SOLID.segments_world).clearance_m(Pose2(x, y, 0.0), side_m), SOLID.clearance_m(pose))
    if clear < 0.8 or Obstacles(lacking).clearance_m(pose) < 0.05 or WORLD.locale_at((x, y)) != name:
        return
    floor = read(np.concatenate([SOLID.segments_world, lacking]), pose, seed, 0.0)
    assert floor is not None and floor.things
    true = shapely.Polygon(lacking[:, 0])
    for thing in floor.things:
        footprint = shapely.Polygon(thing.footprint)
        assert footprint.exterior.is_ccw and footprint.is_valid
        assert footprint.distance(true) <= 3.0 * thing.sigma_m + 0.15 and 0.5 < thing.p_thing < 1.0


def test_more_readings_make_it_narrower() -> None:
    name, pose = place(0, 0.3, 0.5)
    lacking = box(pose.x_m + 1.6, pose.y_m, 0.3, 0.0)
    solid, rng = np.concatenate([SOLID.segments_world, lacking]), np.random.default_rng(1)
    ring = RangeRing(24, sigma_m=0.0, dropout=0.0)
    found: list[FreeFloor] = []
    for step in range(3):
        here = Pose2(pose.x_m + 0.2 * step, pose.y_m + 0.1 * step, 0.15 * step)
        reading = ring.measure(solid, here, rng, float(step))
        assert reading is not None
        found.insert(0, see_ranges(ROBOT, name, here, 0.01, 0.002, reading, found))
    first, last = found[-1].things, found[0].things
    assert len(first) == len(last) == 1
    assert shapely.Polygon(last[0].footprint).area < shapely.Polygon(first[0].footprint).area


@pytest.mark.parametrize("nearer_m", [0.0, 0.02])  # just off its rim; or on a sensor
def test_what_touches_the_robot_ends_the_floor_there(nearer_m: float) -> None:
    name, pose = place(0, 0.5, 0.5)
    solid = np.concatenate([SOLID.segments_world, box(pose.x_m + 0.56, pose.y_m, 0.4, 0.0)])
    reading = RangeRing(24, sigma_m=0.0, dropout=0.0).measure(solid, pose, np.random.default_rng(1), 0.0)
    assert reading is not None
    reading = replace(reading, distances_m=tuple(d and max(ROBOT.radius_m, d - nearer_m) for d in reading.distances_m))
    floor = see_ranges(ROBOT, name, pose, 0.01, 0.002, reading, ())
    ahead = int(np.argmin(np.abs(floor.bearings_rad)))
    assert floor.ends[ahead] == "thing" and floor.far_m[ahead] <= 0.36
    told = FloorMap([floor], np.array([[pose.x_m, pose.y_m, 0.5]])).ask(np.array([[pose.x_m + 0.42, pose.y_m]]))
    assert told.p[0] == 1.0


def test_without_an_echo_nothing_is_free() -> None:
    name, pose = place(0, 0.5, 0.5)
    reading = RangeRing(24).measure(np.zeros((0, 2, 2)), pose, np.random.default_rng(0), 0.0)
    assert reading is not None
    floor = see_ranges(ROBOT, name, pose, 0.02, 0.005, reading, ())
    assert not any(far > near for near, far in zip(floor.near_m, floor.far_m, strict=True))
    assert set(floor.ends) == {"sight"}
