"""A storey of a world as a ROS map: ``map.yaml`` and a PGM, as map_server writes and reads them.

http://wiki.ros.org/map_server, "Map format": trinary, 254 is free, 0 occupied, 205 unknown.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from pathlib import Path

import numpy as np
import shapely
from numpy.typing import NDArray
from scipy import ndimage

from world_models.building.geometry.scene import Floats
from world_models.building.world import World

FREE_VALUE, OCCUPIED_VALUE, UNKNOWN_VALUE = 254, 0, 205
MARGIN_M = 0.5
WALL_M = 0.1
"""Walls are drawn so far from the floor beside them; what is behind is unknown."""
MIN_WALL_CELLS = 1.5
"""So walls have no gaps at corners."""
SEAM_M = 0.01
"""Doorways reach so far into their rooms, so that no row of cells between them is lost."""
RESOLUTIONS_M = (0.005, 0.5)
MAX_CELLS = 100_000_000

YAML = """\
# {world}{storey}, by harvey world export. The map's frame is the world's: metres, x to the east, y to the north.
image: {image}
mode: trinary
resolution: {resolution:g}
origin: [{x:.6f}, {y:.6f}, 0.0]
negate: 0
occupied_thresh: 0.65
free_thresh: 0.196
"""

Mask = NDArray[np.bool_]


def write_ros_map(world: World, rooms: Sequence[str], out: Path, resolution_m: float, with_things: bool) -> str:
    """Write ``out`` (.yaml) and its picture (.pgm) of these rooms; return what was written. Raises OSError, ValueError.

    Args:
        rooms: of one storey.
        resolution_m: side of a cell.
        with_things: whether things that the robot could hit are occupied.
    """
    low, shape = _bounds(world, rooms, resolution_m)
    inside = _fill([world.outline(room) for room in rooms], low, shape, resolution_m)
    doors = {door.name: door for room in rooms for door in world.doorways_of(room)}
    thresholds = [shapely.Polygon(door.thresholds_world.reshape(-1, 2)) for door in doors.values()]
    seams = [np.asarray(t.buffer(SEAM_M, join_style="mitre").exterior.coords) for t in thresholds]
    inside |= _fill(seams, low, shape, resolution_m)
    things = _fill((foot for room in rooms for foot in world.obstacles(room)) if with_things else (), low, shape,
                   resolution_m)
    thick = max(WALL_M / resolution_m, MIN_WALL_CELLS)
    is_wall = ~inside & (ndimage.distance_transform_edt(~inside) <= thick)
    picture = np.full(shape, UNKNOWN_VALUE, np.uint8)
    picture[inside] = FREE_VALUE
    picture[is_wall | (inside & things)] = OCCUPIED_VALUE
    image = out.with_suffix(".pgm")
    rows, columns = shape
    image.write_bytes(f"P5\n{columns} {rows}\n255\n".encode() + picture[::-1].tobytes())
    storey = f", floor at {world.floor_m(rooms[0]):.2f} m"
    out.write_text(YAML.format(world=world.name, storey=storey, image=image.name, resolution=resolution_m, x=low[0],
                               y=low[1]), encoding="utf-8")
    return f"{len(rooms)} rooms in {columns} x {rows} cells of {resolution_m:g} m, picture {image.name}"


def _bounds(world: World, rooms: Sequence[str], resolution_m: float) -> tuple[Floats, tuple[int, int]]:
    """The lower left corner of the grid [m, world], and its rows and columns. Raises ValueError."""
    low_m, high_m = RESOLUTIONS_M
    if not low_m <= resolution_m <= high_m:
        raise ValueError(f"expected a resolution of {low_m:g} to {high_m:g} metres a cell, got {resolution_m:g}")
    corners = np.concatenate([world.outline(room) for room in rooms])
    low = np.floor((corners.min(axis=0) - MARGIN_M) / resolution_m) * resolution_m
    columns, rows = np.ceil((corners.max(axis=0) + MARGIN_M - low) / resolution_m).astype(int).tolist()
    if rows * columns > MAX_CELLS:
        raise ValueError(f"expected at most {MAX_CELLS} cells, got {columns} x {rows}: choose larger ones")
    return np.asarray(low), (rows, columns)


def _fill(polygons: Iterable[Floats], low: Floats, shape: tuple[int, int], cell_m: float) -> Mask:
    """The cells, row 0 at the smallest y, whose middles are in one of the polygons (k, 2) [m, world]."""
    mask = np.zeros(shape, bool)
    for corners in polygons:
        first = np.clip(np.floor((corners.min(axis=0) - low) / cell_m).astype(int), 0, None)
        last = np.clip(np.ceil((corners.max(axis=0) - low) / cell_m).astype(int), 0, shape[::-1])
        x, y = (low[axis] + (np.arange(first[axis], last[axis]) + 0.5) * cell_m for axis in (0, 1))
        window = mask[first[1] : last[1], first[0] : last[0]]
        polygon = shapely.Polygon(corners)
        shapely.prepare(polygon)
        window |= shapely.contains_xy(polygon, *np.meshgrid(x, y))
    return mask
