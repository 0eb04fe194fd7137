"""A ROS map (``map.yaml`` with its picture) as a building plan: rooms, walls and doors traced from the grid."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import shapely

from harvey_buildings.building_plan import (
    BuildingError,
    BuildingPlan,
    Floats,
    Space,
    Storey,
    WallOpening,
    slug,
)
from harvey_buildings.polygons import extract_outline
from harvey_buildings.ros_map.gaps import Gap
from harvey_buildings.ros_map.grid import Grid, make_grid
from harvey_buildings.ros_map.map_yaml import MapFile, read_map_yaml
from harvey_buildings.ros_map.occupancy import FREE, OCCUPIED, UNKNOWN, read_cells
from harvey_buildings.ros_map.outlines import fill_to_walls, gap_on_map, room_shape
from harvey_buildings.ros_map.rooms import Labels, clean_floor, part_rooms, rooms_beside

WALL_HEIGHT_M, DOOR_HEIGHT_M = 2.5, 2.05
MIN_DOOR_M = 0.6
HEADER_M = 0.3
STOREY = "ground"


def read_ros_map(path: Path, wall_height_m: float = WALL_HEIGHT_M) -> BuildingPlan:
    """The plan of a ROS map, in the map's frame. Raises BuildingError where it cannot be read or has no room."""
    file = read_map_yaml(path)
    cells = read_cells(file)
    for value, what, key in ((FREE, "free", "free_thresh"), (OCCUPIED, "occupied", "occupied_thresh")):
        if not (cells == value).any():
            raise BuildingError(f"{file.image.name}: expected free and occupied cells, got no {what} one "
                                f"(see {key} and negate in {path.name})")
    grid = make_grid(cells, file)
    floor, things = clean_floor(grid.cells == FREE, grid.cell_m)
    labels, gaps = part_rooms(floor, grid.cell_m)
    labels = fill_to_walls(labels, grid.cells == FREE, max(1, round(0.15 / grid.cell_m)))
    plan = BuildingPlan(slug(path.stem) or "map", path.name, [Storey(STOREY, 0.0)])
    names = _add_rooms(plan, labels, gaps, grid, wall_height_m)
    if not names:
        raise BuildingError(f"{file.image.name}: expected a room of {1.5:g} m2 or more with walls, got none in "
                            f"{cells.shape[1]} x {cells.shape[0]} cells of {file.resolution_m:g} m")
    _add_doors(plan, labels, gaps, names, grid)
    _report(plan, file, grid, labels, len(things))
    return plan


def _add_rooms(plan: BuildingPlan, labels: Labels, gaps: list[Gap], grid: Grid, wall_height_m: float) -> dict[int, str]:
    """Add a space for each room of the grid; its name by its number. From the top left to the bottom right."""
    names: dict[int, str] = {}
    for number in (int(k) for k in np.unique(labels) if k > 0):
        beside = [(gap, 1 if rooms[0] == number else -1) for gap in gaps
                  if number in (rooms := rooms_beside(gap, labels, grid.cell_m))]
        shape = room_shape(labels == number, beside, grid.cell_m)
        outline = _trace(grid.to_map_polygon(shape)) if shape is not None else None
        if outline is None:
            area_m2 = float((labels == number).sum()) * grid.cell_m**2
            plan.report.left_out.append(f"a part of {area_m2:.1f} m2: no outline could be traced")
            continue
        names[number] = f"room-{len(names) + 1}"
        plan.spaces.append(Space(names[number], "room", names[number], STOREY, outline, 0.0, wall_height_m))
    return names


def _trace(shape: shapely.Geometry) -> Floats | None:
    """The outline (k, 2) of a shape; where it touches itself, without its narrowest parts."""
    for narrow_m in (0.0, 0.03, 0.06, 0.12):
        part = shape.buffer(-narrow_m, join_style="mitre").buffer(narrow_m, join_style="mitre") if narrow_m else shape
        outline = extract_outline(part)
        if outline is not None:
            return outline
    return None


def _add_doors(plan: BuildingPlan, labels: Labels, gaps: list[Gap], names: dict[int, str], grid: Grid) -> None:
    """Add an opening for each gap that parts two rooms."""
    height_m = min(DOOR_HEIGHT_M, plan.spaces[0].height_m - HEADER_M)
    for gap in gaps:
        rooms = tuple(names[k] for k in rooms_beside(gap, labels, grid.cell_m) if k in names)
        width_m = gap.width * grid.cell_m
        if len(rooms) != 2 or width_m < MIN_DOOR_M:
            continue
        middle, along = gap_on_map(gap)
        plan.openings.append(WallOpening(f"door-{len(plan.openings) + 1}", STOREY, grid.to_map(middle[None])[0],
                                         width_m, height_m, rooms, grid.direction(along)))


def _report(plan: BuildingPlan, file: MapFile, grid: Grid, labels: Labels, things: int) -> None:
    report, known = plan.report, grid.cells != UNKNOWN
    report.used.append(f"{file.image.name}: {int(known.sum())} known cells of {file.resolution_m:g} m, "
                       f"{len(plan.spaces)} rooms, {len(plan.openings)} doorways; coordinates are the map's")
    report.guessed.append(f"walls are {plan.spaces[0].height_m:g} m high and doorways "
                          f"{min(DOOR_HEIGHT_M, plan.spaces[0].height_m - HEADER_M):g} m: a grid has no heights")
    report.guessed.append("rooms end where a wall has a gap; their names are numbers, from the top of the picture down")
    report.guessed.append("what is unknown beside free floor is taken for wall")
    if grid.turn_rad:
        report.guessed.append(f"most walls run {abs(math.degrees(grid.turn_rad)):.1f} degrees off the picture's axes; "
                              "walls nearly along those directions are straightened to them")
    outside = int(((grid.cells == FREE) & (labels == 0)).sum())
    if outside:
        report.left_out.append(f"{outside * grid.cell_m**2:.1f} m2 of free cells in no room: rays through windows, "
                               "pockets in walls and furniture")
    if things:
        report.left_out.append(f"{things} things that stand free on the floor (legs, bins, furniture, speckle)")
