"""What a Pioneer feels: its bumpers and its ring of sonars, from numbers to directions and distances.

Source of the sonars' places: the parameter files that come with ARIA (p3dx-sh). The bumper's segments are taken to be
numbered from the left, as the front sonars are.
"""

from __future__ import annotations

import math
from collections.abc import Mapping

from harvey.hardware.drivers.bases.p2os_wire import Status
from world_models.entries.touch import Contact, Ranges

SONARS = (
    (69, 136, 90), (114, 119, 50), (148, 78, 30), (166, 27, 10), (166, -27, -10), (148, -78, -30), (114, -119, -50),
    (69, -136, -90), (-157, -136, -90), (-203, -119, -130), (-237, -78, -150), (-255, -27, -170), (-255, 27, 170),
    (-237, 78, 150), (-203, 119, 130), (-157, 136, 90))
"""Where each sonar is [mm] and faces [degrees], in the robot's frame."""

BUMPERS = (52, 19, 0, -19, -52)
"""Directions of the front segments [degrees]; those of the rear are opposite."""

SEGMENT_SIGMA_RAD = math.radians(40.0) / math.sqrt(12.0)
"""A touch may be anywhere on a segment, of at most this angle."""

REACH_MM = 5000
"""A sonar that tells as much or more has heard no echo."""

SONAR_SIGMA_M, HALF_BEAM_RAD = 0.02, math.radians(12.5)


def find_contact(status: Status, when_s: float, *, turning: bool) -> Contact | None:
    """What a status tells of a touch: the pressed segments, or else held wheels; None where neither is told."""
    pressed = [math.radians(angle) for at, angle in enumerate(BUMPERS) if status.front >> at & 1]
    pressed += [math.radians(angle) + math.pi for at, angle in enumerate(BUMPERS) if status.rear >> at & 1]
    if not pressed:
        return Contact.of_stall(when_s, turning=turning) if status.stalled else None
    ahead, left = math.fsum(map(math.cos, pressed)), math.fsum(map(math.sin, pressed))
    middle = math.atan2(left, ahead)
    widest = max(abs(math.remainder(angle - middle, math.tau)) for angle in pressed)
    return Contact("bumper", middle, SEGMENT_SIGMA_RAD + widest, when_s)


def build_ranges(heard: Mapping[int, int], when_s: float) -> Ranges | None:
    """The ranges of the sonars that have heard, by number [mm]; None where none has."""
    numbers = sorted(number for number in heard if number < len(SONARS))
    if not numbers:
        return None
    directions, distances = zip(*(_echo(*SONARS[number], heard[number]) for number in numbers), strict=True)
    return Ranges(directions, distances, SONAR_SIGMA_M, HALF_BEAM_RAD, REACH_MM / 1000.0, when_s)


def _echo(x_mm: int, y_mm: int, axis_deg: int, range_mm: int) -> tuple[float, float | None]:
    """Direction and distance from the robot's axis; without an echo the sonar's own direction."""
    axis_rad = math.radians(axis_deg)
    if range_mm >= REACH_MM:
        return axis_rad, None
    x, y = x_mm + range_mm * math.cos(axis_rad), y_mm + range_mm * math.sin(axis_rad)
    return math.atan2(y, x), math.hypot(x, y) / 1000.0
