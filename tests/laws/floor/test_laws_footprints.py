"""Footprints: joined from several sights, taken off where the floor is free, and told apart."""

from __future__ import annotations

import math

import numpy as np
import pytest
import shapely
import shapely.affinity
from hypothesis import example, given
from hypothesis import strategies as st

from knowledge_sources.methods.floor import build_free_floor, build_polygon, list_corners
from knowledge_sources.methods.floor.footprints import (
    deepen,
    join_footprints,
    measure_change_m,
    measure_common_directions,
    measure_free_part,
    measure_hull_part,
    measure_width_m,
    take_free,
)
from world_models.building.changes import build_extra_faces
from world_models.building.geometry.faces import area_vector

SQUARE = ((2.0, -0.2), (2.4, -0.2), (2.4, 0.2), (2.0, 0.2))
NOTHING = shapely.Polygon()


def test_the_free_floor_is_what_lies_between_near_and_far() -> None:
    bearings = np.linspace(-0.4, 0.4, 33).tolist()
    far = [2.0 if abs(b) < 0.1 else 4.0 for b in bearings]
    free = build_free_floor(0.0, 0.0, bearings, [1.0] * 33, far)
    assert free.contains(shapely.Point(1.5, 0.0)) and free.contains(shapely.Point(3.0, 0.8))
    assert not free.intersects(shapely.Point(0.9, 0.0)) and not free.intersects(shapely.Point(2.2, 0.0))
    assert build_free_floor(0.0, 0.0, bearings, [1.0] * 33, [0.0] * 33).is_empty


def test_a_near_side_is_deepened_away_from_the_eye_and_what_is_deep_stays() -> None:
    side = deepen(((2.0, -0.2), (2.0, 0.2)), (0.0, 0.0), 0.3)
    assert side.bounds == pytest.approx((2.0, -0.2, 2.3, 0.2), abs=0.03)
    assert deepen(SQUARE, (0.0, 0.0), 0.3).equals(build_polygon(SQUARE))


def test_joined_footprints_hold_both_and_lose_what_is_free() -> None:
    known, seen = build_polygon(SQUARE), build_polygon([(x + 0.1, y) for x, y in SQUARE])
    joined = join_footprints(known, seen, NOTHING)
    assert joined.buffer(1e-9).covers(known) and joined.buffer(1e-9).covers(seen)
    free = shapely.box(1.0, -1.0, 2.1, 1.0)
    assert join_footprints(known, seen, free).bounds == pytest.approx((2.1, -0.2, 2.5, 0.2))
    assert measure_free_part(known, free) == pytest.approx(0.25)
    assert take_free(known, shapely.box(1.0, -1.0, 3.0, 1.0)).is_empty


def test_two_things_apart_are_told_apart_by_the_floor_between_them() -> None:
    square = build_polygon(SQUARE)
    assert measure_hull_part(square, square) == pytest.approx(1.0)
    beside = build_polygon([(x, y + 2.0) for x, y in SQUARE])
    assert measure_hull_part(square, beside) > 2.0


def test_corners_are_told_and_compared() -> None:
    corners = list_corners(build_polygon(SQUARE))
    assert shapely.LinearRing(corners).is_ccw and sorted(corners) == sorted(SQUARE)
    assert list_corners(NOTHING) == ()
    assert measure_change_m(SQUARE, [(x + 0.1, y) for x, y in SQUARE]) == pytest.approx(0.1)
    assert measure_width_m(SQUARE) == pytest.approx(0.4)


def test_the_faces_of_what_is_extra_face_outwards_and_end_at_its_top() -> None:
    faces = build_extra_faces("hall/obstacle-1", "hall", SQUARE, 3.0, 0.5)
    assert len(faces) == 5 and not build_extra_faces("hall/obstacle-1", "hall", SQUARE, 3.0, 0.0)
    middle = np.array([2.2, 0.0, 3.25])
    for face in faces:
        assert np.isnan(face.front[0].colour).all()
        assert area_vector(face.polygon_world) @ (face.polygon_world.mean(axis=0) - middle) > 0.0
        assert face.polygon_world[:, 2].max() == pytest.approx(3.5)


def place_square(bearing_rad: float, away_m: float, side_m: float, turn_rad: float) -> shapely.Polygon:
    half = side_m / 2
    square = shapely.affinity.rotate(shapely.box(-half, -half, half, half), turn_rad, use_radians=True)
    return shapely.affinity.translate(square, away_m * math.cos(bearing_rad), away_m * math.sin(bearing_rad))


squares = st.builds(
    place_square, st.floats(-math.pi, math.pi), st.floats(1.0, 3.0), st.floats(0.1, 1.2), st.floats(0.0, 1.5))


@given(known=squares, seen=squares)
@example(known=place_square(0.7, 1.4, 0.8, 0.3), seen=place_square(-1.9, 1.6, 0.3, 0.0))  # on the other side
def test_directions_that_two_things_share_are_those_of_rays_that_meet_both(
    known: shapely.Polygon, seen: shapely.Polygon
) -> None:
    rays = np.linspace(-math.pi, math.pi, 1440, endpoint=False)
    ends = 9.0 * np.column_stack([np.cos(rays), np.sin(rays)])
    far = shapely.linestrings(np.stack([np.zeros((1440, 2)), ends], axis=1))
    of_seen, of_known = (shapely.intersects(far, shape) for shape in (seen, known))
    expected = np.count_nonzero(of_seen & of_known) / np.count_nonzero(of_seen)
    width_rad = np.count_nonzero(of_seen) * math.tau / 1440
    found = measure_common_directions(known, seen, (0.0, 0.0))
    assert found == pytest.approx(expected, abs=3.0 * math.tau / 1440 / width_rad)
