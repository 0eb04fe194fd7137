"""What the mission asks of a base, how a base fails, the line to it, and what the drivers of bases share."""

from __future__ import annotations

import math
import threading
import time
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from typing import Literal, Protocol

import serial

from world_models.entries import Contact, MotionReport, MotorCommand, Odometry, Ranges

FaultKind = Literal["silent", "nonsense", "disconnected", "stalled", "watchdog", "refused", "stopped"]
"""How a base fails.

silent: no answer that could be read, though the line is there. nonsense: what arrives is not the protocol, or tells of
a motion that was not asked for. disconnected: the line is gone. stalled: the wheels do not turn as commanded.
watchdog: the base heard too little of us and stopped by itself. refused: the base understood and would not.
stopped: :meth:`Base.stop` was called while it moved.
"""

LOOK_S = 0.05
"""A driver that waits for a motion looks up this often, for a stop that was asked for and what the base says [s]."""


class BaseFault(Exception):
    """A base did not do what it was asked.

    Attributes:
        kind: how it failed.
        detail: in words, for the user.
        done: what had been done of the command so far, by the last count that was heard; None where nothing is known.
        stopped: whether the base is known to stand; where False, only its own watchdog will have stopped it.
    """

    def __init__(
        self, kind: FaultKind, detail: str, *, done: MotionReport | None = None, stopped: bool = False
    ) -> None:
        super().__init__(f"the base is {kind}: {detail}" if kind != "watchdog" else f"the base's watchdog: {detail}")
        self.kind: FaultKind = kind
        self.detail = detail
        self.done = done
        self.stopped = stopped


class Line(Protocol):
    """What a base is reached over."""

    def reopen(self) -> None:
        """Try the line again after it was gone; what had come before is forgotten. Raises OSError."""
        ...

    def close(self) -> None:
        """Let the line go. Never raises."""
        ...


class BytePipe(Line, Protocol):
    """A byte pipe that may garble, lose and break. Every method raises OSError where the line is gone."""

    def write(self, data: bytes) -> None:
        """Send."""
        ...

    def read(self, timeout_s: float) -> bytes:
        """What has come, at once if there is any; else whatever comes first within the time, or b""."""
        ...

    def now(self) -> float:
        """The time [s] on the clock that timeouts are counted by. Never raises."""
        ...


SCHEMES = ("socket", "rfc2217", "loop")
"""Of pyserial's URLs: they open nothing but a line."""


class SerialLink:
    """A line of pyserial: a device, a pseudo-terminal, or one of its URLs that only open a line (:data:`SCHEMES`)."""

    def __init__(self, url: str, baud: int) -> None:
        """Open it. Raises OSError."""
        self._url, self._baud = url, baud
        self._port = self._open()

    def write(self, data: bytes) -> None:
        self._port.write(data)

    def read(self, timeout_s: float) -> bytes:
        self._port.timeout = max(0.0, timeout_s)
        first: bytes = self._port.read(1)
        return first + self._port.read(self._port.in_waiting) if first else b""

    def now(self) -> float:
        return time.monotonic()

    def reopen(self) -> None:
        self.close()
        self._port = self._open()

    def close(self) -> None:
        try:
            self._port.close()
        except OSError:
            return

    def _open(self) -> serial.SerialBase:
        """The write timeout keeps a dead line from holding us."""
        scheme, slashes, more = self._url.partition("://")
        if slashes and (scheme not in SCHEMES or "://" in more):  # spy://loop://?file=NAME would empty that file
            raise OSError(f"{self._url}: expected a serial port, or a URL of {', '.join(SCHEMES)}, got {scheme}://")
        try:
            return serial.serial_for_url(self._url, baudrate=self._baud, timeout=0.1, write_timeout=0.5)
        except ValueError as error:
            raise OSError(f"{self._url}: expected a serial port or a URL that pyserial knows, got: {error}") from None


class Base(ABC):
    """A base over any line, that turns on the spot and moves ahead.

    Calls that move return when the robot stands again, and answer within a bound that follows from the command: the
    time of the motion and a few watchdog times. There is one call at a time; only :meth:`stop` comes through to one
    that is under way, from another thread. After a fault the next call tries the line again; there is nothing to reset.
    """

    def __init__(self, line: Line) -> None:
        self._line = line
        self._lock = threading.Lock()
        self._stop_asked = threading.Event()
        self._gone = self._closed = False
        self._so_far: MotionReport | None = None
        self._contact: Contact | None = None

    def turn(self, turn_rad: float) -> MotionReport:
        """Turn on the spot, counter-clockwise; reports what the wheels claim. Raises BaseFault."""
        return self.execute(MotorCommand(turn_rad, 0.0))

    def move(self, move_m: float) -> MotionReport:
        """Move straight ahead (>= 0 m); reports what the wheels claim. Raises BaseFault."""
        return self.execute(MotorCommand(0.0, move_m))

    def execute(self, command: MotorCommand, /) -> MotionReport:
        """TURN, then MOVE. Raises BaseFault with what had been done so far; ValueError where it is no finite motion."""
        if not (math.isfinite(command.turn_rad) and math.isfinite(command.move_m)):
            raise ValueError(f"expected a turn and a move that are finite, got {command}")
        with self._call():
            self._so_far = None
            return self._carried_out(command)

    def take_contact(self) -> Contact | None:
        """What it felt to touch since the last call: pressed bumpers, or wheels that were held."""
        contact, self._contact = self._contact, None
        return contact

    def ranges(self) -> Ranges | None:
        """What its range sensors measure now; None where it has none. Raises BaseFault."""
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
        """Stop, and let the line go. Never raises; a second call does nothing."""
        if self._closed:
            return
        with suppress(BaseFault):  # there is nobody left to tell; what stops it now is the base's watchdog
            self.stop()
        self._closed = True
        self._line.close()

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
                    self._line.reopen()
                    self._gone = False
                    self._after_reopening()
                yield
            except OSError as error:
                self._gone = True
                raise self._fault("disconnected", str(error) or "the line is gone") from None


class Driver(Base):
    """A base over a pipe of bytes."""

    def __init__(self, link: BytePipe) -> None:
        super().__init__(link)
        self._link = link


@dataclass(frozen=True, slots=True)
class BaseKind:
    """A kind of base, as ``harvey drive`` names it before the colon: ``denning:/dev/ttyUSB0``.

    Attributes:
        name: of the kind.
        baud: of its line.
        connect: its driver over a line.
        watchdog: what stops it when it hears nothing any more, in words.
        connect_emulated: its driver over a line to an emulated base, where that must differ: no real time passes
            there, and two runs must send the same bytes.
        open_at: its driver by what stands behind the colon, where that is no serial port; raises OSError and BadInput.
    """

    name: str
    baud: int
    connect: Callable[[BytePipe], Base]
    watchdog: str
    connect_emulated: Callable[[BytePipe], Base] | None = None
    open_at: Callable[[str], Base] | None = None

    def connect_to_emulator(self, link: BytePipe) -> Base:
        """The driver over a line to an emulated base."""
        return (self.connect_emulated or self.connect)(link)
