"""Laws of the way across a room: it keeps clear, it is no longer than it must be, and it is there when there is one."""

from __future__ import annotations

import numpy as np
import pytest
import shapely
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from knowledge_sources.methods.motion.routes import SLACK_M, compute_free_space, find_shortest_route, is_clear

ROOM = [(0.0, 0.0), (8.0, 0.0), (8.0, 6.0), (0.0, 6.0)]
coordinate = st.floats(0.6, 5.4)
point = st.tuples(st.floats(0.6, 7.4), coordinate)


@st.composite
def boxes(draw: st.DrawFn) -> list[list[tuple[float, float]]]:
    out = []
    for _ in range(draw(st.integers(0, 3))):
        x, y = draw(st.floats(0.5, 6.0)), draw(st.floats(0.5, 4.5))
        w, h = draw(st.floats(0.2, 2.0)), draw(st.floats(0.2, 1.5))
        out.append([(x, y), (x + w, y), (x + w, y + h), (x, y + h)])
    return out


@settings(deadline=None, max_examples=60)
@given(obstacles=boxes(), a=point, b=point)
def test_a_route_keeps_clear_and_is_no_shorter_than_the_straight_line(
    obstacles: list[list[tuple[float, float]]], a: tuple[float, float], b: tuple[float, float]
) -> None:
    free = compute_free_space(ROOM, obstacles, 0.4)
    assume(free.covers(shapely.Point(a)) and free.covers(shapely.Point(b)))
    route = find_shortest_route(free, a, b, lambda: compute_free_space(ROOM, obstacles, 0.0))
    if route is None:
        parts = shapely.get_parts(free)
        assert not any(p.covers(shapely.Point(a)) and p.covers(shapely.Point(b)) for p in parts)
        return
    line = shapely.LineString(route) if len(route) > 1 else shapely.Point(route[0])
    assert free.buffer(2.0 * SLACK_M).covers(line)
    straight = float(np.hypot(b[0] - a[0], b[1] - a[1]))
    assert shapely.length(line) >= straight - 1e-6
    if is_clear(free, a, b):
        assert shapely.length(line) == pytest.approx(straight, abs=1e-6)


def test_a_wall_across_the_room_leaves_no_way() -> None:
    wall = [[(3.0, -1.0), (3.5, -1.0), (3.5, 7.0), (3.0, 7.0)]]
    free, floor = compute_free_space(ROOM, wall, 0.3), compute_free_space(ROOM, wall, 0.0)
    assert find_shortest_route(free, (1.0, 1.0), (6.0, 1.0), lambda: floor) is None


def test_a_room_that_is_too_narrow_leaves_no_way() -> None:
    room = [(0, 0), (4, 0), (4, 0.5), (0, 0.5)]
    free, floor = compute_free_space(room, [], 0.4), compute_free_space(room, [], 0.0)
    assert find_shortest_route(free, (1.0, 0.2), (3.0, 0.2), lambda: floor) is None


@settings(deadline=None, max_examples=60)
@given(obstacles=boxes(), a=point, b=point)
def test_an_end_in_the_margin_is_never_joined_through_a_barrier(
    obstacles: list[list[tuple[float, float]]], a: tuple[float, float], b: tuple[float, float]
) -> None:
    floor = compute_free_space(ROOM, obstacles, 0.0)
    assume(floor.covers(shapely.Point(a)) and floor.covers(shapely.Point(b)))
    route = find_shortest_route(compute_free_space(ROOM, obstacles, 0.4), a, b, lambda: floor)
    if route is not None and len(route) > 1:
        assert floor.buffer(2.0 * SLACK_M).covers(shapely.LineString(route))


def test_a_goal_shut_in_behind_an_obstacle_is_not_reached_through_it() -> None:
    desk = [[(0.0, 0.5), (1.8, 0.5), (1.8, 0.7), (0.0, 0.7)], [(1.6, 0.0), (1.8, 0.0), (1.8, 0.6), (1.6, 0.6)]]
    floor = compute_free_space(ROOM, desk, 0.0)
    assert find_shortest_route(compute_free_space(ROOM, desk, 0.4), (1.0, 3.0), (0.9, 0.3), lambda: floor) is None
