"""Floors of 5 to 12 rooms by seed: what is built in miniworld, and the plan of it that Harvey is given.

A corridor with rooms on both sides, some of them joined by doorways of their own. The plan says what a floor plan says:
walls, doorways and their heights, desks as boxes, pictures' rectangles. It knows neither textures, colours, chairs nor
what a desk looks like. Metres; x to the east, y to the north.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np
import shapely

WALLS = ("brick_wall", "drywall", "concrete", "stucco", "cinder_blocks", "wood_planks", "marble", "white")
FLOORS = ("floor_tiles_bw", "wood", "wood_planks", "concrete", "concrete_tiles", "cardboard")
CEILINGS = ("ceiling_tiles", "concrete_tiles", "drywall", "ceiling_tile_noborder", "white")
"""Miniworld's textures, by their names there."""
DESK_M, CHAIR_M = (1.577, 0.776, 1.5), (0.54, 0.52, 0.9)
"""Width, depth and height of its meshes as they are scaled here."""
DESK_BOXES = (((-0.789, -0.401), 1.5), ((-0.401, 0.789), 0.75))
"""A desk with its shelf on the plan: from where to where along it, and how high."""
PICTURES = ("adelaide_hanscom1", "francisco_goya_lucientes1", "hans_holbein1", "viktor_vasnetsov1", "paolo_veronese1",
            "giovanni_bellini1", "parmigianino1", "svetoslav_roerich1")
"""Of its portraits."""
PICTURE_DEPTH_M = 0.05
ASIDE_M = 0.9
"""Desks keep so far from doorways, and pictures half as far."""
SIDES = {"south": 0.0, "east": math.pi / 2.0, "north": math.pi, "west": -math.pi / 2.0}
"""The walls of a room, with the direction in which a thing's own x axis points that stands with its back to one."""


@dataclass(frozen=True, slots=True)
class FloorRoom:
    """A rectangle, with miniworld's textures."""

    name: str
    x: tuple[float, float]
    y: tuple[float, float]
    wall: str
    floor: str
    ceiling: str
    height_m: float

    @property
    def shape(self) -> shapely.Polygon:
        return shapely.box(self.x[0], self.y[0], self.x[1], self.y[1])

    def length_of(self, side: str) -> float:
        low, high = self.x if side in ("south", "north") else self.y
        return high - low

    def on_wall(self, side: str, along_m: float, off_m: float = 0.0) -> tuple[float, float]:
        """A point on a wall, ``along_m`` from the room's south-west corner, and ``off_m`` before it."""
        (x0, x1), (y0, y1) = self.x, self.y
        return {"south": (x0 + along_m, y0 + off_m), "north": (x0 + along_m, y1 - off_m),
                "west": (x0 + off_m, y0 + along_m), "east": (x1 - off_m, y0 + along_m)}[side]


@dataclass(frozen=True, slots=True)
class PlainOpening:
    """A plain opening in the wall between two rooms; ``along_m`` is its middle on the first room's wall."""

    name: str
    between: tuple[str, str]
    side: str
    along_m: float
    width_m: float
    height_m: float


@dataclass(frozen=True, slots=True)
class StandingThing:
    """Something in a room: a desk, a chair or what is in the way; x and y [m], direction of its x axis [rad]."""

    kind: str
    x_m: float
    y_m: float
    turn_rad: float
    size_m: tuple[float, float, float]

    @property
    def shape(self) -> shapely.Polygon:
        """Its outline on the floor."""
        c, s = math.cos(self.turn_rad), math.sin(self.turn_rad)
        w, d, _ = (0.5 * size for size in self.size_m)
        return shapely.Polygon([(self.x_m + c * u - s * v, self.y_m + s * u + c * v)
                                for u, v in ((-w, -d), (w, -d), (w, d), (-w, d))])


@dataclass(frozen=True, slots=True)
class HungPicture:
    """A picture on a wall; ``along_m`` is its middle, ``up_m`` that above the floor."""

    image: str
    room: str
    side: str
    along_m: float
    up_m: float
    width_m: float
    height_m: float


@dataclass(frozen=True)
class TexturedFloor:
    """A floor as it is.

    Attributes:
        desks: they are in the plan; chairs: they are not; added: what stands in the way, and is not in the plan either.
        wall_m: thickness of the walls.
    """

    seed: int
    rooms: tuple[FloorRoom, ...]
    doorways: tuple[PlainOpening, ...]
    desks: tuple[tuple[str, str, float, StandingThing], ...]
    chairs: tuple[StandingThing, ...]
    pictures: tuple[HungPicture, ...]
    wall_m: float
    added: tuple[StandingThing, ...] = ()

    def room(self, name: str) -> FloorRoom:
        return next(room for room in self.rooms if room.name == name)

    @property
    def things(self) -> tuple[StandingThing, ...]:
        """All that stands on the floor."""
        return (*(desk for *_, desk in self.desks), *self.chairs, *self.added)

    def passage(self, door: PlainOpening) -> shapely.Polygon:
        """The floor of a doorway, through the wall."""
        room, half = self.room(door.between[0]), 0.5 * door.width_m
        corners = [room.on_wall(door.side, door.along_m + a, off) for a, off in
                   ((-half, 0.01), (half, 0.01), (half, -self.wall_m - 0.01), (-half, -self.wall_m - 0.01))]
        return shapely.Polygon(corners)

    @cached_property
    def free(self) -> shapely.Geometry:
        """The floor on which nothing stands."""
        floor = shapely.union_all([*(room.shape for room in self.rooms), *map(self.passage, self.doorways)])
        return floor.difference(shapely.union_all([thing.shape for thing in self.things]))

    @property
    def plan(self) -> str:
        """The world file: what a floor plan says of it."""
        return "\n".join(_plan_lines(self)) + "\n"

    def write(self, folder: Path) -> Path:
        """Write the world file."""
        path = folder / f"floor-{self.seed}.toml"
        path.write_text(self.plan, "utf-8")
        return path


def _plan_lines(floor: TexturedFloor) -> Iterator[str]:
    yield from (f"# What a floor plan says of floor {floor.seed}: no colours, no textures, no chairs.",
                f'name = "floor-{floor.seed}"', 'units = "metres"', "", "[finishes]",
                "plain = { colour = \"unknown\" }", "", "[defaults]",
                'kind = "room"', 'frame = "none"',
                *(f'{key} = "plain"' for key in ("walls", "floor", "ceiling", "threshold")))
    for room in floor.rooms:
        (x0, x1), (y0, y1) = room.x, room.y
        yield from ("", f"[locales.{room.name}]", f"at = [{x0:.3f}, {y0:.3f}]",
                    f"size = [{x1 - x0:.3f}, {y1 - y0:.3f}]", f"height = {room.height_m:.3f}", "things = [")
        boxes = ", ".join(f"{{ x = [{low}, {high}], y = [0.0, {DESK_M[1]}], z = [0.0, {top}], finish = \"plain\" }}"
                          for (low, high), top in DESK_BOXES)
        for number, (_, side, along, _) in enumerate((d for d in floor.desks if d[0] == room.name), 1):
            yield f'  {{ name = "desk-{number}", wall = "{side}", along = {along:.3f}, boxes = [{boxes}] }},'
        for number, p in enumerate((p for p in floor.pictures if p.room == room.name), 1):
            yield (f'  {{ name = "picture-{number}", wall = "{p.side}", along = {p.along_m:.3f}, up = {p.up_m:.3f},'
                   f' boxes = [{{ x = [{-p.width_m / 2:.3f}, {p.width_m / 2:.3f}], y = [0.0, {PICTURE_DEPTH_M}],'
                   f' z = [{-p.height_m / 2:.4f}, {p.height_m / 2:.4f}], finish = "plain" }}] }},')
        yield "]"
    for door in floor.doorways:
        yield from ("", f"[doors.{door.name}]", f'between = ["{door.between[0]}", "{door.between[1]}"]',
                    f'wall = "{door.side}"', f"along = {door.along_m:.3f}", f"width = {door.width_m:.3f}",
                    f"height = {door.height_m:.3f}", "open = true")


def generate_floor(seed: int, rooms: int | None = None, *, aspects: Sequence[float] = ()) -> TexturedFloor:
    """A floor, the same for the same arguments.

    Args:
        rooms: how many, the corridor included; None draws 5 to 12.
        aspects: height by width of each of :data:`PICTURES`; 1.25 where it is not known.

    Raises:
        ValueError: not 3 to 40 rooms.
    """
    rng = np.random.default_rng([seed, 46])
    number = int(rng.integers(5, 13)) if rooms is None else rooms
    if not 3 <= number <= 40:
        raise ValueError(f"expected 3 to 40 rooms, got {number}")
    return _Draft(seed, rng, tuple(aspects)).finish(number)


class _Draft:
    """A floor while it is drawn."""

    def __init__(self, seed: int, rng: np.random.Generator, aspects: tuple[float, ...]) -> None:
        self._seed, self._rng, self._aspects = seed, rng, aspects
        self._wall_m = round(float(rng.uniform(0.14, 0.26)), 2)
        self._height_m = round(float(rng.uniform(2.6, 3.0)), 2)
        self._rooms: list[FloorRoom] = []
        self._doors: list[PlainOpening] = []
        self._taken: dict[tuple[str, str], list[tuple[float, float]]] = {}  # of each wall: from, to

    def finish(self, number: int) -> TexturedFloor:
        self._lay_out(number)
        desks, chairs = self._furnish()
        return TexturedFloor(self._seed, tuple(self._rooms), tuple(self._doors), tuple(desks), tuple(chairs),
                     tuple(self._hang()), self._wall_m)

    def _draw(self, low: float, high: float) -> float:
        return round(float(self._rng.uniform(low, high)), 2)

    def _room(self, name: str, x: tuple[float, float], y: tuple[float, float]) -> FloorRoom:
        wall, floor, ceiling = (str(self._rng.choice(names)) for names in (WALLS, FLOORS, CEILINGS))
        room = FloorRoom(name, x, y, wall, floor, ceiling, self._height_m)
        self._rooms.append(room)
        return room

    def _lay_out(self, number: int) -> None:
        wide = self._draw(2.3, 3.0)
        north = (number - 1 + int(self._rng.integers(0, 2))) // 2
        widths = [[self._draw(3.6, 6.5) for _ in range(n)] for n in (north, number - 1 - north)]
        long = max(sum(row) + self._wall_m * (len(row) - 1) for row in widths)
        corridor = self._room("corridor", (0.0, round(long, 2)), (0.0, wide))
        for row, is_north in zip(widths, (True, False), strict=True):
            x, before = 0.0, None
            for index, width in enumerate(row, 1):
                deep = self._draw(3.6, 5.8)
                near = wide + self._wall_m if is_north else -self._wall_m - deep
                room = self._room(f"{'north' if is_north else 'south'}-{index}", (round(x, 2), round(x + width, 2)),
                                  (round(near, 2), round(near + deep, 2)))
                along = x + self._draw(1.1, width - 1.1)
                self._door(corridor, room, "north" if is_north else "south", along, along - x)
                if before is not None and self._rng.random() < 0.4:
                    low, high = max(before.y[0], room.y[0]), min(before.y[1], room.y[1])
                    at = self._draw(low + 1.1, high - 1.1)
                    self._door(before, room, "east", at - before.y[0], at - room.y[0])
                x, before = x + width + self._wall_m, room

    def _door(self, first: FloorRoom, second: FloorRoom, side: str, along_m: float, there_m: float) -> None:
        other = {"north": "south", "south": "north", "east": "west"}[side]
        width, height = self._draw(1.0, 1.4), self._draw(2.0, 2.25)
        self._doors.append(PlainOpening(
            f"{first.name}-{second.name}", (first.name, second.name), side, round(along_m, 2), width, height))
        for room, wall, at in ((first, side, along_m), (second, other, there_m)):
            self._taken.setdefault((room.name, wall), []).append((at - width / 2, at + width / 2))

    def _place(self, room: FloorRoom, side: str, width: float, aside_m: float) -> float | None:
        """A free place of such a width on a wall; None where none is found."""
        length, taken = room.length_of(side), self._taken.get((room.name, side), [])
        if length < width + 0.8:
            return None
        for _ in range(10):
            at = self._draw(0.4 + width / 2, length - 0.4 - width / 2)
            if all(at + width / 2 + aside_m <= low or at - width / 2 - aside_m >= high for low, high in taken):
                self._taken.setdefault((room.name, side), []).append((at - width / 2, at + width / 2))
                return at
        return None

    def _furnish(self) -> tuple[list[tuple[str, str, float, StandingThing]], list[StandingThing]]:
        desks: list[tuple[str, str, float, StandingThing]] = []
        chairs: list[StandingThing] = []
        for room in self._rooms[1:]:
            for _ in range(int(self._rng.integers(1, 3))):
                side = str(self._rng.choice(list(SIDES)))
                at = self._place(room, side, DESK_M[0], ASIDE_M)
                if at is None or any(r == room.name for r, s, *_ in desks if s != side):
                    continue
                x, y = room.on_wall(side, at, DESK_M[1] / 2)
                desks.append((room.name, side, at, StandingThing("office_desk", x, y, SIDES[side], DESK_M)))
                if self._rng.random() < 0.6:
                    x, y = room.on_wall(side, at + self._draw(-0.3, 0.3), DESK_M[1] + self._draw(0.3, 0.45))
                    chairs.append(StandingThing("office_chair", x, y, self._draw(-3.0, 3.0), CHAIR_M))
        return desks, chairs

    def _hang(self) -> Iterator[HungPicture]:
        for room in self._rooms:
            number = int(self._rng.integers(4, 8)) if room.name == "corridor" else int(self._rng.integers(2, 5))
            for _ in range(number):
                side, which = str(self._rng.choice(list(SIDES))), int(self._rng.integers(len(PICTURES)))
                width = self._draw(0.5, 0.95)
                at = self._place(room, side, width, ASIDE_M / 2)
                if at is not None:
                    aspect = self._aspects[which] if self._aspects else 1.25
                    up = self._draw(1.45, 1.6)
                    yield HungPicture(PICTURES[which], room.name, side, at, up, width, width * aspect)
