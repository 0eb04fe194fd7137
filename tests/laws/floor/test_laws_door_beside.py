"""Laws of a door that stands beside its place in the model: a jamb explains what is seen of it, and nothing wider."""

from __future__ import annotations

import math

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st

from knowledge_sources.methods.floor import build_polygon
from knowledge_sources.methods.floor.rivals_on_floor import MAX_BESIDE_M, MIN_JAMB_SIGMA_M, find_jamb_beside
from world_models.building.changes import find_along, outline_door
from world_models.building.locale_frame import FrameChange
from world_models.building.locales import Doorway
from world_models.files.world_files import WORLDS, load_world

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
    spread_m = math.hypot(MIN_JAMB_SIGMA_M, 0.25 * door.depth_m)  # on which side of its wall it is seen is not known
    assert found.sigma_m == pytest.approx(spread_m, abs=1e-3)
    inward = (door.threshold_of(room)[1 - side] - jamb) / door.width_m
    into_m = (shapely.get_coordinates(found.shape) - jamb) @ inward
    assert into_m.min() >= -0.02 and into_m.max() <= MAX_BESIDE_M + 0.02


@few
@given(cases, aways, asides, sides, st.floats(3.5, 6.0))
def test_what_reaches_further_into_the_opening_or_stands_nearer_is_no_jamb(
    case: tuple[str, Doorway], away_m: float, aside_m: float, side: int, wide: float
) -> None:
    room, door = case
    eye = stand(door, room, away_m, aside_m)
    assert find_jamb_beside(WORLD, room, look(door, room, eye, side, 0.0, wide * MAX_BESIDE_M), eye) is None
    seen = shapely.get_coordinates(look(door, room, eye, side, 0.01, 0.1))
    assert find_jamb_beside(WORLD, room, build_polygon(eye + 0.3 * (seen - eye)), eye) is None


@few
@given(cases, st.floats(-0.12, 0.12).filter(lambda off_m: abs(off_m) > 0.01))
def test_a_door_is_redrawn_for_both_its_rooms_and_no_other_is(case: tuple[str, Doorway], off_m: float) -> None:
    door = case[1]
    by_m = off_m * find_along(door)
    change = FrameChange("beside", door.name, "test", outline_door(door), 0.0, (float(by_m[0]), float(by_m[1])), 0.01)
    for frame in (WORLD.frame(room).changed(change) for room in door.between):
        (moved,) = (one for one in frame.doorways if one.name == door.name)
        np.testing.assert_allclose(moved.thresholds_world, door.thresholds_world + by_m)
        for mark in (mark for part in frame.parts for _, mark in part.landmarks if mark.kind == "doorway"):
            off = [*by_m, 0.0] if mark.name == door.name else [0.0, 0.0, 0.0]
            np.testing.assert_allclose(mark.lines_world, WORLD.landmark(mark.name).lines_world + off)
        assert frame.restored("beside", door.name) is WORLD.frame(frame.name)
