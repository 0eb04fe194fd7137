"""A campus of any size round the Research Center, written straight into a compiled world.

Every generated building has four floors of a corridor and 24 rooms, the floors joined by an elevator and laid out side
by side on the plan; a row of buildings is a district with grounds of its own, and the grounds follow one another. The
Research Center lies at the origin, as in its own file, so that the robot's numbers are the same in every campus.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from tqdm import tqdm

from world_models.building.geometry.faces import Face, Finish, build_barrier, expected_brightness
from world_models.building.geometry.landmarks import Edges, Landmark
from world_models.building.geometry.scene import LocaleGeometry
from world_models.building.locale_frame import LocaleFrame
from world_models.building.locales import Doorway, Link, Locale
from world_models.building.world import World, iterate_frames
from world_models.files.packed import write_frames
from world_models.files.world_files import WORLDS, load_world
from world_models.frames import Pose

DETAILS = Path(__file__).parents[3] / "sim" / "buildings" / "research_center_details.toml"
FLOORS, ROOMS = 4, 24
ROOM_M, CORRIDOR_M, HEIGHT_M, WALL_M, DOOR_M, DOOR_HEIGHT_M = 4.0, 2.4, 2.7, 0.15, 0.9, 2.1
FLOOR_PITCH_M = 16.0
BUILDING_M = (60.0, FLOORS * FLOOR_PITCH_M + 12.0)
ROW = 30
"""Buildings per district."""
LOCALES_IN_BUILDING = 1 + FLOORS * (2 + ROOMS)
FIRST_M = 400.0
"""Distance of the generated districts from the Research Center, out of its sight."""
WALL, FLOOR, CEILING, FRAME = (Finish((v, v, v)) for v in (0.78, 0.45, 0.9, 0.3))


@dataclass(frozen=True, slots=True)
class Campus:
    """A campus file, with its number of locales and faces."""

    path: Path
    locales: int
    faces: int


def write_campus(locales: int, folder: Path) -> Campus:
    """Write the campus with at least this many locales, unless it is there already."""
    buildings = max(0, -(-(locales - 12) // LOCALES_IN_BUILDING))
    path = folder / f"campus-{buildings}.world"
    if not path.is_file():
        folder.mkdir(parents=True, exist_ok=True)
        own = path.with_name(f"{path.name}.{os.getpid()}")
        layers = [load_world(WORLDS / "research_center.toml"),
                  load_world(WORLDS / "research_center.toml", details=[DETAILS])]
        plan = _Plan(layers[0], buildings)
        write_frames(own, [plan.frames(layers[0]), plan.frames(layers[1])], [plan.counts(w) for w in layers],
                     [DETAILS.stem])
        os.replace(own, path)
    world = load_world(path)
    return Campus(path, len(world.frames), world.counts()["face"])


class _Plan:
    """Locales and passages of a campus; its geometry is made building by building."""

    def __init__(self, center: World, buildings: int) -> None:
        self._center, self._buildings = center, buildings
        self._locales: dict[str, Locale] = {}
        self._doorways: list[Doorway] = list(center.doorways)
        self._links: list[Link] = []
        self._places: dict[str, tuple[int, float, float]] = {}
        side = FIRST_M + BUILDING_M[0] * ROW
        deep = FIRST_M + BUILDING_M[1] * (buildings // ROW + 2)
        self._add(Locale("campus", "campus", None, Pose.identity(),
                         _rectangle(-FIRST_M, -FIRST_M, side + FIRST_M, deep), 50.0))
        for name, locale in center.locales.items():  # as it is, one level further down
            self._add(replace(locale, parent="campus") if name == center.root else locale)
        before = "hallway"
        for number, first in enumerate(range(0, buildings, ROW)):
            before = self._district(number, range(first, min(first + ROW, buildings)), before)

    def counts(self, center: World) -> dict[str, int]:
        """How much there is, with the Research Center's model or details."""
        packets = _packets("", 0.0, 0.0, 0) if self._buildings else ()
        containers = {locale.parent for locale in self._locales.values()}
        more = {"room": sum(name not in containers for name in self._locales) - len(center.rooms),
                "open doorway": len(self._doorways) - len(center.doorways),
                "face": self._buildings * sum(len(packet.faces) for packet in packets),
                "landmark": self._buildings * sum(len(packet.landmarks) for packet in packets)}
        return {key: count + more.get(key, 0) for key, count in center.counts().items()}

    def frames(self, center: World) -> Iterator[LocaleFrame]:
        """The frames of all locales, with the Research Center's model or details."""
        made: dict[str, dict[str, list[LocaleGeometry]]] = {}

        def parts_of(name: str) -> tuple[LocaleGeometry, ...]:
            if name in center.frames:
                return center.frames[name].parts
            prefix = name.partition("-")[0]
            if prefix not in self._places:
                return ()
            if prefix not in made:
                made.clear()
                made[prefix] = self._geometry(prefix)
            return tuple(made[prefix].get(name, ()))

        frames = iterate_frames(self._locales, self._doorways, self._links, center.things, parts_of)
        yield from tqdm(frames, total=len(self._locales), desc="writing the campus", unit="locale", file=sys.stderr,
                        leave=False, disable=not sys.stderr.isatty())

    def _add(self, locale: Locale) -> None:
        self._locales[locale.name] = locale

    def _district(self, number: int, row: range, before: str) -> str:
        """Add a row of buildings; returns the name of its grounds, which follow those of ``before``."""
        y = FIRST_M + number * BUILDING_M[1]
        name, grounds = f"district-{number}", f"grounds-{number}"
        width = BUILDING_M[0] * ROW
        self._add(Locale(name, "district", "campus", Pose(np.eye(3), np.array([FIRST_M, y, 0.0])),
                         _rectangle(0.0, 0.0, width, BUILDING_M[1]), 40.0))
        self._add(Locale(grounds, "grounds", name, Pose.identity(), _rectangle(0.0, 0.0, width, 6.0), 40.0))
        self._link(f"path-{number}", before, grounds, (FIRST_M + 1.0, y + 1.0))
        for place, building in enumerate(row):
            x = FIRST_M + place * BUILDING_M[0]
            prefix = f"b{building}"
            self._places[prefix] = building, x, y + 8.0
            for locale in _locales(prefix, name, x - FIRST_M, 8.0):
                self._add(locale)
            corridor = f"{prefix}-f0-corridor"
            self._link(f"{prefix}-entrance", grounds, corridor, (x + 2.0, y + 2.0))
            for floor in range(1, FLOORS):
                self._link(f"{prefix}-elevator-{floor}", corridor, f"{prefix}-f{floor}-corridor", (x + 3.0, y + 12.0))
            self._doorways += _doorways(prefix, x, y + 8.0)
        return grounds

    def _link(self, name: str, a: str, b: str, at: tuple[float, float]) -> None:
        self._links.append(Link(name, "elevator", (a, b), np.array([(*at, 0.0)] * 2)))

    def _geometry(self, prefix: str) -> dict[str, list[LocaleGeometry]]:
        """The geometry of the locales of a building."""
        building, x, y = self._places[prefix]
        known: dict[str, list[LocaleGeometry]] = {}
        for packet in _packets(prefix, x, y, 10_000 + 10_000 * building):
            for name in (packet.locale, *([packet.neighbour] if packet.neighbour else [])):
                known.setdefault(name, []).append(packet)
        return known


def _locales(prefix: str, district: str, x: float, y: float) -> Iterator[Locale]:
    yield Locale(prefix, "building", district, Pose(np.eye(3), np.array([x, y, 0.0])),
                 _rectangle(-1.0, -1.0, ROOMS // 2 * (ROOM_M + WALL_M) + 1.0, FLOORS * FLOOR_PITCH_M), 30.0,
                 {"owner": f"Department {prefix[1:]}"})
    for floor in range(FLOORS):
        name = f"{prefix}-f{floor}"
        outline = _rectangle(-0.5, -0.5, ROOMS // 2 * (ROOM_M + WALL_M) + 0.5, 2 * ROOM_M + CORRIDOR_M + 1.0)
        yield Locale(name, "floor", prefix, Pose(np.eye(3), np.array([0.0, floor * FLOOR_PITCH_M, 0.0])), outline,
                     3.0, {"elevation_m": 3.5 * floor})
        for room in _rooms():
            frame = Pose(np.eye(3), np.array([room.x, room.y, 0.0]))
            yield Locale(f"{name}-{room.name}", "corridor" if room.name == "corridor" else "office", name, frame,
                         _rectangle(0.0, 0.0, room.width, room.depth), HEIGHT_M)


def _doorways(prefix: str, x: float, y: float) -> Iterator[Doorway]:
    for floor in range(FLOORS):
        for room in _rooms()[1:]:
            inner, outer = room.threshold(x, y + floor * FLOOR_PITCH_M)
            name = f"{prefix}-f{floor}"
            yield Doorway(f"{name}-{room.name}-door", (f"{name}-{room.name}", f"{name}-corridor"),
                          np.array([inner, outer[::-1]]), DOOR_HEIGHT_M)


@dataclass(frozen=True, slots=True)
class _Room:
    """A rectangle on its floor; the corridor lies to its north or south."""

    name: str
    x: float
    y: float
    width: float
    depth: float
    door_north: bool = True

    def threshold(self, x: float, y: float) -> tuple[list[tuple[float, float]], list[tuple[float, float]]]:
        """Feet of the jambs on the room's and on the corridor's wall, left one first as seen from the room."""
        left = x + self.x + (self.width - DOOR_M) / 2
        near = y + self.y + (self.depth if self.door_north else 0.0)
        far = near + (WALL_M if self.door_north else -WALL_M)
        ends = (left, left + DOOR_M) if self.door_north else (left + DOOR_M, left)
        return [(end, near) for end in ends], [(end, far) for end in ends]


def _rooms() -> list[_Room]:
    """The corridor first."""
    half, pitch = ROOMS // 2, ROOM_M + WALL_M
    south = ROOM_M + WALL_M
    rooms = [_Room("corridor", 0.0, south, half * pitch - WALL_M, CORRIDOR_M)]
    rooms += [_Room(f"r{i}", i * pitch, 0.0, ROOM_M, ROOM_M) for i in range(half)]
    rooms += [_Room(f"r{half + i}", i * pitch, south + CORRIDOR_M + WALL_M, ROOM_M, ROOM_M, False) for i in range(half)]
    return rooms


def _packets(prefix: str, x: float, y: float, first: int) -> list[LocaleGeometry]:
    """The faces and landmarks of a building with its corner at (x, y), numbered from ``first``."""
    packets, faces, marks = [], first, first
    for floor in range(FLOORS):
        base = y + floor * FLOOR_PITCH_M
        for room in _rooms():
            own = _shell(f"{prefix}-f{floor}-{room.name}", room, x, base)
            mark = Landmark(f"{own[0].locale}/corners", own[0].locale, "wall", _corners(room, x, base))
            packets.append(LocaleGeometry(own[0].locale, None, tuple(enumerate(own, faces)), ((marks, mark),)))
            faces, marks = faces + len(own), marks + 1
            if room.name != "corridor":
                door = _door(f"{prefix}-f{floor}", room, x, base)
                corridor = f"{prefix}-f{floor}-corridor"
                packets.append(LocaleGeometry(own[0].locale, corridor, tuple(enumerate(door, faces)), ()))
                faces += len(door)
    return packets


def _shell(name: str, room: _Room, x: float, y: float) -> list[Face]:
    x0, y0 = x + room.x, y + room.y
    x1, y1 = x0 + room.width, y0 + room.depth
    floor = [(x0, y0, 0.0), (x1, y0, 0.0), (x1, y1, 0.0), (x0, y1, 0.0)]
    ceiling = [(cx, cy, HEIGHT_M) for cx, cy, _ in reversed(floor)]
    faces = [build_barrier(f"{name}/floor", name, floor, FLOOR),
             build_barrier(f"{name}/ceiling", name, ceiling, CEILING)]
    sides = zip(("south", "east", "north", "west"), floor, [*floor[1:], floor[0]], strict=True)
    return faces + [build_barrier(f"{name}/{side}-wall", name, _upright(b, a, HEIGHT_M), WALL) for side, a, b in sides]


def _corners(room: _Room, x: float, y: float) -> Edges:
    """The four upright corners of a room."""
    x0, y0 = x + room.x, y + room.y
    x1, y1 = x0 + room.width, y0 + room.depth
    rows = []
    for cx, cy, nx, ny in ((x0, y0, 1.0, 1.0), (x1, y0, -1.0, 1.0), (x1, y1, -1.0, -1.0), (x0, y1, 1.0, -1.0)):
        normals = np.array([(nx, 0.0, 0.0), (0.0, ny, 0.0)])
        levels = [*(expected_brightness(WALL, n) for n in normals), float("nan")]
        rows.append(([(cx, cy, 0.0), (cx, cy, HEIGHT_M)], normals, levels))
    return Edges.from_rows(rows)


def _door(prefix: str, room: _Room, x: float, y: float) -> list[Face]:
    """The opening seen from both sides, jambs, soffit and threshold."""
    (a, b), (c, d) = room.threshold(x, y)
    name, locale, corridor = f"{prefix}-{room.name}-door", f"{prefix}-{room.name}", f"{prefix}-corridor"
    low = [(*p, 0.0) for p in (a, b, d, c)]
    high = [(*p, DOOR_HEIGHT_M) for p in (a, b, d, c)]
    near = Face(f"{name}/in", locale, np.array(_upright(low[0], low[1], DOOR_HEIGHT_M)), "doorway", corridor)
    far = Face(f"{name}/out", locale, np.array(_upright(low[2], low[3], DOOR_HEIGHT_M)), "doorway", corridor)
    more = {"neighbour": corridor, "parent": near.name}
    return [
        near, far,
        build_barrier(f"{name}/left-jamb", locale, _upright(low[3], low[0], DOOR_HEIGHT_M), FRAME, **more),
        build_barrier(f"{name}/right-jamb", locale, _upright(low[1], low[2], DOOR_HEIGHT_M), FRAME, **more),
        build_barrier(f"{name}/soffit", locale, high[::-1], FRAME, **more),
        build_barrier(f"{name}/threshold", locale, low, FLOOR, **more),
    ]


def _upright(start: Sequence[float], end: Sequence[float], height: float) -> list[tuple[float, float, float]]:
    return [(start[0], start[1], 0.0), (end[0], end[1], 0.0), (end[0], end[1], height), (start[0], start[1], height)]


def _rectangle(x0: float, y0: float, x1: float, y1: float) -> NDArray[np.float64]:
    return np.array([(x0, y0), (x1, y0), (x1, y1), (x0, y1)])
