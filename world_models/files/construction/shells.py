"""Room shells: floor, ceiling and walls with their openings, baseboards and crown mouldings."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from world_models.building.faces import Face
from world_models.building.intervals import subtract_intervals
from world_models.building.landmarks import Edges, Landmark
from world_models.building.outlines import convex_pieces
from world_models.building.regions import Finish, build_region, expected_brightness
from world_models.building.solids import MIN_LINE_M, Box, Range, Solid, Surface, surface_from_polygon
from world_models.files.construction.blueprint import LocaleSpec, RoomLook
from world_models.frames import Pose

CASING_M = 0.10
"""Width of the boards round a door."""

CASING_PROUD_M = 0.02
BASEBOARD_M, BASEBOARD_PROUD_M = 0.10, 0.015
MOULDING_M, MOULDING_PROUD_M = 0.08, 0.04

UP = np.array([0.0, 0.0, 1.0])

SKY = 0.85
"""The brightness, 0..1, that the model expects of the sky."""

_Row = tuple[NDArray[np.float64], tuple[NDArray[np.float64], NDArray[np.float64]], tuple[float, float, float]]
"""A line, the normals beside it and the brightnesses, as :class:`Edges` wants them."""


@dataclass(frozen=True)
class Opening:
    """A hole in a wall from the floor up: extent along the wall and height [m]."""

    name: str
    left_m: float
    right_m: float
    top_m: float
    neighbour: str | None


@dataclass(frozen=True, eq=False)
class Wall:
    """One wall of a room, seen from inside.

    Its frame: origin at its right end on the floor as one faces it, x along it to the left (so to the right as one
    stands with the back to it), y into the room, z up.
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
        """(4, 3) an upright rectangle parallel to the wall, counter-clockwise from inside the room [m, world]."""
        return self.world_from_wall.apply([(x[1], y, z[0]), (x[0], y, z[0]), (x[0], y, z[1]), (x[1], y, z[1])])

    def free_of_openings(self, margin_m: float = 0.0) -> list[Range]:
        """The stretches between its openings, which are taken to be wider by the margin on both sides."""
        taken = [(o.left_m - margin_m, o.right_m + margin_m) for o in self.openings]
        return subtract_intervals((0.0, self.length_m), taken, 1e-3)

    def with_opening(self, opening: Opening) -> Wall:
        return replace(self, openings=tuple(sorted((*self.openings, opening), key=lambda o: o.left_m)))


def walls_of(spec: LocaleSpec, world_from_locale: Pose) -> list[Wall]:
    """The walls of a room, one for each side of its outline, without openings."""
    if spec.outline is None:
        return []
    walls = []
    for name, start, end in zip(spec.wall_names, spec.outline, np.roll(spec.outline, -1, axis=0), strict=True):
        length = float(np.linalg.norm(end - start))
        x = np.array([*(end - start) / length, 0.0])
        frame = Pose(np.stack([x, np.cross(UP, x), UP], axis=1), np.array([*start, 0.0]))
        height = spec.wall_heights_m.get(name, spec.height_m)
        walls.append(Wall(spec.name, name, world_from_locale @ frame, length, height, spec.look.walls[name]))
    return walls


def along_wall(wall_from_locale: Pose, locale_xy: Sequence[float]) -> float:
    """Where along the wall (its x) the point (2,) of the locale's frame lies."""
    return float(wall_from_locale.apply([*locale_xy, 0.0])[0])


@dataclass(frozen=True, eq=False)
class Shell:
    """An empty room: ``walls`` with their openings cut, floor and ceiling."""

    spec: LocaleSpec
    walls: tuple[Wall, ...]
    world_from_locale: Pose

    @cached_property
    def surfaces(self) -> tuple[Surface, ...]:
        """What things in the room stand on or against."""
        look, up = self.spec.look, self.world_from_locale.apply([(0.0, 0.0, 0.0), (0.0, 0.0, self.spec.height_m)])[:, 2]
        above = [Surface(-UP, -float(up[1]), expected_brightness(look.ceiling, -UP))] if look.ceiling else []
        return (
            Surface(UP, float(up[0]), expected_brightness(look.floor, UP)), *above,
            *(surface_from_polygon(wall.polygon_world, wall.finish) for wall in self.walls),
        )

    def faces(self) -> list[Face]:
        """Floor, ceiling, walls and trim."""
        look = self.spec.look
        faces = [self._flat("floor", look.floor), *([self._flat("ceiling", look.ceiling)] if look.ceiling else [])]
        for index, wall in enumerate(self.walls):
            faces.append(_wall_face(wall))
            for solid in self._trim(index):
                faces.extend(solid.faces(wall.locale, parent=wall.face_name))
        return faces

    def landmarks(self) -> list[Landmark]:
        """One for each wall: its trim and the corner at its end."""
        return [Landmark(wall.face_name, wall.locale, "wall", self._wall_edges(index), source=self.spec.source)
                for index, wall in enumerate(self.walls)]

    def _flat(self, name: str, finish: Finish) -> Face:
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

    def _trim(self, index: int) -> list[Solid]:
        """Baseboard and moulding of a wall."""
        wall, look = self.walls[index], self.spec.look
        solids = []
        if look.baseboard:
            stretches = wall.free_of_openings(CASING_M)
            z = (0.0, BASEBOARD_M)
            solids.append(self._strip(index, "baseboard", look.baseboard, stretches, z, BASEBOARD_PROUD_M))
        if look.moulding:
            z = (wall.height_m - MOULDING_M, wall.height_m)
            solids.append(self._strip(index, "moulding", look.moulding, [(0.0, wall.length_m)], z, MOULDING_PROUD_M))
        return solids

    def _strip(
        self, index: int, name: str, finish: Finish, stretches: Sequence[Range], z: Range, protrusion_m: float
    ) -> Solid:
        """Boards along a wall; in an inner corner they end at the front of the next wall's board."""
        wall, ahead = self.walls[index], self.walls[(index + 1) % len(self.walls)]
        along, surfaces = wall.world_from_wall.rotation[:, 0], self.surfaces
        end = wall.length_m
        if float(along @ ahead.inward_world) < -1e-6:
            end -= protrusion_m
            front = ahead.rectangle((0.0, 1.0), (0.0, 1.0), protrusion_m)
            surfaces = (*surfaces, surface_from_polygon(front, finish))
        boxes = [Box((low, min(high, end)), (0.0, protrusion_m), z, finish)
                 for low, high in stretches if low < end - 1e-3]
        return Solid(f"{wall.face_name}/{name}", tuple(boxes), wall.world_from_wall, surfaces)

    def _wall_edges(self, index: int) -> Edges:
        wall, before = self.walls[index], self.walls[index - 1]
        look, rows = self.spec.look, []
        low, high = trim_heights(look, min(wall.height_m, before.height_m))
        nan = float("nan")
        rows.append((wall.world_from_wall.apply([(0, 0, low), (0, 0, high)]),
                     (wall.inward_world, before.inward_world), (wall.brightness, before.brightness, nan)))
        flats = [(0.0, look.floor, UP, look.baseboard)]
        if look.ceiling is None:
            rows += self._skyline(wall, before)
        else:
            flats.append((wall.height_m, look.ceiling, -UP, look.moulding))
        for z, finish, normal, board in flats:
            for x in wall.free_of_openings(CASING_M) if board is None and z == 0.0 else [(0.0, wall.length_m)]:
                if board is None and x[1] - x[0] >= MIN_LINE_M:
                    line = wall.world_from_wall.apply([(x[0], 0, z), (x[1], 0, z)])
                    brightness = (wall.brightness, expected_brightness(finish, normal), nan)
                    rows.append((line, (wall.inward_world, normal), brightness))
        return Edges.concatenate([Edges.from_rows(rows), *(solid.edges() for solid in self._trim(index))])


    def _skyline(self, wall: Wall, before: Wall) -> list[_Row]:
        """The top of a wall under the sky, and its end where it is higher than the one before, or that one's."""
        nan, rows = float("nan"), []
        tops = [(wall, [(0.0, 0.0, wall.height_m), (wall.length_m, 0.0, wall.height_m)])]
        if wall.height_m > before.height_m:
            tops.append((wall, [(0.0, 0.0, before.height_m), (0.0, 0.0, wall.height_m)]))
        elif before.height_m > wall.height_m:
            end = before.length_m
            tops.append((before, [(end, 0.0, wall.height_m), (end, 0.0, before.height_m)]))
        for seen, line in tops:
            normals = (seen.inward_world, seen.inward_world)
            rows.append((seen.world_from_wall.apply(line), normals, (seen.brightness, SKY, nan)))
        return rows


def trim_heights(look: RoomLook, height_m: float) -> Range:
    """Where the bare wall begins and ends above the floor."""
    return (BASEBOARD_M if look.baseboard else 0.0), height_m - (MOULDING_M if look.moulding else 0.0)


def _wall_face(wall: Wall) -> Face:
    """The wall with a convex region for each stretch between openings and each header above one."""
    full = (0.0, wall.height_m)
    rectangles = [(x, full) for x in wall.free_of_openings()]
    rectangles += [((o.left_m, o.right_m), (o.top_m, wall.height_m)) for o in wall.openings]
    name = wall.face_name
    regions = tuple(build_region(f"{name}/{i}", wall.rectangle(x, z), wall.finish)
                    for i, (x, z) in enumerate(rectangles))
    return Face(name, wall.locale, wall.polygon_world, front=regions)
