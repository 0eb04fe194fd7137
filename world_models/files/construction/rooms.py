"""Room shells: floor, ceiling and walls with their openings, baseboards and mouldings."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from world_models.building.geometry.faces import Face, Finish, build_region, expected_brightness
from world_models.building.geometry.landmarks import Edges, Landmark
from world_models.building.geometry.outlines import convex_pieces, subtract_intervals
from world_models.building.geometry.solids import MIN_LINE_M, Box, Range, Solid, Surface, surface_from_polygon
from world_models.files.construction.specs import LocaleSpec, RoomFinishes
from world_models.frames import Pose

CASING_WIDTH_M, CASING_DEPTH_M = 0.10, 0.02
"""Of the boards round a door; depth is measured from the wall."""
BASEBOARD_HEIGHT_M, BASEBOARD_DEPTH_M = 0.10, 0.015
MOULDING_HEIGHT_M, MOULDING_DEPTH_M = 0.08, 0.04

UP = np.array([0.0, 0.0, 1.0])

SKY_BRIGHTNESS = 0.85
"""Expected brightness of the sky, 0..1."""

MIN_STRETCH_M = 1e-3
"""Shorter stretches of wall are left out."""

_Row = tuple[NDArray[np.float64], tuple[NDArray[np.float64], NDArray[np.float64]], tuple[float, float, float]]
"""(line, normals, brightness) as :class:`Edges` takes them."""


@dataclass(frozen=True)
class Opening:
    """A hole in a wall from the floor up: extent along the wall and height [m], and the locale beyond.

    Attributes:
        frame_m: how wide the boards round it are; 0 where it has none.
    """

    name: str
    left_m: float
    right_m: float
    top_m: float
    neighbour: str | None
    frame_m: float = CASING_WIDTH_M


@dataclass(frozen=True, eq=False)
class Wall:
    """One wall of a room.

    Its coordinate frame: origin on the floor at its right end as seen from inside, x along it to the left, y into the
    room, z up.
    """

    locale: str
    name: str
    world_from_wall: Pose
    length_m: float
    height_m: float
    finish: Finish
    openings: tuple[Opening, ...] = ()

    @property
    def face_name(self) -> str:
        return f"{self.locale}/{self.name}-wall"

    @property
    def inward_world(self) -> NDArray[np.float64]:
        """(3,) unit normal into the room."""
        return np.asarray(self.world_from_wall.rotation[:, 1])

    @property
    def brightness(self) -> float:
        return expected_brightness(self.finish, self.inward_world)

    @property
    def polygon_world(self) -> NDArray[np.float64]:
        return self.rectangle((0.0, self.length_m), (0.0, self.height_m))

    def rectangle(self, x: Range, z: Range, y: float = 0.0) -> NDArray[np.float64]:
        """(4, 3) an upright rectangle parallel to the wall, counter-clockwise as seen from inside [m, world]."""
        return self.world_from_wall.apply([(x[1], y, z[0]), (x[0], y, z[0]), (x[0], y, z[1]), (x[1], y, z[1])])

    def free_of_openings(self, *, with_frames: bool = False) -> list[Range]:
        """The stretches between its openings; ``with_frames``: and between the boards round them."""
        margins = [o.frame_m if with_frames else 0.0 for o in self.openings]
        taken = [(o.left_m - m, o.right_m + m) for o, m in zip(self.openings, margins, strict=True)]
        return subtract_intervals((0.0, self.length_m), taken, MIN_STRETCH_M)

    @property
    def top_stretches(self) -> list[Range]:
        """The stretches that reach its full height."""
        taken = [(o.left_m, o.right_m) for o in self.openings if o.top_m >= self.height_m]
        return subtract_intervals((0.0, self.length_m), taken, MIN_STRETCH_M)

    def with_opening(self, opening: Opening) -> Wall:
        """The wall with one more opening."""
        return replace(self, openings=tuple(sorted((*self.openings, opening), key=lambda o: o.left_m)))


def build_walls(spec: LocaleSpec, world_from_locale: Pose) -> list[Wall]:
    """The walls of a room, one for each side of its outline, without openings."""
    if spec.outline is None:
        return []
    walls = []
    for name, start, end in zip(spec.wall_names, spec.outline, np.roll(spec.outline, -1, axis=0), strict=True):
        length = float(np.linalg.norm(end - start))
        x = np.array([*(end - start) / length, 0.0])
        frame = Pose(np.stack([x, np.cross(UP, x), UP], axis=1), np.array([*start, 0.0]))
        height = spec.wall_heights_m.get(name, spec.height_m)
        walls.append(Wall(spec.name, name, world_from_locale @ frame, length, height, spec.finishes.walls[name]))
    return walls


def coordinate_along_wall(wall_from_locale: Pose, locale_xy: Sequence[float]) -> float:
    """The wall's x of a point (2,) in the locale's frame [m]."""
    return float(wall_from_locale.apply([*locale_xy, 0.0])[0])


@dataclass(frozen=True, eq=False)
class RoomShell:
    """An empty room: ``walls`` with their openings cut, floor and ceiling."""

    spec: LocaleSpec
    walls: tuple[Wall, ...]
    world_from_locale: Pose

    @cached_property
    def surfaces(self) -> tuple[Surface, ...]:
        """The planes that things in the room stand on or against."""
        finishes = self.spec.finishes
        low, high = self.world_from_locale.apply([(0.0, 0.0, 0.0), (0.0, 0.0, self.spec.height_m)])[:, 2]
        above = [Surface(-UP, -float(high), expected_brightness(finishes.ceiling, -UP))] if finishes.ceiling else []
        return (
            Surface(UP, float(low), expected_brightness(finishes.floor, UP)), *above,
            *(surface_from_polygon(wall.polygon_world, wall.finish) for wall in self.walls),
        )

    def faces(self) -> list[Face]:
        """Floor, ceiling, walls and trim."""
        finishes = self.spec.finishes
        faces = [self._build_flat_face("floor", finishes.floor)]
        if finishes.ceiling:
            faces.append(self._build_flat_face("ceiling", finishes.ceiling))
        for index, wall in enumerate(self.walls):
            faces.append(_build_wall_face(wall))
            for solid in self._build_trim(index):
                faces.extend(solid.faces(wall.locale, parent=wall.face_name))
        return faces

    def landmarks(self) -> list[Landmark]:
        """One landmark for each wall: its trim and the corner at its start."""
        return [Landmark(wall.face_name, wall.locale, "wall", self._build_wall_edges(index), source=self.spec.source)
                for index, wall in enumerate(self.walls)]

    def _build_flat_face(self, name: str, finish: Finish) -> Face:
        up = name == "floor"
        assert self.spec.outline is not None
        z = 0.0 if up else self.spec.height_m
        name = f"{self.spec.name}/{name}"
        flat = np.column_stack([self.spec.outline, np.full(len(self.spec.outline), z)])
        pieces = [[*corners] if up else [*corners][::-1] for corners in convex_pieces(self.spec.outline)]
        polygons = [self.world_from_locale.apply(flat[piece]) for piece in pieces]
        regions = tuple(build_region(f"{name}/{index}", polygon, finish) for index, polygon in enumerate(polygons))
        outline = self.world_from_locale.apply(flat if up else flat[::-1])
        return Face(name, self.spec.name, outline, front=regions)

    def _build_trim(self, index: int) -> list[Solid]:
        """Baseboard and moulding of a wall, where it has them."""
        wall, finishes = self.walls[index], self.spec.finishes
        solids = []
        if finishes.baseboard:
            stretches = wall.free_of_openings(with_frames=True)
            z = (0.0, BASEBOARD_HEIGHT_M)
            solids.append(self._build_strip(index, "baseboard", finishes.baseboard, stretches, z, BASEBOARD_DEPTH_M))
        if finishes.moulding:
            z = (wall.height_m - MOULDING_HEIGHT_M, wall.height_m)
            solids.append(
                self._build_strip(index, "moulding", finishes.moulding, wall.top_stretches, z, MOULDING_DEPTH_M))
        return solids

    def _build_strip(
        self, index: int, name: str, finish: Finish, stretches: Sequence[Range], z: Range, depth_m: float
    ) -> Solid:
        """Boards along a wall; in a concave corner they end at the front of the next wall's board."""
        wall, ahead = self.walls[index], self.walls[(index + 1) % len(self.walls)]
        along, surfaces = wall.world_from_wall.rotation[:, 0], self.surfaces
        end = wall.length_m
        if float(along @ ahead.inward_world) < -1e-6:
            end -= depth_m
            front = ahead.rectangle((0.0, 1.0), (0.0, 1.0), depth_m)
            surfaces = (*surfaces, surface_from_polygon(front, finish))
        boxes = [Box((low, min(high, end)), (0.0, depth_m), z, finish)
                 for low, high in stretches if low < end - MIN_STRETCH_M]
        return Solid(f"{wall.face_name}/{name}", tuple(boxes), wall.world_from_wall, surfaces)

    def _build_wall_edges(self, index: int) -> Edges:
        wall, before = self.walls[index], self.walls[index - 1]
        finishes, rows = self.spec.finishes, []
        low, high = bare_wall_range(finishes, min(wall.height_m, before.height_m))
        beside = [o.top_m for o in wall.openings if o.left_m <= 0.0]
        beside += [o.top_m for o in before.openings if o.right_m >= before.length_m]
        low, nan = max([low, *beside]), float("nan")
        if high - low >= MIN_LINE_M:
            rows.append((wall.world_from_wall.apply([(0, 0, low), (0, 0, high)]),
                         (wall.inward_world, before.inward_world), (wall.brightness, before.brightness, nan)))
        flats = [(0.0, finishes.floor, UP, finishes.baseboard)]
        if finishes.ceiling is None:
            rows += self._build_skyline(wall, before)
        else:
            flats.append((wall.height_m, finishes.ceiling, -UP, finishes.moulding))
        for z, finish, normal, board in flats:
            for x in wall.free_of_openings(with_frames=True) if z == 0.0 else wall.top_stretches:
                if board is None and x[1] - x[0] >= MIN_LINE_M:
                    line = wall.world_from_wall.apply([(x[0], 0, z), (x[1], 0, z)])
                    brightness = (wall.brightness, expected_brightness(finish, normal), nan)
                    rows.append((line, (wall.inward_world, normal), brightness))
        return Edges.concatenate([Edges.from_rows(rows), *(solid.edges() for solid in self._build_trim(index))])

    def _build_skyline(self, wall: Wall, before: Wall) -> list[_Row]:
        """Edges against the sky: the top of a wall, and the vertical end of whichever wall at its start is higher."""
        nan, rows = float("nan"), []
        tops = [(wall, [(low, 0.0, wall.height_m), (high, 0.0, wall.height_m)]) for low, high in wall.top_stretches]
        if wall.height_m > before.height_m:
            tops.append((wall, [(0.0, 0.0, before.height_m), (0.0, 0.0, wall.height_m)]))
        elif before.height_m > wall.height_m:
            end = before.length_m
            tops.append((before, [(end, 0.0, wall.height_m), (end, 0.0, before.height_m)]))
        for seen, line in tops:
            normals = (seen.inward_world, seen.inward_world)
            rows.append((seen.world_from_wall.apply(line), normals, (seen.brightness, SKY_BRIGHTNESS, nan)))
        return rows


def bare_wall_range(finishes: RoomFinishes, height_m: float) -> Range:
    """Where the wall between baseboard and moulding begins and ends above the floor [m]."""
    low = BASEBOARD_HEIGHT_M if finishes.baseboard else 0.0
    return low, height_m - (MOULDING_HEIGHT_M if finishes.moulding else 0.0)


def _build_wall_face(wall: Wall) -> Face:
    """The face of a wall, with one region for each stretch between openings and one above each opening."""
    full = (0.0, wall.height_m)
    rectangles = [(x, full) for x in wall.free_of_openings()]
    rectangles += [((o.left_m, o.right_m), (o.top_m, wall.height_m)) for o in wall.openings if o.top_m < wall.height_m]
    name = wall.face_name
    regions = tuple(build_region(f"{name}/{i}", wall.rectangle(x, z), wall.finish)
                    for i, (x, z) in enumerate(rectangles))
    return Face(name, wall.locale, wall.polygon_world, front=regions)
