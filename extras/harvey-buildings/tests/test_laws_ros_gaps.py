"""The laws of gaps in the walls of a grid: those of drawn walls, cell by cell, and both sides of each threshold.

A plan is drawn on a grid; turned or mirrored it has the same gaps, turned or mirrored.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from harvey_buildings.formats.ros_map import Grid, find_wall_turn, gap_on_map, make_grid
from harvey_buildings.formats.ros_map_file import FREE, OCCUPIED, UNKNOWN, MapFile
from harvey_buildings.formats.ros_map_openings import Gap, close_openings, line_cells
from harvey_buildings.formats.ros_map_rooms import clean_floor, close_gaps, part_rooms, rooms_beside

Mask = NDArray[np.bool_]


def two_rooms(width: int, depth: int, at: int = 30, tall: int = 100, wide: tuple[int, int] = (80, 70)) -> Mask:
    """Two rooms beside one another: a wall of ``depth`` columns, with a gap of ``width`` rows from row ``at`` on."""
    floor = np.ones((tall, sum(wide) + depth), bool)
    floor[:, wide[0]:wide[0] + depth] = False
    floor[at:at + width, wide[0]:wide[0] + depth] = True
    return np.pad(floor, 4)


def found(floor: Mask, cell_m: float = 0.05) -> list[Gap]:
    """Its gaps that part two rooms."""
    return part_rooms(floor, cell_m)[1]


SIDES: dict[str, tuple[Callable[[Mask], Mask], Callable[[float, float, tuple[int, int]], tuple[float, float]]]] = {
    "as drawn": (lambda m: m, lambda r, c, n: (r, c)),
    "turned": (lambda m: m.T, lambda r, c, n: (c, r)),
    "upside down": (lambda m: m[::-1], lambda r, c, n: (n[0] - 1 - r, c)),
    "mirrored": (lambda m: m[:, ::-1], lambda r, c, n: (r, n[1] - 1 - c)),
}


@pytest.mark.parametrize("side", list(SIDES))
@settings(deadline=None, max_examples=15)
@given(st.integers(11, 25), st.integers(1, 12), st.integers(8, 60), st.sampled_from((0.05, 0.045)))
def test_a_door_is_where_and_as_wide_and_deep_as_it_is_drawn(
    side: str, width: int, depth: int, at: int, cell_m: float
) -> None:
    floor = two_rooms(width, depth, at)
    if width * cell_m < 0.5 or width * cell_m > 1.3:
        return
    change, move = SIDES[side]
    (gap,) = found(np.ascontiguousarray(change(floor)), cell_m)
    middle = move(4 + at + (width - 1) / 2, 84 + (depth - 1) / 2, floor.shape)
    assert (gap.width, gap.depth) == (width, depth) and gap.middle == middle
    expected = {move(4 + at - 1, gap_column, floor.shape) for gap_column in range(84, 84 + depth)}
    assert expected & {gap.start, gap.end}
    expected = {move(4 + at + width, gap_column, floor.shape) for gap_column in range(84, 84 + depth)}
    assert expected & {gap.start, gap.end}
    place, along = gap_on_map(gap)
    assert tuple(place) == middle and np.linalg.norm(along) == pytest.approx(1.0)
    labels, _ = part_rooms(np.ascontiguousarray(change(floor)), cell_m)
    right, left = rooms_beside(gap, labels, cell_m)
    across = np.array([along[1], -along[0]])
    for sign, room in ((1, right), (-1, left)):
        spot = (place + sign * across * (depth / 2 + 5)).round().astype(int)
        assert labels[tuple(spot)] == room


@pytest.mark.parametrize(("width", "depth", "is_gap"), [
    (9, 4, False), (10, 4, True), (26, 18, True), (26, 19, False), (27, 11, True), (27, 13, False), (90, 4, True),
    (91, 4, False), (27, 8, True), (10, 18, True), (10, 19, False),
])
def test_which_openings_are_gaps_of_a_wall(width: int, depth: int, is_gap: bool) -> None:
    """From 0.5 m: doors up to 1.3 m in walls up to 0.9 m, wide openings up to 4.5 m in walls up to 0.6 m."""
    floor = two_rooms(width, depth, at=50, tall=240)
    _, gaps = close_gaps(floor, 0.05)
    assert any((gap.width, gap.depth) == (width, depth) for gap in gaps) == is_gap


@pytest.mark.parametrize(("thick", "stub", "is_gap"), [(8, 13, True), (9, 17, False), (9, 19, True), (11, 21, False),
                                                     (11, 23, True)])
def test_a_thick_wall_beside_a_wide_opening_is_slender_or_it_is_furniture(thick: int, stub: int, is_gap: bool) -> None:
    """Above 0.4 m thick it is twice as long; here 2 m wide, with a hall that is no wider on one side."""
    floor = two_rooms(40, thick, at=stub, tall=40 + stub)
    _, gaps = close_gaps(floor, 0.05)
    assert any(gap.width == 40 and gap.depth == thick for gap in gaps) == is_gap


@pytest.mark.parametrize(("width", "stub", "is_gap"), [(14, 4, False), (14, 5, True), (24, 7, False), (24, 8, True)])
def test_so_much_wall_is_beside_a_gap(width: int, stub: int, is_gap: bool) -> None:
    """0.25 m, and 0.3 of the gap's width; the rooms themselves widen by no more than the gap."""
    floor = np.zeros((width + stub, 60), bool)
    floor[:, :28] = floor[:, 32:] = True
    floor[stub:, 28:32] = True
    _, gaps = close_gaps(np.pad(floor, 4), 0.05)
    assert any(gap.width == width and gap.depth == 4 for gap in gaps) == is_gap


@pytest.mark.parametrize(("shift", "depth"), [(0, 4), (3, 4), (4, 2), (-3, 4), (-4, 2)])
def test_jambs_may_be_ragged_by_fifteen_centimetres(shift: int, depth: int) -> None:
    """Three cells of 0.05 m: a row whose ends lie further off begins another gap."""
    floor = two_rooms(20, 4, at=30)
    floor[4 + 30:4 + 50, 86:88] = False
    floor[4 + 30 + shift:4 + 50 + shift, 86:88] = True
    (gap,) = found(floor)
    assert gap.depth == depth
    assert gap.width == (20 - abs(shift) if depth == 4 else 20)


def slanting(angle_deg: float, width_m: float, at_m: float = 0.0, radius_m: float = 3.0) -> tuple[Mask, Mask, Mask]:
    """A round room with a wall of 0.2 m through its middle and a gap in it; coordinates along the wall and off it."""
    size = round(2.0 * radius_m / 0.05) + 10
    rows, columns = np.mgrid[:size, :size] - (size - 1) / 2.0
    c, s = math.cos(math.radians(angle_deg)), math.sin(math.radians(angle_deg))
    along, off = (c * columns + s * rows) * 0.05, (c * rows - s * columns) * 0.05
    floor = np.hypot(rows, columns) * 0.05 < radius_m
    return floor & ((np.abs(off) > 0.1) | (np.abs(along - at_m) < width_m / 2.0)), along, off


@pytest.mark.parametrize("is_mirrored", [False, True])
@pytest.mark.parametrize(("angle_deg", "width_m", "at_m"), [
    (25.0, 0.7, 0.0), (30.0, 0.9, 0.5), (45.0, 0.8, -0.6), (45.0, 1.1, 0.3), (52.0, 1.0, 0.6), (63.0, 0.7, -0.4),
])
def test_a_door_in_a_slanting_wall(angle_deg: float, is_mirrored: bool, width_m: float, at_m: float) -> None:
    """Its width and middle are right within three cells, and it parts the room in two."""
    angle_deg = -angle_deg if is_mirrored else angle_deg
    floor, _, off = slanting(angle_deg, width_m, at_m)
    labels, gaps = part_rooms(floor, 0.05)
    (gap,) = gaps
    c, s = math.cos(math.radians(angle_deg)), math.sin(math.radians(angle_deg))
    assert gap.width * 0.05 == pytest.approx(width_m, abs=0.14) and gap.depth == 1.0
    expected = (len(floor) - 1) / 2.0 + np.array([s, c]) * at_m / 0.05
    assert np.linalg.norm(np.array(gap.middle) - expected) * 0.05 < 0.16
    assert gap.width == pytest.approx(np.hypot(*np.subtract(gap.end, gap.start)) - 1.0)
    assert np.allclose(np.add(gap.start, gap.end) / 2.0, gap.middle)
    assert abs(gap_on_map(gap)[1] @ np.array([s, c])) > 0.93
    one, other = labels[(off > 0.4) & floor], labels[(off < -0.4) & floor]
    assert len(set(one)) == len(set(other)) == 1 and one[0] != other[0] and one[0] * other[0] > 0


@pytest.mark.parametrize(("angle_deg", "width_m", "is_gap"), [
    (45.0, 0.4, False), (45.0, 0.6, True), (45.0, 1.2, True), (45.0, 1.55, False), (30.0, 0.3, False),
    (30.0, 1.6, False), (18.0, 0.9, True), (6.0, 0.9, True),
])
def test_which_slanting_openings_are_doors(angle_deg: float, width_m: float, is_gap: bool) -> None:
    """From 0.5 to 1.3 m wide, as cells tell."""
    assert bool(close_openings(slanting(angle_deg, width_m)[0], 0.05)[1]) == is_gap


@given(st.integers(0, 30), st.integers(0, 30), st.integers(0, 30), st.integers(0, 30))
def test_the_line_of_a_gap_lets_nothing_pass_between_its_cells(r0: int, c0: int, r1: int, c1: int) -> None:
    """Consecutive cells share a side, and each lies near the straight line."""
    cells = line_cells((r0, c0), (r1, c1))
    assert cells[0] == (r0, c0) and cells[-1] == (r1, c1)
    distinct = list(dict.fromkeys(cells))
    assert all(abs(a - c) + abs(b - d) == 1 for (a, b), (c, d) in pairwise(distinct))
    line = shapely.LineString([(r0, c0), (r1, c1)])
    assert all(line.distance(shapely.Point(cell)) <= 1.2 for cell in cells)


@pytest.mark.parametrize(("radius_m", "corridor_m", "long_m", "is_closed"), [
    (3.0, 1.6, 12.0, True), (2.0, 1.6, 12.0, True), (3.0, 1.6, 2.0, False), (0.9, 1.6, 12.0, False),
])
def test_the_mouth_of_a_corridor_into_a_hall(
    radius_m: float, corridor_m: float, long_m: float, is_closed: bool
) -> None:
    """A corridor is longer than wide, and the hall is twice as wide."""
    cell_m = 0.05
    rows, columns = np.mgrid[:160, :420]
    floor = np.hypot(rows - 80, columns - 80) * cell_m < radius_m
    ends = 80 + (radius_m + long_m) / cell_m
    floor |= (np.abs(rows - 80) < corridor_m / 2.0 / cell_m) & (columns > 80) & (columns < ends)
    _, gaps = close_gaps(floor, cell_m)
    assert bool(gaps) == is_closed
    for gap in gaps:
        assert gap.width * cell_m == pytest.approx(corridor_m, abs=0.45)
        assert gap.middle[0] == pytest.approx(80.0, abs=2.0)
        assert gap.middle[1] == pytest.approx(80.0 + radius_m / cell_m, abs=14.0)
        assert gap.depth == 1.0
        between = np.linspace(gap.start, gap.end, 2001)
        on_floor = np.mean([floor[tuple(cell)] for cell in np.rint(between).astype(int)])
        assert not floor[gap.start] and not floor[gap.end]
        assert gap.width == pytest.approx(on_floor * np.hypot(*np.subtract(gap.end, gap.start)), abs=0.5)
        assert gap.middle == pytest.approx(between.mean(axis=0))


def drawn(*boxes: tuple[int, int, int, int], tall: int = 400, wide: int = 420) -> Mask:
    """Floor in boxes of rows and columns, from first to before last."""
    floor = np.zeros((tall, wide), bool)
    for r0, r1, c0, c1 in boxes:
        floor[r0:r1, c0:c1] = True
    return floor


CORRIDOR = (100, 140, 10, 410)


@pytest.mark.parametrize("side", list(SIDES))
@pytest.mark.parametrize(("boxes", "rooms"), [
    ((CORRIDOR, (100, 390, 200, 240)), 1),  # a branch as wide as the corridor is a piece of it
    ((CORRIDOR, (100, 230, 370, 410)), 1),  # and so it is round a corner
    ((CORRIDOR, (10, 101, 150, 230)), 2),  # a lounge beside it is none
    ((CORRIDOR, (80, 101, 150, 200)), 1),  # a niche is
    ((CORRIDOR, (60, 200, 10, 150)), 2),  # a hall at its end
    (((10, 120, 10, 160), (60, 120, 10, 190)), 1),  # a room with a corner
])
def test_pieces_of_a_corridor_are_joined_and_lounges_are_not(
    side: str, boxes: tuple[tuple[int, int, int, int], ...], rooms: int
) -> None:
    """In whatever direction they lie; openings have no jambs here."""
    labels, gaps = part_rooms(np.ascontiguousarray(SIDES[side][0](drawn(*boxes))), 0.05)
    assert len(np.unique(labels)) - 1 == rooms and len(gaps) == rooms - 1


@pytest.mark.parametrize(("apart", "parts"), [(20, True), (26, True), (30, False)])
def test_things_in_a_row_part_two_rooms_where_only_doorways_are_between_them(apart: int, parts: bool) -> None:
    """Up to 1.3 m; one thing alone is furniture."""
    wide = 3 * apart + 2 * 24
    free = np.pad(np.ones((160, wide), bool), 6)
    for first in (apart, 2 * apart + 24):
        free[80:92, 6 + first:6 + first + 24] = False
    floor, _ = clean_floor(free, 0.05)
    assert (not floor[85, 6 + apart + 12]) == parts
    assert len(np.unique(part_rooms(floor, 0.05)[0])) - 1 == 1 + parts
    free[80:92, 6 + apart:6 + apart + 24] = True
    assert clean_floor(free, 0.05)[0][85, 6 + 2 * apart + 36]


def test_what_is_hollow_behind_a_thin_wall_is_no_part_of_the_room() -> None:
    """A hollow wall of 0.5 m, drawn by its two faces."""
    floor = drawn((20, 120, 20, 160), (20, 120, 161, 171))
    labels, _ = part_rooms(floor, 0.05)
    assert labels[60, 158] and not labels[20:120, 161:171].any()


@pytest.mark.parametrize(("side", "is_thing"), [(10, True), (11, False)])
def test_small_things_that_stand_free_are_floor(side: int, is_thing: bool) -> None:
    """Up to 0.5 m; larger ones only where they are thick, and none that touches the border."""
    free = np.ones((80, 80), bool)
    free[30:30 + side, 40:42] = False
    floor, things = clean_floor(free, 0.05)
    assert bool(things) == is_thing and floor[31, 40] == is_thing
    assert not clean_floor(np.pad(np.ones((40, 40), bool), 1), 0.05)[1]


@pytest.mark.parametrize(("long", "thick", "is_thing"), [(50, 8, True), (51, 8, False), (50, 6, False), (20, 9, True)])
def test_furniture_that_stands_free_is_floor(long: int, thick: int, is_thing: bool) -> None:
    """Up to 2.5 m long and from 0.4 m thick."""
    free = np.ones((120, 120), bool)
    free[30:30 + long, 40:40 + thick] = False
    floor, things = clean_floor(free, 0.05)
    assert len(things) == int(is_thing) and floor[31, 41] == is_thing


@pytest.mark.parametrize(("width", "is_floor"), [(5, False), (8, True)])
def test_rays_through_windows_are_no_floor(width: int, is_floor: bool) -> None:
    """Strips narrower than 0.3 m."""
    free = np.zeros((80, 200), bool)
    free[10:70, 10:90] = True
    free[40:40 + width, 90:180] = True
    floor, _ = clean_floor(free, 0.05)
    assert floor[40 + width // 2, 150] == is_floor and floor[30:50, 20:80].all()


@pytest.mark.parametrize(("side", "is_room"), [(24, False), (25, True)])
def test_what_is_too_small_is_no_room(side: int, is_room: bool) -> None:
    """1.5 m2: 24 x 25 cells of 0.05 m are."""
    floor = np.pad(np.ones((side, 25), bool), 4)
    floor[4 + side - 1, 4:29] = True
    assert part_rooms(floor, 0.05)[0].any() == (side * 25 * 0.0025 >= 1.5)


@pytest.mark.parametrize(("width", "is_room"), [(9, False), (11, True)])
def test_what_is_too_narrow_is_no_room(width: int, is_room: bool) -> None:
    """Below 0.3 m of clearance, by the middles of cells."""
    assert part_rooms(np.pad(np.ones((width, 120), bool), 4), 0.05)[0].any() == is_room


@pytest.mark.parametrize("wall", [1, 2, 3])
def test_no_doorway_is_in_a_wall_without_one(wall: int) -> None:
    """However thin it is: a hall ends at its wall."""
    floor = np.pad(np.ones((100, 150 + wall), bool), 4)
    floor[:, 84:84 + wall] = False
    labels, gaps = part_rooms(floor, 0.05)
    assert gaps == [] and len(np.unique(labels)) == 3


def make(turn: float, origin: tuple[float, float, float], resolution_m: float = 0.05) -> Grid:
    c, s = math.cos(turn), math.sin(turn)
    matrix, offset = np.array([[c, -s], [s, c]]), np.array([7.0, -3.0])
    return Grid(np.zeros((2, 2), np.int8), resolution_m, turn, matrix, offset, 90, origin)


@settings(max_examples=60)
@given(st.floats(-0.7, 0.7), st.floats(-9.0, 9.0), st.floats(-9.0, 9.0), st.floats(-3.1, 3.1), st.floats(0.01, 0.2),
       st.floats(0.0, 60.0), st.floats(0.0, 60.0), st.floats(-math.pi, math.pi))
def test_places_and_directions_of_the_grid_in_the_map(
    turn: float, x: float, y: float, yaw: float, cell_m: float, row: float, column: float, angle: float
) -> None:
    """The picture's lower left corner is the origin; x runs along columns and y against rows, turned by the yaw."""
    grid = make(turn, (x, y, yaw), cell_m)
    picture = complex(math.cos(turn) * row - math.sin(turn) * column + 7.0,
                      math.sin(turn) * row + math.cos(turn) * column - 3.0)  # row + i column
    flat = complex(picture.imag + 0.5, 90 - 0.5 - picture.real) * cell_m
    there = complex(x, y) + flat * complex(math.cos(yaw), math.sin(yaw))
    assert complex(*grid.to_map(np.array([[row, column]]))[0]) == pytest.approx(there, abs=1e-9)
    # Along rows and columns: columns point to the grid's x, rows against its y.
    d = grid.direction(np.array([math.sin(angle), math.cos(angle)]))
    expected = complex(math.cos(angle), -math.sin(angle)) * complex(math.cos(turn + yaw), math.sin(turn + yaw))
    assert complex(*d) == pytest.approx(expected, abs=1e-9)


@settings(deadline=None, max_examples=15)
@given(st.floats(-44.0, 44.0))
def test_the_turn_of_thin_walls_is_found_to_a_tenth_of_a_degree_or_so(turn_deg: float) -> None:
    rows, columns = np.mgrid[:260, :260] - 130.0
    c, s = math.cos(math.radians(turn_deg)), math.sin(math.radians(turn_deg))
    along, across = c * columns - s * rows, s * columns + c * rows
    cells = np.full((260, 260), UNKNOWN)
    cells[(np.abs(along) < 100) & (np.abs(across) < 70)] = OCCUPIED
    cells[(np.abs(along) < 98.5) & (np.abs(across) < 68.5)] = FREE
    found_deg = math.degrees(find_wall_turn(cells))
    assert found_deg == pytest.approx(turn_deg if abs(turn_deg) > 0.3 else 0.0, abs=0.35)


def test_a_straight_map_is_cut_to_what_is_known_with_a_margin() -> None:
    cells = np.full((90, 80), UNKNOWN)
    cells[20:60, 30:70] = OCCUPIED
    cells[22:58, 32:68] = FREE
    grid = make_grid(cells, MapFile(Path("m.pgm"), 0.1, (1.0, 2.0, 0.0), False, 0.65, 0.196, "trinary"))
    assert grid.turn_rad == 0.0 and grid.cells.shape == (40 + 12, 40 + 12) and grid.rows == 90
    corner = np.argwhere(grid.cells == FREE)[0]
    assert grid.to_map(corner[None].astype(float))[0] == pytest.approx([1.0 + 3.25, 2.0 + (90 - 22.5) * 0.1])
    tiny = np.full((30, 30), UNKNOWN)
    tiny[10:14, 10:14] = OCCUPIED
    assert find_wall_turn(tiny) == 0.0
