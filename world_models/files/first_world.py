"""The text of a first world file, for people to change: rooms along a corridor, with doors and landmarks."""

from __future__ import annotations

import re
from collections.abc import Sequence

ROOM_M, CORRIDOR_M = (4.0, 3.6), (4.5, 1.8)
"""Width and depth of a room; length of the corridor before each room, and its width. Measure yours instead."""
WALL_M = 0.15
MAX_ROOMS = 20
NAME = re.compile(r"[a-z][a-z0-9]*(-[a-z0-9]+)*")
CORRIDOR = "corridor"

HEAD = """\
# {name}: a first world to change. Check it after each change: harvey world check {name}.toml
# Metres. A room's origin is its south-west corner, x goes to the east, y to the north; "at" is its place.
name = "{name}"
units = "metres"

# Materials: red, green, blue in 0..1. What differs clearly from its wall is a landmark.
[finishes]
plaster = {{ colour = [0.80, 0.77, 0.68] }}
floor = {{ colour = [0.46, 0.42, 0.38] }}
white = {{ colour = [0.92, 0.91, 0.88] }}
wood = {{ colour = [0.50, 0.34, 0.20] }}
dark = {{ colour = [0.16, 0.16, 0.18] }}
blue = {{ colour = [0.18, 0.28, 0.48] }}
rust = {{ colour = [0.58, 0.26, 0.16] }}

# What each room has unless it says otherwise.
[defaults]
height = 2.6
walls = "plaster"
floor = "floor"
ceiling = "white"
baseboard = "dark"
frame = "wood"
leaf = "wood"
door_width = 0.9
door_height = 2.05

# Things that hang or stand on walls, as boxes: x to the right as you stand with your back to the wall, y off the wall,
# z up. The robot finds its place by their edges: put in what is large, fixed and has clear edges.
[parts]
notice = [ {{ x = [-0.30, 0.30], y = [0.0, 0.03], z = [1.0, 1.7], finish = "white", rim = "dark", rim_width = 0.04 }},
           {{ x = [-0.18, 0.08], y = [0.01, 0.04], z = [1.2, 1.5], finish = "rust" }} ]
poster = [ {{ x = [-0.28, 0.28], y = [0.0, 0.02], z = [0.8, 1.6], finish = "blue", rim = "white", rim_width = 0.05 }} ]
window = [ {{ x = [-0.6, 0.6], y = [0.0, 0.03], z = [0.9, 2.0], finish = "white", rim = "wood", rim_width = 0.07 }} ]
cupboard = [ {{ x = [-0.5, 0.5], y = [0.0, 0.45], z = [0.0, 1.9], finish = "wood" }},
             {{ x = [0.04, 0.46], y = [0.45, 0.47], z = [0.1, 1.8], finish = "white", twin = true }} ]
"""

CORRIDOR_TEXT = """
[locales.{corridor}]
kind = "hallway"
size = [{length:g}, {width:g}]
things = [   # [part, wall, metres along the wall from its west or south end, more places on the same wall ...]
  ["poster", "west", 0.6],
  ["notice", "east", {notice:g}],
{things}
]
"""

ROOM_TEXT = """
[locales.{name}]
kind = "room"
at = [{x:g}, {y:g}]
size = [{width:g}, {depth:g}]
things = [
  ["{north}", "north", {along:g}],
  ["{west}", "west", 0.8, 2.6],
  ["{east}", "east", 1.2],
  ["window", "east", 2.7],
  ["{south}", "south", 0.7],
]
"""

DOORS_TEXT = """
# Doors: "wall" and "along" are of the first room. Shut ones have no open = true.
[doors]
{doors}

# A mission, in a file of its own, say {name}-mission.toml; then: harvey run {name}-mission.toml
#
#   world = "{name}.toml"
#   goal = "Go from the {first} to the {last}"
#   [start]
#   heading_deg = 270.0          # 0 is east, 90 north
#   put_down_sigma_cm = 2.0      # how exactly the robot is put down
#   put_down_sigma_deg = 1.0
"""

LOOKS = (("window", 2.0, "notice", "poster", "notice"), ("cupboard", 2.2, "poster", "notice", "poster"),
         ("notice", 2.3, "notice", "notice", "poster"), ("poster", 1.7, "poster", "poster", "notice"))
"""What is on the north wall, and where [m], on the west, east and south walls: neighbouring rooms differ."""


def first_world_text(name: str, rooms: Sequence[str]) -> str:
    """The text of a world file of this name: these rooms from west to east, north of a corridor.

    Raises ValueError where a name is none that can be used, comes twice, or there are too many rooms.
    """
    _check_names(name, rooms)
    step, width = CORRIDOR_M
    text = HEAD.format(name=name) + CORRIDOR_TEXT.format(
        corridor=CORRIDOR, length=step * len(rooms), width=width, notice=width / 2,
        things="\n".join(_along_the_corridor(number) for number in range(len(rooms))))
    for number, room in enumerate(rooms):
        north, along, west, east, south = LOOKS[number % len(LOOKS)]
        text += ROOM_TEXT.format(
            name=room, x=number * step, y=width + WALL_M, width=ROOM_M[0], depth=ROOM_M[1], north=north,
            along=along, west=west, east=east, south=south)
    doors = "\n".join(f'{room}-door = {{ between = ["{room}", "{CORRIDOR}"], wall = "south", '
                      f"along = {ROOM_M[0] / 2:g}, open = true }}" for room in rooms)
    return text + DOORS_TEXT.format(name=name, doors=doors, first=rooms[0], last=rooms[-1])


def _along_the_corridor(number: int) -> str:
    """What hangs opposite the door of a room, next to it, and between it and the next."""
    x = number * CORRIDOR_M[0]
    parts = ("notice", "poster") if number % 2 else ("poster", "notice")
    return (f'  ["{parts[0]}", "south", {x + 1.2 + 0.2 * (number % 3):g}], ["{parts[1]}", "south", {x + 3.2:g}],\n'
            f'  ["{parts[1]}", "north", {x + 0.8:g}], ["{parts[0]}", "north", {x + 3.4:g}],')


def _check_names(name: str, rooms: Sequence[str]) -> None:
    for each in (name, *rooms):
        if not NAME.fullmatch(each):
            raise ValueError(f"expected names of small letters, digits and hyphens, as 'second-floor', got {each!r}")
    if not 2 <= len(rooms) <= MAX_ROOMS:
        raise ValueError(f"expected 2 to {MAX_ROOMS} rooms, got {len(rooms)}")
    taken = [name, CORRIDOR, *rooms]
    twice = [each for each in dict.fromkeys(taken) if taken.count(each) > 1]
    if twice:
        raise ValueError(f"expected each name once, beside those of the world and its {CORRIDOR!r}, got {twice[0]!r} "
                         "twice")
