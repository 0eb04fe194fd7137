"""Belief: the hypothesis that is acted on, placed in the world; reckoned once for all who draw it."""

from __future__ import annotations

import math
from dataclasses import dataclass

from logs.recording.board_mirror import Mirror
from world_models.building.world import World
from world_models.entries.location import Hypothesis
from world_models.frames import Pose2


@dataclass(frozen=True, slots=True)
class Held:
    """The held hypothesis.

    Attributes:
        value: as it stands on the board.
        world_from_robot: its pose in the world frame.
        sigma_m: the largest standard deviation of the place; sigma_rad: that of the heading.
    """

    value: Hypothesis
    world_from_robot: Pose2
    sigma_m: float
    sigma_rad: float


class Belief:
    """Gives the held hypothesis, and remembers the last one."""

    def __init__(self, world: World) -> None:
        self._world = world
        self._last: Held | None = None

    def now(self, mirror: Mirror) -> Held | None:
        """The belief as of now; None where there is none, as when it is lost."""
        value = find_belief(mirror)
        if value is None:
            return None
        if self._last is None or self._last.value is not value:
            self._last = Held(value, value.world_from_robot(self._world), sigma_m(value), value.sigma_rad)
        return self._last


def find_belief(mirror: Mirror) -> Hypothesis | None:
    """The hypothesis that is acted on."""
    entry = mirror.latest(Hypothesis, _is_held)
    return entry.value if entry else None


def sigma_m(value: Hypothesis) -> float:
    """Its largest standard deviation of the place: the larger eigenvalue of a 2 x 2 matrix, in closed form [m]."""
    (a, b, _), (_, d, _), _ = value.covariance
    return math.sqrt(max(0.0, (a + d) / 2 + math.hypot((a - d) / 2, b)))


def _is_held(value: Hypothesis) -> bool:
    return value.is_held
