"""Solid things by name, each made of boxes; and things of the model that stand elsewhere."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from world_models.building.geometry.faces import Face, Finish, Region
from world_models.building.geometry.solids import Box, Range, Solid
from world_models.frames import Pose
from world_models.units import Bounded, bounded

CARDBOARD = Finish((0.58, 0.46, 0.32), "speckle", 0.1)
TAPE = Finish((0.72, 0.63, 0.44))
STEEL = Finish((0.52, 0.55, 0.57))
DARK = Finish((0.10, 0.10, 0.11))
OAK = Finish((0.55, 0.38, 0.22), "wood", 0.09)
CLOTH = Finish((0.20, 0.26, 0.42), "carpet", 0.03)
TERRACOTTA = Finish((0.60, 0.32, 0.22))
LEAVES = Finish((0.16, 0.34, 0.14), "speckle", 0.05)
STEM = Finish((0.30, 0.22, 0.12))
YELLOW = Finish((0.86, 0.72, 0.12))
PLASTIC = Finish((0.30, 0.32, 0.30))
RED = Finish((0.62, 0.12, 0.12))
PLASTER = Finish((0.78, 0.75, 0.68), "speckle", 0.08)


@dataclass(frozen=True, slots=True)
class Piece:
    """Boxes of a shape that lean together, by an angle about the line y = ``foot_m``, z = 0 (positive: to the back)."""

    boxes: tuple[Box, ...]
    lean_rad: float = 0.0
    foot_m: float = 0.0

    @property
    def shape_from_piece(self) -> Pose:
        """Pose of its frame in the frame of the shape."""
        return Pose.from_rotation_vector(np.array([self.lean_rad, 0.0, 0.0]), np.array([0.0, self.foot_m, 0.0]))


def _box(x: Range, y: Range, z: Range, finish: Finish) -> Box:
    return Box(x, y, z, finish)


def _legs(half_x: float, half_y: float, side: float, height: float, finish: Finish) -> tuple[Box, ...]:
    """Four upright legs with these outer faces."""
    ends = ((-1, -1), (-1, 1), (1, -1), (1, 1))
    return tuple(
        _box(_span(sx * half_x, sx * (half_x - side)), _span(sy * half_y, sy * (half_y - side)), (0.0, height), finish)
        for sx, sy in ends)


def _span(a: float, b: float) -> Range:
    return min(a, b), max(a, b)


def _upright(*boxes: Box) -> tuple[Piece, ...]:
    return (Piece(boxes),)


def _leaning(boxes: tuple[Box, ...], lean_rad: float, foot_m: float) -> tuple[Piece, Piece]:
    """Two equal halves that lean against each other."""
    return Piece(boxes, lean_rad, foot_m), Piece(boxes, -lean_rad, -foot_m)


LADDER = (
    _box((-0.24, -0.20), (-0.015, 0.015), (0.0, 1.85), STEEL), _box((0.20, 0.24), (-0.015, 0.015), (0.0, 1.85), STEEL),
    *(_box((-0.20, 0.20), (-0.015, 0.015), (z, z + 0.03), STEEL) for z in (0.28, 0.56, 0.84, 1.12, 1.40, 1.68)),
)
SIGN = (_box((-0.15, 0.15), (-0.008, 0.008), (0.0, 0.62), YELLOW),
        _box((-0.10, 0.10), (-0.011, 0.011), (0.22, 0.42), DARK))

SHAPES: Mapping[str, tuple[Piece, ...]] = {
    "box": _upright(_box((-0.30, 0.30), (-0.20, 0.20), (0.0, 0.40), CARDBOARD),
                    _box((-0.03, 0.03), (-0.20, 0.20), (0.40, 0.402), TAPE)),
    "cartons": _upright(_box((-0.35, 0.25), (-0.25, 0.25), (0.0, 0.45), CARDBOARD),
                        _box((-0.25, 0.20), (-0.20, 0.20), (0.45, 0.80), CARDBOARD),
                        _box((-0.18, 0.15), (-0.15, 0.18), (0.80, 1.05), TAPE)),
    "chair": _upright(*_legs(0.21, 0.21, 0.025, 0.44, DARK), _box((-0.22, 0.22), (-0.22, 0.22), (0.44, 0.48), CLOTH),
                      _box((-0.20, -0.175), (-0.22, -0.195), (0.48, 0.90), DARK),
                      _box((0.175, 0.20), (-0.22, -0.195), (0.48, 0.90), DARK),
                      _box((-0.20, 0.20), (-0.225, -0.19), (0.66, 0.88), CLOTH)),
    "table": _upright(*_legs(0.68, 0.36, 0.05, 0.71, DARK), _box((-0.70, 0.70), (-0.38, 0.38), (0.71, 0.74), OAK)),
    "cart": _upright(*_legs(0.42, 0.26, 0.03, 0.92, STEEL), _box((-0.42, 0.42), (-0.26, 0.26), (0.14, 0.17), STEEL),
                     _box((-0.42, 0.42), (-0.26, 0.26), (0.74, 0.77), STEEL),
                     _box((-0.30, 0.10), (-0.20, 0.20), (0.17, 0.48), RED)),
    "plant": _upright(_box((-0.17, 0.17), (-0.17, 0.17), (0.0, 0.32), TERRACOTTA),
                      _box((-0.02, 0.02), (-0.02, 0.02), (0.32, 0.60), STEM),
                      _box((-0.28, 0.28), (-0.28, 0.28), (0.60, 1.00), LEAVES),
                      _box((-0.20, 0.20), (-0.20, 0.20), (1.00, 1.35), LEAVES)),
    "ladder": _leaning(LADDER, math.radians(14.0), 0.45),
    "bin": _upright(_box((-0.17, 0.17), (-0.17, 0.17), (0.0, 0.50), PLASTIC)),
    "wet-floor-sign": _leaning(SIGN, math.radians(15.0), 0.17),
    "bag": _upright(_box((-0.22, 0.22), (-0.12, 0.12), (0.0, 0.26), CLOTH),
                    _box((-0.07, 0.07), (-0.02, 0.02), (0.26, 0.32), DARK)),
    "plank": _upright(_box((-0.40, 0.40), (-0.10, 0.10), (0.0, 0.10), OAK)),
    "mat": _upright(_box((-0.50, 0.50), (-0.35, 0.35), (0.0, 0.008), DARK)),
    "door-leaf": _upright(_box((-0.45, 0.45), (-0.0225, 0.0225), (0.01, 2.05), OAK),
                          _box((0.34, 0.42), (-0.06, 0.06), (0.98, 1.06), STEEL)),
    "partition": _upright(_box((-1.0, 1.0), (-0.05, 0.05), (0.0, 2.4), PLASTER)),
}
ROLLED_OVER = ("mat",)
"""What is so low that it stops nobody."""


def build_thing(
    kind: str, name: str, locale: str, world_from_thing: Pose, colour: tuple[float, ...] = ()
) -> tuple[Face, ...]:
    """The faces of a thing that stands somewhere; its frame's origin is on the floor.

    Args:
        colour: red, green, blue (0..1) of all of it, in place of its own.
    """
    def paint(box: Box) -> Box:
        return replace(box, finish=replace(box.finish, colour=(colour[0], colour[1], colour[2]))) if colour else box

    return tuple(
        face for i, piece in enumerate(SHAPES[kind])
        for face in Solid(f"{name}/{i}", tuple(map(paint, piece.boxes)),
                          world_from_thing @ piece.shape_from_piece).faces(locale))


def footprint(kind: str) -> NDArray[np.float64]:
    """(4, 2) rectangle on the floor round a shape, in its own frame [m]."""
    corners = np.concatenate([
        piece.shape_from_piece.apply([[x, y, z] for x in box.x for y in box.y for z in box.z])
        for piece in SHAPES[kind] for box in piece.boxes])
    (x0, y0, _), (x1, y1, _) = corners.min(axis=0), corners.max(axis=0)
    return np.array([[x0, y0], [x1, y0], [x1, y1], [x0, y1]])


Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class MovedThing(Bounded):
    """One of a scenario's ``[[moved]]``.

    Attributes:
        thing: its name, as "hallway/fire-hose".
        x_m, y_m: displacement in the world frame [m].
    """

    thing: str
    x_m: float = bounded(0.0, -1000.0, 1000.0)
    y_m: float = bounded(0.0, -1000.0, 1000.0)


def move_things(faces: Sequence[Face], moved: Sequence[MovedThing]) -> tuple[Face, ...]:
    """The faces of a building after things were moved, in the same order.

    Raises:
        ValueError: there is no such thing.
    """
    for thing in moved:
        if not any(belongs_to(face, thing) for face in faces):
            raise ValueError(f"expected a thing of the building, as locale/name, got {thing.thing!r}")
    return tuple(_shift(face, [thing for thing in moved if belongs_to(face, thing)]) for face in faces)


def belongs_to(face: Face, moved: MovedThing) -> bool:
    """Whether a face is part of a thing."""
    return face.name == moved.thing or face.name.startswith(f"{moved.thing}/")


def _shift(face: Face, moved: Sequence[MovedThing]) -> Face:
    if not moved:
        return face
    by_m = np.sum([(thing.x_m, thing.y_m, 0.0) for thing in moved], axis=0)
    return _map_face(face, lambda polygon: polygon + by_m)


def displace_faces(faces: Sequence[Face], x_m: float, y_m: float, turn_rad: float = 0.0) -> tuple[Face, ...]:
    """Faces, all shifted in the world frame, and turned counter-clockwise about the middle of what they cover."""
    corners = np.concatenate([face.polygon_world[:, :2] for face in faces])
    middle = 0.5 * (corners.min(axis=0) + corners.max(axis=0))
    c, s = math.cos(turn_rad), math.sin(turn_rad)
    turn = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    pivot, by_m = np.array([*middle, 0.0]), np.array([x_m, y_m, 0.0])
    return tuple(_map_face(face, lambda polygon: (polygon - pivot) @ turn.T + pivot + by_m) for face in faces)


def _map_face(face: Face, mapped: Callable[[Floats], Floats]) -> Face:
    return replace(face, polygon_world=mapped(face.polygon_world), front=_map_regions(face.front, mapped),
                   back=_map_regions(face.back, mapped))


def _map_regions(regions: Sequence[Region], mapped: Callable[[Floats], Floats]) -> tuple[Region, ...]:
    return tuple(replace(region, polygon_world=mapped(region.polygon_world)) for region in regions)
