"""A base of one's own: a protocol of plain text lines, as a microcontroller could speak it.

``t 0.5`` turns by half a radian, ``m 0.6`` moves 0.6 m ahead, ``s`` stops, ``?`` asks; every answer is
``turned moved seconds``, what the wheels counted of the last motion.
"""

from __future__ import annotations

from harvey.hardware.drivers.base_driver import BaseKind, Driver
from world_models.entries import MotionReport, MotorCommand, Odometry
from world_models.frames import Pose2

BAUD = 115200
MAX_WAIT_S = 60.0
"""A motion that has not ended after this is a fault."""


class CountingBase(Driver):
    """A base that carries out a line and answers when it stands again."""

    pose = Pose2(0.0, 0.0, 0.0)

    def _carried_out(self, command: MotorCommand) -> MotionReport:
        turned, _, turn_s = self._ask(f"t {command.turn_rad:.4f}")
        _, moved, move_s = self._ask(f"m {command.move_m:.4f}")
        self.pose = self.pose @ Pose2(0.0, 0.0, turned) @ Pose2(moved, 0.0, 0.0)
        return MotionReport(turned, moved, turn_s + move_s, self._link.now())

    def _halt(self) -> None:
        self._ask("s")

    def _read_odometry(self) -> Odometry:
        self._ask("?")
        return Odometry(self.pose.x_m, self.pose.y_m, self.pose.heading_rad, self._link.now())

    def _after_reopening(self) -> None:
        """Nothing is half read: every line is answered before the next."""

    def _ask(self, line: str) -> tuple[float, float, float]:
        """The three numbers of the answer. Raises BaseFault."""
        self._link.write(f"{line}\n".encode())
        answer, end_s = b"", self._link.now() + MAX_WAIT_S
        while not answer.endswith(b"\n"):
            if self._link.now() > end_s:
                raise self._fault("silent", f"no answer to {line!r}")
            answer += self._link.read(0.1)
        try:
            turned, moved, took_s = map(float, answer.split())
        except ValueError:
            raise self._fault("nonsense", f"expected three numbers, got {answer!r}") from None
        return turned, moved, took_s


KIND = BaseKind("counting", BAUD, CountingBase, "none: give it one before it drives among people")
