"""The ground under an emulated base: what its wheels roll on."""

from __future__ import annotations

import math
from typing import Protocol

from sim.body.simulated_body import SimulatedBody
from world_models.frames import Pose2


class Ground(Protocol):
    """Something that wheels roll on, with the clock of the base."""

    @property
    def time_s(self) -> float:
        """Of the base."""
        ...

    def roll(self, turn_rad: float, move_m: float, duration_s: float) -> tuple[float, float]:
        """Let time pass and the wheels roll: a turn on the spot or a move. Returns what they could: (turn, move)."""
        ...


class IdealGround:
    """An endless, even floor on which wheels do exactly as they are told.

    Attributes:
        pose: where the robot is.
        turned_rad, moved_m: all that it turned and moved, signs and all.
        rolled_s: when it last moved.
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
    """The floor of a simulated building, with wheels that err as a robot's do."""

    def __init__(self, body: SimulatedBody) -> None:
        self._body = body

    @property
    def time_s(self) -> float:
        return self._body.truth.time_s

    def roll(self, turn_rad: float, move_m: float, duration_s: float) -> tuple[float, float]:
        return self._body.roll(turn_rad, move_m, duration_s)
