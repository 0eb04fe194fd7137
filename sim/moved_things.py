"""Things that stand elsewhere in the building than in the robot's model."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from world_models.bounds import Bounds, check_bounds
from world_models.building.geometry.faces import Face
from world_models.building.geometry.regions import Region


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
    return replace(
        face, polygon_world=face.polygon_world + by_m,
        front=tuple(_shift_region(region, by_m) for region in face.front),
        back=tuple(_shift_region(region, by_m) for region in face.back),
    )


def _shift_region(region: Region, by_m: NDArray[np.float64]) -> Region:
    return replace(region, polygon_world=region.polygon_world + by_m)
