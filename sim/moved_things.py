"""Things that stand elsewhere in the building than in the robot's model."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from world_models.building.geometry.faces import Face, Region
from world_models.units import Bounds, check_bounds

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class MovedThing:
    """One of a scenario's ``[[moved]]``.

    Attributes:
        thing: its name, as "hallway/fire-hose".
        x_m, y_m: displacement in the world frame [m].
    """

    thing: str
    x_m: float = 0.0
    y_m: float = 0.0

    def __post_init__(self) -> None:
        check_bounds(self, {"x_m": Bounds(-1000.0, 1000.0), "y_m": Bounds(-1000.0, 1000.0)})


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
