"""Routes in words, drawn at random: what a person might say of the way from one place to another, and where it ends.

Its wording is its own: no word of the lexicon's file is read here.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from harvey_words.directions.directions import NUMBERS, ORDINALS
from harvey_words.following.word_map import NamedFeature, NamedSight, WordMap, moved, turned

Node = tuple[int, int]
Hall = tuple[Node, Node, str, str]
PITCH_M, WIDTH_M = 4.0, 1.6
COLOURS = {"brick": (0.58, 0.3, 0.25), "blue": (0.2, 0.3, 0.6), "grass": (0.3, 0.55, 0.25), "gravel": (0.5, 0.5, 0.5),
           "flower": (0.85, 0.55, 0.62), "wood": (0.45, 0.3, 0.2), "yellow": (0.8, 0.7, 0.2)}
SAID = {"notice-board": "bulletin board", "hose-cabinet": "fire hose", "fountain": "drinking fountain",
        "white-board": "whiteboard", "exit-sign": "exit sign", "picture": "painting", "pillar": "column",
        "elevator": "elevator", "sign": "sign", "hatrack": "coat rack", "stool": "bar stool"}
FLOORS = {"brick": "brick", "blue": "blue", "grass": "grassy", "gravel": "gravel", "flower": "flowered",
          "wood": "wooden", "yellow": "yellow"}


@dataclass(frozen=True)
class Told:
    """A route in words.

    Attributes:
        start: the room or crossing where it begins; end: the room, or crossing, or shut door, where it ends.
        text: as it is told.
        details: sentences that could be added, all of them true on this way.
    """

    start: str
    end: str
    text: str
    details: tuple[str, ...] = ()


def tell_rooms(plan: WordMap, rng: np.random.Generator) -> Told | None:
    """From a room out into its hall and to another door of the hall; None where nothing can be told."""
    rooms = [area for area in plan.areas.values() if not area.is_hall and _out(plan, area.features)]
    start = rooms[int(rng.integers(len(rooms)))]
    door = _out(plan, start.features)
    assert door is not None and door.beyond is not None and door.outward is not None
    hall = plan.areas[door.beyond]
    side = str(rng.choice(["left", "right"]))
    heading = turned(door.outward, math.pi / 2 if side == "left" else -math.pi / 2)
    at = moved(door.at, door.outward, hall.half[1])
    ahead = [sight for sight in plan.look(hall.name, at, heading) if sight.feature is not None and sight.ahead_m > 0.5]
    goals = [sight for sight in ahead if sight.feature is not None and sight.feature.sort == "door"
             and sight.side in ("left", "right")]
    if not goals:
        return None
    goal = goals[int(rng.integers(len(goals)))]
    if any(sight.feature is not None and sight.feature.sort == "door" and sight.side == goal.side
           and abs(sight.ahead_m) < 0.8 for sight in plan.look(hall.name, at, heading)):
        return None  # whether the one opposite counts nobody could say
    assert goal.feature is not None
    first = [f"Leave the room and turn {side}.", f"Come out of the door and go {side}.", f"Step out, then {side}.",
             f"Exit and hang a {side}.", f"When you are out of the room take a {side}."]
    last, mark = _tell_goal(goals, goal, ahead, rng)
    details = [f"You will pass the {SAID[sight.feature.own_kind]} on your {sight.side}."
               for sight in ahead if sight.feature is not None and sight.feature.own_kind in SAID
               and sight.side in ("left", "right") and sight.ahead_m < goal.ahead_m - 1.0]
    walk = ["Go down the hallway.", "Follow the corridor.", "", "Walk along the hall."]
    text = " ".join(filter(None, [_pick(first, rng), mark or _pick(walk, rng), last]))
    return Told(start.name, goal.feature.beyond or goal.feature.name, text, tuple(details))


def _out(plan: WordMap, features: Sequence[NamedFeature]) -> NamedFeature | None:
    """The one door of a room that leads to a hall."""
    doors = [one for one in features if one.is_open and one.sort == "door" and one.outward is not None
             and one.beyond is not None and plan.areas[one.beyond].is_hall]
    return doors[0] if len(doors) == 1 else None


def _tell_goal(goals: Sequence[NamedSight], goal: NamedSight, ahead: Sequence[NamedSight],
               rng: np.random.Generator) -> tuple[str, str]:
    """The last sentence, and one before it that a mark is passed."""
    row = [sight for sight in goals if sight.side == goal.side]
    rank = row.index(goal)
    choice = int(rng.integers(3))
    if choice == 1 and goal is row[-1]:
        return f"It is the last door on the {goal.side}.", ""
    marks = [sight for sight in ahead if sight.feature is not None and sight.feature.sort == "thing"
             and sight.feature.own_kind in SAID and _is_first(sight, ahead)
             and (row[rank - 1].ahead_m if rank else 0.0) + 0.6 < sight.ahead_m < goal.ahead_m - 0.6]
    if choice == 2 and marks:
        feature = marks[-1].feature
        assert feature is not None
        name = SAID[feature.own_kind]
        if rng.random() < 0.5:
            return f"It is the next door on the {goal.side}.", f"Walk past the {name}."
        return f"You want the first door on your {goal.side} after the {name}.", ""
    return _pick([f"It is the {ORDINALS[rank]} door on the {goal.side}.",
                  f"Take the {ORDINALS[rank]} door on your {goal.side}.",
                  f"You want the {ORDINALS[rank]} doorway on the {goal.side} hand side."], rng), ""


def _is_first(mark: NamedSight, ahead: Sequence[NamedSight]) -> bool:
    """Whether no other thing of its kind comes before it."""
    kinds = [sight.feature and sight.feature.own_kind for sight in ahead]
    return ahead[kinds.index(mark.feature and mark.feature.own_kind)] is mark


def write_maze(halls: Sequence[Hall], things: Mapping[Node, str]) -> str:
    """The text of its world file."""
    half = WIDTH_M / 2
    lines = ['name = "maze"', 'units = "metres"', 'include = ["standard"]', "[finishes]"]
    lines += [f'{floor}-floor = {{ colour = {list(rgb)}, words = "{floor}" }}' for floor, rgb in COLOURS.items()]
    lines += ["[locales]"]
    for node in sorted({node for hall in halls for node in hall[:2]}):
        x, y = (PITCH_M * value - half for value in node)
        thing = (f', things = [{{ boxes = [{{ x = [-0.2, 0.2], y = [-0.2, 0.2], z = [0.0, 1.0], finish = "oak" }}], '
                 f'kind = "{things[node]}", at = [{half}, {half}] }}]' if node in things else "")
        lines.append(f'{_crossing(node)} = {{ kind = "crossing", at = [{x}, {y}], '
                     f'size = [{WIDTH_M}, {WIDTH_M}]{thing} }}')
    doors = ["[doors]"]
    for number, (one, two, floor, picture) in enumerate(halls):
        one, two = sorted((one, two))
        level = one[1] == two[1]
        x, y = (PITCH_M * value for value in one)
        at = [x + half, y - half] if level else [x - half, y + half]
        size = [PITCH_M - WIDTH_M, WIDTH_M] if level else [WIDTH_M, PITCH_M - WIDTH_M]
        lines.append(f'hall-{number} = {{ kind = "hallway", at = {at}, size = {size}, floor = "{floor}-floor", '
                     f'words = "{picture}" }}')
        for node, wall in ((one, "east" if level else "north"), (two, "west" if level else "south")):
            doors.append(f'o-{number}-{node[0]}-{node[1]} = {{ between = ["{_crossing(node)}", "hall-{number}"], '
                         f'wall = "{wall}", along = {half}, width = 1.4, open = true, frame = "none" }}')
    return "\n".join([*lines, *doors, ""])


def _crossing(node: Node) -> str:
    return f"c-{node[0]}-{node[1]}"


def draw_maze(rng: np.random.Generator) -> tuple[tuple[Hall, ...], dict[Node, str]]:
    """Halls and things of a maze of three by four crossings, all of which can be reached."""
    floors = list(FLOORS)
    rows = [floors[int(index)] for index in rng.permutation(len(floors))]
    nodes = [(x, y) for x in range(4) for y in range(3)]
    edges = [((x, y), (x + 1, y), rows[y]) for x in range(3) for y in range(3)]
    edges += [((x, y), (x, y + 1), rows[3 + x]) for x in range(4) for y in range(2)]
    kept = [edge for edge in edges if rng.random() < 0.8]
    reached = {nodes[0]}
    while len(reached) < len(nodes):
        more = [edge for edge in edges if (edge[0] in reached) != (edge[1] in reached)]
        open_ones = [edge for edge in more if edge in kept] or more[:1]
        kept = [*kept, *(edge for edge in open_ones[:1] if edge not in kept)]
        reached |= set(open_ones[0][:2])
    pictures = {floor: str(rng.choice(["fish", "butterfly", "tower"])) for floor in rows}
    kinds = ["easel", "hatrack", "lamp", "chair", "sofa", "stool"]
    places = rng.permutation(len(nodes))[:len(kinds)]
    return (tuple((one, two, floor, pictures[floor]) for one, two, floor in kept),
            {nodes[int(place)]: kind for place, kind in zip(places, kinds, strict=True)})


def tell_maze(halls: Sequence[Hall], things: dict[Node, str], rng: np.random.Generator) -> Told:
    """From a crossing to another, by a shortest way, leg by leg."""
    ways: dict[Node, dict[Node, str]] = {}
    for one, two, floor, _ in halls:
        ways.setdefault(one, {})[two] = floor
        ways.setdefault(two, {})[one] = floor
    nodes = sorted(ways)
    while True:
        start, end = (nodes[int(index)] for index in rng.choice(len(nodes), 2, replace=False))
        path = _shortest(ways, start, end)
        if 3 <= len(path) <= 6 and list(ways[path[0]].values()).count(ways[path[0]][path[1]]) == 1:
            break
    legs: list[list[Node]] = [[path[0]]]
    for here, there in pairwise(path):
        last = legs[-1]
        if len(last) > 1 and _step(last[-2], last[-1]) != _step(here, there):
            legs.append([here])
        legs[-1].append(there)
    floor = ways[path[0]][path[1]]
    sentences = [_pick([f"Face the {FLOORS[floor]} hall.", f"Take the {FLOORS[floor]} hallway.",
                        f"Turn so that you look down the {FLOORS[floor]} corridor."], rng)]
    for number, leg in enumerate(legs):
        if number:
            dx, dy = _step(legs[number - 1][-2], legs[number - 1][-1])
            ex, ey = _step(leg[0], leg[1])
            side = "left" if dx * ey - dy * ex > 0 else "right"
            sentences.append(_pick([f"Turn {side}.", f"Make a {side}.", f"Take a {side} there."], rng))
        sentences.append(_tell_leg(leg, ways, things, rng))
    details = ([f"There is a {SAID.get(things[end], things[end])} here."] if end in things else [])
    return Told(f"c-{start[0]}-{start[1]}", f"c-{end[0]}-{end[1]}", " ".join(sentences), tuple(details))


def _tell_leg(leg: Sequence[Node], ways: dict[Node, dict[Node, str]], things: dict[Node, str],
              rng: np.random.Generator) -> str:
    steps = len(leg) - 1
    unit = _pick(["block", "segment"], rng) + ("s" if steps > 1 else "")
    said = [f"Go forward {NUMBERS[steps - 1]} {unit}.", f"Walk {NUMBERS[steps - 1]} {unit}."]
    end = leg[-1]
    if end in things:
        name = SAID.get(things[end], things[end])
        said += [f"Go to the {name}.", f"Walk on until you reach the {name}."]
    dx, dy = _step(leg[-2], end)
    if (end[0] + dx, end[1] + dy) not in ways[end]:
        said.append("Go to the end of the hall.")
    passed = [node for node in leg[1:-1] if node in things]
    if passed and end in things:
        one, other = (SAID.get(things[node], things[node]) for node in (passed[0], end))
        said.append(f"Go past the {one} to the {other}.")
    return _pick(said, rng)


def _shortest(ways: dict[Node, dict[Node, str]], start: Node, end: Node) -> list[Node]:
    paths = [[start]]
    for path in paths:
        if path[-1] == end:
            break
        paths += [[*path, there] for there in sorted(ways[path[-1]]) if there not in path]
    return path


def _step(one: Node, other: Node) -> Node:
    return other[0] - one[0], other[1] - one[1]


def _pick(said: Sequence[str], rng: np.random.Generator) -> str:
    return said[int(rng.integers(len(said)))]
