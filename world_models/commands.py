"""Commands in plain words (§3.3): "Go from the laboratory to Allen's office" is (ptrans laboratory allens-office).

Rooms answer to the words of their name, their kind and their properties, such as an owner. Without coordinates a room
means the point in it that is furthest from walls and from what stands about.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence

import numpy as np

from world_models.building.memory_locales import words_of
from world_models.building.outlines import distance_to_border, inside_polygon
from world_models.building.world import World
from world_models.entries.location import Place
from world_models.ptrans import parse_ptrans

GO = re.compile(r"\s*(?:please\s+)?(?:go|drive|move|(?:bring|take|carry)\s+(?:this|it))"
                r"(?:\s+from\s+(?P<origin>.+?))?\s+to\s+(?P<destination>.+?)\s*[.!]?\s*", re.IGNORECASE)
FETCH = re.compile(r"\s*(?:please\s+)?(?:fetch|get)\s+(?P<what>.+?)\s*[.!]?\s*", re.IGNORECASE)
INSIDE = re.compile(r"(?P<room>.+?)\s+(?:in|of|on)\s+(?:the\s+)?(?P<within>.+)", re.IGNORECASE)
EMPTY = frozenset(("the", "a", "an", "of", "my"))
SHOWN = 6
GRID = 21
NUMBERS: Mapping[int, str] = {2: "two", 3: "three", 4: "four", 5: "five", 6: "six", 7: "seven", 8: "eight", 9: "nine"}


def check_command(text: str) -> None:
    """Raises ValueError where a text is no command that could be meant; which rooms there are is not asked."""
    if text.lstrip().startswith("("):
        parse_ptrans(text)
    else:
        _ends(text)


def parse_command(text: str, world: World) -> tuple[Place, Place]:
    """From where to where a command leads.

    Raises:
        ValueError: it is not understood, or no room, or more than one, answers to its words; says which.
    """
    if text.lstrip().startswith("("):
        places = parse_ptrans(text)
        for place in places:
            world.locale(place.locale)
        return places
    origin, destination = (find_room(words, world) for words in _ends(text))
    return find_open_point(world, origin), find_open_point(world, destination)


def _ends(text: str) -> tuple[str, str]:
    """The words for both ends of the way."""
    found = GO.fullmatch(text)
    if found is None and FETCH.fullmatch(text):
        raise ValueError(f"expected a way to go, got {text!r}: to fetch takes an arm, which this robot has not")
    if found is None:
        raise ValueError("expected a goal like (ptrans (locale (x,y,z)) (locale (x,y,z))), 'Go from ROOM to ROOM' or"
                         f" 'Bring this from ROOM to SOMEBODY', got {text!r}")
    if found["origin"] is None:
        raise ValueError(f"expected 'from' and the room where the robot stands, got {text!r}")
    return found["origin"], found["destination"]


def find_room(words: str, world: World) -> str:
    """The one room that answers to these words, as "Hanson's office in Engineering", where it is said in which part
    of the world. Raises ValueError where there is none, or more than one."""
    inside = INSIDE.fullmatch(words)
    within = _parts_named(inside["within"], world) if inside else []
    if inside and within:
        return _one_of(inside["room"], words, world, within)
    return _one_of(words, words, world, [world.root])


def _parts_named(words: str, world: World) -> list[str]:
    """The parts of the world, of more than one room, that answer to these words; of what is nested the smallest."""
    asked = " ".join(sorted(words_of(words) - EMPTY))
    found = [name for name in world.locale_source.named(asked) if not world.is_room(name)] if asked else []
    return [name for name in found if not any(name in world.path_of(other)[:-1] for other in found)]


def _one_of(asked_words: str, words: str, world: World, within: Sequence[str]) -> str:
    asked = " ".join(sorted(words_of(asked_words) - EMPTY))
    rooms = [name for name in world.locale_source.named(asked) if world.is_room(name)] if asked else []
    rooms = [name for name in rooms if set(within) & set(world.path_of(name))]
    exact = [name for name in rooms if words_of(name) == words_of(asked)]
    if len(exact) == 1:
        return exact[0]
    if len(rooms) == 1:
        return rooms[0]
    if not rooms:
        raise ValueError(f"no room of {world.name} answers to {words!r}")
    more = f" and {len(rooms) - SHOWN} more" if len(rooms) > SHOWN else ""
    raise ValueError(f"{NUMBERS.get(len(rooms), len(rooms))} rooms answer to {words!r}:"
                     f" {', '.join(rooms[:SHOWN])}{more}")


def find_open_point(world: World, room: str) -> Place:
    """The point of a grid over a room that is furthest from its walls and from what stands in it."""
    outline, solid = world.outline(room), world.obstacles(room)
    low, high = outline.min(axis=0), outline.max(axis=0)
    best, widest = outline.mean(axis=0), -1.0
    for x in np.linspace(low[0], high[0], GRID)[1:-1]:
        for y in np.linspace(low[1], high[1], GRID)[1:-1]:
            point = np.array([x, y])
            if inside_polygon(point, outline) and not any(inside_polygon(point, footprint) for footprint in solid):
                room_m = min(distance_to_border(point, border) for border in (outline, *solid))
                if room_m > widest + 1e-9:
                    best, widest = point, room_m
    return Place.of_world(world, room, float(best[0]), float(best[1]))
