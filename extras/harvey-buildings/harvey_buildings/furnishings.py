"""Furniture and stairs of a building file, fitted into the rooms that they stand in."""

from __future__ import annotations

import math
from dataclasses import replace
from itertools import pairwise

import numpy as np
import shapely

from harvey_buildings.building_plan import Furnishing, Space, Steps
from harvey_buildings.polygons import Floats

MAX_PUSH_M = 0.3
"""A thing that must be moved further is left out."""
MAX_PUSHES = 8
MIN_SIZE_M = 0.01
CLEARANCE_M = 2e-3
TRIM_M = 0.06
ROBOT_TOP_M = 1.4
"""A thing that begins higher is above the robot."""


def fit_into_room(thing: Furnishing, outline: Floats, space: Space) -> Furnishing | None:
    """The thing pushed out of walls and clipped to floor and ceiling; None where it does not fit."""
    boxes = tuple(kept for box in thing.boxes if (kept := _clip_to_room(box, space)) is not None)
    if not boxes:
        return None
    room = shapely.Polygon(outline).buffer(-CLEARANCE_M, join_style="mitre")
    return _push_inside(replace(thing, boxes=boxes), room) or _push_inside(replace(thing, boxes=_trim(boxes)), room)


def _trim(boxes: Steps) -> Steps:
    """The boxes without the outermost TRIM_M of their common bounds."""
    box = np.array(boxes)
    low, high = box[:, (0, 2)].min(axis=0) + TRIM_M, box[:, (1, 3)].max(axis=0) - TRIM_M
    cut = np.column_stack([np.clip(box[:, :2], low[0], high[0]), np.clip(box[:, 2:4], low[1], high[1]), box[:, 4:]])
    kept = [row for row in cut.tolist() if min(row[1] - row[0], row[3] - row[2]) >= MIN_SIZE_M]
    return tuple((x0, x1, y0, y1, z0, z1) for x0, x1, y0, y1, z0, z1 in kept)


def _push_inside(thing: Furnishing, room: shapely.Geometry) -> Furnishing | None:
    """The thing pushed into the room; None where it would move more than MAX_PUSH_M."""
    if not thing.boxes:
        return None
    at = np.round(thing.at, 4)
    for _ in range(MAX_PUSHES):
        corners = _corners(replace(thing, at=at))
        outside = [c for c in corners if not shapely.Point(c).within(room)]
        if not outside:
            return replace(thing, at=at)
        pushes = [shapely.get_coordinates(shapely.shortest_line(shapely.Point(c), room)) for c in outside]
        deepest = max((p[-1] - p[0] for p in pushes), key=lambda push: float(np.linalg.norm(push)))
        at = np.round(at + deepest + 1e-3 * np.sign(deepest) * (np.abs(deepest) > 1e-9), 4)
        if float(np.linalg.norm(at - thing.at)) > MAX_PUSH_M:
            return None
    return None


def _corners(thing: Furnishing) -> list[Floats]:
    """The four corners (2,) of its bounding rectangle on the plan [m]."""
    box = np.array(thing.boxes)
    c, s = math.cos(thing.turn_rad), math.sin(thing.turn_rad)
    turn = np.array([[c, -s], [s, c]])
    xs, ys = (box[:, 0].min(), box[:, 1].max()), (box[:, 2].min(), box[:, 3].max())
    return [thing.at + turn @ np.array([x, y]) for x in xs for y in ys]


def footprint(thing: Furnishing) -> Floats:
    """(4, 2) its bounding rectangle on the plan [m]."""
    a, b, d, c = _corners(thing)
    return np.array([a, b, c, d])


def is_obstacle(thing: Furnishing) -> bool:
    """Whether a robot could hit it; stairs do not count."""
    return thing.kind != "stairs" and bottom_m(thing) < ROBOT_TOP_M


def bottom_m(thing: Furnishing) -> float:
    """Height of its lowest box above the floor [m], once it is fitted into its room."""
    return min(box[4] for box in thing.boxes)


def _clip_to_room(box: tuple[float, ...], space: Space) -> tuple[float, float, float, float, float, float] | None:
    """A box clipped to the room's height, with z above its floor; None where nothing is left."""
    x0, x1, y0, y1, z0, z1 = box
    low, high = max(0.0, z0 - space.floor_m), min(space.height_m - CLEARANCE_M, z1 - space.floor_m)
    if min(x1 - x0, y1 - y0, high - low) < MIN_SIZE_M:
        return None
    return x0, x1, y0, y1, 0.0 if low < 0.03 else low, high


def build_bounding_boxes(points: Floats, steps: int) -> Steps:
    """Bounding boxes of points (n, 3) in a thing's own frame: one, or one for each part of its longer side."""
    low, high = points.min(axis=0), points.max(axis=0)
    if steps == 1:
        return ((low[0], high[0], low[1], high[1], low[2], high[2]),)
    axis = int(high[1] - low[1] > high[0] - low[0])
    marks = np.linspace(low[axis], high[axis], steps + 1)
    boxes = []
    for start, end in pairwise(marks):
        inside = points[(points[:, axis] >= start - 1e-6) & (points[:, axis] <= end + 1e-6)]
        top = float(inside[:, 2].max()) if len(inside) else float(low[2])
        if top - low[2] > MIN_SIZE_M:
            x = (start, end) if axis == 0 else (low[0], high[0])
            y = (start, end) if axis == 1 else (low[1], high[1])
            boxes.append((float(x[0]), float(x[1]), float(y[0]), float(y[1]), float(low[2]), top))
    return tuple(boxes)
