"""What can be seen from where: for the places of a room, the points of model lines that are in sight, whatever way one
looks. Worked out once for a room, kept with the world, and read by whoever asks of many places at once.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
import shapely
from numba import njit
from numpy.typing import NDArray

from knowledge_sources.methods.motion.routes import compute_free_space
from world_models.building.world import World

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

CELL_M = 0.75
"""What is in sight is worked out for one place of each of such squares."""
STEP_M = 0.25
"""Places are so far apart."""
SPACING_M = 0.25
MOST_POINTS = 60
"""Points of one line."""
FAR_M = 14.0
"""Points further away are not looked for."""
CONTRAST = 0.05
"""Lines that are fainter are not looked for."""
ROOM_M = 0.2
"""The robot's middle keeps at least so far from walls and things; a bump may leave it nearer than it would go."""


@dataclass(frozen=True, eq=False, slots=True)
class VisibilityMap:
    """A room, as seen from its places.

    Attributes:
        places: (n, 2) where the robot may stand [m, world]; cell: (n,) the square of each.
        eyes: (c, 2) the place of each square, of its own, that is nearest to its middle [m, world].
        points: (p, 3) along model lines [m, world]; directions: (p, 3) unit, of each one's line.
        first: (c + 1,) and seen: what is in sight from eye i are the points seen[first[i] : first[i + 1]].
        axis_rad: the direction of most of its walls, modulo a right angle.
    """

    positions: Floats
    cell: Ints
    eyes: Floats
    points: Floats
    directions: Floats
    first: Ints
    visible: Ints
    axis_rad: float


def get_visibility_map(world: World, room: str, eye_m: float) -> VisibilityMap:
    """What is in sight from a room's places for an eye at so high above the world's zero. Kept with the world."""
    known: dict[tuple[str, float], VisibilityMap] = world.cache.setdefault("vantages", {})
    key = room, eye_m
    if key not in known:
        known[key] = _vantage(world, room, eye_m)
    return known[key]


def sample_lines(lines_world: Floats, spacing_m: float = SPACING_M) -> tuple[Floats, Floats, Ints]:
    """Points (k, 3) along lines (n, 2, 3), the unit direction (k, 3) of each one's line, and which line (k,)."""
    lines = np.asarray(lines_world, float).reshape(-1, 2, 3)
    along = lines[:, 1] - lines[:, 0]
    length = np.linalg.norm(along, axis=1)
    count = np.clip(np.rint(length / spacing_m), 2, MOST_POINTS).astype(np.int64)
    owner = np.repeat(np.arange(len(lines)), count)
    number = np.arange(len(owner)) - np.repeat(np.cumsum(count) - count, count)
    t = (number + 0.5) / count[owner]
    unit = along / np.maximum(length, 1e-9)[:, None]
    return lines[owner, 0] + t[:, None] * along[owner], unit[owner], owner


def _vantage(world: World, room: str, eye_m: float) -> VisibilityMap:
    places = _places(world, room)
    squares, cell = np.unique(np.floor(places / CELL_M).astype(np.int64), axis=0, return_inverse=True)
    eyes = _eyes(places, cell.reshape(-1), squares)
    scene = world.scene_of((room,))
    points, directions, owner = sample_lines(scene.edges.lines_world)
    first, seen = [0], []
    for eye in np.column_stack([eyes, np.full(len(eyes), eye_m)]):
        showing = scene.edges.contrasts(eye)[owner] >= CONTRAST
        near = np.linalg.norm(points - eye, axis=1) < FAR_M
        asked = np.flatnonzero(showing & near)
        seen.append(asked[_in_sight(eye, points[asked], scene.planes_world, scene.polygons_world)])
        first.append(first[-1] + len(seen[-1]))
    return VisibilityMap(
        places, cell.reshape(-1).astype(np.int64), eyes, points, directions, np.array(first, np.int64),
        np.concatenate([np.zeros(0, np.int64), *seen]), _axis(scene.edges.lines_world),
    )


def _eyes(places: Floats, cell: Ints, squares: Ints) -> Floats:
    """(c, 2) of the places of each square the one nearest to its middle: the middle itself may be beyond a wall."""
    away = np.sum((places - (squares[cell] + 0.5) * CELL_M) ** 2, axis=1)
    order = np.lexsort((away, cell))
    return np.asarray(places[order[np.searchsorted(cell[order], np.arange(len(squares)))]])


def _places(world: World, room: str) -> Floats:
    """(n, 2) points of a grid in the room's free space, and of its open doorways as far as their middle [m, world]."""
    sills = [d.thresholds_world.mean(axis=1)[:: 1 if d.between[0] == room else -1] for d in world.doorways_of(room)]
    in_doorways = np.array([point for own, other in sills for point in (own, 0.5 * (own + other))]).reshape(-1, 2)
    free = compute_free_space(world.outline(room), world.obstacles(room), ROOM_M)
    if free.is_empty:
        return in_doorways
    x0, y0, x1, y1 = (float(v) for v in free.bounds)
    xs = np.arange(math.ceil(x0 / STEP_M), math.floor(x1 / STEP_M) + 1) * STEP_M
    ys = np.arange(math.ceil(y0 / STEP_M), math.floor(y1 / STEP_M) + 1) * STEP_M
    grid = np.stack(np.meshgrid(xs, ys, indexing="ij"), axis=-1).reshape(-1, 2)
    shapely.prepare(free)
    return np.concatenate([grid[shapely.intersects_xy(free, grid[:, 0], grid[:, 1])], in_doorways])


def _axis(lines_world: Floats) -> float:
    """Direction of the level lines, weighted by length, modulo a right angle [rad]."""
    along = lines_world[:, 1] - lines_world[:, 0]
    level = np.abs(along[:, 2]) < 0.05 * np.maximum(np.linalg.norm(along, axis=1), 1e-9)
    turned = 4.0 * np.arctan2(along[level, 1], along[level, 0])
    weight = np.linalg.norm(along[level], axis=1)
    return math.atan2(float(np.sum(weight * np.sin(turned))), float(np.sum(weight * np.cos(turned)))) / 4.0


def _in_sight(eye: Floats, points: Floats, planes: Floats, polygons: Floats) -> NDArray[np.bool_]:
    """(n,) which points (n, 3) no surface, of those that face the eye, hides from it."""
    facing = planes[:, :3] @ eye - planes[:, 3] > 1e-6
    return np.asarray(_unhidden(eye, np.ascontiguousarray(points), planes[facing], polygons[facing]))


@njit(cache=True, error_model="numpy")
def _unhidden(eye: Any, points: Any, planes: Any, polygons: Any) -> Any:
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
            if below > -0.01:
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
