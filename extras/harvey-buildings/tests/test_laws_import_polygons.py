"""The laws of outlines that importers make: how a plan is turned, which walls face each other, what is cut and squared.

Plans are drawn straight and turned by any angle; what is found is what was drawn. The areas are shapely's.
"""

from __future__ import annotations

import math

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from harvey_buildings.fitting.polygons import (
    clean_outline,
    cut_holes_open,
    extract_outline,
    find_center,
    find_facing_stretches,
    find_turn,
    separate_outlines,
    side_of,
    square_outline,
    straighten_wall,
)

Floats = NDArray[np.float64]
ANGLES = st.floats(-math.pi, math.pi)
LENGTHS = st.lists(st.floats(0.5, 9.0), min_size=3, max_size=8)


def rectangle(width: float, depth: float, x: float = 0.0, y: float = 0.0) -> Floats:
    return np.array([[x, y], [x + width, y], [x + width, y + depth], [x, y + depth]])


def turned(points: Floats, angle: float) -> Floats:
    c, s = math.cos(angle), math.sin(angle)
    return np.asarray(points @ np.array([[c, s], [-s, c]]))


def sides(angles_deg: list[float], lengths: list[float]) -> Floats:
    return np.array([[length * math.cos(math.radians(a)), length * math.sin(math.radians(a))]
                     for a, length in zip(angles_deg, lengths, strict=True)])


@settings(max_examples=60)
@given(st.floats(-44.0, 44.0).filter(lambda a: abs(a) > 0.3), LENGTHS, st.data())
def test_a_plan_is_turned_as_most_of_its_walls_are(turn_deg: float, lengths: list[float], data: st.DataObject) -> None:
    quarters = data.draw(st.lists(st.integers(0, 3), min_size=len(lengths), max_size=len(lengths)))
    most = [turn_deg + 90.0 * quarter for quarter in quarters]
    others = data.draw(st.lists(st.floats(5.0, 85.0), max_size=6))
    small = [0.6 * sum(lengths) / max(1, len(others))] * len(others)
    found = find_turn(sides([*(turn_deg + a for a in others), *most], [*small, *lengths]))
    assert math.degrees(found) == pytest.approx(turn_deg, abs=1e-6)


@settings(max_examples=30)
@given(st.floats(-40.0, 40.0).filter(lambda a: abs(a) > 3.0), st.floats(1.0, 5.0), st.floats(1.0, 5.0))
def test_walls_within_a_degree_are_averaged_by_their_length(turn_deg: float, one: float, other: float) -> None:
    close = find_turn(sides([turn_deg, turn_deg + 90.9], [one, other]))
    assert math.degrees(close) == pytest.approx(turn_deg + 0.9 * other / (one + other), abs=1e-6)
    apart = find_turn(sides([turn_deg, turn_deg - 91.1], [one, other]))
    if abs(one - other) > 1e-6:
        assert math.degrees(apart) == pytest.approx(turn_deg if one > other else turn_deg - 1.1, abs=1e-6)


def test_none_prevails_below_a_quarter_and_a_fifth_of_a_degree_is_left() -> None:
    spread = [10.0 + 6.0 * i for i in range(10)]
    for most, expected in ((3.4, 5.0), (3.2, 0.0)):
        assert math.degrees(find_turn(sides([5.0, *spread], [most, *[1.0] * 10]))) == pytest.approx(expected)
    for turn in (0.21, -0.21):
        assert math.degrees(find_turn(sides([turn], [1.0]))) == pytest.approx(turn)
        assert find_turn(sides([turn / 1.1], [1.0])) == 0.0


@settings(max_examples=80)
@given(
    st.floats(0.6, 6.0), st.floats(0.6, 6.0), st.floats(0.6, 6.0), st.floats(-4.0, 5.0), st.floats(-0.3, 0.9), ANGLES,
    st.integers(0, 3), st.integers(0, 3),
)
def test_rooms_face_each_other_along_what_both_have_at_a_walls_thickness(
    width: float, depth: float, other: float, at: float, gap: float, angle: float, first: int, second: int
) -> None:
    """The other room stands behind the right side of the first, ``at`` along it; whichever corner is named first."""
    a = np.roll(turned(rectangle(width, depth), angle), -first, axis=0)
    b = np.roll(turned(rectangle(1.5, other, width + gap, at), angle), -second, axis=0)
    low, high = max(0.0, at), min(depth, at + other)
    found = find_facing_stretches("a", a, "b", b)
    if min(abs(gap - 1e-3), abs(gap - 0.55), abs(high - low - 0.3)) < 1e-6:
        return
    if not (1e-3 < gap < 0.55 and high - low > 0.3):
        assert not found or gap < 0.0  # one in the other has walls behind it too
        return
    (stretch,) = found
    assert (stretch.a, stretch.b, stretch.side) == ("a", "b", (1 - first) % 4)
    assert (stretch.low_m, stretch.high_m, stretch.gap_m) == pytest.approx((low, high, gap), abs=1e-9)
    (back,) = find_facing_stretches("b", b, "a", a)
    assert back.high_m - back.low_m == pytest.approx(high - low) and back.gap_m == pytest.approx(gap)
    start, along, length = side_of(a, stretch.side)
    middle = start + (low + high) / 2.0 * along
    assert length == pytest.approx(depth)
    assert shapely.Point(middle).distance(shapely.Polygon(b)) == pytest.approx(gap, abs=1e-9)


@pytest.mark.parametrize(("tilt_deg", "faces"), [(2.0, True), (-2.0, True), (2.3, False), (-2.3, False)])
def test_walls_that_face_are_parallel_within_two_degrees(tilt_deg: float, faces: bool) -> None:
    b = turned(rectangle(1.8, 3.0, 0.0, -1.5), math.radians(tilt_deg)) + np.array([4.2, 1.5])
    found = find_facing_stretches("a", rectangle(4.0, 3.0), "b", b)
    assert bool(found) == faces


def test_rooms_far_apart_are_not_looked_at_twice() -> None:
    a, b = rectangle(4.0, 3.0), rectangle(4.0, 3.0, 4.7, 0.0)
    assert not find_facing_stretches("a", a, "b", b) and not find_facing_stretches("b", b, "a", a)
    assert len(find_facing_stretches("a", a, "b", b, max_gap_m=0.8)) == 1
    touching = rectangle(4.0, 3.0, 4.0, 0.0)
    assert not find_facing_stretches("a", a, "b", touching)
    assert len(find_facing_stretches("a", a, "b", touching, min_gap_m=-0.2)) == 1


@settings(max_examples=40)
@given(st.floats(2.0, 9.0), st.floats(2.0, 9.0), st.floats(-7.5, 7.5), st.floats(-0.1, 0.1))
def test_a_skew_room_is_squared_to_the_means_of_its_walls(
    width: float, depth: float, skew_deg: float, off: float
) -> None:
    rise, lean = width * math.tan(math.radians(skew_deg)), off
    outline = np.array([[0.0, 0.0], [width, rise], [width + lean, depth + 2.0], [lean, depth + 2.0]])
    if abs(lean) > 0.9 * min(depth + 2.0, depth + 2.0 - rise) * math.tan(math.radians(8.0)) or depth + 2.0 - rise < 0.5:
        return
    x, y = lean / 2.0, rise / 2.0
    expected = shapely.box(x, y, width + x, depth + 2.0)
    assert shapely.hausdorff_distance(shapely.Polygon(square_outline(outline)), expected) < 2e-4


@pytest.mark.parametrize(("skew_deg", "is_squared"), [(7.9, True), (-7.9, True), (8.1, False), (-8.1, False)])
def test_walls_more_than_eight_degrees_off_stay(skew_deg: float, is_squared: bool) -> None:
    rise = 4.0 * math.tan(math.radians(skew_deg))
    outline = np.array([[0.0, 0.0], [4.0, rise], [4.0, 5.0], [0.0, 5.0]])
    found = square_outline(outline)
    assert (np.ptp(found[:, 1]) == pytest.approx(5.0 - rise / 2.0, abs=1e-3)) == is_squared
    assert is_squared or np.array_equal(np.sort(found, axis=0), np.sort(np.round(outline, 4), axis=0))


@settings(max_examples=25, deadline=None)
@given(st.floats(0.5, 5.0), st.floats(0.8, 5.0), st.floats(-0.3, 0.06), ANGLES)
def test_between_rooms_that_touch_or_overlap_comes_a_wall(width: float, depth: float, gap: float, angle: float) -> None:
    """Each ends 25 mm before the other; where they overlap by more than 0.05 m2, only the larger. 48 mm are a wall."""
    wide = width + 0.7
    a, b = turned(rectangle(width, depth), angle), turned(rectangle(wide, depth, width + gap, 0.0), angle)
    shared = max(0.0, -gap) * depth
    if min(abs(gap - 0.048), abs(gap - 0.025), abs(shared - 0.05), abs(gap)) < 3e-3 or shared > 0.5 * width * depth:
        return
    kept, changed = separate_outlines({"a": a, "b": b})
    apart = shapely.Polygon(kept["a"]).distance(shapely.Polygon(kept["b"]))
    assert sorted(changed) == (["a", "b"] if gap < 0.048 else [])
    expected = 0.025 if shared > 0.05 else 0.05 - gap if gap < 0.025 else gap
    assert apart == pytest.approx(expected, abs=2e-3)
    assert shapely.Polygon(kept["a"]).area <= width * depth + 1e-3


def test_a_room_that_others_cover_is_left_out() -> None:
    """More than 0.6 of it."""
    for share, is_kept in ((0.55, True), (0.65, False)):
        outlines = {"zone": rectangle(10.0, 10.0), "room": rectangle(10.0, 10.0 * share)}
        assert ("zone" in separate_outlines(outlines)[0]) == is_kept
        assert "room" in separate_outlines(outlines)[0]
    kept, changed = separate_outlines({"twice": rectangle(3.0, 3.0), "again": rectangle(3.0, 3.0)})
    assert list(kept) == ["twice"] and changed == []


@pytest.mark.parametrize(("area", "is_kept"), [(0.049, False), (0.051, True)])
def test_the_smallest_outline_and_the_smallest_hole(area: float, is_kept: bool) -> None:
    """Both 0.05 m2."""
    side = math.sqrt(area)
    assert (extract_outline(shapely.box(0, 0, side, side)) is not None) == is_kept
    room = shapely.box(0, 0, 4, 4).difference(shapely.box(1, 1, 1 + side, 1 + side))
    outline = extract_outline(room)
    assert outline is not None
    assert (shapely.Polygon(outline).area < 16.0 - area - 0.02) == is_kept
    slit = cut_holes_open(room)
    assert (len(slit.interiors) == 0) == is_kept
    assert not is_kept or room.area - slit.area == pytest.approx(0.05 * (1.0 + 0.0), abs=0.003)


@pytest.mark.parametrize(("corner", "is_read"), [(4999.0, True), (5001.0, False), (-5001.0, False)])
def test_what_is_too_far_is_no_outline(corner: float, is_read: bool) -> None:
    x = np.copysign(abs(corner) - 3.0, corner)
    points = np.array([[x, 0.0], [corner, 0.0], [corner, 3.0], [x, 3.0]])
    assert (clean_outline(points) is not None) == is_read
    assert clean_outline(points[:2]) is None and clean_outline(np.full((4, 2), np.nan)) is None


@settings(max_examples=30)
@given(st.integers(5, 60), st.floats(1.0, 6.0))
def test_a_round_room_keeps_few_corners_and_its_area(corners: int, radius: float) -> None:
    angles = np.linspace(0.0, math.tau, corners, endpoint=False)
    found = clean_outline(np.column_stack([radius * np.cos(angles), radius * np.sin(angles)]))
    assert found is not None and shapely.Polygon(found).exterior.is_ccw
    drawn = shapely.Polygon(np.column_stack([radius * np.cos(angles), radius * np.sin(angles)]))
    off = shapely.hausdorff_distance(shapely.Polygon(found).exterior, drawn.exterior)
    if corners <= 24:
        assert len(found) == corners and off < 0.0021
    else:
        assert off < 0.031


@pytest.mark.parametrize(("step", "corners"), [(0.028, 4), (0.033, 8)])
def test_steps_of_less_than_three_centimetres_are_smoothed(step: float, corners: int) -> None:
    room = shapely.box(0, 0, 4, 3).union(shapely.box(1, -step, 2, 0))
    outline = extract_outline(room)
    assert outline is not None and len(outline) == corners
    assert shapely.Polygon(outline).symmetric_difference(room).area < 0.15


@given(st.floats(1.0, 5.0), st.floats(1.0, 5.0), st.floats(0.2, 0.8))
def test_the_middle_has_the_largest_clearance(width: float, depth: float, share: float) -> None:
    free = find_center(rectangle(width, depth), [])
    clear = shapely.Polygon(rectangle(width, depth)).exterior.distance(shapely.Point(free))
    assert clear == pytest.approx(min(width, depth) / 2.0, abs=0.021)
    table = rectangle(share * width, depth)
    beside = find_center(rectangle(width, depth), [table])
    assert beside[0] > share * width
    room = shapely.box(share * width, 0.0, width, depth)
    clear = room.exterior.distance(shapely.Point(beside))
    assert clear == pytest.approx(min((1.0 - share) * width, depth) / 2.0, abs=0.03)
    assert find_center(rectangle(width, depth), [rectangle(width + 1.0, depth + 1.0, -0.5, -0.5)]) == pytest.approx(
        free, abs=0.05)


@settings(max_examples=40)
@given(st.floats(3.0, 9.0), st.floats(0.8, 1.2), st.floats(-0.2, 0.2), ANGLES, st.booleans())
def test_a_curved_wall_becomes_straight_at_a_door(
    radius: float, width: float, off: float, angle: float, is_reversed: bool
) -> None:
    """A round room of 48 sides: the new side is as long as the door and two jambs of 6 cm, parallel to the door."""
    ring = np.linspace(0.0, math.tau, 48, endpoint=False) + 0.03
    outline = radius * np.column_stack([np.cos(ring), np.sin(ring)])
    outward = np.array([math.cos(angle), math.sin(angle)])
    along = np.array([-outward[1], outward[0]]) * (-1.0 if is_reversed else 1.0)
    centre = (radius + off) * outward
    changed = straighten_wall(outline, centre, along, width)
    half = width / 2.0 + 0.06
    if radius < 2.0 * half + 0.3:
        return
    assert changed is not None
    ends = [p for p in changed if abs(abs((p - centre) @ along) - half) < 2e-4 and p @ outward > 0]
    assert len(ends) == 2
    levels = [float(p @ outward) for p in ends]
    assert levels[0] == pytest.approx(levels[1], abs=2e-4)
    assert levels[0] == pytest.approx(math.sqrt(radius**2 - half**2), abs=0.02 + radius * 0.003)
    assert not any(abs((p - centre) @ along) < half - 1e-3 and p @ outward > 0 for p in changed)
    assert shapely.Polygon(changed).area == pytest.approx(shapely.Polygon(outline).area, rel=0.03)


@pytest.mark.parametrize(("off", "is_near"), [(0.58, True), (0.62, False), (-0.58, True), (-0.62, False)])
def test_a_curved_wall_is_near_its_door(off: float, is_near: bool) -> None:
    ring = np.linspace(0.0, math.tau, 48, endpoint=False)
    outline = 5.0 * np.column_stack([np.cos(ring), np.sin(ring)])
    assert (straighten_wall(outline, np.array([5.0 + off, 0.0]), np.array([0.0, 1.0]), 1.0) is not None) == is_near


def test_corners_of_a_room_are_not_straightened() -> None:
    """A wall that is off the new one by more than 0.25 m."""
    for depth, is_curve in ((0.24, True), (0.53, False)):
        outline = np.array([[0.0, 0.0], [4.0, 0.0], [4.0, 1.4], [4.0 + depth, 1.5], [4.0, 1.6], [4.0, 3.0], [0.0, 3.0]])
        found = straighten_wall(outline, np.array([4.05, 1.5]), np.array([0.0, 1.0]), 0.9)
        assert (found is not None) == is_curve
