"""Commands in plain words (§3.3): "Go from the laboratory to Allen's office" is (ptrans laboratory allens-office).

Rooms answer to the words of their name, their kind and their properties, such as an owner. A room without coordinates
means the point in it with the largest clearance from walls and obstacles.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from difflib import get_close_matches

import numpy as np

from world_models.building.building import Building
from world_models.building.geometry.outlines import distance_to_border, inside_polygon
from world_models.building.world import World, words_of
from world_models.entries.location import Place
from world_models.units import FOOT_M

MAX_COORDINATE_FT = 1e6
MOST_LETTERS = 1_000
"""Of a command: nobody says more in a sentence."""
_NUMBER = r"\s*([-+]?[0-9]+(?:\.[0-9]*)?)\s*"
_PLACE = rf"\(\s*([\w'-]+)\s+\({_NUMBER},{_NUMBER},{_NUMBER}\)\s*\)"
_DESTINATION = re.compile(rf"\s*{_PLACE}\s*")
_GOAL = re.compile(rf"\s*\(\s*ptrans\s+{_PLACE}\s*{_PLACE}\s*\)\s*")


def parse_ptrans(text: str) -> tuple[Place, Place]:
    """Origin and destination; coordinates are feet in each locale's own frame, and z is 0, the floor.

    Raises:
        ValueError: the text has another form, z is not 0, or a coordinate is above MAX_COORDINATE_FT.
    """
    match = _GOAL.fullmatch(text)
    if match is None:
        raise ValueError(f"expected a goal like (ptrans (locale (x,y,z)) (locale (x,y,z))), got {text!r}")
    a, ax, ay, az, b, bx, by, bz = match.groups()
    return _place(a, ax, ay, az), _place(b, bx, by, bz)


def parse_place(text: str) -> Place:
    """One place, as ``(library (6,10,0))``. Raises ValueError as :func:`parse_ptrans` does."""
    match = _DESTINATION.fullmatch(text)
    if match is None:
        raise ValueError(f"expected a place like (library (6,10,0)), got {text!r}")
    locale, x, y, z = match.groups()
    return _place(locale, x, y, z)


def _place(locale: str, x: str, y: str, z: str) -> Place:
    if float(z) != 0.0:
        raise ValueError(f"expected z = 0, the floor of {locale}, got {z}")
    if max(abs(float(x)), abs(float(y))) > MAX_COORDINATE_FT:
        raise ValueError(f"expected coordinates of at most {MAX_COORDINATE_FT:g} ft, got ({x}, {y})")
    return Place(locale, float(x) * FOOT_M, float(y) * FOOT_M)


GO = re.compile(r"\s*(?:please\s+)?(?:go|drive|move|(?:bring|take|carry)\s+(?:this|it))"
                r"(?:\s+from\s+(?P<origin>.+?))?\s+to\s+(?P<destination>.+?)\s*[.!]?\s*", re.IGNORECASE)
INSIDE = re.compile(r"(?P<room>.+?)\s+(?:in|of|on)\s+(?:the\s+)?(?P<within>.+)", re.IGNORECASE)
STOP_WORDS = frozenset(("the", "a", "an", "of", "my"))
MAX_NAMED = 6
"""An error names at most so many rooms."""
GRID_POINTS = 21
"""Grid points along each axis of a room in the search for its open point."""
NUMBERS: Mapping[int, str] = {2: "two", 3: "three", 4: "four", 5: "five", 6: "six", 7: "seven", 8: "eight", 9: "nine"}


def check_command(text: str) -> None:
    """Raises ValueError for a text that is no command in any world."""
    if len(text) > MOST_LETTERS:
        raise ValueError(f"expected at most {MOST_LETTERS} letters, got {len(text)}")
    if text.lstrip().startswith("("):
        parse_ptrans(text)
    else:
        _parse_ends(text)


def read_places(
    text: str, building: Building, find_rooms: Callable[[tuple[str, ...]], Sequence[str]]
) -> tuple[Place, Place]:
    """Origin and destination of a command, in plain words or as ptrans.

    Args:
        find_rooms: the one room that answers to each phrase; raises ValueError where none, or more than one, does.

    Raises:
        ValueError: the text is not understood, or no room, or more than one, answers to its words.
    """
    if text.lstrip().startswith("("):
        places = parse_ptrans(text)
        for place in places:
            building.locale(place.locale)
        return places
    origin, destination = find_rooms(_parse_ends(text))
    return find_open_point(building, origin), find_open_point(building, destination)


def parse_command(text: str, world: World) -> tuple[Place, Place]:
    """Origin and destination of a command in a world that is known whole. Raises ValueError."""
    return read_places(text, world, lambda phrases: [find_room(words, world) for words in phrases])


def check_destination(text: str) -> None:
    """Raises ValueError for a text that is no destination in any world."""
    if len(text) > MOST_LETTERS:
        raise ValueError(f"expected at most {MOST_LETTERS} letters, got {len(text)}")
    if text.lstrip().startswith("("):
        parse_place(text)
    else:
        _parse_destination(text)


def read_destination(text: str, building: Building, find_rooms: Callable[[tuple[str, ...]], Sequence[str]]) -> Place:
    """The place where a robot that is on its way is to go instead: "Go to the library", "library", or a place in feet.

    Raises:
        ValueError: as :func:`read_places` does.
    """
    if text.lstrip().startswith("("):
        place = parse_place(text)
        building.locale(place.locale)
        return place
    (room,) = find_rooms((_parse_destination(text),))
    return find_open_point(building, room)


def parse_destination(text: str, world: World) -> Place:
    """The same in a world that is known whole. Raises ValueError."""
    return read_destination(text, world, lambda phrases: [find_room(words, world) for words in phrases])


def _parse_destination(text: str) -> str:
    """The words for the room. Raises ValueError."""
    match = GO.fullmatch(text)
    if match is not None and match["origin"] is not None:
        raise ValueError(f"expected 'Go to ROOM', as the robot goes from where it is, got {text!r}")
    words = match["destination"] if match is not None else text.strip(" .!")
    if not words_of(words) - STOP_WORDS:
        raise ValueError(f"expected a room, as in 'Go to the library', got {text!r}")
    return words


def _parse_ends(text: str) -> tuple[str, str]:
    """The words for origin and destination. Raises ValueError."""
    match = GO.fullmatch(text)
    if match is None:
        raise ValueError("expected a goal like (ptrans (locale (x,y,z)) (locale (x,y,z))), 'Go from ROOM to ROOM' or"
                         f" 'Bring this from ROOM to SOMEBODY', got {text!r}")
    if match["origin"] is None:
        raise ValueError(f"expected 'from' and the room where the robot stands, got {text!r}")
    return match["origin"], match["destination"]


def find_room(words: str, world: World) -> str:
    """The one room that answers to words such as "Hanson's office" or "Hanson's office in Engineering".

    Raises:
        ValueError: no room, or more than one, answers.
    """
    inside = INSIDE.fullmatch(words)
    containers = _find_containers(inside["within"], world) if inside else []
    if inside and containers:
        return _find_room_in(inside["room"], words, world, containers)
    return _find_room_in(words, words, world, [world.root])


def _find_containers(words: str, world: World) -> list[str]:
    """The locales with rooms in them that answer to these words; of nested ones the innermost."""
    names = [name for name in _find_named(words, world) if not world.is_room(name)]
    return [name for name in names if not any(name in world.path_of(other)[:-1] for other in names)]


def _find_named(words: str, world: World) -> Sequence[str]:
    """The locales that answer to all of these words but stop words; none where there are no others."""
    asked = " ".join(sorted(words_of(words) - STOP_WORDS))
    return world.named(asked) if asked else ()


def _find_room_in(room_words: str, words: str, world: World, containers: Sequence[str]) -> str:
    """The one room in one of the containers that answers to ``room_words``; ``words`` are for the error."""
    rooms = [name for name in _find_named(room_words, world)
             if world.is_room(name) and set(containers) & set(world.path_of(name))]
    exact = [name for name in rooms if words_of(name) == words_of(room_words) - STOP_WORDS]
    if len(exact) == 1:
        return exact[0]
    if len(rooms) == 1:
        return rooms[0]
    if not rooms:
        near = get_close_matches("-".join(sorted(words_of(words) - STOP_WORDS)), world.rooms, 3)
        nearest = f"; the nearest are {' and '.join(near)}" if near else ""
        raise ValueError(f"no room of {world.name} answers to {words!r}{nearest}")
    more = f" and {len(rooms) - MAX_NAMED} more" if len(rooms) > MAX_NAMED else ""
    raise ValueError(f"{NUMBERS.get(len(rooms), len(rooms))} rooms answer to {words!r}:"
                     f" {', '.join(rooms[:MAX_NAMED])}{more}")


def find_open_point(building: Building, room: str) -> Place:
    """The point of a grid over a room with the largest clearance from walls and obstacles."""
    outline, obstacles = building.outline(room), building.obstacles(room)
    low, high = outline.min(axis=0), outline.max(axis=0)
    best, best_clearance_m = outline.mean(axis=0), -1.0
    for x in np.linspace(low[0], high[0], GRID_POINTS)[1:-1]:
        for y in np.linspace(low[1], high[1], GRID_POINTS)[1:-1]:
            point = np.array([x, y])
            if inside_polygon(point, outline) and not any(inside_polygon(point, footprint) for footprint in obstacles):
                clearance_m = min(distance_to_border(point, border) for border in (outline, *obstacles))
                if clearance_m > best_clearance_m + 1e-9:
                    best, best_clearance_m = point, clearance_m
    return Place.of_world(building, room, float(best[0]), float(best[1]))
