"""Doors: openings with casing, jambs and threshold, and closed leaves set into the wall."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from world_models.building.geometry.faces import Face, Finish, build_barrier, expected_brightness
from world_models.building.geometry.landmarks import Edges, Landmark
from world_models.building.geometry.solids import Box, Range, Solid, Surface, surface_from_polygon
from world_models.files.construction.rooms import CASING_DEPTH_M, CASING_WIDTH_M, Opening, Wall
from world_models.files.construction.specs import DoorSpec
from world_models.frames import Pose

LEAF_DEPTH_M = 0.05
"""How far a closed leaf is set back from the wall's surface."""

Point = tuple[float, float, float]


@dataclass(frozen=True, eq=False)
class DoorSide:
    """A door as seen from one of its rooms; coordinates are in the frame of that room's wall.

    Attributes:
        spec: the door.
        wall: the wall of that room.
        opening: the hole in it.
        depth_m: how far the jambs reach back: through the wall, or to the leaf.
        floor: finish of the room's floor.
    """

    spec: DoorSpec
    wall: Wall
    opening: Opening
    depth_m: float
    floor: Finish

    @property
    def name(self) -> str:
        return f"{self.wall.locale}/{self.spec.name}"

    @property
    def x(self) -> Range:
        return self.opening.left_m, self.opening.right_m

    @property
    def casing(self) -> Finish:
        """Finish of jambs and soffit, and of the boards where there are some; a plain opening is of the wall's."""
        return self.spec.casing or self.wall.finish

    @property
    def casing_m(self) -> float:
        """How far the boards stand before the wall."""
        return CASING_DEPTH_M if self.spec.casing else 0.0

    def casing_faces(self) -> list[Face]:
        """The boards round the opening, but for their inner sides: those are one with jambs and soffit."""
        if self.spec.casing is None:
            return []
        (a, b), h, y, finish = self.x, self.opening.top_m, (0.0, CASING_DEPTH_M), self.spec.casing
        boxes = (
            Box((a - CASING_WIDTH_M, a), y, (0.0, h + CASING_WIDTH_M), finish),
            Box((b, b + CASING_WIDTH_M), y, (0.0, h + CASING_WIDTH_M), finish),
            Box((a, b), y, (h, h + CASING_WIDTH_M), finish),
        )
        solid = Solid(f"{self.name}/casing", boxes, self.wall.world_from_wall, self._surfaces)
        faces = solid.faces(self.wall.locale, parent=self.wall.face_name, neighbour=self.opening.neighbour)
        return [face for face in faces if not face.name.endswith(("/0x+", "/1x-", "/2z-"))]

    def doorway_face(self) -> Face:
        """The opening (§3.4, Figure 6): a face of type doorway, with the wall as its parent."""
        polygon = self.wall.rectangle(self.x, (0.0, self.opening.top_m))
        return Face(f"{self.name}/doorway", self.wall.locale, polygon, "doorway", self.opening.neighbour,
                    self.wall.face_name)

    def lining(self, back_m: float) -> list[Face]:
        """Jambs and soffit from the front of the casing to y = -``back_m``."""
        (a, b), h, front, back = self.x, self.opening.top_m, self.casing_m, -back_m
        sides = {
            "right-jamb": [(a, front, 0), (a, back, 0), (a, back, h), (a, front, h)][::-1],
            "left-jamb": [(b, front, 0), (b, back, 0), (b, back, h), (b, front, h)],
            "soffit": [(a, front, h), (b, front, h), (b, back, h), (a, back, h)],
        }
        return [self._build_face(name, corners, self.casing) for name, corners in sides.items()]

    def threshold(self, finish: Finish) -> Face:
        """The floor between the jambs."""
        (a, b), back = self.x, -self.depth_m
        return self._build_face("threshold", [(a, back, 0), (b, back, 0), (b, 0, 0), (a, 0, 0)], finish)

    def leaf(self) -> tuple[list[Face], Edges]:
        """The closed leaf with its panel."""
        polygon = self.wall.rectangle(self.x, (0.0, self.opening.top_m), -self.depth_m)
        face = build_barrier(f"{self.name}/leaf", self.wall.locale, polygon, self.spec.leaf, parent=self.wall.face_name)
        to_middle = np.array([(self.x[0] + self.x[1]) / 2, -self.depth_m, 0.0])
        middle = self.wall.world_from_wall @ Pose(np.eye(3), to_middle)
        surface = surface_from_polygon(polygon, self.spec.leaf)
        panel = Solid(f"{self.name}/panel", self.spec.panel, middle, (*self._surfaces, surface))
        (a, b), h, y, frame = self.x, self.opening.top_m, -self.depth_m, self.casing
        edges = [
            self._edge_row((a, y, 0), (a, y, h), "+x", "+y", frame, self.spec.leaf),
            self._edge_row((b, y, 0), (b, y, h), "-x", "+y", frame, self.spec.leaf),
            self._edge_row((a, y, h), (b, y, h), "-z", "+y", frame, self.spec.leaf),
            self._edge_row((a, y, 0), (b, y, 0), "+z", "+y", self.floor, self.spec.leaf),
        ]
        faces = [face, *panel.faces(self.wall.locale, parent=face.name)]
        return faces, Edges.concatenate([Edges.from_rows(edges), panel.edges()])

    def casing_edges(self) -> Edges:
        """Outer edges of the boards, and their inner edges along the jambs; of a plain opening the wall's edges."""
        (a, b), h, p, w = self.x, self.opening.top_m, self.casing_m, CASING_WIDTH_M
        frame, wall = self.casing, self.wall.finish
        if self.spec.casing is None:
            sides = [self._edge_row((x, 0, 0), (x, 0, h), "+y", into, wall, wall) for x, into in ((a, "+x"), (b, "-x"))
                     if 0.0 < x < self.wall.length_m]
            top = [self._edge_row((a, 0, h), (b, 0, h), "+y", "-z", wall, wall)] if h < self.wall.height_m else []
            return Edges.from_rows([*sides, *top])
        rows = []
        for x, out, into in ((a, -1, "+x"), (b, 1, "-x")):
            side, outer = ("-x" if out < 0 else "+x"), x + out * w
            rows.append(self._edge_row((outer, p, 0), (outer, p, h + w), "+y", side, frame, frame, wall))
            rows.append(self._edge_row((outer, 0, 0), (outer, 0, h + w), side, "+y", frame, wall, ground=True))
            rows.append(self._edge_row((x, p, 0), (x, p, h), "+y", into, frame, frame))
        rows.append(self._edge_row((a - w, p, h + w), (b + w, p, h + w), "+y", "+z", frame, frame, wall))
        rows.append(self._edge_row((a - w, 0, h + w), (b + w, 0, h + w), "+z", "+y", frame, wall, ground=True))
        rows.append(self._edge_row((a, p, h), (b, p, h), "+y", "-z", frame, frame))
        return Edges.from_rows(rows)

    def lining_edges(self, back_m: float, floor: Finish) -> Edges:
        """Edges where the jambs meet soffit and floor."""
        (a, b), h, front, back, frame = self.x, self.opening.top_m, self.casing_m, -back_m, self.casing
        rows = []
        for x, into in ((a, "+x"), (b, "-x")):
            rows.append(self._edge_row((x, back, h), (x, front, h), into, "-z", frame, frame))
            rows.append(self._edge_row((x, back, 0), (x, front, 0), into, "+z", frame, floor))
        return Edges.from_rows(rows)

    def threshold_edge(self) -> Edges:
        """Edge where the threshold meets the floor of this room."""
        (a, b) = self.x
        return Edges.from_rows([self._edge_row((a, 0, 0), (b, 0, 0), "+z", "+z", self.spec.threshold, self.floor)])

    @property
    def _surfaces(self) -> tuple[Surface, ...]:
        up = np.array([0.0, 0.0, 1.0])
        base = float(self.wall.world_from_wall.translation[2])
        floor = Surface(up, base, expected_brightness(self.floor, up))
        return floor, surface_from_polygon(self.wall.polygon_world, self.wall.finish)

    def _build_face(self, name: str, corners: Sequence[Sequence[float]], finish: Finish) -> Face:
        polygon = self.wall.world_from_wall.apply(corners)
        return build_barrier(f"{self.name}/{name}", self.wall.locale, polygon, finish,
                       neighbour=self.opening.neighbour, parent=self.wall.face_name)

    def _edge_row(
        self, start: Point, end: Point, first: str, second: str, finish: Finish, other: Finish,
        behind: Finish | None = None, *, ground: bool = False,
    ) -> tuple[NDArray[np.float64], list[NDArray[np.float64]], list[float]]:
        """A row of :class:`Edges` between two sides, named ``+x`` .. ``-z``.

        With ``ground`` the second side only carries the first, and the line shows when the first side does.
        """
        normals = [self._direction(first), self._direction(second)]
        brightness = [expected_brightness(finish, normals[0]), expected_brightness(other, normals[1])]
        brightness.append(float("nan") if behind is None else expected_brightness(behind, self.wall.inward_world))
        return self.wall.world_from_wall.apply([start, end]), [normals[0], normals[0 if ground else 1]], brightness

    def _direction(self, side: str) -> NDArray[np.float64]:
        sign = 1.0 if side[0] == "+" else -1.0
        return np.asarray(sign * self.wall.world_from_wall.rotation[:, "xyz".index(side[1])])


def build_open_door(near: DoorSide, far: DoorSide) -> tuple[list[Face], Landmark]:
    """Faces and the landmark of a doorway between two rooms."""
    back = near.depth_m + far.casing_m
    faces = [near.doorway_face(), far.doorway_face(), *near.lining(back), near.threshold(near.spec.threshold)]
    for side in (near, far):
        faces += side.casing_faces()
    edges = [near.lining_edges(back, near.spec.threshold)]
    edges += [part for side in (near, far) for part in (side.casing_edges(), side.threshold_edge())]
    name, (first, second) = near.spec.name, near.spec.between
    return faces, Landmark(name, first, "doorway", Edges.concatenate(edges), neighbour=second, source=near.spec.source)


def build_closed_door(side: DoorSide) -> tuple[list[Face], Landmark]:
    """Faces and the landmark of a closed door, as seen from one room."""
    leaf_faces, leaf_edges = side.leaf()
    faces = [*side.casing_faces(), *side.lining(side.depth_m), side.threshold(side.floor), *leaf_faces]
    edges = Edges.concatenate([side.casing_edges(), side.lining_edges(side.depth_m, side.floor), leaf_edges])
    return faces, Landmark(side.name, side.wall.locale, "door", edges, source=side.spec.source)
