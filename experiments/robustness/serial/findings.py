"""Bounds of a driver over a bad line, and the findings of trials."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, field

PROTOCOLS = ("denning", "p2os", "create2")


@dataclass(frozen=True, slots=True)
class Bounds:
    """Bounds of a protocol.

    Attributes:
        done_m, done_rad: largest shortfall of a motion that is reported done.
        beyond_m, beyond_rad: largest excess of a motion over its command, while the base can be reached.
        operations: reads and writes within which a line breaks.
    """

    done_m: float
    done_rad: float
    beyond_m: float
    beyond_rad: float
    operations: int


BOUNDS: Mapping[str, Bounds] = {
    "denning": Bounds(1e-9, 1e-9, 1e-9, 1e-9, 60),
    "p2os": Bounds(0.02, math.radians(2.0), 0.35, math.radians(45.0), 100),
    "create2": Bounds(0.02, math.radians(10.0), 0.35, math.radians(120.0), 400),
}
"""Denning: rounding only. P2OS and Create 2: the distance until the driver notices and stops the base."""


@dataclass
class Findings:
    """Findings of trials.

    Attributes:
        violations: descriptions of violated bounds.
        beyond_m, beyond_rad: largest excess of a motion over its command, while the base could be reached.
        strays: motions with an excess of more than 2 cm or 2 degrees, while the base could be reached.
        overtaken: reports of a motion given after a late command had moved the base on.
        restarted: times that noise restarted a base that stood when its driver last heard from it.
        forged: commands that the base accepted but nobody sent.
        stops, late: how often it had to stop within the watchdog time, and how often it did not.
        unreachable: times that a base without watchdog ran on: line cut, host dead, or another baud rate.
        ran_on_m: largest distance that it ran on.
        resumed, ended: trials in which a command was executed once the line was good again, of all.
        deafened: times that noise set another baud rate, so that the base had to be power-cycled.
        deaths, blackouts, cuts: of the host, of the base, of the line.
        states: (last message of the host, whether the base moved) when the line broke.
    """

    frames: int = 0
    asked: int = 0
    done: int = 0
    faults: Counter[str] = field(default_factory=Counter)
    noise: Counter[str] = field(default_factory=Counter)
    violations: list[str] = field(default_factory=list)
    beyond_m: float = 0.0
    beyond_rad: float = 0.0
    strays: int = 0
    overtaken: int = 0
    restarted: int = 0
    forged: int = 0
    stops: int = 0
    late: int = 0
    unreachable: int = 0
    ran_on_m: float = 0.0
    deafened: int = 0
    deaths: int = 0
    blackouts: int = 0
    cuts: int = 0
    resumed: int = 0
    ended: int = 0
    longest_s: float = 0.0
    states: set[tuple[str, bool]] = field(default_factory=set)
