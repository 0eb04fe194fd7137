"""What a Create 2 feels: the two halves of its bumper, and the light bumper, from signals to directions and distances.

The manual gives no law of the light bumper's signals: they fall with distance, and with how well a thing reflects. We
take them to fall exponentially, and count a factor of two in reflection as uncertainty of the distance.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

from harvey.hardware.drivers.bases.create2_wire import MAX_SIGNAL
from world_models.entries.touch import Contact, Ranges

RIGHT, LEFT = 1, 2
HALF_SIGMA_RAD = math.pi / 2.0 / math.sqrt(12.0)
"""A touch of one half is anywhere on its 90 degrees."""

BOTH_SIGMA_RAD = math.radians(30.0) / math.sqrt(12.0)
"""Both halves are pressed by a touch near the middle."""

LIGHTS = (65, 38, 13, -13, -38, -65)
"""Directions of the light bumper's sensors [degrees], from the left; they are on the rim."""

RADIUS_M, FADING_M, FAINTEST = 0.17, 0.05, 20
"""Of the rim; over which distance the signal falls to a third; what is fainter is noise."""

LIGHT_SIGMA_M = FADING_M * math.log(2.0)
LIGHT_HALF_BEAM_RAD = math.radians(12.5)
"""About half of the angle between two of them."""

LIGHT_REACH_M = RADIUS_M + FADING_M * math.log(MAX_SIGNAL / FAINTEST)


def find_contact(bumps: int, when_s: float) -> Contact:
    """What the pressed halves of the bumper tell."""
    if bumps & LEFT and bumps & RIGHT:
        return Contact("bumper", 0.0, BOTH_SIGMA_RAD, when_s)
    return Contact("bumper", math.pi / 4.0 if bumps & LEFT else -math.pi / 4.0, HALF_SIGMA_RAD, when_s)


def build_ranges(lights: Sequence[int], when_s: float) -> Ranges:
    """The ranges of the light bumper's signals, from the left."""
    directions = tuple(math.radians(angle) for angle in LIGHTS)
    distances = tuple(
        None if signal < FAINTEST else RADIUS_M - FADING_M * math.log(signal / MAX_SIGNAL) for signal in lights)
    return Ranges(directions, distances, LIGHT_SIGMA_M, LIGHT_HALF_BEAM_RAD, LIGHT_REACH_M, when_s)
