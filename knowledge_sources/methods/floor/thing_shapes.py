"""Shapes of things on the floor: what was seen of one, what it may take behind that, and how two sights are joined.

From far away what hangs over the floor seems to stand on it further off, and things that stand behind one another seem
to be one. So of two sights the one from clearly nearer tells the shape.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
import shapely

from knowledge_sources.methods.arrays import Floats
from knowledge_sources.methods.floor.footprints import (
    build_polygon,
    join_footprints,
    list_corners,
    measure_common_directions,
    take_free,
)
from world_models.entries import Corners, Obstacle

NEARER = 0.7
"""A sight from less than this part of the distance of another is from clearly nearer."""
MIN_COMMON_DIRECTIONS = 0.6
"""A sight without feet tells nothing new where this part of its directions is that of what is known."""
REACH_M = 10.0
"""No thing is further off than this when it is seen."""
CORE_PART = 0.9
"""Where more of a thing than this part was seen, all of it counts as seen."""


class ThingShape(NamedTuple):
    """What is known of the shape of a thing [m, world].

    Attributes:
        seen: what was seen of it; whole: with what it may take besides.
        from_m: from how near it was seen; infinite where its feet were not.
    """

    seen: shapely.Geometry
    whole: shapely.Geometry
    from_m: float

    @staticmethod
    def of(obstacle: Obstacle) -> ThingShape:
        seen, whole = (build_polygon(corners) for corners in (obstacle.core or obstacle.footprint, obstacle.footprint))
        return ThingShape(seen, whole, obstacle.seen_from_m)

    def list_corners(self) -> tuple[Corners, Corners]:
        """Of the whole, and of what was seen; () for the latter where it is about all."""
        footprint = list_corners(self.whole)
        if not footprint:
            return (), ()
        whole = build_polygon(footprint)
        core = shapely.intersection(whole, self.seen)
        return footprint, list_corners(core) if 0.0 < core.area < CORE_PART * whole.area else ()


def join_shapes(known: ThingShape, new: ThingShape, free: shapely.Geometry, eye: Floats) -> ThingShape:
    """The shape of a thing by what is known and by a new sight from an ``eye`` (2,), which shows some floor ``free``.

    A sight of which the feet are not seen tells only in which directions the thing is: it adds to what is known in
    directions in which nothing was known.
    """
    if new.from_m < NEARER * known.from_m:
        behind = _build_sector(new.seen, eye)
        seen, whole = (take_free(shapely.difference(shape, behind), free) for shape in (known.seen, known.whole))
        return ThingShape(_join(new.seen, seen), _join(new.whole, whole), new.from_m)
    if not math.isfinite(new.from_m):
        if measure_common_directions(known.seen, new.seen, eye) >= MIN_COMMON_DIRECTIONS:
            return leave_free(known, free)
    elif NEARER * new.from_m > known.from_m:
        return known
    seen = join_footprints(known.seen, new.seen, free)
    return ThingShape(seen, _join(join_footprints(known.whole, new.whole, free), seen), min(known.from_m, new.from_m))


def leave_free(known: ThingShape, free: shapely.Geometry) -> ThingShape:
    """What is left of a shape without the floor that is seen to be free."""
    return ThingShape(take_free(known.seen, free), take_free(known.whole, free), known.from_m)


def _build_sector(shape: shapely.Geometry, eye: Floats) -> shapely.Geometry:
    """All in the directions of a shape from an eye."""
    to = shapely.get_coordinates(shape) - eye
    rim = eye + REACH_M * to / np.maximum(np.linalg.norm(to, axis=1, keepdims=True), 1e-9)
    return shapely.convex_hull(shapely.multipoints(np.vstack([eye, rim])))


def _join(one: shapely.Geometry, other: shapely.Geometry) -> shapely.Geometry:
    return shapely.convex_hull(shapely.union(one, other))
