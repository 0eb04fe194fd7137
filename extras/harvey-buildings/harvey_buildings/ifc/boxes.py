"""Boxes for the stairs, furniture and columns of an IFC file, and the spaces that stairs join."""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import pairwise

import numpy as np
import shapely

from harvey_buildings.building_plan import Furnishing, Space
from harvey_buildings.furnishings import build_bounding_boxes
from harvey_buildings.ifc.shapes import Body
from harvey_buildings.polygons import Floats

STAIR_BOXES = 8
"""Boxes of a flight of stairs."""
MAX_REACH_M = 0.5
"""Distance, in height and on the plan, within which stairs begin or end at a floor."""
MAX_RAIL_M = 1.3
"""How far the shape of stairs, with its railing, may reach above the upper floor."""


def build_box(name: str, kind: str, room: str, body: Body) -> Furnishing:
    """A thing as its bounding box in its own frame."""
    turn = math.atan2(body.frame[1, 0], body.frame[0, 0])
    c, s = math.cos(turn), math.sin(turn)
    own = body.world @ np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    low, high = own.min(axis=0), own.max(axis=0)
    middle = np.array([*((low + high) / 2)[:2], 0.0])
    at = np.array([[c, -s], [s, c]]) @ middle[:2]
    return Furnishing(name, kind, room, at, turn, build_bounding_boxes(own - middle, 1))


def build_column(name: str, space: Space, hole: shapely.Polygon) -> Furnishing:
    """A column from floor to ceiling in a hole of a floor."""
    corners = shapely.get_coordinates(hole.minimum_rotated_rectangle)[:-1]
    arm = corners[1] - corners[0]
    body = Body(np.array([(x, y, z) for x, y in corners for z in (space.floor_m, space.floor_m + space.height_m)]), (),
                np.eye(4)[:3])
    turn = math.atan2(arm[1], arm[0])
    c, s = math.cos(turn), math.sin(turn)
    frame = np.array([[c, -s, 0.0, 0.0], [s, c, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0]])
    return build_box(name, "column", space.name, Body(body.points @ frame[:, :3], (), frame))


def build_stairs(name: str, room: str, points: Floats) -> Furnishing:
    """Stairs with corners (n, 3) as a row of boxes."""
    centre = np.array([points[:, 0].min() + points[:, 0].max(), points[:, 1].min() + points[:, 1].max()]) / 2
    boxes = build_bounding_boxes(points - np.array([*centre, 0.0]), STAIR_BOXES)
    return Furnishing(name, "stairs", room, centre, 0.0, boxes)


def find_climbed_spaces(points: Floats, spaces: Sequence[Space]) -> list[tuple[Space, Space]]:
    """The pairs of spaces, lower first, of consecutive floors that stairs with corners (n, 3) join."""
    low, high = float(points[:, 2].min()), float(points[:, 2].max())
    footprint = shapely.MultiPoint(points[:, :2]).envelope
    ends = [_at(footprint, z, spaces) for z in (low, high)]
    if ends[0] is not None and ends[1] is not None and ends[0].storey != ends[1].storey:
        return [(ends[0], ends[1])]
    levels = sorted({round(s.floor_m, 1) for s in spaces if low - MAX_REACH_M < s.floor_m < high + MAX_REACH_M})
    found: list[Space] = []
    for level in levels:
        space = _at(footprint, level, spaces)
        if space is not None and space.storey not in {other.storey for other in found}:
            found.append(space)
    reaches = len(found) > 1 and high - found[-1].floor_m < MAX_RAIL_M and abs(low - found[0].floor_m) < MAX_REACH_M
    return list(pairwise(found)) if reaches else []


def _at(footprint: shapely.Geometry, z_m: float, spaces: Sequence[Space]) -> Space | None:
    """The space with its floor at a height whose outline holds most of a footprint, or is next to it."""
    level = [s for s in spaces if abs(s.floor_m - z_m) < MAX_REACH_M]
    shapes = {s.name: shapely.Polygon(s.outline) for s in level}
    near = [s for s in level if shapes[s.name].distance(footprint) < MAX_REACH_M]
    return max(near, key=lambda s: (round(shapes[s.name].intersection(footprint).area, 3),
                                    -shapes[s.name].distance(footprint)), default=None)
