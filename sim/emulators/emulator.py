"""What an emulated base is: bytes in, bytes out, and time that passes; and the ground that its wheels roll on."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

from sim.body.simulated_body import SimulatedBody
from world_models.camera import Camera, CameraMount
from world_models.frames import Pose2


class Emulator(Protocol):
    """The base's side of a protocol: bytes in, bytes out, and time that passes. It does no input or output itself."""

    def receive(self, data: bytes) -> None:
        """Take bytes from the line."""
        ...

    def advance(self, duration_s: float) -> None:
        """Let time pass: motors run, watchdogs act, what is due is sent."""
        ...

    def take(self) -> bytes:
        """Return the bytes for the line since the last call."""
        ...

    @property
    def moving(self) -> bool:
        """Whether the motors run."""
        ...


class Ground(Protocol):
    """What wheels roll on, with the clock of the base: :class:`IdealGround`, or a simulated body in its building."""

    @property
    def time_s(self) -> float:
        """Time of the base [s]."""
        ...

    @property
    def touching_rad(self) -> float | None:
        """The direction, from the heading, in which the base touches something; None where it touches nothing."""
        ...

    def echo(self, sensor: Pose2) -> float | None:
        """What a sonar hears, from the sensor [m]; None without an echo. Its pose is in the robot's frame."""
        ...

    def roll(self, turn_rad: float, move_m: float, duration_s: float) -> tuple[float, float]:
        """Roll for a while: a turn in place or a move. Returns what was done, (turn [rad], move [m])."""
        ...


class IdealGround:
    """An endless plane on which wheels do exactly what they are commanded.

    Attributes:
        pose: of the robot, from where it began; time_s: of the base [s].
        turned_rad, moved_m: sums of all turns and moves, signed.
        rolled_s: time of its last motion [s].
        held: whether something holds the wheels; touching_rad: in which direction something is touched.
        wall_m: how far all round it every sonar has an echo, from its axis; None: nowhere.
    """

    def __init__(self) -> None:
        self.time_s = 0.0
        self.pose = Pose2(0.0, 0.0, 0.0)
        self.turned_rad = self.moved_m = 0.0
        self.rolled_s = -math.inf
        self.held = False
        self.touching_rad: float | None = None
        self.wall_m: float | None = None

    def echo(self, sensor: Pose2) -> float | None:
        return None if self.wall_m is None else self.wall_m - math.hypot(sensor.x_m, sensor.y_m)

    def roll(self, turn_rad: float, move_m: float, duration_s: float) -> tuple[float, float]:
        self.time_s += duration_s
        if self.held or turn_rad == move_m == 0.0:
            return 0.0, 0.0
        self.pose = self.pose @ Pose2(move_m, 0.0, turn_rad)
        self.turned_rad += turn_rad
        self.moved_m += move_m
        self.rolled_s = self.time_s
        return turn_rad, move_m


@dataclass(frozen=True, slots=True)
class Served:
    """What a kind on no serial line is served with.

    Attributes:
        ground: that its wheels roll on; body: under it, with a camera; None without a scenario.
        camera, mount: of that body, as a calibration would find them.
        at: where it is to be met; "" for any free place.
        speed: how many times as fast as real time.
        until: asked again and again whether it is over; trace: hears of the traffic, as lines of text.
    """

    ground: Ground
    body: SimulatedBody | None
    at: str
    speed: float
    until: Callable[[], bool]
    camera: Camera | None = None
    mount: CameraMount | None = None
    trace: Callable[[str, bytes], None] | None = None


@dataclass(frozen=True, slots=True)
class EmulatorKind:
    """A kind of emulated base.

    Attributes:
        name: of its protocol, as its driver's ``BaseKind`` has it.
        on_ground: one whose wheels roll on a ground, in the time that passes for it.
        on_body: one whose motions are over at once, in the time of a simulated body, for missions over
            ``--body serial:NAME``; None where its driver waits by the base's time.
        serve: serves one that is on no serial line, in real time, for ``harvey emulate``; None where it is on one.
    """

    name: str
    on_ground: Callable[[Ground], Emulator]
    on_body: Callable[[SimulatedBody], Emulator] | None = None
    serve: Callable[[Served], None] | None = None
