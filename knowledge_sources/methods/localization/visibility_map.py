"""The points of model lines that are visible from each position of a room, in any direction.

Computed once for a room and cached, so that many poses can be scored quickly.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
import shapely
from numba import njit

from knowledge_sources.methods.arrays import Floats, Ints, Mask
from knowledge_sources.methods.motion.routes import compute_free_space
from world_models.building.building import Building

POSITION_STEP_M = 0.25  # spacing of the positions that are tried in a room
POSITION_CLEARANCE_M = 0.2
"""Distance of positions from walls and things: less than the robot's radius, as a bump may move it."""
VISIBILITY_CELL_M = 0.75  # side of the cells of which each shares one set of visible points
POINT_SPACING_M = 0.25  # spacing of points along model lines
MAX_LINE_POINTS = 60  # most points along one model line
MAX_POINT_DISTANCE_M = 14.0  # largest distance of a visible point
MIN_POINT_CONTRAST = 0.05  # smallest contrast of a line with visible points, 0..1
OCCLUSION_TOLERANCE_M = 0.01  # distance behind a surface from which a point is hidden by it
MAX_LEVEL_SLOPE = 0.05  # largest slope of a model line that counts as level

MAX_MAPS = 256
"""Size of the cache of visibility maps."""


@dataclass(frozen=True, eq=False, slots=True)
class VisibilityMap:
    """What is visible from the positions of a room.

    Attributes:
        positions: (n, 2) where the robot may be [m, world].
        cell: (n,) the cell of each position.
        eyes: (c, 2) of each cell the position nearest to its middle [m, world].
        points, directions: (p, 3) points along model lines [m, world], and the unit direction of each one's line.
        first: (c + 1,) the points ``visible[first[i] : first[i + 1]]`` are visible from eye i.
        visible: indices of points.
        axis_rad: direction of most of the walls, modulo a right angle.
    """

    positions: Floats
    cell: Ints
    eyes: Floats
    points: Floats
    directions: Floats
    first: Ints
    visible: Ints
    axis_rad: float


def get_visibility_map(building: Building, room: str, eye_m: float) -> VisibilityMap:
    """Return the visibility map of a room for a camera at a height above the world's zero. Cached."""
    return building.cached("visibility maps", MAX_MAPS, (room, eye_m),
                           lambda: _build(building, room, eye_m))


def sample_lines(lines_world: Floats) -> tuple[Floats, Floats, Ints]:
    """Return points (k, 3) along lines (n, 2, 3), the unit direction (k, 3) of each one's line, and which line (k,)."""
    lines = np.asarray(lines_world, float).reshape(-1, 2, 3)
    along = lines[:, 1] - lines[:, 0]
    length = np.linalg.norm(along, axis=1)
    count = np.clip(np.rint(length / POINT_SPACING_M), 2, MAX_LINE_POINTS).astype(np.int64)
    owner = np.repeat(np.arange(len(lines)), count)
    number = np.arange(len(owner)) - np.repeat(np.cumsum(count) - count, count)
    t = (number + 0.5) / count[owner]
    unit = along / np.maximum(length, 1e-9)[:, None]
    return lines[owner, 0] + t[:, None] * along[owner], unit[owner], owner


def _build(building: Building, room: str, eye_m: float) -> VisibilityMap:
    positions = _find_positions(building, room)
    cells, cell = np.unique(
        np.floor(positions / VISIBILITY_CELL_M).astype(np.int64), axis=0, return_inverse=True)
    cell = cell.reshape(-1).astype(np.int64)
    eyes = _choose_eyes(positions, cell, cells, VISIBILITY_CELL_M)
    scene = building.scene_of((room,))
    points, directions, owner = sample_lines(scene.edges.lines_world)
    first, visible = [0], []
    for eye in np.column_stack([eyes, np.full(len(eyes), eye_m)]):
        clear = scene.edges.contrasts(eye)[owner] >= MIN_POINT_CONTRAST
        near = np.linalg.norm(points - eye, axis=1) < MAX_POINT_DISTANCE_M
        some = np.flatnonzero(clear & near)
        seen = _are_visible(eye, points[some], scene.planes_world, scene.polygons_world, OCCLUSION_TOLERANCE_M)
        visible.append(some[seen])
        first.append(first[-1] + len(visible[-1]))
    return VisibilityMap(
        positions, cell, eyes, points, directions, np.array(first, np.int64),
        np.concatenate([np.zeros(0, np.int64), *visible]),
        _find_axis(scene.edges.lines_world, MAX_LEVEL_SLOPE),
    )


def _choose_eyes(positions: Floats, cell: Ints, cells: Ints, side_m: float) -> Floats:
    """(c, 2) of each cell the position nearest to its middle; the middle itself may be beyond a wall."""
    away = np.sum((positions - (cells[cell] + 0.5) * side_m) ** 2, axis=1)
    order = np.lexsort((away, cell))
    return np.asarray(positions[order[np.searchsorted(cell[order], np.arange(len(cells)))]])


def _find_positions(building: Building, room: str) -> Floats:
    """(n, 2) grid points in a room's free space, and points of its open doorways up to their middle [m, world]."""
    sills = [d.thresholds_world.mean(axis=1)[:: 1 if d.between[0] == room else -1] for d in building.doorways_of(room)]
    in_doorways = np.array([point for own, other in sills for point in (own, 0.5 * (own + other))]).reshape(-1, 2)
    free = compute_free_space(building.outline(room), building.obstacles(room), POSITION_CLEARANCE_M)
    if free.is_empty:
        return in_doorways
    step = POSITION_STEP_M
    x0, y0, x1, y1 = (float(v) for v in free.bounds)
    xs = np.arange(math.ceil(x0 / step), math.floor(x1 / step) + 1) * step
    ys = np.arange(math.ceil(y0 / step), math.floor(y1 / step) + 1) * step
    grid = np.stack(np.meshgrid(xs, ys, indexing="ij"), axis=-1).reshape(-1, 2)
    shapely.prepare(free)
    return np.concatenate([grid[shapely.intersects_xy(free, grid[:, 0], grid[:, 1])], in_doorways])


def _find_axis(lines_world: Floats, max_slope: float) -> float:
    """Mean direction of the level lines, weighted by length, modulo a right angle [rad]."""
    along = lines_world[:, 1] - lines_world[:, 0]
    level = np.abs(along[:, 2]) < max_slope * np.maximum(np.linalg.norm(along, axis=1), 1e-9)
    turned = 4.0 * np.arctan2(along[level, 1], along[level, 0])
    weight = np.linalg.norm(along[level], axis=1)
    return math.atan2(float(np.sum(weight * np.sin(turned))), float(np.sum(weight * np.cos(turned)))) / 4.0


def _are_visible(eye: Floats, points: Floats, planes: Floats, polygons: Floats, tolerance_m: float) -> Mask:
    """(n,) which points (n, 3) are hidden by no surface that faces the eye."""
    facing = planes[:, :3] @ eye - planes[:, 3] > 1e-6
    return np.asarray(_find_visible(eye, np.ascontiguousarray(points), planes[facing], polygons[facing], tolerance_m))


@njit(cache=True, error_model="numpy")
def _find_visible(eye: Any, points: Any, planes: Any, polygons: Any, tolerance_m: float) -> Any:
    """(n,) which points are visible. The polygon that hid the last point is tried first."""
    out = np.ones(len(points), np.bool_)
    corners = polygons.shape[1]
    height = np.empty(len(planes))
    for j in range(len(planes)):
        height[j] = planes[j, 0] * eye[0] + planes[j, 1] * eye[1] + planes[j, 2] * eye[2] - planes[j, 3]
    last = -1
    for i in range(len(points)):
        px, py, pz = points[i, 0], points[i, 1], points[i, 2]
        for step in range(-1, len(planes)):
            j = last if step < 0 else step
            if j < 0:
                continue
            below = planes[j, 0] * px + planes[j, 1] * py + planes[j, 2] * pz - planes[j, 3]
            if below > -tolerance_m:
                continue
            t = height[j] / (height[j] - below)
            x, y, z = eye[0] + t * (px - eye[0]), eye[1] + t * (py - eye[1]), eye[2] + t * (pz - eye[2])
            hit = True
            for a in range(corners):
                b = a + 1 if a + 1 < corners else 0
                ux, uy, uz = (polygons[j, b, 0] - polygons[j, a, 0], polygons[j, b, 1] - polygons[j, a, 1],
                              polygons[j, b, 2] - polygons[j, a, 2])
                vx, vy, vz = x - polygons[j, a, 0], y - polygons[j, a, 1], z - polygons[j, a, 2]
                side = (planes[j, 0] * (uy * vz - uz * vy) + planes[j, 1] * (uz * vx - ux * vz)
                        + planes[j, 2] * (ux * vy - uy * vx))
                if side < -1e-9:
                    hit = False
                    break
            if hit:
                out[i] = False
                last = j
                break
    return out
