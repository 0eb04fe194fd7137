"""The geometer: solids made of boxes become faces to see and model lines to look for (§3.4)."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from world_models.building.faces import Face, build_barrier
from world_models.building.intervals import subtract_intervals
from world_models.building.landmarks import Edges
from world_models.building.regions import Finish, expected_brightness
from world_models.frames import Pose

CONTACT_M = 1.5e-3
"""Surfaces that lie this near to one another touch."""

SHORTEST_LINE_M = 0.05
"""Shorter edges are not worth a model line."""

THIN_M = 0.03
"""What stands out from its wall by no more than this is seen against that wall from everywhere."""

Range = tuple[float, float]
Side = tuple[int, int]
"""A side of a box: axis 0..2 and 0 for its low, 1 for its high end."""

SIDES: tuple[Side, ...] = tuple((axis, end) for axis in range(3) for end in range(2))

BOX_EDGES: tuple[tuple[int, Side, Side], ...] = tuple(
    (axis, (b, i), (c, j)) for axis, b, c in ((0, 1, 2), (1, 0, 2), (2, 0, 1)) for i in range(2) for j in range(2)
)
"""Direction of each of the twelve edges of a box, and the two sides that meet in it."""


@dataclass(frozen=True, slots=True)
class Box:
    """A block in the frame of a part: x to the right as one stands with the back to the wall, y off it, z up [m]."""

    x: Range
    y: Range
    z: Range
    finish: Finish

    @property
    def ranges(self) -> tuple[Range, Range, Range]:
        return self.x, self.y, self.z

    def side(self, side: Side) -> NDArray[np.float64]:
        """(4, 3) the corners of a side, counter-clockwise from outside [m, part frame]."""
        axis, end = side
        b, c = (axis + 1) % 3, (axis + 2) % 3
        corners = np.empty((4, 3))
        corners[:, axis] = self.ranges[axis][end]
        corners[:, b] = np.take(self.ranges[b], [0, 1, 1, 0])
        corners[:, c] = np.take(self.ranges[c], [0, 0, 1, 1])
        return corners if end else corners[::-1]


@dataclass(frozen=True, slots=True)
class Surface:
    """A plane that things stand on or against: floor, ceiling, wall or door leaf.

    Attributes:
        normal_world: (3,) unit, towards the room.
        offset_m: normal . p for its points.
        level: its brightness, 0..1.
    """

    normal_world: NDArray[np.float64]
    offset_m: float
    level: float

    def touches(self, corners_world: NDArray[np.float64], normal_world: NDArray[np.float64]) -> bool:
        """Whether a side with these corners and this outward normal lies against it."""
        opposed = float(self.normal_world @ normal_world) < -0.999
        return opposed and bool(np.abs(corners_world @ self.normal_world - self.offset_m).max() < CONTACT_M)


def surface_of(polygon_world: NDArray[np.float64], finish: Finish) -> Surface:
    """The plane of a flat polygon (k, 3), seen from its front."""
    normal = np.cross(polygon_world[1] - polygon_world[0], polygon_world[2] - polygon_world[1])
    normal = normal / np.linalg.norm(normal)
    return Surface(normal, float(normal @ polygon_world[0]), expected_brightness(finish, normal))


@dataclass(frozen=True, eq=False)
class Solid:
    """Boxes that stand somewhere.

    Attributes:
        name: unique in the world.
        boxes: in the part's frame.
        world_from_part: where the part stands; its z axis is up.
        surfaces: what it may stand on or against.
    """

    name: str
    boxes: tuple[Box, ...]
    world_from_part: Pose
    surfaces: tuple[Surface, ...] = ()

    def faces(self, locale: str, **more: Any) -> list[Face]:
        """The sides that can be seen, each a face with one region."""
        return [
            build_barrier(f"{self.name}/{index}{'xyz'[axis]}{'-+'[end]}", locale,
                    self.world_from_part.apply(box.side((axis, end))), box.finish, **more)
            for index, box in enumerate(self.boxes)
            for axis, end in SIDES
            if (axis, end) not in self._grounds[index]
        ]

    def edges(self) -> Edges:
        """Its model lines: each edge once, where a person would see it."""
        taken: dict[tuple[float, ...], list[Range]] = {}
        rows = []
        for index, box in enumerate(self.boxes):
            for axis, first, second in BOX_EDGES:
                place = (float(axis), *(round(box.ranges[a][e], 3) for a, e in (first, second)), float(first[0]))
                known = taken.setdefault(place, [])
                for whole, look in self._looks(index, axis, first, second):
                    for extent in subtract_intervals(whole, known, SHORTEST_LINE_M):
                        rows.append((self.world_from_part.apply(_edge(box, axis, extent, first, second)), *look))
                known.append(box.ranges[axis])
        return Edges.of(rows)

    @cached_property
    def _grounds(self) -> list[dict[Side, float]]:
        """For each box, the sides that lie wholly against something, with the brightness of that."""
        return [
            {side: ground for side in SIDES if (ground := self._ground(index, side)) is not None}
            for index in range(len(self.boxes))
        ]

    def _ground(self, index: int, side: Side) -> float | None:
        corners = self.world_from_part.apply(self.boxes[index].side(side))
        normal = self._normal(side)
        for surface in self.surfaces:
            if surface.touches(corners, normal):
                return surface.level
        for other, box in enumerate(self.boxes):
            if other != index and _covers(box, self.boxes[index], side):
                return self._level(box.finish, _opposite(side))
        return None

    def _looks(self, index: int, axis: int, first: Side, second: Side) -> Iterator[tuple[Range, tuple[Any, Any]]]:
        """The stretches of an edge that can be seen, each with (normals, levels) as :class:`Edges` wants them."""
        stretches: list[tuple[Range, tuple[float | None, float | None]]] = []
        for low, high in self._cuts(index, axis):
            middle = (low + high) / 2
            grounds = (self._ground_at(index, axis, middle, first, second),
                       self._ground_at(index, axis, middle, second, first))
            if stretches and stretches[-1][1] == grounds:
                low = stretches.pop()[0][0]
            stretches.append(((low, high), grounds))
        for extent, grounds in stretches:
            if look := self._look(index, (first, second), grounds):
                yield extent, look

    def _cuts(self, index: int, axis: int) -> list[Range]:
        """The extent of a box along an axis, cut where other boxes begin and end."""
        low, high = self.boxes[index].ranges[axis]
        ends = {end for box in self.boxes for end in box.ranges[axis] if low + CONTACT_M < end < high - CONTACT_M}
        marks = [low, *sorted(ends), high]
        return list(pairwise(marks))

    def _ground_at(self, index: int, axis: int, middle: float, side: Side, other: Side) -> float | None:
        """Brightness of what a side lies against, just at its edge with ``other``; ``None`` where it is open."""
        edge = self.boxes[index].ranges[other[0]][other[1]]
        inwards = edge - 2 * CONTACT_M if other[1] else edge + 2 * CONTACT_M
        for near in self._touching[index][side]:
            low, high = near.ranges[other[0]]
            if low < inwards < high and near.ranges[axis][0] < middle < near.ranges[axis][1]:
                flush = abs((high if other[1] else low) - edge) < CONTACT_M
                return self._level(near.finish, other if flush else _opposite(side))
        return self._grounds[index].get(side)

    @cached_property
    def _touching(self) -> list[dict[Side, list[Box]]]:
        """For each box and side, the other boxes that have a side in the same plane, facing it."""
        return [
            {side: [b for b in self.boxes if b is not box and _back_to_back(b, box, side)] for side in SIDES}
            for box in self.boxes
        ]

    def _look(
        self, index: int, sides: tuple[Side, Side], grounds: tuple[float | None, float | None]
    ) -> tuple[Any, Any] | None:
        """(normals, levels) of an edge between two sides; ``None`` where there is nothing to see."""
        finish, behind = self.boxes[index].finish, self._behind(index)
        normals = [self._normal(side) for side in sides]
        own = [self._level(finish, side) for side in sides]
        if grounds == (None, None):
            return normals, [*own, behind]
        seen = 0 if grounds[0] is None else 1
        ground = grounds[1 - seen]
        if grounds[seen] is not None or ground is None or abs(ground - own[seen]) < 1e-9:
            return None
        return [normals[seen]] * 2, [own[seen], ground, behind]

    def _normal(self, side: Side) -> NDArray[np.float64]:
        return self._normals[side]

    @cached_property
    def _normals(self) -> dict[Side, NDArray[np.float64]]:
        """Of its sides, outward."""
        return {(axis, end): np.asarray(self.world_from_part.rotation[:, axis] * (1.0 if end else -1.0))
                for axis, end in SIDES}

    @cached_property
    def _levels(self) -> dict[tuple[Finish, Side], float]:
        return {}

    def _level(self, finish: Finish, side: Side) -> float:
        """The brightness of a finish on a side, worked out once."""
        if (finish, side) not in self._levels:
            self._levels[finish, side] = expected_brightness(finish, self._normal(side))
        return self._levels[finish, side]

    def _behind(self, index: int) -> float:
        """Brightness behind a thin box on a wall; NaN for others."""
        for (axis, _), ground in self._grounds[index].items():
            low, high = self.boxes[index].ranges[axis]
            if high - low <= THIN_M:
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
