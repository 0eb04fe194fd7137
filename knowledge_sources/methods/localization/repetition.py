"""Where a floor plan repeats itself: poses that lie to their room, or to their door, as a pose lies to its own."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

import numpy as np

from knowledge_sources.methods.arrays import Floats
from knowledge_sources.settings import DEFAULT
from knowledge_sources.settings.localization import LocalizationSettings
from world_models.building.building import Building
from world_models.frames import Pose2


def find_repetitions(
    building: Building, room: str, pose: Pose2, rooms: Sequence[str],
    settings: LocalizationSettings = DEFAULT.localization,
) -> Iterator[tuple[str, Pose2]]:
    """Yield room and pose of every place in ``rooms`` that looks like ``pose`` in ``room`` by walls and doors alone.

    Rooms of the same size are laid on each other, turned by right angles, also a room on itself; and the door nearest
    to the pose is laid on every other door.
    """
    middle, size = _find_box(building, room)
    own = Pose2(pose.x_m - float(middle[0]), pose.y_m - float(middle[1]), pose.heading_rad)
    for other in rooms:
        there, sides = _find_box(building, other)
        for quarter in range(4):
            turned = size if quarter % 2 == 0 else size[::-1]
            if np.all(np.abs(turned - sides) < settings.max_size_difference_m) and (quarter or other != room):
                yield other, Pose2(float(there[0]), float(there[1]), quarter * 0.5 * math.pi) @ own
    doors = [(name, doorway.pose_from(name)) for name in (room, *(r for r in rooms if r != room))
             for doorway in building.doorways_of(name)]
    nearest = min((door for name, door in doors if name == room), key=pose.distance_to, default=None)
    if nearest is not None:
        yield from ((name, door @ (nearest.inverse() @ pose)) for name, door in doors if door is not nearest)


def _find_box(building: Building, room: str) -> tuple[Floats, Floats]:
    """Middle and sides of the rectangle around a room [m, world]."""
    corners = building.outline(room)
    low, high = corners.min(axis=0), corners.max(axis=0)
    return 0.5 * (low + high), high - low
