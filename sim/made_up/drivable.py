"""Whether a drawn mission can be driven: room at both ends, and a way between them."""

from __future__ import annotations

from sim.body.collision import Obstacles
from sim.body.free_floor import find_free_floor, has_way
from world_models.frames import Pose2

ROOM_M, WAY_MARGIN_M = 0.3, 0.06
"""Free floor round start and goal, and beside the robot on a way that counts as one."""


def is_drivable(obstacles: Obstacles, start: Pose2, goal: Pose2) -> bool:
    """Whether the robot has room at start and goal [world], and a way from one to the other."""
    has_room = min(obstacles.clearance_m(start), obstacles.clearance_m(goal)) >= ROOM_M
    return has_room and has_way(find_free_floor(obstacles, WAY_MARGIN_M), start, goal)
