"""A way that is told within a task: what the words name on it becomes places to come by, one after the other.

Each is a goal of its own, so the milestone that is verified there is the perceptual event that the words name. A way
that may lead to more than one place, or that the building does not have, is asked about.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace

from harvey_words.directions.way_commands import name_end
from harvey_words.following.reading import Reading, read_route
from harvey_words.following.word_map import WordMap
from harvey_words.tasks.task_entries import Step
from harvey_words.tasks.task_words import TaskWordsError
from world_models.building.locale_frame import LocaleFrame
from world_models.building.world import World
from world_models.commands import find_open_point
from world_models.entries import Place
from world_models.frame_building import FrameBuilding

MOST_ROOMS = 200
"""A way is told within the largest part of a building that has no more rooms."""
APART_M = 1.0
"""Places on a way that are nearer to each other are one."""


def read_way(building: FrameBuilding, text: str, here: Place) -> list[Step]:
    """The places that a way leads by, and its end.

    Args:
        here: where it begins; which way the body faces is known where that place says so.

    Raises:
        TaskWordsError: it is not sure where the way leads; names the likeliest places and what did not fit.
        MissingEntryError: frames of the building are needed.
    """
    parts = ((name, tuple(list_rooms(building, name))) for name in building.path_of(here.locale)[:-1])
    part, rooms = next((name, rooms) for name, rooms in parts if len(rooms) <= MOST_ROOMS)
    building.require(rooms)
    plan = building.cached("words", 1, part, lambda: WordMap(_take_part(building, part, rooms)))
    begin = here.in_world(building)
    facing = None if here.heading_rad is None else math.degrees(begin.heading_rad)
    reading = read_route(text, plan, begin.position.tolist(), facing)
    if reading.end is None or not reading.is_understood:
        raise TaskWordsError(_ask(text, reading))
    end, places, last = reading.end, list[tuple[str, float, float, str]](), begin.position.tolist()
    for stop in end.way[:-1]:
        is_only_door = len(building.doorways_of(here.locale)) == 1 and not places
        if not is_only_door and min(math.dist(last, stop[1:3]), math.dist((end.x_m, end.y_m), stop[1:3])) > APART_M:
            places.append(stop)
            last = stop[1:3]
    steps = [Step("ptrans", place=Place.of_world(building, locale, x, y), mark=mark) for locale, x, y, mark in places]
    goal = (Place.of_world(building, end.locale, end.x_m, end.y_m) if plan.areas[end.locale].is_hall
            else find_open_point(building, end.locale))
    sure = f"{end.odds:.0%} sure of the words"
    return [*steps, Step("ptrans", text.strip(" ."), place=goal, mark=end.door, note=sure)]


def _ask(text: str, reading: Reading) -> str:
    likely = " or ".join(f"{name_end(end)} ({end.odds:.0%})" for end in reading.ends[:3])
    unfit = "".join(f"; {phrase!r} does not fit" for phrase in reading.unused)
    return f"expected a way to one place, got {text.strip(' .')!r}: it may lead to {likely or 'any place'}{unfit}"


def list_rooms(building: FrameBuilding, container: str) -> Iterator[str]:
    """The rooms in a container; only the frames of containers are read."""
    for child in building.frame(container).children:
        yield from [child.name] if child.is_room else list_rooms(building, child.name)


def _take_part(building: FrameBuilding, part: str, rooms: tuple[str, ...]) -> World:
    """A part of a building as a world of its own, with the doors between its rooms."""
    def cut(name: str) -> LocaleFrame:
        frame = building.frame(name)
        inner = tuple(door for door in frame.doorways if set(door.between) <= set(rooms))
        return replace(frame, doorways=inner, links=(), memo={})

    root = building.frame(part)
    top = replace(root.locale, parent=None, frame=building.world_from_locale(part))
    return World({part: replace(root, locale=top, memo={}), **{
        name: cut(name) for room in rooms for name in building.path_of(room) if name not in building.path_of(part)}})
