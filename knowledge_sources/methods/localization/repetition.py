"""Where a floor may repeat itself: the places that lie to their room, or to their door, as a place lies to its own."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from world_models.building.locales import Doorway
from world_models.building.world import World
from world_models.frames import Pose2

Floats = NDArray[np.float64]
SAME_M = 0.1
"""Rooms whose sides differ by no more may be alike."""


def find_repetitions(world: World, room: str, pose: Pose2, rooms: Sequence[str]) -> Iterator[tuple[str, Pose2]]:
    """Room and pose of every place, of these rooms, that could look like a pose in a room if walls and doors alone did.

    Rooms of the same size are laid on each other in all ways that turn them by right angles, a room on itself too, and
    the door nearest to the pose on every other door.
    """
    middle, size = _box(world, room)
    own = Pose2(pose.x_m - float(middle[0]), pose.y_m - float(middle[1]), pose.heading_rad)
    for other in rooms:
        there, sides = _box(world, other)
        for quarter in range(4):
            turned = size if quarter % 2 == 0 else size[::-1]
            if np.all(np.abs(turned - sides) < SAME_M) and (quarter or other != room):
                yield other, Pose2(float(there[0]), float(there[1]), quarter * 0.5 * math.pi) @ own
    doors = [(name, _door(doorway, name)) for name in (room, *(r for r in rooms if r != room))
             for doorway in world.doorways_of(name)]
    nearest = min((door for name, door in doors if name == room), key=pose.distance_to, default=None)
    if nearest is not None:
        yield from ((name, door @ (nearest.inverse() @ pose)) for name, door in doors if door is not nearest)


def _box(world: World, room: str) -> tuple[Floats, Floats]:
    """Middle and sides of the rectangle round a room [m, world]."""
    corners = world.outline(room)
    low, high = corners.min(axis=0), corners.max(axis=0)
    return 0.5 * (low + high), high - low


def _door(doorway: Doorway, room: str) -> Pose2:
    """In the middle of a doorway, looking out of the room."""
    x, y = doorway.threshold_of(room).mean(axis=0)
    ahead = doorway.outward_from(room)
    return Pose2(float(x), float(y), float(np.arctan2(ahead[1], ahead[0])))
