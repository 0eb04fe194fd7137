"""ROS maps of worlds of one storey, as a laser scanner draws them: free floor, walls with noise, the rest unknown."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import shapely
from numpy.typing import NDArray
from scipy import ndimage

from world_models.building.world import World

MARGIN_M = 1.0
WALL_M = 0.1
"""How far into a wall the scanner's hits lie."""
FREE_VALUE, WALL_VALUE, UNKNOWN_VALUE = 254, 0, 205


@dataclass(frozen=True, slots=True)
class ScanNoise:
    """What a scanner gets wrong.

    Attributes:
        rough: share of the cells along walls that are drawn as free, and of free cells along them drawn as wall.
        speckle: share of the free cells that are drawn as occupied.
        unseen: share of the free cells that are drawn as unknown.
        turn_rad: angle of the building in the picture.
    """

    rough: float = 0.15
    speckle: float = 0.0005
    unseen: float = 0.002
    turn_rad: float = 0.0


def write_floor_map(folder: Path, world: World, noise: ScanNoise, rng: np.random.Generator, cell_m: float = 0.05,
                    is_furnished: bool = True) -> Path:
    """Write ``map.yaml`` and ``map.pgm`` of a world of one storey; its coordinates are the world's. Return the yaml."""
    floor = floor_shape(world, is_furnished)
    low_x, low_y, high_x, high_y = shapely.transform(floor, lambda p: _turn(p, -noise.turn_rad)).bounds
    low = np.array([low_x, low_y]) - MARGIN_M
    columns, rows = np.ceil((np.array([high_x, high_y]) + MARGIN_M - low) / cell_m).astype(int).tolist()
    grid = np.meshgrid(np.arange(columns) + 0.5, rows - 0.5 - np.arange(rows))
    at = _turn(np.column_stack([axis.ravel() for axis in grid]) * cell_m + low, noise.turn_rad)
    free = shapely.contains_xy(floor, at).reshape(rows, columns)
    folder.mkdir(parents=True, exist_ok=True)
    picture = _scan(free, noise, rng, cell_m)
    (folder / "map.pgm").write_bytes(f"P5\n# made up\n{columns} {rows}\n255\n".encode() + picture.tobytes())
    x, y = _turn(low[None], noise.turn_rad)[0]
    (folder / "map.yaml").write_text(
        f"image: map.pgm\nresolution: {cell_m:g}\norigin: [{x:.9f}, {y:.9f}, {noise.turn_rad:.9f}]\nnegate: 0\n"
        "occupied_thresh: 0.65\nfree_thresh: 0.196\n", encoding="utf-8")
    return folder / "map.yaml"


def floor_shape(world: World, is_furnished: bool) -> shapely.Geometry:
    """The free floor of all rooms and open doorways [m]."""
    rooms = [shapely.Polygon(world.outline(room)) for room in world.rooms]
    ways = [shapely.Polygon(door.thresholds_world.reshape(4, 2)).buffer(0.01, join_style="mitre")
            for door in world.doorways]
    floor = shapely.union_all([*rooms, *ways])
    solid = [shapely.Polygon(border) for room in world.rooms for border in world.obstacles(room)]
    return floor.difference(shapely.union_all(solid)) if is_furnished and solid else floor


def _turn(points: NDArray[np.float64], angle: float) -> NDArray[np.float64]:
    c, s = math.cos(angle), math.sin(angle)
    return np.asarray(points @ np.array([[c, s], [-s, c]]))


def _scan(free: NDArray[np.bool_], noise: ScanNoise, rng: np.random.Generator, cell_m: float) -> NDArray[np.uint8]:
    beside = ndimage.binary_dilation(free) & ~free
    inside = free & ~ndimage.binary_erosion(free)
    seen = (free | (beside & (rng.random(free.shape) < noise.rough))) & ~(
        inside & (rng.random(free.shape) < noise.rough))
    wall = ndimage.binary_dilation(seen, iterations=max(1, round(WALL_M / cell_m))) & ~seen
    picture = np.full(free.shape, UNKNOWN_VALUE, np.uint8)
    picture[wall] = WALL_VALUE
    picture[seen & (rng.random(free.shape) >= noise.unseen)] = FREE_VALUE
    picture[seen & (rng.random(free.shape) < noise.speckle)] = WALL_VALUE
    return picture
