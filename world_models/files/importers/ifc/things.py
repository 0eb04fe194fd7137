"""Stairs, furniture and columns of an IFC file, as boxes, and which floors stairs join."""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import pairwise

import numpy as np
import shapely

from world_models.files.importers.ifc.shapes import Body
from world_models.files.importers.outlines import Floats
from world_models.files.importers.plan import Furnishing, Space
from world_models.files.importers.things import bounding_steps

STEPS = 8
"""Boxes that stand for a flight of stairs."""
REACH_M = 0.5
"""Stairs begin and end so near a floor, in height and on the plan."""
RAIL_M = 1.3
"""The shape of stairs may reach so far above where they end: their railing is part of it."""


def boxed(name: str, kind: str, room: str, body: Body) -> Furnishing:
    """The box round a thing, turned as its own frame is."""
    turn = math.atan2(body.frame[1, 0], body.frame[0, 0])
    c, s = math.cos(turn), math.sin(turn)
    own = body.world @ np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    low, high = own.min(axis=0), own.max(axis=0)
    middle = np.array([*((low + high) / 2)[:2], 0.0])
    at = np.array([[c, -s], [s, c]]) @ middle[:2]
    return Furnishing(name, kind, room, at, turn, bounding_steps(own - middle, 1))


def column(name: str, space: Space, hole: shapely.Polygon) -> Furnishing:
    """What stands in a hole of a floor, up to the ceiling."""
    corners = shapely.get_coordinates(hole.minimum_rotated_rectangle)[:-1]
    arm = corners[1] - corners[0]
    body = Body(np.array([(x, y, z) for x, y in corners for z in (space.floor_m, space.floor_m + space.height_m)]), (),
                np.eye(4)[:3])
    turn = math.atan2(arm[1], arm[0])
    c, s = math.cos(turn), math.sin(turn)
    frame = np.array([[c, -s, 0.0, 0.0], [s, c, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0]])
    return boxed(name, "column", space.name, Body(body.points @ frame[:, :3], (), frame))


def flight(name: str, room: str, points: Floats) -> Furnishing:
    """Stairs (n, 3) as steps."""
    centre = np.array([points[:, 0].min() + points[:, 0].max(), points[:, 1].min() + points[:, 1].max()]) / 2
    return Furnishing(name, "stairs", room, centre, 0.0, bounding_steps(points - np.array([*centre, 0.0]), STEPS))


def climbed(points: Floats, spaces: Sequence[Space]) -> list[tuple[Space, Space]]:
    """The pairs of spaces, lower first, of floors that follow each other, which stairs (n, 3) join; empty: none."""
    low, high = float(points[:, 2].min()), float(points[:, 2].max())
    shadow = shapely.MultiPoint(points[:, :2]).envelope
    ends = [_at(shadow, z, spaces) for z in (low, high)]
    if ends[0] is not None and ends[1] is not None and ends[0].storey != ends[1].storey:
        return [(ends[0], ends[1])]
    levels = sorted({round(s.floor_m, 1) for s in spaces if low - REACH_M < s.floor_m < high + REACH_M})
    found: list[Space] = []
    for level in levels:
        space = _at(shadow, level, spaces)
        if space is not None and space.storey not in {other.storey for other in found}:
            found.append(space)
    reaches = len(found) > 1 and high - found[-1].floor_m < RAIL_M and abs(low - found[0].floor_m) < REACH_M
    return list(pairwise(found)) if reaches else []


def _at(shadow: shapely.Geometry, z_m: float, spaces: Sequence[Space]) -> Space | None:
    """The space whose floor is at a height and whose outline holds most of a shadow, or is next to it."""
    level = [s for s in spaces if abs(s.floor_m - z_m) < REACH_M]
    shapes = {s.name: shapely.Polygon(s.outline) for s in level}
    near = [s for s in level if shapes[s.name].distance(shadow) < REACH_M]
    return max(near, key=lambda s: (round(shapes[s.name].intersection(shadow).area, 3),
                                    -shapes[s.name].distance(shadow)), default=None)
