"""What keeps its place in the picture, and would have to move on the floor for that: it is before the camera (§4)."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import shapely

from knowledge_sources.methods.floor.footprints import build_polygon
from world_models.camera import Camera
from world_models.entries import FloorThing, Obstruction

MAX_FIXED_LOOKS = 2  # so many earlier looks tell enough
MAX_ABSENT_LOOKS = 4  # what so many of the last looks do not show at its place was not there
FIXED_PX = 6.0  # sides that are no further apart are one: the floor is looked at every second pixel
BORDER_PX = 4.0  # a side so near to the picture's border tells nothing; nor does the upper one: there the floor ends
MIN_MOVED_M = 0.3  # so far it would have moved on the floor from each look to each other one
MIN_HIDDEN = 0.8  # least part of a box within an obstruction, by which what was seen in it is of that
ROUND_PX = 8.0  # so far round an obstruction it may reach: its outline is not known better

Box = tuple[float, float, float, float]


def find_fixed(thing: FloorThing, earlier: Iterable[Sequence[FloorThing]], camera: Camera) -> dict[int, Box]:
    """The boxes in earlier looks (the newest first), by their numbers, that show a thing at the same place of the
    picture and elsewhere on the floor.
    """
    found, places, absent = dict[int, Box](), [build_polygon(thing.footprint).centroid], 0
    for number, things in enumerate(earlier):
        alike = [one for one in things if _is_same(one.box_px, thing.box_px, camera)]
        absent += not alike
        for same in alike:
            place = build_polygon(same.footprint).centroid
            if number not in found and min(shapely.distance(place, places)) >= MIN_MOVED_M:
                found[number] = same.box_px
                places.append(place)
        if len(found) == MAX_FIXED_LOOKS or absent == MAX_ABSENT_LOOKS:
            break
    return found


def enclose(boxes: Sequence[Box], known: Obstruction | None) -> Obstruction:
    """The obstruction that takes all of the boxes, and what is known of it."""
    corners = [(u, v) for left, top, right, bottom in boxes for u in (left, right) for v in (top, bottom)]
    whole = build_polygon([*corners, *(() if known is None else known.outline_px)])
    return Obstruction(tuple((float(u), float(v)) for u, v in shapely.get_coordinates(whole)[:-1]))


def is_behind(box: Box, obstruction: Obstruction) -> bool:
    """Whether a box of the picture lies within what is before the camera."""
    left, top, right, bottom = box
    across = [[(left, top), (right, bottom)], [(left, bottom), (right, top)]]
    return bool(obstruction.hidden_part(across, ROUND_PX).mean() >= MIN_HIDDEN)


def _is_same(box: Box, now: Box, camera: Camera) -> bool:
    """Whether two boxes have all sides in common that tell anything, two at least."""
    off_px = [abs(box[i] - now[i]) for i, end in ((0, camera.width), (2, camera.width), (3, camera.height))
              if BORDER_PX < now[i] < end - BORDER_PX]
    return len(off_px) >= 2 and max(off_px) <= FIXED_PX
