"""The laws of doors, windows and furniture that importers put into rooms: where they were told, or moved a little.

Rooms are drawn beside one another and turned by any angle; each bound has a row on either side of it.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from harvey_buildings.fitting.building_plan import Furnishing, Space, WallOpening, Window
from harvey_buildings.fitting.placement import (
    PlacedOpening,
    build_bounding_boxes,
    doorway,
    find_panes,
    fit_into_room,
    footprint,
    is_obstacle,
    overlap,
    place_door,
    place_outer_door,
    place_wide_opening,
)

Floats = NDArray[np.float64]
ANGLES = st.floats(-math.pi, math.pi)
DEPTH, GAP = 4.0, 0.2


def rectangle(width: float, depth: float, x: float = 0.0, y: float = 0.0) -> Floats:
    return np.array([[x, y], [x + width, y], [x + width, y + depth], [x, y + depth]])


def turned(points: Floats, angle: float) -> Floats:
    c, s = math.cos(angle), math.sin(angle)
    return np.asarray(np.asarray(points) @ np.array([[c, s], [-s, c]]))


def rooms(angle: float = 0.0, gap: float = GAP) -> dict[str, Floats]:
    """Room a with room b behind its right side, 4 m long; the side begins at (5, 0)."""
    return {"a": turned(rectangle(5.0, DEPTH), angle), "b": turned(rectangle(3.0, DEPTH, 5.0 + gap), angle)}


def door(x: float, y: float, width: float, angle: float = 0.0, **more: Any) -> WallOpening:
    return WallOpening("d", "s", turned(np.array([x, y]), angle), width, 2.0, **more)


@settings(max_examples=60)
@given(st.floats(0.6, 1.4), st.floats(0.9, 3.1), st.floats(0.05, 0.5), st.floats(-0.2, 0.2), ANGLES)
def test_a_door_that_fits_stays_where_it_is(width: float, at: float, gap: float, off: float, angle: float) -> None:
    outlines = rooms(angle, gap)
    found = place_door(door(5.0 + gap / 2.0 + off, at, width, angle), outlines, [("a", "b"), ("b", "a")])
    assert found is not None
    placed, change = found
    assert (placed.between, placed.side, placed.is_open, placed.height_m) == (("a", "b"), 1, True, 2.0)
    assert (placed.along_m, placed.width_m) == pytest.approx((at, width)) and change == pytest.approx(0.0, abs=1e-9)
    floor = shapely.Polygon(doorway(placed, outlines, 0.1))
    assert floor.area == pytest.approx(width * (gap + 0.2)) and floor.is_valid
    middle = turned(np.array([5.0 + gap / 2.0, at]), angle)
    assert shapely.get_coordinates(floor.centroid)[0] == pytest.approx(middle, abs=1e-6)


@pytest.mark.parametrize(("at", "width", "along", "fitted"), [
    (0.6, 1.0, 0.6, 1.0), (0.4, 1.0, 0.52, 1.0), (0.33, 1.0, 0.52, 1.0), (0.31, 1.0, None, 1.0),
    (3.67, 1.0, 3.48, 1.0), (3.69, 1.0, None, 1.0), (2.0, 3.96, 2.0, 3.96), (2.0, 4.2, 2.0, 3.96),
    (1.8, 4.2, 2.0, 3.96),
    (-0.07, 0.2, 0.12, 0.2), (-0.09, 0.2, None, 0.2), (1.7, 4.2, None, 0.0), (1.76, 4.2, 2.0, 3.96),
])
def test_a_door_is_moved_by_at_most_twenty_centimetres_or_narrowed(
    at: float, width: float, along: float | None, fitted: float
) -> None:
    """2 cm from the end of its wall; one that must be narrowed may be moved by as much."""
    found = place_door(door(5.1, at, width), rooms(), [("a", "b")])
    assert (found is None) == (along is None)
    if found is not None:
        placed, change = found
        assert (placed.along_m, placed.width_m) == pytest.approx((along, fitted))
        assert change == pytest.approx(abs(float(along or 0.0) - at) + width - fitted)


@pytest.mark.parametrize(("wall", "width", "is_placed"), [(0.63, 0.9, False), (0.65, 0.9, True), (0.63, 0.55, True)])
def test_a_door_is_narrowed_to_sixty_centimetres(wall: float, width: float, is_placed: bool) -> None:
    outlines = {"a": rectangle(5.0, 4.0), "b": rectangle(3.0, wall, 5.2)}
    assert (place_door(door(5.1, wall / 2.0, width), outlines, [("a", "b")]) is not None) == is_placed


@pytest.mark.parametrize(("off", "is_placed"), [(0.34, True), (-0.34, True), (0.36, False), (-0.36, False)])
def test_a_door_is_in_its_wall_or_a_quarter_of_a_metre_off(off: float, is_placed: bool) -> None:
    for angle in (0.0, 2.0):
        assert (place_door(door(5.1 + off, 2.0, 0.9, angle), rooms(angle), [("a", "b")]) is not None) == is_placed
    thick = rooms(0.0, 0.7)
    assert place_door(door(5.35, 2.0, 0.9), thick, [("a", "b")]) is None
    assert place_door(door(5.35, 2.0, 0.9), thick, [("a", "b")], 0.89) is not None


def test_of_two_walls_a_door_takes_the_nearer() -> None:
    outlines = rooms() | {"c": rectangle(5.0, 3.0, 0.0, 4.2)}
    pairs = [("a", "b"), ("a", "c")]
    for x, y, room in ((4.9, 3.5, "b"), (4.5, 4.0, "c"), (5.0, 3.53, "b"), (4.53, 3.9, "c")):
        found = place_door(door(x, y, 0.9), outlines, pairs)
        assert found is not None and found[0].between == ("a", room)


@pytest.mark.parametrize(("off", "is_placed"), [(0.49, True), (-0.49, True), (0.51, False), (-0.51, False)])
def test_an_outer_door_is_in_the_nearest_wall(off: float, is_placed: bool) -> None:
    for angle in (0.0, -1.0):
        found = place_outer_door(door(2.0, off, 0.9, angle), {"a": turned(rectangle(5.0, 4.0), angle)})
        assert (found is not None) == is_placed
        if found is not None:
            assert (found.between, found.side, found.is_open) == (("a",), 0, False)
            assert (found.along_m, found.width_m) == pytest.approx((2.0, 0.9))
    near = place_outer_door(door(2.0, -0.2, 0.9), {"a": rectangle(5.0, 4.0), "z": rectangle(5.0, 4.0, 0.0, -4.3)})
    assert near is not None and near.between == ("z",)


def opening(along: float, width: float, side: int = 1, between: tuple[str, ...] = ("a", "b")) -> PlacedOpening:
    return PlacedOpening("o", between, side, along, width, 2.0, True)


@pytest.mark.parametrize(("shift", "overlaps"), [(0.0, True), (0.99, True), (1.01, True), (1.03, False), (-1.01, True),
                                                 (-1.03, False), (-0.5, True)])
def test_openings_overlap_where_less_than_two_centimetres_are_between(shift: float, overlaps: bool) -> None:
    for angle in (0.0, 0.7):
        outlines = rooms(angle)
        assert overlap(opening(2.0, 1.0), [opening(2.0 + shift, 1.0)], outlines) == overlaps
        other = opening(DEPTH - 2.0 - shift, 1.0, 3, ("b", "a"))
        assert overlap(opening(2.0, 1.0), [other], outlines) == overlaps
    assert not overlap(opening(2.0, 1.0), [opening(2.0, 1.0, 1, ("x", "y"))], rooms() | {"x": rooms()["a"]})
    assert not overlap(opening(2.0, 1.0), [opening(2.0, 1.0, 3, ("a",))], rooms())


@settings(max_examples=40)
@given(st.floats(1.2, 4.0), st.floats(0.0, 1.0), ANGLES)
def test_a_wide_opening_leaves_twelve_centimetres_of_wall_on_either_side(long: float, at: float, angle: float) -> None:
    outlines = {"a": turned(rectangle(5.0, DEPTH), angle), "b": turned(rectangle(3.0, long, 5.05, at), angle)}
    found = place_wide_opening("w", "a", "b", outlines, 2.3, (), 0.125)
    low, high = at, min(DEPTH, at + long)
    if abs(high - low - 1.14) > 1e-6:
        assert (found is None) == (high - low < 1.14)
    if found is not None:
        assert (found.along_m, found.width_m) == pytest.approx(((low + high) / 2.0, high - low - 0.24))
        assert (found.side, found.height_m, found.is_open, found.between) == (1, 2.3, True, ("a", "b"))


@pytest.mark.parametrize(("gap", "is_placed"), [(0.12, True), (0.13, False)])
def test_only_thin_walls_are_opened(gap: float, is_placed: bool) -> None:
    assert (place_wide_opening("w", "a", "b", rooms(0.0, gap), 2.3, (), 0.125) is not None) == is_placed


@pytest.mark.parametrize(("solid", "low", "high"), [
    (rectangle(1.0, 1.0, 3.9, 0.0), 1.12, 4.0), (rectangle(1.0, 1.0, 2.9, 0.0), 0.0, 4.0),
    (rectangle(1.0, 1.0, 6.0, 0.0), 1.12, 4.0), (rectangle(1.0, 1.0, 6.2, 0.0), 0.0, 4.0),
    (rectangle(1.0, 0.5, 3.05, 3.0), 0.0, 2.88), (rectangle(1.0, 1.0, 4.5, 1.2), 2.32, 4.0),
])
def test_a_wide_opening_is_where_no_furniture_stands_within_a_metre(solid: Floats, low: float, high: float) -> None:
    for angle in (0.0, 1.0):
        found = place_wide_opening("w", "a", "b", rooms(angle, 0.05), 2.3, (), 0.125, [turned(solid, angle)])
        assert found is not None
        assert (found.along_m, found.width_m) == pytest.approx(((low + high) / 2.0, high - low - 0.24))


@pytest.mark.parametrize(("barrier", "low", "high"), [
    (shapely.box(4.0, 0.0, 6.0, 1.0), 1.02, 4.0), (shapely.box(4.0, 3.2, 6.0, 4.5), 0.0, 3.18),
    (shapely.box(3.0, 0.0, 4.9, 1.0), 0.0, 4.0), (shapely.box(5.03, 0.5, 5.04, 1.5), 1.52, 4.0),
])
def test_a_wide_opening_is_where_no_wall_or_railing_is(barrier: shapely.Geometry, low: float, high: float) -> None:
    found = place_wide_opening("w", "a", "b", rooms(0.0, 0.05), 2.3, (), 0.125, (), [barrier])
    assert found is not None
    assert (found.along_m, found.width_m) == pytest.approx(((low + high) / 2.0, high - low - 0.24))


def test_a_wide_opening_is_beside_the_doors_of_its_wall() -> None:
    taken = [opening(1.0, 0.8), opening(3.0, 0.8, 2), opening(3.0, 0.8, 1, ("b", "a"))]
    found = place_wide_opening("w", "a", "b", rooms(0.0, 0.05), 2.3, taken, 0.125)
    assert found is not None and (found.along_m, found.width_m) == pytest.approx(((1.4 + 4.0) / 2.0, 2.6 - 0.24))


@pytest.mark.parametrize(("off", "tilt_deg", "at", "width", "pane"), [
    (0.49, 0.0, 2.0, 1.0, (2.0, 1.0)), (-0.49, 2.0, 2.0, 1.0, (2.0, 1.0)), (0.51, 0.0, 2.0, 1.0, None),
    (-0.51, 0.0, 2.0, 1.0, None), (0.0, 3.0, 2.0, 1.0, None), (0.0, 180.0, 2.0, 1.0, (2.0, 1.0)),
    (0.0, 0.0, 0.03, 1.0, (0.275, 0.51)), (0.0, 0.0, 0.01, 1.0, None), (0.0, 0.0, 3.9, 0.8, (3.74, 0.48)),
    (0.0, 0.0, 2.0, 0.29, None), (0.0, 0.0, 2.0, 0.31, (2.0, 0.31)), (0.0, 0.0, 2.0, 5.0, (2.0, 3.96)),
])
def test_a_window_is_on_the_side_that_runs_along_it_and_holds_half_of_it(
    off: float, tilt_deg: float, at: float, width: float, pane: tuple[float, float] | None
) -> None:
    for angle in (0.0, 0.4):
        tilt = math.radians(tilt_deg)
        along = turned(np.array([-math.sin(tilt), math.cos(tilt)]), angle)
        window = Window("w", "s", turned(np.array([5.0 + off, at]), angle), along, width, 1.0, 1.0)
        found = find_panes(window, {"a": rooms(angle)["a"]})
        assert [(p.room, p.side) for p in found] == [("a", 1)] * (pane is not None)
        assert pane is None or (found[0].along_m, found[0].width_m) == pytest.approx(pane)


Box = tuple[float, float, float, float, float, float]
SPACE = Space("a", "room", "a", "s", rectangle(5.0, 4.0), 3.0, 2.5)


def thing(x: float, y: float, *boxes: Box, turn: float = 0.0, kind: str = "table") -> Furnishing:
    return Furnishing("t", kind, "a", np.array([x, y]), turn, boxes)


@settings(max_examples=50)
@given(st.floats(0.2, 1.0), st.floats(0.2, 1.0), st.floats(0.9, 4.1), st.floats(0.9, 3.1), ANGLES)
def test_furniture_within_its_room_stays(width: float, depth: float, x: float, y: float, turn: float) -> None:
    table = thing(x, y, (-width / 2, width / 2, -depth / 2, depth / 2, 3.0, 3.7), turn=turn)
    placed = fit_into_room(table, SPACE.outline, SPACE)
    assert placed is not None and placed.at == pytest.approx([x, y], abs=1e-4)
    assert placed.boxes == ((-width / 2, width / 2, -depth / 2, depth / 2, 0.0, pytest.approx(0.7)),)
    drawn = shapely.affinity.translate(shapely.affinity.rotate(
        shapely.box(-width / 2, -depth / 2, width / 2, depth / 2), turn, origin=(0, 0), use_radians=True), x, y)
    assert shapely.Polygon(footprint(table)).symmetric_difference(drawn).area < 1e-9


@pytest.mark.parametrize(("into", "moved"), [(0.1, 0.103), (0.29, 0.293), (0.31, 0.313), (0.35, 0.353), (0.37, None)])
def test_furniture_in_a_wall_is_moved_by_up_to_thirty_centimetres(into: float, moved: float | None) -> None:
    """Or trimmed by 6 cm on each side, where that is not enough."""
    for x, sign in ((0.5 - into, 1.0), (4.5 + into, -1.0)):
        placed = fit_into_room(thing(x, 2.0, (-0.5, 0.5, -0.4, 0.4, 3.0, 3.7)), SPACE.outline, SPACE)
        assert (placed is None) == (moved is None)
        if placed is None or moved is None:
            continue
        trim = 0.06 * (moved > 0.3)
        assert sign * (placed.at[0] - x) == pytest.approx(moved - trim, abs=2e-4) and placed.at[1] == 2.0
        assert placed.boxes[0][:4] == pytest.approx((-0.5 + trim, 0.5 - trim, -0.4 + trim, 0.4 - trim))
        assert shapely.Polygon(SPACE.outline).contains(shapely.Polygon(footprint(placed)))


@pytest.mark.parametrize(("low", "high", "clipped"), [
    (3.0, 3.7, (0.0, 0.7)), (2.5, 3.7, (0.0, 0.7)), (3.029, 3.7, (0.0, 0.7)), (3.031, 3.7, (0.031, 0.7)),
    (4.0, 9.0, (1.0, 2.498)), (5.49, 9.0, None), (5.487, 9.0, (2.487, 2.498)), (2.0, 3.009, None),
    (2.0, 3.011, (0.0, 0.011)),
])
def test_furniture_is_between_floor_and_ceiling(low: float, high: float, clipped: tuple[float, float] | None) -> None:
    placed = fit_into_room(thing(2.0, 2.0, (-0.5, 0.5, -0.4, 0.4, low, high)), SPACE.outline, SPACE)
    assert (placed is None) == (clipped is None)
    assert placed is None or placed.boxes[0][4:] == pytest.approx(clipped)


@pytest.mark.parametrize(("kind", "bottom", "is_in_the_way"), [
    ("table", 1.39, True), ("table", 1.4, False), ("stairs", 0.0, False), ("table", 0.0, True),
])
def test_what_a_robot_could_hit(kind: str, bottom: float, is_in_the_way: bool) -> None:
    high = (-0.1, 0.1, -0.1, 0.1, 2.0, 2.1)
    assert is_obstacle(thing(1.0, 1.0, high, (*high[:4], bottom, 2.1), kind=kind)) == is_in_the_way


@given(st.integers(1, 6), st.floats(0.6, 4.0), st.floats(0.5, 3.0), st.booleans())
def test_a_flight_is_boxes_along_its_longer_side(steps: int, long: float, rise: float, along_y: bool) -> None:
    """Each as high as the points in it; the points are corners of the steps."""
    marks = np.linspace(0.0, long, steps + 1)
    points = [(x, y, z) for i in range(steps) for x in (marks[i] + 1e-5, marks[i + 1] - 1e-5) for y in (0.0, 0.5)
              for z in (0.0, rise * (i + 1) / steps)]
    cloud = np.array(points)[:, (1, 0, 2) if along_y else (0, 1, 2)]
    boxes = build_bounding_boxes(cloud, steps)
    assert len(boxes) == steps
    for i, (x0, x1, y0, y1, z0, z1) in enumerate(boxes):
        low, high, side0, side1 = (y0, y1, x0, x1) if along_y else (x0, x1, y0, y1)
        assert (low, high) == pytest.approx((marks[i], marks[i + 1]), abs=2e-5)
        assert (side0, side1, z0, z1) == pytest.approx((0.0, 0.5, 0.0, rise * (i + 1) / steps))
