"""A driver and an emulated robot without network and real time; what goes between them can be spoilt."""

from __future__ import annotations

import heapq
from collections.abc import Callable
from dataclasses import dataclass, field
from itertools import count
from typing import Any

from harvey_ros2.emulated.robot_emulator import RobotEmulator
from harvey_ros2.messages.messages import message_types
from harvey_ros2.messages.middleware import Heard
from harvey_ros2.robot.robot_file import DriveSettings, ScanMount
from harvey_ros2.robot.ros2_base import Ros2Base
from sim.emulators.emulator import IdealGround

TICK_S = 0.01
Spoil = Callable[[float, str, bytes], list[tuple[float, bytes, str]]]
"""Of a message (time, key, bytes): what arrives of it, each with its delay [s] and sender."""


def deliver(_time_s: float, _key: str, cdr: bytes) -> list[tuple[float, bytes, str]]:
    """At once, as it is."""
    return [(0.0, cdr, "robot")]


@dataclass
class Bench:
    """The robot's end, and a :class:`harvey_ros2.robot.node.RobotMessages` for the driver.

    Attributes:
        said: every message to the robot: time and speeds, as the bench reads them.
        before_tick: called before each tick.
        age_s: of the newest picture.
    """

    spoil: Spoil = deliver
    ground: IdealGround = field(default_factory=IdealGround)
    before_tick: Callable[[], None] = lambda: None
    age_s: float | None = None
    said: list[tuple[float, float, float]] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.types = message_types("jazzy")
        self.robot = RobotEmulator(self.ground, epoch_s=1000.0)
        self._due: list[tuple[float, int, str, Heard]] = []
        self._numbers = count()
        self.time_s, self.messages = 0.0, 0
        self.delivered_s = 0.0

    def driver(self, scanner: ScanMount | None = None, **settings: Any) -> Ros2Base:
        return Ros2Base(self, DriveSettings(**settings), scanner)

    def send(self, key: str, message: Any) -> None:
        twist = getattr(message, "twist", message)
        self.said.append((self.time_s, twist.linear.x, twist.angular.z))
        stamped = "_stamped" if hasattr(message, "twist") else ""
        self.robot.hear(key + stamped, self.types.encode(message))

    def say(self, key: str, cdr: bytes, sender: str) -> None:
        """Somebody else publishes."""
        heapq.heappush(self._due, (self.time_s, next(self._numbers), key, Heard(cdr, sender, self.time_s)))

    def receive(self, timeout_s: float) -> tuple[str, Heard] | None:
        ends_s = self.time_s + timeout_s
        while not self._due or self._due[0][0] > self.time_s:
            if self.time_s >= ends_s:
                return None
            self.tick()
        _, _, key, heard = heapq.heappop(self._due)
        return key, Heard(heard.cdr, heard.sender, self.time_s)

    def tick(self) -> None:
        """Time passes."""
        self.before_tick()
        self.time_s += TICK_S
        self.robot.advance(TICK_S)
        for key, cdr in self.robot.take():
            self.messages += 1
            for delay_s, data, sender in self.spoil(self.time_s, key, cdr):
                due_s = self.time_s + delay_s
                heapq.heappush(self._due, (due_s, next(self._numbers), key, Heard(data, sender, due_s)))

    def is_ours(self, _key: str, heard: Heard) -> bool:
        return heard.sender == "driver"

    def now(self) -> float:
        return self.time_s

    def time_there(self) -> float:
        return 1000.0 + self.time_s

    def picture_age_s(self) -> float | None:
        return self.age_s

    def reopen(self) -> None:
        pass

    def close(self) -> None:
        pass
