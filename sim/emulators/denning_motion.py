"""How an emulated Denning-style base carries a command out: at once on a simulated body, or rolling on the ground."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Protocol

from sim.emulators.ground import Ground
from world_models.entries.body import MotionReport, MotorCommand


@dataclass(frozen=True, slots=True)
class Claim:
    """What the wheels claim of one command: how far it has come, and when."""

    turn_rad: float = 0.0
    move_m: float = 0.0
    duration_s: float = 0.0
    time_s: float = 0.0


class Motion(Protocol):
    """The motors under a protocol.

    Attributes:
        turn_rate, speed: how fast they go [rad/s, m/s].
    """

    turn_rate: float
    speed: float

    def begin(self, turn_rad: float, move_m: float) -> None:
        """TURN, then MOVE."""
        ...

    def advance(self, duration_s: float) -> None:
        """Time passes."""
        ...

    def halt(self) -> None:
        """Stand, wherever the command has come to."""
        ...

    @property
    def ended(self) -> str:
        """"" while it moves, else "ok" or "stalled"."""
        ...

    @property
    def claim(self) -> Claim:
        """Of the command that was begun last."""
        ...


class Body(Protocol):
    """Something that carries out a whole command at once."""

    def execute(self, command: MotorCommand, /) -> MotionReport: ...


class InstantMotion:
    """Commands are carried out when they come, in the time of the body: nothing of them is seen on the way."""

    turn_rate, speed = math.radians(45.0), 0.4

    def __init__(self, body: Body) -> None:
        self._body = body
        self._claim = Claim()

    def begin(self, turn_rad: float, move_m: float) -> None:
        report = self._body.execute(MotorCommand(turn_rad, move_m))
        self._claim = Claim(report.turn_rad, report.move_m, report.duration_s, report.sim_time_s)

    def advance(self, duration_s: float) -> None:
        """The body's time passes only in what it does."""

    def halt(self) -> None:
        """It stands between commands."""

    @property
    def ended(self) -> str:
        return "ok"

    @property
    def claim(self) -> Claim:
        return self._claim


class ConstantSpeedMotion:
    """Wheels that turn at one speed and move at one speed, and come to what was commanded exactly.

    Wheels that do not get on for half a second are stalled.
    """

    turn_rate, speed = math.radians(45.0), 0.4

    def __init__(self, ground: Ground) -> None:
        self._ground = ground
        self._turn = self._move = 0.0
        self._began_s = ground.time_s
        self._claim = Claim(time_s=ground.time_s)
        self._ended = "ok"
        self._held_s = 0.0

    def begin(self, turn_rad: float, move_m: float) -> None:
        self._turn, self._move, self._began_s = turn_rad, move_m, self._ground.time_s
        self._claim = Claim(time_s=self._began_s)
        self._ended, self._held_s = "", 0.0

    def advance(self, duration_s: float) -> None:
        left_s = duration_s
        while left_s > 0.0 and not self._ended:
            left_s -= self._step(left_s)
        if left_s > 0.0:
            self._ground.roll(0.0, 0.0, left_s)

    def halt(self) -> None:
        self._ended = self._ended or "halted"

    @property
    def ended(self) -> str:
        return self._ended

    @property
    def claim(self) -> Claim:
        return self._claim

    def _step(self, most_s: float) -> float:
        """Roll for at most this time, to the end of the turn or of the move; returns the time that it took."""
        turning = self._claim.turn_rad != self._turn
        to_go = self._turn - self._claim.turn_rad if turning else self._move - self._claim.move_m
        if to_go == 0.0:
            self._ended = "ok"
            return 0.0
        rate = self.turn_rate if turning else self.speed
        step_s = min(most_s, abs(to_go) / rate)
        step = to_go if step_s < most_s or abs(to_go) <= rate * most_s else math.copysign(rate * step_s, to_go)
        rolled = self._ground.roll(step if turning else 0.0, 0.0 if turning else step, step_s)
        self._held_s = self._held_s + step_s if rolled == (0.0, 0.0) else 0.0
        if self._held_s > 0.5:
            self._ended = "stalled"
        self._count(*rolled, finished=step == to_go and rolled != (0.0, 0.0), turning=turning)
        return max(step_s, 1e-9)

    def _count(self, turn_rad: float, move_m: float, *, finished: bool, turning: bool) -> None:
        """A part that is finished claims what was commanded, without the rounding of its steps."""
        turn, move = self._claim.turn_rad + turn_rad, self._claim.move_m + move_m
        if finished:
            turn, move = (self._turn, move) if turning else (turn, self._move)
        now_s = self._ground.time_s
        self._claim = Claim(turn, move, now_s - self._began_s, now_s)
