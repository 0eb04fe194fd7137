"""Solids made of boxes, and the faces and model lines that follow from them (§3.4)."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from world_models.building.geometry.faces import Face, Finish, build_barrier, expected_brightness
from world_models.building.geometry.landmarks import Edges
from world_models.building.geometry.outlines import Interval, subtract_intervals
from world_models.frames import Pose

CONTACT_M = 1.5e-3
"""Surfaces this near to each other touch."""

MIN_LINE_M = 0.05
"""Shorter edges are no model lines."""

MAX_THIN_M = 0.03
"""A box this thin on a wall is seen against that wall from everywhere."""

Range = Interval
"""Extent along an axis [m]."""
Side = tuple[int, int]
"""A side of a box: axis 0..2, and 0 for its low or 1 for its high end."""

SIDES: tuple[Side, ...] = tuple((axis, end) for axis in range(3) for end in range(2))

BOX_EDGES: tuple[tuple[int, Side, Side], ...] = tuple(
    (axis, (b, i), (c, j)) for axis, b, c in ((0, 1, 2), (1, 0, 2), (2, 0, 1)) for i in range(2) for j in range(2)
)
"""Direction of each of the twelve edges of a box, and the two sides that meet in it."""


@dataclass(frozen=True)
class Box:
    """A block in the frame of a part: x to the right with the back to the wall, y off the wall, z up [m]."""

    x: Range
    y: Range
    z: Range
    finish: Finish

    @cached_property
    def ranges(self) -> tuple[Range, Range, Range]:
        return self.x, self.y, self.z

    def side(self, side: Side) -> NDArray[np.float64]:
        """(4, 3) corners of a side, counter-clockwise as seen from outside [m, part frame]."""
        axis, end = side
        b, c = (axis + 1) % 3, (axis + 2) % 3
        corners = np.empty((4, 3))
        corners[:, axis] = self.ranges[axis][end]
        (b_low, b_high), (c_low, c_high) = self.ranges[b], self.ranges[c]
        corners[:, b] = b_low, b_high, b_high, b_low
        corners[:, c] = c_low, c_low, c_high, c_high
        return corners if end else corners[::-1]


@dataclass(frozen=True, slots=True)
class Surface:
    """A plane that things stand on or against: floor, ceiling, wall or door leaf.

    Attributes:
        normal_world: (3,) unit, towards the room.
        offset_m: normal . p for its points.
        brightness: expected, 0..1.
    """

    normal_world: NDArray[np.float64]
    offset_m: float
    brightness: float

    def opposes(self, normal_world: NDArray[np.float64]) -> bool:
        """Whether a side with this outward normal may lie against it."""
        return float(self.normal_world @ normal_world) < -0.999

    def touches(self, corners_world: Any) -> bool:
        """Whether a side that it opposes, with these corners, lies against it."""
        return bool(np.abs(corners_world @ self.normal_world - self.offset_m).max() < CONTACT_M)


def surface_from_polygon(polygon_world: NDArray[np.float64], finish: Finish) -> Surface:
    """The plane of a flat polygon (k, 3) [m, world] that is counter-clockwise as seen from its front."""
    normal = np.cross(polygon_world[1] - polygon_world[0], polygon_world[2] - polygon_world[1])
    normal = normal / np.linalg.norm(normal)
    return Surface(normal, float(normal @ polygon_world[0]), expected_brightness(finish, normal))


@dataclass(frozen=True, eq=False)
class Solid:
    """Boxes that stand somewhere.

    Attributes:
        name: unique in the world.
        boxes: in the part's frame.
        world_from_part: pose of the part; its z axis is up.
        surfaces: planes that it may stand on or against.
    """

    name: str
    boxes: tuple[Box, ...]
    world_from_part: Pose
    surfaces: tuple[Surface, ...] = ()

    def faces(self, locale: str, **more: Any) -> list[Face]:
        """The visible sides, each a face with one region; ``more`` goes to every Face."""
        return [
            build_barrier(f"{self.name}/{index}{'xyz'[axis]}{'-+'[end]}", locale,
                    self.world_from_part.apply(box.side((axis, end))), box.finish, **more)
            for index, box in enumerate(self.boxes)
            for axis, end in SIDES
            if (axis, end) not in self._covered[index]
        ]

    def edges(self) -> Edges:
        """Its model lines: each edge once, along the stretches where it is visible."""
        taken: dict[tuple[float, ...], list[Range]] = {}
        rows = []
        for index, box in enumerate(self.boxes):
            for axis, first, second in BOX_EDGES:
                place = (float(axis), *(round(box.ranges[a][e], 3) for a, e in (first, second)), float(first[0]))
                known = taken.setdefault(place, [])
                for whole, sides in self._visible_stretches(index, axis, first, second):
                    for extent in subtract_intervals(whole, known, MIN_LINE_M):
                        rows.append((self.world_from_part.apply(_edge(box, axis, extent, first, second)), *sides))
                known.append(box.ranges[axis])
        return Edges.from_rows(rows)

    @cached_property
    def _covered(self) -> list[dict[Side, float]]:
        """For each box, its sides that lie wholly against something, with the brightness of the covering surface."""
        covered = []
        for index in range(len(self.boxes)):
            brightness = {side: self._find_cover(index, side) for side in SIDES}
            covered.append({side: value for side, value in brightness.items() if value is not None})
        return covered

    def _find_cover(self, index: int, side: Side) -> float | None:
        """Brightness of the surface or box that covers all of a side; None for an open side."""
        corners = self.world_from_part.apply(self.boxes[index].side(side)) if self._facing[side] else None
        for surface in self._facing[side]:
            if surface.touches(corners):
                return surface.brightness
        for other, box in enumerate(self.boxes):
            if other != index and _covers(box, self.boxes[index], side):
                return self._brightness(box.finish, _opposite(side))
        return None

    def _visible_stretches(
        self, index: int, axis: int, first: Side, second: Side
    ) -> Iterator[tuple[Range, tuple[Any, Any]]]:
        """The visible stretches of an edge, each with (normals, brightness) as :class:`Edges` takes them."""
        stretches: list[tuple[Range, tuple[float | None, float | None]]] = []
        for low, high in self._cut_at_neighbours(index, axis):
            middle = (low + high) / 2
            covers = (self._cover_at(index, axis, middle, first, second),
                      self._cover_at(index, axis, middle, second, first))
            if stretches and stretches[-1][1] == covers:
                low = stretches.pop()[0][0]
            stretches.append(((low, high), covers))
        for extent, covers in stretches:
            sides = self._visible_sides(index, (first, second), covers)
            if sides is not None:
                yield extent, sides

    def _cut_at_neighbours(self, index: int, axis: int) -> list[Range]:
        """The extent of a box along an axis, cut where other boxes begin and end."""
        low, high = self.boxes[index].ranges[axis]
        ends = {end for box in self.boxes for end in box.ranges[axis] if low + CONTACT_M < end < high - CONTACT_M}
        marks = [low, *sorted(ends), high]
        return list(pairwise(marks))

    def _cover_at(self, index: int, axis: int, middle: float, side: Side, other: Side) -> float | None:
        """Brightness of what covers a side next to its edge with ``other``; None where the side is open."""
        edge = self.boxes[index].ranges[other[0]][other[1]]
        inwards = edge - 2 * CONTACT_M if other[1] else edge + 2 * CONTACT_M
        for near in self._touching[index][side]:
            low, high = near.ranges[other[0]]
            if low < inwards < high and near.ranges[axis][0] < middle < near.ranges[axis][1]:
                flush = abs((high if other[1] else low) - edge) < CONTACT_M
                return self._brightness(near.finish, other if flush else _opposite(side))
        return self._covered[index].get(side)

    @cached_property
    def _touching(self) -> list[dict[Side, list[Box]]]:
        """For each box and side, the other boxes with a side in the same plane that faces it."""
        return [
            {side: [b for b in self.boxes if b is not box and _back_to_back(b, box, side)] for side in SIDES}
            for box in self.boxes
        ]

    def _visible_sides(
        self, index: int, sides: tuple[Side, Side], covers: tuple[float | None, float | None]
    ) -> tuple[Any, Any] | None:
        """(normals, brightness) of an edge between two sides; None where it is not visible."""
        finish, background = self.boxes[index].finish, self._background(index)
        normals = [self._normals[side] for side in sides]
        own = [self._brightness(finish, side) for side in sides]
        if covers == (None, None):
            return normals, [*own, background]
        seen = 0 if covers[0] is None else 1
        ground = covers[1 - seen]
        if covers[seen] is not None or ground is None or abs(ground - own[seen]) < 1e-9:
            return None
        return [normals[seen]] * 2, [own[seen], ground, background]

    @cached_property
    def _normals(self) -> dict[Side, NDArray[np.float64]]:
        """(3,) outward unit normal of each side [world]."""
        return {(axis, end): np.asarray(self.world_from_part.rotation[:, axis] * (1.0 if end else -1.0))
                for axis, end in SIDES}

    @cached_property
    def _facing(self) -> dict[Side, list[Surface]]:
        """The surfaces that each side may lie against."""
        return {side: [s for s in self.surfaces if s.opposes(normal)] for side, normal in self._normals.items()}

    @cached_property
    def _known_brightness(self) -> dict[tuple[int, Side], float]:
        return {}

    def _brightness(self, finish: Finish, side: Side) -> float:
        """Expected brightness on a side of the finish of one of the boxes; cached by its identity."""
        key = id(finish), side
        if key not in self._known_brightness:
            self._known_brightness[key] = expected_brightness(finish, self._normals[side])
        return self._known_brightness[key]

    def _background(self, index: int) -> float:
        """Brightness behind a thin box on a wall; NaN for others."""
        for (axis, _), ground in self._covered[index].items():
            low, high = self.boxes[index].ranges[axis]
            if high - low <= MAX_THIN_M:
                return ground
        return float("nan")


def _opposite(side: Side) -> Side:
    return side[0], 1 - side[1]


def _back_to_back(box: Box, other: Box, side: Side) -> bool:
    """Whether a side of ``other`` and the opposite side of ``box`` lie in the same plane."""
    axis, end = side
    return abs(box.ranges[axis][1 - end] - other.ranges[axis][end]) < CONTACT_M


def _covers(box: Box, other: Box, side: Side) -> bool:
    """Whether ``box`` lies against the whole of a side of ``other``."""
    across = [a for a in range(3) if a != side[0]]
    return _back_to_back(box, other, side) and all(
        box.ranges[a][0] <= other.ranges[a][0] + CONTACT_M and box.ranges[a][1] >= other.ranges[a][1] - CONTACT_M
        for a in across
    )


def _edge(box: Box, axis: int, extent: Range, first: Side, second: Side) -> NDArray[np.float64]:
    line = np.empty((2, 3))
    line[:, axis] = extent
    for side_axis, end in (first, second):
        line[:, side_axis] = box.ranges[side_axis][end]
    return line
