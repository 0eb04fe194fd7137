"""Laws of the way across a room: it keeps clear, it is no longer than it must be, and it is there when there is one."""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
import pytest
import shapely
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from knowledge_sources.methods.motion import SLACK_M, compute_free_space, is_clear
from knowledge_sources.methods.motion.routes import AWAY_PART, AWAY_STEP_M, TOUCHED_M, find_shortest_route

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


CLEARANCE_M = 0.4
THINGS = (
    ((0.0, 0.0), (1.2, 0.0), (1.2, 0.7), (0.0, 0.7)), ((0.0, 0.0), (0.8, 0.3), (0.1, 0.9)),
    ((0.0, 0.0), (0.9, 0.1), (1.1, 0.8), (0.4, 1.1), (-0.2, 0.6)),
)
"""Footprints with four, five and three corners."""


@st.composite
def furniture(draw: st.DrawFn) -> list[list[tuple[float, float]]]:
    """Up to four things of any of these shapes, turned and anywhere."""
    out = []
    for _ in range(draw(st.integers(1, 4))):
        corners, turn = np.array(draw(st.sampled_from(THINGS))), draw(st.floats(0.0, 6.28))
        c, s = np.cos(turn), np.sin(turn)
        at = np.array([draw(st.floats(1.0, 7.0)), draw(st.floats(1.0, 5.0))])
        out.append([tuple(row) for row in (corners @ np.array([[c, s], [-s, c]]) + at).tolist()])
    return out


def measure_raw_m(points: NDArray[np.float64], rings: list[list[tuple[float, float]]]) -> NDArray[np.float64]:
    """(n,) distance of points (n, 2) to the nearest of the raw outlines, in plain numpy; 0 within an obstacle.

    The room is the first ring: beyond it the distance is 0 too.
    """
    least = np.full(len(points), np.inf)
    for number, ring in enumerate(rings):
        a = np.array(ring)
        b = np.roll(a, -1, axis=0)
        along = b - a
        t = np.clip(np.einsum("nek,ek->ne", points[:, None] - a, along) / np.sum(along**2, axis=1), 0.0, 1.0)
        off = np.linalg.norm(points[:, None] - (a + t[..., None] * along), axis=2).min(axis=1)
        crosses = (a[:, 1] > points[:, None, 1]) != (b[:, 1] > points[:, None, 1])
        with np.errstate(divide="ignore", invalid="ignore"):
            x = a[:, 0] + (points[:, None, 1] - a[:, 1]) * along[:, 0] / along[:, 1]
        is_within = np.count_nonzero(crosses & (points[:, None, 0] < x), axis=1) % 2 == 1
        least = np.minimum(least, np.where(is_within == (number == 0), off, 0.0))
    return least


@settings(deadline=None, max_examples=60, derandomize=True)
@given(obstacles=furniture(), a=point, b=point, is_round=st.booleans())
def test_a_route_is_as_far_from_the_raw_obstacles_as_was_asked(
    obstacles: list[list[tuple[float, float]]], a: tuple[float, float], b: tuple[float, float], is_round: bool
) -> None:
    """Every place on it, every two centimetres; round corners may be 4.4 % too near. The free space is not asked."""
    least_m = CLEARANCE_M * (0.956 if is_round else 1.0) - 1e-5
    rings = [ROOM, *obstacles]
    ends = measure_raw_m(np.array([a, b]), rings)
    assume(ends.min() >= CLEARANCE_M * 1.5)
    free = compute_free_space(ROOM, obstacles, CLEARANCE_M, is_round=is_round)
    assume(free.covers(shapely.Point(a)) and free.covers(shapely.Point(b)))
    route = find_shortest_route(free, a, b, lambda: compute_free_space(ROOM, obstacles, 0.0))
    if route is None or len(route) < 2:
        return
    counts = [max(2, int(np.hypot(q[0] - p[0], q[1] - p[1]) / 0.02)) for p, q in pairwise(route)]
    places = np.concatenate([np.linspace(p, q, n) for (p, q), n in zip(pairwise(route), counts, strict=True)])
    assert measure_raw_m(places, rings).min() >= least_m


@settings(deadline=None, max_examples=40, derandomize=True)
@given(obstacles=furniture(), seed=st.integers(0, 2**32 - 1))
def test_free_is_what_is_far_enough_from_the_raw_obstacles(
    obstacles: list[list[tuple[float, float]]], seed: int
) -> None:
    """Both ways: what is free keeps the clearance, and what is clearly further away is free."""
    points = np.random.default_rng(seed).uniform((0.0, 0.0), (8.0, 6.0), (300, 2))
    away_m = measure_raw_m(points, [ROOM, *obstacles])
    free = compute_free_space(ROOM, obstacles, CLEARANCE_M, is_round=True)
    is_free = shapely.contains_xy(free, points)
    assert away_m[is_free].min(initial=9.0) >= 0.956 * CLEARANCE_M - 1e-6
    assert np.all(is_free[away_m > CLEARANCE_M + 1e-6])
    with_corners = shapely.contains_xy(compute_free_space(ROOM, obstacles, CLEARANCE_M), points)
    assert away_m[with_corners].min(initial=9.0) >= CLEARANCE_M - 1e-6


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


@given(st.floats(-math.pi, math.pi), st.floats(-0.015, 0.015))
@settings(max_examples=30, deadline=None)
def test_a_way_begins_by_leading_away_from_what_the_robot_stands_at(side: float, gap_m: float) -> None:
    """It does not slide along it, nor come nearer; where the goal lies behind, it goes round."""
    radius_m, middle = 0.35, np.array([4.0, 3.0])
    thing = shapely.Point(middle).buffer(0.2)
    out = np.array([math.cos(side), math.sin(side)])
    start, goal = middle + (0.2 + radius_m + gap_m) * out, middle - 1.2 * out
    room = shapely.box(0.0, 0.0, 8.0, 6.0)
    free = room.buffer(-radius_m - 0.12).difference(thing.buffer(radius_m + 0.12))
    route = find_shortest_route(free, start, goal, lambda: room.difference(thing), radius_m)
    assert route is not None
    first = shapely.line_interpolate_point(shapely.LineString(route), AWAY_STEP_M)
    begin_m = thing.distance(shapely.Point(start))
    assert thing.distance(first) >= begin_m + 0.9 * AWAY_PART * AWAY_STEP_M
    assert thing.distance(shapely.LineString(route)) >= min(radius_m, begin_m) - 2.0 * TOUCHED_M
