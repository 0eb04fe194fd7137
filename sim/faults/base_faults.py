"""Faults of the base and of the serial line to it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from sim.faults.fault import DeviceFault

WATCHDOG_S = 0.5
"""A base that receives nothing any more stops by itself after this time [s]."""


@dataclass(frozen=True, slots=True)
class LinkLost(DeviceFault):
    """Nothing comes through the line, in either direction. The base's watchdog stops it."""

    kind: ClassVar[str] = "link_lost"
    part: ClassVar[str] = "base"
    what: ClassVar[str] = "link lost"
    detail: ClassVar[str] = "no answer on the line"
    stops_motion_after_s: ClassVar[float | None] = WATCHDOG_S
    odometry_arrives: ClassVar[bool] = False


@dataclass(frozen=True, slots=True)
class Nonsense(DeviceFault):
    """What arrives from the base is noise. The base's watchdog stops it."""

    kind: ClassVar[str] = "nonsense"
    part: ClassVar[str] = "base"
    what: ClassVar[str] = "base answers nonsense"
    detail: ClassVar[str] = "what arrives is not the protocol"
    stops_motion_after_s: ClassVar[float | None] = WATCHDOG_S
    odometry_arrives: ClassVar[bool] = False


@dataclass(frozen=True, slots=True)
class Stall(DeviceFault):
    """The wheels are held. The line works, so the base reports how far it came."""

    kind: ClassVar[str] = "stall"
    part: ClassVar[str] = "base"
    what: ClassVar[str] = "stalled"
    detail: ClassVar[str] = "the wheels do not turn as they were told to"
    stops_motion_after_s: ClassVar[float | None] = 0.0
