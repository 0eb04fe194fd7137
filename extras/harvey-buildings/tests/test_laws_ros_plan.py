"""A drawn plan comes back from its map: rooms and doorways to about a cell, at any resolution and origin."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
import shapely

from harvey_buildings.formats.ros_map import find_wall_turn, read_ros_map
from harvey_buildings.formats.ros_map_file import FREE, OCCUPIED, UNKNOWN
from harvey_buildings.formats.ros_map_rooms import clean_floor

ROOMS = {"left": (1.0, 1.0, 4.0, 5.0), "right": (4.2, 1.0, 9.0, 5.0), "above": (1.0, 5.2, 9.0, 8.0)}
DOORS = ((4.0, 2.0, 4.2, 2.9), (2.0, 5.0, 3.0, 5.2), (6.5, 5.0, 7.3, 5.2))
"""Lower left and upper right corners [m], in the picture's own frame."""
SIZE = (10.0, 9.0)


def write(folder: Path, cell_m: float, origin: tuple[float, float, float]) -> Path:
    columns, rows = (round(side / cell_m) for side in SIZE)
    x, y = (np.arange(columns) + 0.5) * cell_m, (np.arange(rows)[::-1] + 0.5) * cell_m
    picture = np.full((rows, columns), 205, np.uint8)

    def fill(x0: float, y0: float, x1: float, y1: float, grey: int) -> None:
        picture[np.ix_((y > y0) & (y < y1), (x > x0) & (x < x1))] = grey

    fill(0.8, 0.8, 9.2, 8.2, 0)
    for box in (*ROOMS.values(), *DOORS):
        fill(*box, 254)
    (folder / "m.pgm").write_bytes(f"P5 {columns} {rows} 255\n".encode() + picture.tobytes())
    (folder / "m.yaml").write_text(f"image: m.pgm\nresolution: {cell_m}\norigin: [{', '.join(map(str, origin))}]\n"
                                   "negate: 0\noccupied_thresh: 0.65\nfree_thresh: 0.196\n")
    return folder / "m.yaml"


@pytest.mark.parametrize("origin", [(0.0, 0.0, 0.0), (-3.0, 7.5, 0.0), (2.0, -1.0, 0.7), (0.0, 4.0, -2.5)])
@pytest.mark.parametrize("cell_m", [0.04, 0.05, 0.1])
def test_a_drawn_plan_comes_back(tmp_path: Path, cell_m: float, origin: tuple[float, float, float]) -> None:
    plan = read_ros_map(write(tmp_path, cell_m, origin), 2.4)
    x, y, yaw = origin
    c, s = math.cos(yaw), math.sin(yaw)

    def place(points: np.ndarray) -> np.ndarray:
        return np.asarray(points @ np.array([[c, s], [-s, c]]) + np.array([x, y]))

    assert len(plan.spaces) == len(ROOMS) and len(plan.openings) == len(DOORS)
    name_of = {}
    for room, (x0, y0, x1, y1) in ROOMS.items():
        drawn = shapely.Polygon(place(np.array([[x0, y0], [x1, y0], [x1, y1], [x0, y1]])))
        space = max(plan.spaces, key=lambda one: shapely.Polygon(one.outline).intersection(drawn).area)
        name_of[space.name] = room
        made = shapely.Polygon(space.outline)
        assert shapely.hausdorff_distance(made, drawn) < max(1.5 * cell_m, 0.1)  # corners are smoothed
        assert made.symmetric_difference(drawn).area < 0.6 * cell_m * drawn.length + 0.05
        assert (space.height_m, space.floor_m) == (2.4, 0.0)
    joined = [("left", "right"), ("above", "left"), ("above", "right")]
    for (x0, y0, x1, y1), rooms in zip(DOORS, joined, strict=True):
        middle = place(np.array([[(x0 + x1) / 2.0, (y0 + y1) / 2.0]]))[0]
        door = min(plan.openings, key=lambda one: float(np.linalg.norm(one.centre - middle)))
        assert door.centre == pytest.approx(middle, abs=0.51 * cell_m + 1e-6)
        assert door.width_m == pytest.approx(max(x1 - x0, y1 - y0), abs=cell_m + 1e-6)
        assert tuple(sorted(name_of[room] for room in door.rooms)) == rooms and door.height_m == 2.05
        wall = place(np.array([[0.0, 0.0], [1.0, 0.0] if x1 - x0 > y1 - y0 else [0.0, 1.0]]))
        assert door.along is not None and abs(door.along @ (wall[1] - wall[0])) == pytest.approx(1.0, abs=1e-6)
    free_m2 = sum((x1 - x0) * (y1 - y0) for x0, y0, x1, y1 in ROOMS.values())
    assert sum(shapely.Polygon(space.outline).area for space in plan.spaces) == pytest.approx(free_m2, rel=0.03)


@pytest.mark.parametrize(("wall_height_m", "door_m"), [(2.4, 2.05), (2.2, 1.9), (2.36, 2.05), (2.34, 2.04)])
def test_doorways_are_as_high_as_there_is_wall(tmp_path: Path, wall_height_m: float, door_m: float) -> None:
    """2.05 m, and 0.3 m of wall above."""
    plan = read_ros_map(write(tmp_path, 0.1, (0.0, 0.0, 0.0)), wall_height_m)
    assert {round(door.height_m, 6) for door in plan.openings} == {door_m}


def test_in_a_round_room_no_direction_prevails() -> None:
    rows, columns = np.mgrid[:300, :300] - 149.5
    away = np.hypot(rows, columns)
    cells = np.full((300, 300), UNKNOWN)
    cells[away < 140.0] = OCCUPIED
    cells[away < 137.0] = FREE
    assert find_wall_turn(cells) == 0.0


@pytest.mark.parametrize(("inner", "outer", "is_floor"), [(4, 6, True), (2, 4, False), (10, 12, True), (11, 13, False)])
def test_small_hollow_things_at_a_wall_are_floor(inner: int, outer: int, is_floor: bool) -> None:
    """Bins: from 0.15 to 0.5 m within; their rims too, but not the wall behind."""
    free = np.pad(np.ones((60, 60), bool), 3)
    free[3:3 + outer, 20:20 + outer] = False
    rim = (outer - inner) // 2
    free[3 + rim:3 + rim + inner, 20 + rim:20 + rim + inner] = True
    floor, _ = clean_floor(free, 0.05)
    assert floor[3 + outer - 1, 20 + outer // 2] == is_floor and not floor[2, 10:60].any()
