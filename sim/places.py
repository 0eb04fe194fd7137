"""Where a mission begins and ends, read from its goal by the simulator itself, to put the robot down and to score."""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import Protocol

from sim.settings import FOOT_M
from world_models.frames import Pose, Pose2, flattened

_NUMBER = r"\s*([-+]?\d+(?:\.\d*)?)\s*"
_PLACE = rf"\(\s*([\w'-]+)\s+\({_NUMBER},{_NUMBER},{_NUMBER}\)\s*\)"
_GOAL = re.compile(rf"\s*\(\s*ptrans\s+{_PLACE}\s*{_PLACE}\s*\)\s*")


class WorldLike(Protocol):
    """What placing needs of a world."""

    def world_from_locale(self, name: str, /) -> Pose: ...


@dataclass(frozen=True, slots=True)
class Place:
    """A point of the floor in a locale's own frame."""

    locale: str
    x_m: float
    y_m: float

    def pose_in_world(self, world: WorldLike, heading_rad: float = 0.0) -> Pose2:
        """The pose of a robot there, with a heading in the locale's frame, in the world frame."""
        return flattened(world.world_from_locale(self.locale)) @ Pose2(self.x_m, self.y_m, heading_rad)


def places(goal: str) -> tuple[Place, Place]:
    """From where to where ``(ptrans (locale (x,y,z)) (locale (x,y,z)))`` goes; its coordinates are feet (Figure 17).

    Raises:
        ValueError: the text has another form.
    """
    match = _GOAL.fullmatch(goal)
    if match is None:
        raise ValueError(f"expected a goal like (ptrans (locale (x,y,z)) (locale (x,y,z))), got {goal!r}")
    a, ax, ay, _, b, bx, by, _ = match.groups()
    return (Place(a, float(ax) * FOOT_M, float(ay) * FOOT_M), Place(b, float(bx) * FOOT_M, float(by) * FOOT_M))
