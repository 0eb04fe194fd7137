"""The ground under an emulated base: ideal, or of a simulated building."""

from __future__ import annotations

import math
from typing import Protocol

from sim.body.simulated_body import SimulatedBody
from world_models.frames import Pose2


class Ground(Protocol):
    """What wheels roll on, with the clock of the base."""

    @property
    def time_s(self) -> float:
        """Time of the base [s]."""
        ...

    def roll(self, turn_rad: float, move_m: float, duration_s: float) -> tuple[float, float]:
        """Roll for a while: a turn in place or a move. Returns what was done, (turn [rad], move [m])."""
        ...


class IdealGround:
    """An endless plane on which wheels do exactly what they are commanded.

    Attributes:
        pose: of the robot, from where it began.
        turned_rad, moved_m: sums of all turns and moves, signed.
        rolled_s: time of its last motion [s].
        held: whether something holds the wheels.
    """

    def __init__(self) -> None:
        self._time_s = 0.0
        self.pose = Pose2(0.0, 0.0, 0.0)
        self.turned_rad = self.moved_m = 0.0
        self.rolled_s = -math.inf
        self.held = False

    @property
    def time_s(self) -> float:
        return self._time_s

    def roll(self, turn_rad: float, move_m: float, duration_s: float) -> tuple[float, float]:
        self._time_s += duration_s
        if self.held or turn_rad == move_m == 0.0:
            return 0.0, 0.0
        self.pose = self.pose @ Pose2(move_m, 0.0, turn_rad)
        self.turned_rad += turn_rad
        self.moved_m += move_m
        self.rolled_s = self._time_s
        return turn_rad, move_m


class SimulatedGround:
    """The floor of a simulated building; the wheels have the errors of the simulated body."""

    def __init__(self, body: SimulatedBody) -> None:
        self._body = body

    @property
    def time_s(self) -> float:
        return self._body.truth.time_s

    def roll(self, turn_rad: float, move_m: float, duration_s: float) -> tuple[float, float]:
        return self._body.roll(turn_rad, move_m, duration_s)
