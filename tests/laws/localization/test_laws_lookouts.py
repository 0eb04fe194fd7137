"""Laws of places to look again from: they are free, face the thing, and nothing stands in between."""

from __future__ import annotations

import math

import numpy as np
import shapely
from hypothesis import given
from hypothesis import strategies as st

from knowledge_sources.methods.motion.routes import list_lookouts

ROOM = shapely.box(0.0, 0.0, 6.0, 5.0)
RADIUS_M, DISTANCES_M, SHORT_M = 0.47, (1.8, 2.4, 3.0), 0.4

squares = st.tuples(st.floats(0.5, 5.5), st.floats(0.5, 4.5), st.floats(0.1, 0.4)).map(
    lambda s: shapely.box(s[0] - s[2], s[1] - s[2], s[0] + s[2], s[1] + s[2]))


@given(squares, st.lists(squares, max_size=3))
def test_each_is_free_faces_the_thing_and_sees_it(thing: shapely.Polygon, others: list[shapely.Polygon]) -> None:
    solid = shapely.union_all([thing, *others])
    free = shapely.difference(ROOM.buffer(-RADIUS_M), solid.buffer(RADIUS_M))
    poses = list_lookouts(free, shapely.difference(ROOM, solid), shapely.get_coordinates(thing)[:-1], DISTANCES_M, 24,
                          SHORT_M)
    middle = np.array([thing.centroid.x, thing.centroid.y])
    for x, y, heading in poses:
        place = shapely.Point(x, y)
        assert place.distance(solid) >= RADIUS_M - 0.01
        assert ROOM.exterior.distance(place) >= RADIUS_M - 1e-9
        out = middle - (x, y)
        assert any(math.isclose(float(np.hypot(*out)), far, abs_tol=1e-6) for far in DISTANCES_M)
        assert math.isclose(math.cos(heading - math.atan2(out[1], out[0])), 1.0, abs_tol=1e-9)
        line = shapely.LineString([place, middle])
        assert all(line.intersection(other).difference(thing.buffer(SHORT_M + 1e-6)).length < 1e-9 for other in others)


@given(squares)
def test_in_a_hall_with_nothing_else_it_is_seen_from_all_round(thing: shapely.Polygon) -> None:
    hall = shapely.box(-9.0, -9.0, 15.0, 15.0)
    poses = list_lookouts(hall.difference(thing.buffer(RADIUS_M)), hall.difference(thing),
                          shapely.get_coordinates(thing)[:-1], DISTANCES_M, 24, SHORT_M)
    assert len(poses) == 24 * len(DISTANCES_M)
