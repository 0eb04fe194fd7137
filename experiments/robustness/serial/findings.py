"""What a driver over a bad line has to hold, and what was found of it."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, field

PROTOCOLS = ("denning", "p2os", "create2")


@dataclass(frozen=True, slots=True)
class Bounds:
    """What a protocol has to hold.

    Attributes:
        done_m, done_rad: by how much a motion that is reported done may fall short of what was asked for.
        beyond_m, beyond_rad: how far any motion may go beyond what was asked for, while the base can be reached.
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
"""Denning: nothing but rounding. P2OS and Create 2: what can be gone while the driver finds out and says stop."""


@dataclass
class Findings:
    """What came of trials.

    Attributes:
        violations: in words; none, if all is well.
        beyond_m, beyond_rad: the furthest that a motion went beyond what was asked, while the base could be reached.
        strays: motions that went beyond by more than 2 cm or 2 degrees, while the base could be reached.
        overtaken: reports of a motion that the base had left behind, by a late command, when they were given.
        restarted: times that noise set a base going again that had stood when its driver last heard of it.
        forged: commands that the base accepted and nobody had given.
        stops, late: how often it had to stand within the watchdog time, and how often it did not.
        unreachable: times that a base without a watchdog ran on: line cut, host dead, or told another baud rate.
        ran_on_m: the furthest that it ran on so.
        resumed, ended: trials in which a command was carried out as asked once the line was good again, of all.
        deafened: times that noise told it another baud rate, so that somebody had to switch it off and on.
        deaths, blackouts, cuts: of the host, of the base, of the line.
        states: (what the host had said last, whether the base moved) when the line broke.
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
