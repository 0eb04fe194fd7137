"""The body protocol: what the mission asks of a base, whatever stands on the floor, and how a base fails.

The simulator's body is one implementation, by its shape alone; the drivers of this package are the others.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal, Protocol, get_args

from harvey.hardware.drivers.bases.link import Link
from world_models.entries.body import MotionReport, MotorCommand, Odometry
from world_models.entries.touch import Contact, Ranges

FaultKind = Literal["silent", "nonsense", "disconnected", "stalled", "watchdog", "refused", "stopped"]
"""How a base fails.

silent: no answer that could be read, though the line is there. nonsense: what arrives is not the protocol, or tells of
a motion that was not asked for. disconnected: the line is gone. stalled: the wheels do not turn as they were told to.
watchdog: the base heard too little of us and stopped by itself. refused: the base understood and would not.
stopped: :meth:`Base.stop` was called while it moved.
"""


class Base(Protocol):
    """A base that turns on the spot and moves ahead.

    Calls that move return when the robot stands again, and answer within a bound that follows from the command: the
    time of the motion and a few watchdog times. Only :meth:`stop` may be called while another call is under way, from
    another thread. After a fault the next call tries the line again; there is nothing to reset.
    """

    def turn(self, turn_rad: float) -> MotionReport:
        """Turn on the spot, counter-clockwise; reports what the wheels claim. Raises BaseFault."""
        ...

    def move(self, move_m: float) -> MotionReport:
        """Move straight ahead (>= 0 m); reports what the wheels claim. Raises BaseFault."""
        ...

    def execute(self, command: MotorCommand, /) -> MotionReport:
        """TURN, then MOVE. Raises BaseFault, with what had been done so far."""
        ...

    def take_contact(self) -> Contact | None:
        """What it felt to touch since the last call: pressed bumpers, or wheels that were held. Asks the base nothing.
        """
        ...

    def ranges(self) -> Ranges | None:
        """What its range sensors measure now; None where it has none. Raises BaseFault."""
        ...

    def stop(self) -> None:
        """Stand still, at once. May be called from any thread. Raises BaseFault where the base did not confirm it."""
        ...

    def odometry(self) -> Odometry:
        """Where the wheels count that the robot is. Raises BaseFault."""
        ...

    def heartbeat(self) -> None:
        """Keep the base's watchdog quiet, and find out whether the base answers. Raises BaseFault."""
        ...

    def close(self) -> None:
        """Stop, and let the line go. Never raises; a second call does nothing."""
        ...


@dataclass(frozen=True, slots=True)
class BaseKind:
    """A kind of base, as ``harvey drive`` names it before the colon: ``denning:/dev/ttyUSB0``.

    Attributes:
        name: of the kind.
        baud: of its line.
        connect: its driver over a line.
        watchdog: what stops it when it hears nothing any more, in words.
        connect_emulated: its driver over a line to an emulated base, where that must be otherwise: no real time passes
            there, and two runs must send the same bytes.
    """

    name: str
    baud: int
    connect: Callable[[Link], Base]
    watchdog: str
    connect_emulated: Callable[[Link], Base] | None = None

    def connect_to_emulator(self, link: Link) -> Base:
        """The driver over a line to an emulated base."""
        return (self.connect_emulated or self.connect)(link)


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
        if kind not in get_args(FaultKind):
            raise ValueError(f"expected a kind of fault, one of {get_args(FaultKind)}, got {kind!r}")
        super().__init__(f"the base is {kind}: {detail}" if kind != "watchdog" else f"the base's watchdog: {detail}")
        self.kind: FaultKind = kind
        self.detail = detail
        self.done = done
        self.stopped = stopped
