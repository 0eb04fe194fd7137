"""Layout of a generated floor: where rooms, doors and things are, what the walls look like, and its files' text."""

from __future__ import annotations

import json
import tomllib
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from typing import Any

import numpy as np

from sim.render.renderer import illumination
from sim.scenario_names import SCENARIOS
from world_models.files.world_files import WORLDS

Table = dict[str, Any]


def as_toml(data: Mapping[str, Any]) -> str:
    """Format a world file: plain values first, then its tables."""
    lines = [f"{key} = {_value(value)}" for key, value in data.items() if not isinstance(value, Mapping)]
    for table, entries in data.items():
        if isinstance(entries, Mapping):
            lines += ["", f"[{table}]"]
            flat = table in ("finishes", "defaults", "parts", "doors")
            lines += [f"{key} = {_value(value)}" for key, value in entries.items() if flat]
            for key, value in entries.items() if not flat else ():
                lines += ["", f"[{table}.{key}]", *(f"{k} = {_value(v)}" for k, v in value.items())]
    return "\n".join(lines) + "\n"


def _value(value: Any) -> str:
    if isinstance(value, Mapping):
        return "{ " + ", ".join(f"{key} = {_value(item)}" for key, item in value.items()) + " }"
    if isinstance(value, list):
        return "[" + ", ".join(_value(item) for item in value) + "]"
    return json.dumps(value)


def scale_colour(finish: Mapping[str, Any], gain: float) -> Table:
    """Scale the colour of a finish."""
    return {**finish, "colour": [round(min(1.0, gain * channel), 4) for channel in finish["colour"]]}


def replace_finishes(boxes: Sequence[Mapping[str, Any]], finish: Callable[[str], str]) -> list[Table]:
    """Replace the finishes of a part's boxes."""
    return [{key: finish(value) if key in ("finish", "rim") else value for key, value in box.items()} for box in boxes]


SOURCE = WORLDS / "parts" / "standard.toml"
DETAILS = SCENARIOS.parent / "buildings" / "research_center_details.toml"
MAX_ROOMS_PER_SIDE = 7
"""Rooms on one side of a corridor."""
WALL_FT = 0.5
DEPTH_FT = 14.0
"""Depth of identical rooms."""
DOOR_FT, DOOR_MARGIN_FT = 3.3, 2.1
"""Width of a doorway, and the distance from its middle that is kept free."""
INWARD: Mapping[str, tuple[float, float, float]] = {
    "south": (0.0, 1.0, 0.0), "east": (-1.0, 0.0, 0.0), "north": (0.0, -1.0, 0.0), "west": (1.0, 0.0, 0.0),
}
ACROSS: Mapping[str, str] = {"south": "north", "north": "south", "east": "west", "west": "east"}
EVEN_LIGHT = 0.62
"""Share of its colour that every wall and board of a symmetric corridor reflects, whichever way it faces."""

HALF_FT: Mapping[str, float] = {
    "picture": 1.0, "notice-board": 1.5, "white-board": 1.7, "sign": 0.4, "window": 2.6, "blackboard": 5.0,
    "pillar": 0.8, "hose-cabinet": 1.1, "fountain": 0.7, "exit-sign": 0.7, "desk": 2.8, "bookshelf": 1.8,
    "file-cabinet": 0.75, "cupboard": 1.6, "rack": 1.0,
}
"""Half the width of parts along a wall."""
DEEP = ("desk", "bookshelf", "file-cabinet", "cupboard", "rack")
IN_CORRIDORS = ("picture", "notice-board", "white-board", "sign", "pillar", "hose-cabinet", "fountain", "notice-board",
                "picture", "sign", "pillar")
FLAT = ("picture", "notice-board", "white-board", "sign", "notice-board", "picture")
IN_ROOMS = (*DEEP, *DEEP, "picture", "notice-board", "white-board", "sign", "window", "window", "blackboard", "pillar",
            "picture")
FRAMES = ("walnut", "navy", "rust", "teal", "dark-steel", "oak")
LEAVES = ("oak", "teal", "navy", "mustard", "red", "steel", "brown")
PANELS = (None, "pane", "kick-plate", "louvre")
CLUTTER: Mapping[str, float] = {
    "socket": 0.15, "switch": 0.15, "poster": 0.9, "leaflet": 0.5, "conduit": 0.1, "carton": 0.7, "basket": 0.5,
}


@dataclass
class WallSide:
    """The intervals of a wall that are still free [ft]."""

    free: list[tuple[float, float]]

    @staticmethod
    def of(length: float, margin: float = 0.4) -> WallSide:
        return WallSide([(margin, length - margin)])

    def take(self, middle: float, half: float) -> None:
        """Remove an interval from the free ones."""
        out = []
        for low, high in self.free:
            out += [(low, min(high, middle - half)), (max(low, middle + half), high)]
        self.free = [(low, high) for low, high in out if high - low > 0.1]

    def place(self, half: float, rng: np.random.Generator, low: float = 0.0, high: float = np.inf) -> float | None:
        """Draw and take a free place for a thing, to a tenth of a foot; None if there is none."""
        rooms = [(max(a, low) + half, min(b, high) - half) for a, b in self.free]
        rooms = [(a, b) for a, b in rooms if b > a]
        if not rooms:
            return None
        a, b = rooms[int(rng.integers(len(rooms)))]
        middle = round(float(rng.uniform(a, b)), 1)
        self.take(middle, half + 0.3)
        return middle


@dataclass
class FloorPlan:
    """Lays out a floor, draws its things, and writes its files."""

    rng: np.random.Generator
    symmetric: bool
    repeated: bool
    open_share: float
    joined: bool = False
    identical: bool = False
    corridors: dict[str, Table] = field(default_factory=dict)
    rooms: dict[str, Table] = field(default_factory=dict)
    doors: dict[str, Table] = field(default_factory=dict)
    finishes: dict[str, Table] = field(default_factory=dict)
    sides: dict[tuple[str, str], WallSide] = field(default_factory=dict)
    gallery: Table | None = None

    def __post_init__(self) -> None:
        self._known: Mapping[str, Any] = tomllib.loads(SOURCE.read_text("utf-8"))

    # -- rooms and doors -----------------------------------------------------------------------------------------------

    def lay_out(self, rooms: int) -> None:
        """Lay out corridors with a number of rooms, and furnish them."""
        count = -(-rooms // (2 * MAX_ROOMS_PER_SIDE))
        shares = [rooms // count + (i < rooms % count) for i in range(count)]
        y = 0.0
        for number, share in enumerate(shares):
            y = self._add_corridor(number, share, y)
        if count > 1 and not self.symmetric:
            self._add_gallery(y)
        for name in (*self.corridors, *self.rooms):
            self._furnish(name)
        if self.identical:
            self._copy_first_room()

    def _copy_first_room(self) -> None:
        """Make all rooms on the north sides copies of the first one, and all others the same turned by 180 degrees."""
        first, model = next(iter(self.rooms.items()))
        for name, room in self.rooms.items():
            turned = room["of"][1] != model["of"][1]
            room.update({"floor": model["floor"], "walls": {
                ACROSS[wall] if turned else wall: finish for wall, finish in model["walls"].items()}})
            room["things"] = [self._turn_thing(thing, model["size"]) if turned else dict(thing)
                              for thing in model["things"]]
            for wall in INWARD:
                length = model["size"][0 if wall in ("south", "north") else 1]
                free = self.sides[first, wall].free
                side = ACROSS[wall] if turned else wall
                self.sides[name, side] = WallSide([(length - b, length - a) for a, b in free][::-1] if turned else free)

    def _turn_thing(self, thing: Table, size: Sequence[float]) -> Table:
        """A thing of a room, where it is if the room is turned by 180 degrees."""
        if "at" in thing:
            return {**thing, "at": [round(s - v, 1) for s, v in zip(size, thing["at"], strict=True)]}
        length = size[0 if thing["wall"] in ("south", "north") else 1]
        return {**thing, "wall": ACROSS[thing["wall"]], "along": round(length - thing["along"], 1)}

    def _add_corridor(self, number: int, rooms: int, y: float) -> float:
        """Add a corridor with its rooms from y on; returns where the next one may begin."""
        name, width = f"corridor-{number}", round(float(self.rng.uniform(7.0, 9.0)), 1)
        per_side = (-(-rooms // 2), rooms // 2)
        spans = [self._draw_spans(n) for n in per_side]
        length = round(max(s[-1][1] if s else 0.0 for s in spans) + self.rng.uniform(2.0, 8.0), 1)
        if self.symmetric:
            length = round(spans[0][-1][1] + spans[0][0][0], 1)
            spans[1] = [(round(length - b, 1), round(length - a, 1)) for a, b in spans[0]][::-1][: per_side[1]]
        depths = [[round(float(self.rng.uniform(10.0, 18.0)), 1) for _ in s] for s in spans]
        if self.identical:
            depths = [[DEPTH_FT] * len(s) for s in spans]
        bottom = y + max(depths[1], default=0.0) + WALL_FT
        self.corridors[name] = {"kind": "hallway", "at": [0.0, round(bottom, 1)], "size": [length, width],
                                "floor": str(self.rng.choice(["linoleum", "carpet"])), **self._draw_walls(name)}
        self._add_sides(name, length, width)
        for side, wall in ((0, "north"), (1, "south")):
            for i, ((x0, x1), depth) in enumerate(zip(spans[side], depths[side], strict=True)):
                at = bottom + width + WALL_FT if wall == "north" else bottom - WALL_FT - depth
                self._add_room(f"room-{number}-{wall}-{i}", name, wall, (x0, x1), (round(at, 1), depth))
        self._add_doors(name, spans, length)
        if self.joined:
            for side, wall in ((0, "north"), (1, "south")):
                for i in range(len(spans[side]) - 1):
                    self._join_rooms(f"{number}-{wall}-{i}", f"{number}-{wall}-{i + 1}")
        return bottom + width + max(depths[0]) + 2 * WALL_FT

    def _draw_spans(self, rooms: int) -> list[tuple[float, float]]:
        """Draw the intervals of one side's rooms along the corridor [ft]."""
        wide = self.rng.uniform(10.0, 22.0, rooms)
        if self.repeated:
            wide[:] = 14.0
        begin = 0.0 if self.repeated else round(float(self.rng.uniform(0.5, 3.0)), 1)
        ends = begin + np.cumsum(np.round(wide, 1) + WALL_FT)
        return [(round(float(e - w), 1), round(float(e), 1)) for e, w in zip(ends, np.round(wide, 1), strict=True)]

    def _add_room(
        self, name: str, corridor: str, wall: str, x: tuple[float, float], y: tuple[float, float]
    ) -> None:
        size = [round(x[1] - x[0], 1), y[1]]
        self.rooms[name] = {"kind": "office", "at": [x[0], y[0]], "size": size, "of": (corridor, wall),
                            "floor": str(self.rng.choice(["linoleum", "carpet"])), **self._draw_walls(name, even=False)}
        self._add_sides(name, *size)

    def _add_doors(self, corridor: str, spans: Sequence[Sequence[tuple[float, float]]], length: float) -> None:
        looks = [self._draw_door_look() for _ in range(max(len(s) for s in spans))]
        if self.repeated:
            looks = looks[:1] * len(looks)
        places = [[self._draw_door_position(x0, x1) for x0, x1 in side] for side in spans]
        if self.symmetric:
            places[1] = [round(length - along, 1) for along in places[0]][::-1][: len(spans[1])]
        for side, wall in ((0, "north"), (1, "south")):
            for i, along in enumerate(places[side]):
                look = looks[i] if side == 0 else looks[-1 - i] if self.symmetric else self._draw_door_look()
                room = f"room-{corridor.partition('-')[2]}-{wall}-{i}"
                self._add_door(f"door-{room[5:]}", (corridor, room), wall, along, looks[0] if self.repeated else look)

    def _draw_door_position(self, x0: float, x1: float) -> float:
        middle = 0.5 * (x0 + x1)
        return round(middle if self.repeated else float(self.rng.uniform(x0 + 2.4, x1 - 2.4)), 1)

    def _draw_door_look(self) -> Table:
        pick = self.rng.integers
        look: Table = {"frame": FRAMES[pick(len(FRAMES))], "leaf": LEAVES[pick(len(LEAVES))]}
        panel = PANELS[pick(len(PANELS))]
        return look if panel is None else {**look, "panel": panel}

    def _add_door(self, name: str, between: tuple[str, str], wall: str, along: float, look: Table) -> None:
        is_open = bool(self.rng.random() < self.open_share)
        self.doors[name] = {"between": list(between), "wall": wall, "along": along, "width": DOOR_FT,
                            **({"open": True} if is_open else {}), **self._balance_look(look, wall)}
        self.sides[between[0], wall].take(along, DOOR_MARGIN_FT + 0.3)
        x0 = self.rooms[between[1]]["at"][0]
        self.sides[between[1], ACROSS[wall]].take(along - x0, DOOR_MARGIN_FT + 0.3)

    def _add_gallery(self, top: float) -> None:
        """Add a gallery along the west ends of the corridors, with a wide doorway to each."""
        width = 9.0
        self.corridors["gallery"] = {"kind": "hallway", "at": [-width - WALL_FT, 0.0], "size": [width, round(top, 1)],
                                     "floor": "linoleum", **self._draw_walls("gallery")}
        self._add_sides("gallery", width, round(top, 1))
        for name, locale in self.corridors.items():
            if name != "gallery":
                along = round(locale["size"][1] / 2, 1)
                self.doors[f"{name}-end"] = {"between": [name, "gallery"], "wall": "west", "along": along, "width": 5.0,
                                             "open": True, "frame": str(self.rng.choice(FRAMES))}
                self.sides[name, "west"].take(along, 3.4)
                self.sides["gallery", "east"].take(locale["at"][1] + along, 3.4)

    def _join_rooms(self, west: str, east: str) -> None:
        """Add an open door between two neighbouring rooms, where they share enough of a wall."""
        rooms = [f"room-{west}", f"room-{east}"]
        begins = [self.rooms[room]["at"][1] for room in rooms]
        ends = [begin + self.rooms[room]["size"][1] for room, begin in zip(rooms, begins, strict=True)]
        low, high = max(begins) + DOOR_MARGIN_FT + 0.5, min(ends) - DOOR_MARGIN_FT - 0.5
        if high <= low:
            return
        y = float(self.rng.uniform(low, high))
        along = round(y - begins[0], 1)
        self.doors[f"way-{west}"] = {"between": rooms, "wall": "east", "along": along, "width": DOOR_FT, "open": True,
                                     **self._draw_door_look()}
        self.sides[rooms[0], "east"].take(along, DOOR_MARGIN_FT + 0.3)
        self.sides[rooms[1], "west"].take(y - begins[1], DOOR_MARGIN_FT + 0.3)

    # -- walls and things ------------------------------------------------------------------------------------------

    def _draw_walls(self, name: str, even: bool = True) -> Table:
        """Draw a finish for every wall; half of the rooms have one for all four."""
        colours = [self._add_paint(f"{name}-{i}") for i in range(int(self.rng.integers(1, 4)))]
        walls = {wall: colours[int(self.rng.integers(len(colours)))] for wall in INWARD}
        if self.symmetric and even:
            walls["south"], walls["west"] = walls["north"], walls["east"]
            return {"walls": {wall: self._add_balanced_finish(finish, wall) for wall, finish in walls.items()},
                    "baseboard": "black", "moulding": "black"}
        return {"walls": walls}

    def _add_paint(self, name: str) -> str:
        base = self._known["finishes"][str(self.rng.choice(["cream", "sand", "sage", "sky", "brick", "white"]))]
        shade = np.array(base["colour"]) * self.rng.uniform(0.8, 1.1) + self.rng.uniform(-0.06, 0.06, 3)
        shade = np.clip(shade, 0.1, 0.93)
        self.finishes[f"paint-{name}"] = {**base, "colour": [round(float(c), 3) for c in shade]}
        return f"paint-{name}"

    def _add_balanced_finish(self, finish: str, wall: str) -> str:
        """Add the finish that looks the same on this wall as on the opposite one: the more light, the darker."""
        name = f"{finish}-{wall}"
        if name not in self.finishes:
            gain = EVEN_LIGHT / float(illumination(np.array([INWARD[wall]]))[0])
            base = self.finishes[finish] if finish in self.finishes else self._known["finishes"][finish]
            self.finishes[name] = scale_colour(base, gain)
        return name

    def _balance_look(self, look: Table, wall: str) -> Table:
        """Return a door's look, with balanced finishes if the corridor is symmetric."""
        if not self.symmetric:
            return look
        out = {key: self._add_balanced_finish(look[key], wall) for key in ("frame", "leaf")}
        return {**out, **({"panel": f"{look['panel']}-{wall}"} if "panel" in look else {})}

    def _add_sides(self, name: str, length: float, width: float) -> None:
        for wall in INWARD:
            self.sides[name, wall] = WallSide.of(length if wall in ("south", "north") else width)

    def _furnish(self, name: str) -> None:
        corridor = name in self.corridors
        locale = self.corridors[name] if corridor else self.rooms[name]
        things = list(self._draw_wall_things(name, locale) if corridor else self._draw_furniture(name, locale))
        locale["things"] = things

    def _draw_wall_things(self, name: str, locale: Table) -> Iterator[Table]:
        """Draw boards and pictures along a corridor, about one per seven feet of wall."""
        kinds = ("picture", "sign") if self.repeated else FLAT if self.symmetric else IN_CORRIDORS
        for wall in ("north", "east") if self.symmetric else INWARD:
            length = locale["size"][0 if wall in ("south", "north") else 1]
            for _ in range(round(length / (28.0 if self.repeated else 7.0))):
                part = kinds[int(self.rng.integers(len(kinds)))]
                along = self.sides[name, wall].place(HALF_FT[part], self.rng)
                if along is not None:
                    yield from self._mirror_thing(name, part, wall, along, length)

    def _mirror_thing(self, name: str, part: str, wall: str, along: float, length: float) -> Iterator[Table]:
        """Return a thing on a wall and, if the corridor is symmetric, its mirror image."""
        if not self.symmetric:
            yield {"part": part, "wall": wall, "along": along}
            return
        for side, place in ((wall, along), (ACROSS[wall], round(length - along, 1))):
            self.sides[name, side].take(place, HALF_FT[part] + 0.3)
            yield {"part": f"{part}-{side}", "wall": side, "along": place}

    def _draw_furniture(self, name: str, locale: Table) -> Iterator[Table]:
        """Draw the furniture along the walls of a room, and a table if there is space."""
        width, depth = locale["size"]
        for _ in range(int(self.rng.integers(6, 13))):
            part, wall = IN_ROOMS[int(self.rng.integers(len(IN_ROOMS)))], str(self.rng.choice(list(INWARD)))
            length = width if wall in ("south", "north") else depth
            corner = 3.2 if part in DEEP else 0.4
            along = self.sides[name, wall].place(HALF_FT[part], self.rng, corner, length - corner)
            if along is not None:
                yield {"part": part, "wall": wall, "along": along}
        if min(width, depth) > 14.0 and self.rng.random() < 0.5:
            x, y = (round(float(v / 2 + self.rng.uniform(-1.0, 1.0)), 1) for v in (width, depth))
            yield {"part": "table", "at": [x, y], "turn": int(self.rng.choice([0, 90]))}

    # -- texts ---------------------------------------------------------------------------------------------------------

    def format_world(self, seed: int) -> str:
        """Format the world file."""
        parts = dict(self._known["parts"])
        if self.symmetric:
            for wall in INWARD:
                for part in sorted({*FLAT, *(panel for panel in PANELS if panel)}):
                    balance = partial(self._add_balanced_finish, wall=wall)
                    parts[f"{part}-{wall}"] = replace_finishes(self._known["parts"][part], balance)
        locales = {"floor": {"kind": "floor"}}
        for name, locale in (*self.corridors.items(), *self.rooms.items()):
            locales[name] = {"in": "floor", **{key: value for key, value in locale.items() if key != "of"}}
        return as_toml({
            "name": f"floor-{seed}", "units": "feet", "finishes": {**self._known["finishes"], **self.finishes},
            "defaults": self._known["defaults"], "parts": parts, "locales": locales, "doors": self.doors,
        })

    def format_details(self, clutter: float) -> str:
        """Format the file of what the model lacks: about one thing per ten feet of wall."""
        known = tomllib.loads(DETAILS.read_text("utf-8"))
        locales: dict[str, Table] = {}
        for (name, wall), side in self.sides.items():
            locale = self.corridors.get(name) or self.rooms[name]
            length = locale["size"][0 if wall in ("south", "north") else 1]
            for _ in range(int(self.rng.poisson(clutter * length / 10.0))):
                part = list(CLUTTER)[int(self.rng.integers(len(CLUTTER)))]
                along = side.place(CLUTTER[part], self.rng, 1.2, length - 1.2)
                if along is not None:
                    locales.setdefault(name, {"things": []})["things"].append(
                        {"part": part, "wall": wall, "along": along})
        return as_toml({"units": "feet", "finishes": known["finishes"], "parts": known["parts"],
                        "locales": locales or {next(iter(self.rooms)): {"things": []}}})
