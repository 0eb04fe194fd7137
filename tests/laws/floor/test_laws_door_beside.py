"""Laws of a door that stands beside its place in the model: a jamb explains what is seen of it, and nothing wider."""

from __future__ import annotations

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st

from generated_boards import plain_robot
from knowledge_sources.methods.doors import find_beside
from knowledge_sources.methods.floor import build_polygon
from knowledge_sources.methods.floor.rivals_on_floor import MAX_BESIDE_M, find_jamb_beside
from world_models.building.changes import find_along, outline_door
from world_models.building.locale_frame import FrameChange
from world_models.building.locales import Doorway
from world_models.files.world_files import WORLDS, load_world
from world_models.frames import Pose2

WORLD = load_world(WORLDS / "research_center.toml", details=[])
CASES = [(room, door) for room in WORLD.rooms for door in WORLD.doorways_of(room) if door.width_m > 6.0 * MAX_BESIDE_M]
cases = st.sampled_from(CASES)
aways, asides = st.floats(0.8, 1.4), st.floats(-0.3, 0.3)
sides, parts = st.sampled_from((0, 1)), st.floats(0.3, 1.0)
few = settings(max_examples=150, deadline=None)


def stand(door: Doorway, room: str, away_m: float, aside_m: float) -> tuple[float, float]:
    """A place in a room before a door."""
    jambs = door.threshold_of(room)
    along = (jambs[1] - jambs[0]) / door.width_m
    x, y = jambs.mean(axis=0) - away_m * door.outward_from(room) + aside_m * along
    return float(x), float(y)


def look(door: Doorway, room: str, eye: tuple[float, float], side: int, low_m: float, high_m: float) -> shapely.Polygon:
    """What is seen of a thing without feet, further off than a door, past places so far into its opening from a jamb.
    """
    jambs = door.threshold_of(room)
    inward = (jambs[1 - side] - jambs[side]) / door.width_m
    ends = np.array([jambs[side] + at * inward for at in (low_m, high_m)])
    return build_polygon(np.concatenate([eye + part * (ends - eye) for part in (1.15, 1.4)]))


@few
@given(cases, aways, asides, sides, parts)
def test_what_is_seen_of_a_jamb_is_that_end_of_the_wall(
    case: tuple[str, Doorway], away_m: float, aside_m: float, side: int, part: float
) -> None:
    room, door = case
    eye = stand(door, room, away_m, aside_m)
    seen = look(door, room, eye, side, 0.01, part * MAX_BESIDE_M)
    found = find_jamb_beside(WORLD, room, seen, eye)
    assert found is not None and found.door == door.name
    jamb = door.threshold_of(room)[side]
    opening = shapely.MultiPoint(np.concatenate(door.thresholds_world)).convex_hull.buffer(0.02)
    assert opening.contains(found.shape)
    inward = (door.threshold_of(room)[1 - side] - jamb) / door.width_m
    into_m = (shapely.get_coordinates(found.shape) - jamb) @ inward
    assert into_m.min() >= -0.02 and into_m.max() <= MAX_BESIDE_M + 0.02


@few
@given(cases, aways, asides, sides, st.floats(3.5, 6.0))
def test_what_reaches_further_into_the_opening_is_no_jamb(
    case: tuple[str, Doorway], away_m: float, aside_m: float, side: int, wide: float
) -> None:
    room, door = case
    eye = stand(door, room, away_m, aside_m)
    assert find_jamb_beside(WORLD, room, look(door, room, eye, side, 0.0, wide * MAX_BESIDE_M), eye) is None


@few
@given(cases, aways, asides, sides)
def test_what_stands_nearer_than_the_door_is_no_jamb(
    case: tuple[str, Doorway], away_m: float, aside_m: float, side: int
) -> None:
    room, door = case
    eye = np.array(stand(door, room, away_m, aside_m))
    seen = shapely.get_coordinates(look(door, room, (float(eye[0]), float(eye[1])), side, 0.01, 0.1))
    near = build_polygon(eye + 0.3 * (seen - eye))
    assert find_jamb_beside(WORLD, room, near, (float(eye[0]), float(eye[1]))) is None


@settings(max_examples=25, deadline=None)
@given(cases, st.sampled_from((-0.1, 0.0, 0.07, 0.1)), st.floats(1.6, 2.4), asides, st.integers(0, 99))
def test_a_picture_tells_where_along_its_wall_a_door_stands(
    case: tuple[str, Doorway], off_m: float, away_m: float, aside_m: float, seed: int
) -> None:
    room, door = case
    robot, rng = plain_robot(WORLD), np.random.default_rng(seed)
    pose = Pose2(*stand(door, room, away_m, aside_m), door.pose_from(room).heading_rad)
    lines, along = WORLD.landmark(door.name).lines_world, np.array([*find_along(door), 0.0])
    shown, _ = robot.camera.project_segments(lines + off_m * along, robot.camera_from_world(pose))
    shown = shown[np.isfinite(shown).all(axis=(1, 2))]
    shown = rng.permutation(shown + rng.normal(0.0, 0.3, shown.shape))
    by = robot.camera, robot.mount.camera_from_robot, pose, 0.008
    found, again = (find_beside(lines, along, 0.0, segments, *by) for segments in (shown, shown[::-1]))
    redrawn = find_beside(lines + off_m * along, along, off_m, shown, *by)
    assert found is not None and found == again and redrawn is not None
    assert (redrawn.off_m, redrawn.log_ratio) == pytest.approx((found.off_m, found.log_ratio), abs=1e-6)
    assert abs(found.off_m - off_m) <= 3.0 * found.sigma_m + 0.003 and found.sigma_m < 0.02
    assert (found.log_ratio > 2.0) if off_m else (found.log_ratio < 0.0)


@few
@given(cases, st.floats(-0.12, 0.12).filter(lambda off_m: abs(off_m) > 0.01))
def test_a_door_that_is_redrawn_stands_there_for_both_its_rooms_and_no_other(
    case: tuple[str, Doorway], off_m: float
) -> None:
    door = case[1]
    by_m = off_m * find_along(door)
    change = FrameChange("beside", door.name, "test", outline_door(door), 0.0, (float(by_m[0]), float(by_m[1])), 0.01)
    frames = [WORLD.frame(room).changed(change) for room in door.between]
    shared = [{name: mark for part in frame.parts for _, mark in part.landmarks if (name := mark.name)}
              for frame in frames]
    for frame, marks in zip(frames, shared, strict=True):
        (moved,) = (one for one in frame.doorways if one.name == door.name)
        np.testing.assert_allclose(moved.thresholds_world, door.thresholds_world + by_m)
        known = WORLD.landmark(door.name).lines_world
        np.testing.assert_allclose(marks[door.name].lines_world, known + np.array([*by_m, 0.0]))
        assert all(mark.lines_world is WORLD.landmark(name).lines_world for name, mark in marks.items()
                   if mark.kind == "doorway" and name != door.name)
        assert frame.restored("beside", door.name) is WORLD.frame(frame.name)
