"""What the drivers of bases share: one call at a time, a stop that comes through, and a line that is tried again."""

from __future__ import annotations

import math
import threading
from abc import ABC, abstractmethod
from collections.abc import Iterator
from contextlib import contextmanager, suppress

from harvey.hardware.drivers.bases.base import BaseFault, FaultKind
from harvey.hardware.drivers.bases.link import Link
from world_models.entries.body import MotionReport, MotorCommand, Odometry
from world_models.entries.touch import Contact, Ranges

LOOK_S = 0.05
"""A driver that waits for a motion looks up this often, for a stop that was asked for and what the base says [s]."""


class Driver(ABC):
    """A base over a line (:class:`harvey.hardware.drivers.bases.base.Base`)."""

    def __init__(self, link: Link) -> None:
        self._link = link
        self._lock = threading.Lock()
        self._stop_asked = threading.Event()
        self._gone = self._closed = False
        self._so_far: MotionReport | None = None
        self._contact: Contact | None = None

    def turn(self, turn_rad: float) -> MotionReport:
        """Turn on the spot. Raises BaseFault."""
        return self.execute(MotorCommand(turn_rad, 0.0))

    def move(self, move_m: float) -> MotionReport:
        """Move ahead. Raises BaseFault."""
        return self.execute(MotorCommand(0.0, move_m))

    def execute(self, command: MotorCommand, /) -> MotionReport:
        """TURN, then MOVE. Raises BaseFault, and ValueError where the command is no finite motion."""
        if not (math.isfinite(command.turn_rad) and math.isfinite(command.move_m)):
            raise ValueError(f"expected a turn and a move that are finite, got {command}")
        with self._call():
            self._so_far = None
            return self._carried_out(command)

    def take_contact(self) -> Contact | None:
        """What it felt to touch since the last call."""
        contact, self._contact = self._contact, None
        return contact

    def ranges(self) -> Ranges | None:
        """What its range sensors measure. Raises BaseFault."""
        with self._call():
            self._so_far = None
            return self._read_ranges()

    def stop(self) -> None:
        """Stand still; what is under way in another thread ends with a fault of kind ``stopped``. Raises BaseFault."""
        self._stop_asked.set()
        try:
            with self._call():
                self._so_far = None
                self._halt()
        finally:
            self._stop_asked.clear()

    def odometry(self) -> Odometry:
        """Where the wheels count that the robot is. Raises BaseFault."""
        with self._call():
            self._so_far = None
            return self._read_odometry()

    def heartbeat(self) -> None:
        """Keep the base's watchdog quiet, and hear from it. Raises BaseFault."""
        self.odometry()

    def close(self) -> None:
        """Stop, and let the line go."""
        if self._closed:
            return
        with suppress(BaseFault):  # there is nobody left to tell; what stops it now is the base's watchdog
            self.stop()
        self._closed = True
        self._link.close()

    @abstractmethod
    def _carried_out(self, command: MotorCommand) -> MotionReport:
        """The motion, with :attr:`_so_far` kept up to date on the way. Raises BaseFault and OSError."""

    @abstractmethod
    def _halt(self) -> None:
        """Make it stand, and have that confirmed. Raises BaseFault and OSError."""

    @abstractmethod
    def _read_odometry(self) -> Odometry:
        """Ask the base where it is. Raises BaseFault and OSError."""

    def _read_ranges(self) -> Ranges | None:
        """Ask the base what its range sensors measure; None where it has none. Raises BaseFault and OSError."""
        return None

    @abstractmethod
    def _after_reopening(self) -> None:
        """The line is new: nothing that was half read or half said counts any more."""

    def _fault(self, kind: FaultKind, detail: str, *, stopped: bool = False) -> BaseFault:
        return BaseFault(kind, detail, done=self._so_far, stopped=stopped)

    @contextmanager
    def _call(self) -> Iterator[None]:
        with self._lock:
            if self._closed:
                raise BaseFault("disconnected", "this driver was closed", stopped=True)
            try:
                if self._gone:
                    self._link.reopen()
                    self._gone = False
                    self._after_reopening()
                yield
            except OSError as error:
                self._gone = True
                raise self._fault("disconnected", str(error) or "the line is gone") from None
