"""The doors that a picture may show, and what somebody says of doors and things; for several knowledge sources."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np
import shapely

from blackboard import Entry, View
from knowledge_sources.methods.doors import MAX_TOUCH_M, is_in_view
from knowledge_sources.methods.floor import build_polygon, contradicts, may_be_there
from knowledge_sources.reads.questions import find_frames, find_robot_in
from world_models.building.locale_frame import FrameChange, LocaleFrame
from world_models.building.locales import Doorway
from world_models.entries import BELIEVED, KNOWN, DoorState, Hypothesis, Obstacle, UserReport
from world_models.frame_building import FrameBuilding

MAX_SIGMA_M = 0.1  # largest standard deviation of the robot's place when it judges a door
MAX_SIGMA_RAD = 0.035  # largest standard deviation of its heading when it does

Frames = tuple[Entry[LocaleFrame], ...]


class Watched(NamedTuple):
    """A doorway in view, and whether it is believed to be shut."""

    doorway: Doorway
    is_shut: bool


def list_doors_in_view(view: View, belief: Hypothesis) -> Iterator[Watched]:
    """The doorways of the robot's room that a picture may show."""
    robot = find_robot_in(view, belief.locale)
    pose = belief.world_from_robot(robot.world)
    for frame in find_frames(view, (belief.locale,)):
        doors = [Watched(doorway, is_shut=False) for doorway in frame.value.doorways]
        doors += [Watched(doorway, is_shut=True) for doorway in frame.value.shut_doorways]
        yield from (w for w in doors if is_in_view(robot, pose, w.doorway, belief.locale))


def list_filed_doors(view: View) -> dict[str, Doorway]:
    """The doorways of the frames on the board, as the file has them, by name."""
    frames = (entry.value for entry in view.all(LocaleFrame))
    return {door.name: door for frame in frames for door in (frame.filed or frame).doorways}


def find_before_door(view: View, doorway: Doorway, locale: str) -> shapely.Geometry:
    """The floor of what may stand in a room before a doorway and hide it [m, world]; what is in it may be its leaf."""
    opening = shapely.MultiPoint(np.concatenate(doorway.thresholds_world)).convex_hull
    found = view.where(Obstacle, lambda thing: thing.locale == locale and may_be_there(thing))
    polygons = [(build_polygon(entry.value.footprint), MAX_TOUCH_M + 2.0 * entry.value.sigma_m) for entry in found]
    return shapely.union_all([polygon for polygon, least_m in polygons if polygon.distance(opening) > least_m])


def find_door_state(view: View, door: str) -> Entry[DoorState] | None:
    """What is known of a door."""
    return view.latest(DoorState, lambda state: state.door == door)


def with_door_open(view: View, door: str, frames: Frames) -> FrameBuilding:
    """The building as it would be known if a door were open that is believed to be shut."""
    return FrameBuilding(view, [entry.value.restored("shut", door) for entry in frames])


def with_door_shut(view: View, door: str, frames: Frames) -> FrameBuilding:
    """The building as it would be known if a door were shut that is believed to be open."""
    return FrameBuilding(view, [entry.value.changed(FrameChange("shut", door, "")) for entry in frames])


def list_contradicted(view: View, frames: Sequence[LocaleFrame]) -> tuple[Entry[UserReport], ...]:
    """What somebody said last of a door or a thing, and was taken up, where frames say otherwise."""
    newest = {entry.value.what: entry for entry in view.all(UserReport)}
    return tuple(entry for entry in newest.values() if entry.value.answer in (BELIEVED, KNOWN)
                 and any(contradicts(frame, entry.value, entry.author) for frame in frames))
