"""Laws of straight lines through doorways: they keep their distance, the straight one is preferred, none is missed."""

from __future__ import annotations

import numpy as np
import shapely
from hypothesis import given
from hypothesis import strategies as st

from knowledge_sources.methods.motion.routes import find_line_through

CLEARANCE_M = 0.38
DISTANCES_M, OFFSETS_M = (0.65, 0.55, 0.47, 0.40), (0.0, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6)
ROOMS = (((-3.0, -4.0), (3.0, -4.0), (3.0, 0.0), (-3.0, 0.0)), ((-3.0, 0.15), (3.0, 0.15), (3.0, 4.0), (-3.0, 4.0)))
MIDDLES, OUTWARD = ((0.0, 0.0), (0.0, 0.15)), (0.0, 1.0)

places = st.tuples(st.floats(-1.0, 1.0), st.floats(-1.2, 1.2))
things = st.lists(st.tuples(places, st.floats(0.05, 0.3)), max_size=3)


def build_square(middle: tuple[float, float], half_m: float) -> shapely.Polygon:
    return shapely.box(middle[0] - half_m, middle[1] - half_m, middle[0] + half_m, middle[1] + half_m)


def build_walls(half_width_m: float) -> shapely.Geometry:
    """All that is no floor, near the doorway."""
    floor = shapely.union_all([*(shapely.Polygon(room) for room in ROOMS),
                               shapely.box(-half_width_m, -0.01, half_width_m, 0.16)])
    return shapely.difference(shapely.box(-5.0, -5.0, 5.0, 5.0), floor)


def find_line(half_width_m: float, squares: list[shapely.Polygon]) -> tuple[np.ndarray, np.ndarray] | None:
    solid = shapely.union_all([build_walls(half_width_m), *squares])
    free = shapely.difference(shapely.box(-3.0, -4.0, 3.0, 4.0), shapely.buffer(solid, CLEARANCE_M))
    return find_line_through(free, MIDDLES, OUTWARD, DISTANCES_M, OFFSETS_M)


@given(st.floats(0.4, 0.8), things)
def test_a_line_keeps_its_distance_from_walls_and_things(half_m: float, found: list) -> None:
    squares = [build_square(*thing) for thing in found]
    line = find_line(half_m, squares)
    if line is not None:
        way = shapely.LineString(line)
        assert way.distance(build_walls(half_m)) >= CLEARANCE_M - 0.011
        assert all(way.distance(square) >= CLEARANCE_M - 0.01 for square in squares)
        assert line[0][1] < 0.0 < 0.15 < line[1][1]


@given(st.floats(0.4, 0.8))
def test_with_nothing_in_the_way_it_leads_through_the_middle(half_m: float) -> None:
    line = find_line(half_m, [])
    assert line is not None
    assert line[0][0] == line[1][0] == 0.0


@given(st.floats(0.4, 0.8), things)
def test_where_it_finds_none_none_of_many_drawn_lines_is_free(half_m: float, found: list) -> None:
    squares = [build_square(*thing) for thing in found]
    if find_line(half_m, squares) is not None:
        return
    solid = shapely.union_all([build_walls(half_m), *squares])
    rng = np.random.default_rng(0)
    for _ in range(200):
        sides, away = rng.choice(OFFSETS_M, 2) * rng.choice([-1, 1], 2), rng.choice(DISTANCES_M, 2)
        way = shapely.LineString([(sides[0], -away[0]), (sides[1], 0.15 + away[1])])
        assert way.distance(solid) < CLEARANCE_M + 0.011


@given(st.floats(0.4, 0.8), things, st.tuples(places, st.floats(0.05, 0.3)))
def test_a_further_thing_opens_no_line(half_m: float, found: list, further: tuple) -> None:
    squares = [build_square(*thing) for thing in found]
    if find_line(half_m, squares) is None:
        assert find_line(half_m, [*squares, build_square(*further)]) is None
