"""What keeps its place in the picture while it would have to move on the floor: it is on the lens, or before it (§4)."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np
import shapely

from knowledge_sources.methods.motion.footprints import build_polygon
from world_models.camera import Camera
from world_models.entries.floor import FloorThing
from world_models.entries.obstacle import Obstruction

MIN_FIXED_LOOKS = 3  # in two looks something may be at one place of the picture by chance
FIXED_PX = 6.0  # sides that are no further apart are one: the floor is looked at every second pixel
BORDER_PX = 4.0  # a side so near to the picture's border tells nothing
MIN_FIXED_SIDES = 2  # fewest sides that tell: the upper one never does, as there the floor ends
MIN_MOVED_M = 0.3  # so far it would have moved on the floor from each look to each other one
MIN_HIDDEN = 0.8  # least part of a box within an obstruction, by which what was seen in it is of that
ROUND_PX = 8.0  # so far round an obstruction it may reach: its outline is not known better

Box = tuple[float, float, float, float]


def find_fixed(thing: FloorThing, earlier: Iterable[tuple[FloorThing, ...]], camera: Camera) -> list[tuple[int, Box]]:
    """The earlier looks (their numbers), with the boxes in them, that show a thing at the same place of the picture and
    elsewhere on the floor; none where they are too few.

    Args:
        earlier: the things in each earlier look, the newest first.
    """
    found: list[tuple[int, Box]] = []
    places = [_find_middle(thing)]
    for number, things in enumerate(earlier):
        same = next((one for one in things if _is_same(one.box_px, thing.box_px, camera)), None)
        if same is not None and min(shapely.distance(_find_middle(same), places)) >= MIN_MOVED_M:
            found.append((number, same.box_px))
            places.append(_find_middle(same))
        if len(places) == MIN_FIXED_LOOKS:
            return found
    return []


def enclose(boxes: Sequence[Box], known: Obstruction | None) -> Obstruction:
    """The obstruction that takes all of the boxes, and what is known of it where that is beside them."""
    whole = shapely.box(*np.min(boxes, axis=0)[:2], *np.max(boxes, axis=0)[2:])
    if known is not None and shapely.distance(whole, build_polygon(known.outline_px)) <= ROUND_PX:
        whole = shapely.convex_hull(shapely.union(whole, build_polygon(known.outline_px)))
    return Obstruction(tuple((float(u), float(v)) for u, v in shapely.get_coordinates(whole)[:-1]))


def is_behind(box: Box, obstruction: Obstruction) -> bool:
    """Whether a box of the picture lies within what is before the camera."""
    left, top, right, bottom = box
    points = np.stack(np.meshgrid(np.linspace(left, right, 9), np.linspace(top, bottom, 9)), axis=-1)
    return bool(np.mean(obstruction.covers(points, ROUND_PX)) >= MIN_HIDDEN)


def _is_same(box: Box, now: Box, camera: Camera) -> bool:
    """Whether two boxes have all sides in common that tell anything."""
    most = camera.width - 1.0, camera.height - 1.0
    telling = [abs(box[i] - now[i]) for i, end in ((0, most[0]), (2, most[0]), (3, most[1]))
               if BORDER_PX < now[i] < end - BORDER_PX]
    return len(telling) >= MIN_FIXED_SIDES and max(telling) <= FIXED_PX


def _find_middle(thing: FloorThing) -> shapely.Point:
    return shapely.Point(np.mean(thing.footprint, axis=0))
