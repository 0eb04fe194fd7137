"""How an emulated Denning-style base executes a command: at once on a simulated body, or rolling on the ground."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Protocol

from sim.body.bumper import Bumper
from sim.body.collision import ROBOT_RADIUS_M
from sim.body.range_ring import RangeRing
from sim.emulators.ground import Ground
from world_models.entries.body import MotionReport, MotorCommand
from world_models.entries.touch import Contact, Ranges
from world_models.frames import Pose2

RING = RangeRing(sensors=24)
"""Of the platform: sonars that face outward at equal angles."""


@dataclass(frozen=True, slots=True)
class Claim:
    """What the encoders report of one command: how far it has come [rad, m], its duration and the time [s]."""

    turn_rad: float = 0.0
    move_m: float = 0.0
    duration_s: float = 0.0
    time_s: float = 0.0


class Motion(Protocol):
    """The motors of a base.

    Attributes:
        turn_rate, speed: of every motion [rad/s, m/s].
    """

    turn_rate: float
    speed: float

    def begin(self, turn_rad: float, move_m: float, speed_m_per_s: float | None = None) -> None:
        """Begin a command: TURN, then MOVE."""
        ...

    def advance(self, duration_s: float) -> None:
        """Let time pass."""
        ...

    def halt(self) -> None:
        """Break the command off."""
        ...

    @property
    def ended(self) -> str:
        """"" while it moves, else "ok" or "stalled"."""
        ...

    @property
    def claim(self) -> Claim:
        """Of the last command."""
        ...

    @property
    def contact(self) -> Contact | None:
        """What the last command touched."""
        ...

    def ranges(self) -> Ranges | None:
        """What its sonars measure now."""
        ...


class Body(Protocol):
    """Something that executes a whole command in one call."""

    def execute(self, command: MotorCommand, /) -> MotionReport: ...

    def take_contact(self) -> Contact | None: ...

    def ranges(self) -> Ranges | None: ...


class InstantMotion:
    """Executes a command at once, in the time of the body: no state in between is visible."""

    turn_rate, speed = math.radians(45.0), 0.4

    def __init__(self, body: Body) -> None:
        self._body = body
        self._claim = Claim()
        self._contact: Contact | None = None

    def begin(self, turn_rad: float, move_m: float, speed_m_per_s: float | None = None) -> None:
        report = self._body.execute(MotorCommand(turn_rad, move_m, speed_m_per_s))
        self._contact = self._body.take_contact()
        self._claim = Claim(report.turn_rad, report.move_m, report.duration_s, report.sim_time_s)

    def advance(self, duration_s: float) -> None:
        """Nothing to do: the body's time passes only in commands."""

    def halt(self) -> None:
        """Nothing to do: it stands between commands."""

    @property
    def ended(self) -> str:
        return "ok"

    @property
    def claim(self) -> Claim:
        return self._claim

    @property
    def contact(self) -> Contact | None:
        return self._contact

    def ranges(self) -> Ranges | None:
        return self._body.ranges()


class ConstantSpeedMotion:
    """Turns and moves at constant speeds, and ends exactly where it was commanded to.

    Wheels that are held for half a second are stalled.
    """

    turn_rate, speed = math.radians(45.0), 0.4
    max_held_s = 0.5

    def __init__(self, ground: Ground) -> None:
        self._ground = ground
        self._turn = self._move = 0.0
        self._speed = self.speed
        self._began_s = ground.time_s
        self._claim = Claim(time_s=ground.time_s)
        self._ended = "ok"
        self._held_s = 0.0
        self._contact: Contact | None = None

    def begin(self, turn_rad: float, move_m: float, speed_m_per_s: float | None = None) -> None:
        self._turn, self._move, self._began_s = turn_rad, move_m, self._ground.time_s
        self._speed = self.speed if speed_m_per_s is None else min(self.speed, speed_m_per_s)
        self._claim = Claim(time_s=self._began_s)
        self._ended, self._held_s, self._contact = "", 0.0, None

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

    @property
    def contact(self) -> Contact | None:
        return self._contact

    def ranges(self) -> Ranges | None:
        axes = [math.remainder(math.tau * number / RING.sensors, math.tau) for number in range(RING.sensors)]
        heard = [self._ground.echo(Pose2(0.0, 0.0, axis) @ Pose2(ROBOT_RADIUS_M, 0.0, 0.0)) for axis in axes]
        distances = tuple(None if away_m is None else ROBOT_RADIUS_M + away_m for away_m in heard)
        return Ranges(tuple(axes), distances, RING.sigma_m, RING.half_beam_rad, ROBOT_RADIUS_M + RING.reach_m,
                      self._ground.time_s)

    def _step(self, max_s: float) -> float:
        """Roll for at most this time, or to the end of the turn or move; returns the time that it took [s]."""
        turning = self._claim.turn_rad != self._turn
        to_go = self._turn - self._claim.turn_rad if turning else self._move - self._claim.move_m
        if to_go == 0.0:
            self._ended = "ok"
            return 0.0
        rate = self.turn_rate if turning else self._speed
        step_s = min(max_s, abs(to_go) / rate)
        step = to_go if step_s < max_s or abs(to_go) <= rate * max_s else math.copysign(rate * step_s, to_go)
        rolled = self._ground.roll(step if turning else 0.0, 0.0 if turning else step, step_s)
        self._held_s = self._held_s + step_s if rolled == (0.0, 0.0) else 0.0
        if self._held_s > self.max_held_s:
            self._ended = "stalled"
            touching_rad, now_s = self._ground.touching_rad, self._ground.time_s
            self._contact = (Contact.of_stall(now_s, turning=turning) if touching_rad is None
                             else Bumper().feel(touching_rad, now_s))
        self._add(*rolled, finished=step == to_go and rolled != (0.0, 0.0), turning=turning)
        return max(step_s, 1e-9)

    def _add(self, turn_rad: float, move_m: float, *, finished: bool, turning: bool) -> None:
        """Add a step to the claim; a finished turn or move claims exactly what was commanded."""
        turn, move = self._claim.turn_rad + turn_rad, self._claim.move_m + move_m
        if finished:
            turn, move = (self._turn, move) if turning else (turn, self._move)
        now_s = self._ground.time_s
        self._claim = Claim(turn, move, now_s - self._began_s, now_s)
