"""Is a thing whose feet are not seen the jamb of a door that stands a little beside its place in the model (§4)?

A model is right to centimetres, and a wall's end that reaches into the model's opening looks like a thing there. So a
sight in the directions of such an end alone is that end, and not anything from there to the robot's rim.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import shapely

from knowledge_sources.methods.arrays import Floats
from knowledge_sources.methods.motion.footprints import build_polygon, measure_common_directions
from world_models.building.building import Building
from world_models.building.locales import Doorway

MAX_BESIDE_M = 0.15  # a jamb stands at most so far beside: 10 cm, with its casing
MIN_EXPLAINED = 0.8  # least part of the directions of a sight that such a jamb explains


class JambBeside(NamedTuple):
    """The door, and the end of its wall that is seen in its opening (on the floor, world)."""

    door: str
    shape: shapely.Polygon


def find_jamb_beside(
    world: Building, locale: str, seen: shapely.Polygon, eye: tuple[float, float]
) -> JambBeside | None:
    """The jamb of a door of a room that explains a sight without feet, by that end of its wall alone; None: none does.

    Args:
        seen: what is seen of the thing, on the floor: its foot is no further from the ``eye`` than that.
    """
    at = np.array(eye)
    reach_m = float(np.linalg.norm(shapely.get_coordinates(seen) - at, axis=1).max())
    best: tuple[float, JambBeside] | None = None
    for doorway in world.doorways_of(locale):
        for end in _list_ends(doorway, locale):
            if end.distance(shapely.Point(at)) > reach_m or end.buffer(MAX_BESIDE_M).contains(shapely.Point(at)):
                continue
            part = measure_common_directions(end, seen, at)
            if part >= MIN_EXPLAINED and (best is None or part > best[0]):
                best = part, JambBeside(doorway.name, _cut_to(end, seen, at))
    return None if best is None else best[1]


def _list_ends(doorway: Doorway, locale: str) -> list[shapely.Polygon]:
    """Both ends of the wall, as far as they may reach into an opening, through the wall."""
    near, far = doorway.threshold_of(locale), doorway.threshold_of(doorway.other(locale))[::-1]
    into = MAX_BESIDE_M / doorway.width_m * (near[1] - near[0])
    return [build_polygon([a, a + step, b + step, b])
            for a, b, step in ((near[0], far[0], into), (near[1], far[1], -into))]


def _cut_to(end: shapely.Polygon, seen: shapely.Polygon, at: Floats) -> shapely.Polygon:
    """The part of a wall's end that lies in the directions of what is seen; all of it where that is nothing."""
    away = shapely.get_coordinates(seen)[:-1] - at
    far_m = 2.0 * float(np.linalg.norm(shapely.get_coordinates(end) - at, axis=1).max())
    rim = at + far_m * away / np.maximum(np.linalg.norm(away, axis=1, keepdims=True), 1e-9)
    part = shapely.intersection(end, build_polygon(np.concatenate([rim, at[None]])))
    return build_polygon(shapely.get_coordinates(end if part.is_empty else part))
