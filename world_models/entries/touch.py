"""Touch and range: what the robot feels of its surroundings, by its bumper, its wheels or a ring of range sensors."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

from blackboard.kinds import observation
from world_models import words

Sense = Literal["bumper", "stall"]
LAST_CONTACTS = 8
"""The newest contacts that stay on the board."""
AHEAD_SIGMA_RAD = math.pi / math.sqrt(12.0)
"""Of wheels that are held in a move: what stops it is anywhere on the half that faces ahead."""
AROUND_SIGMA_RAD = 2.0 * AHEAD_SIGMA_RAD
"""Of wheels that are held in a turn: anywhere round the robot."""


@observation(keep=LAST_CONTACTS)
@dataclass(frozen=True, slots=True)
class Contact:
    """Something was touched, and ended the motion; it rests on the request of that motion.

    Attributes:
        by: bumper, or stall: the wheels are held, which knows no direction but that of the motion.
        direction_rad: from the robot's heading, counter-clockwise, -pi..pi.
        sigma_rad: standard deviation of the direction.
        when_s: by the body's clock.
    """

    by: Sense
    direction_rad: float
    sigma_rad: float
    when_s: float

    def __post_init__(self) -> None:
        if not (abs(self.direction_rad) <= math.pi and self.sigma_rad > 0.0):
            raise ValueError("expected a direction of -pi to pi and a sigma above 0 rad, got "
                             f"{self.direction_rad:g} and {self.sigma_rad:g}")

    @staticmethod
    def of_stall(when_s: float, *, turning: bool = False) -> Contact:
        """What held wheels tell: something ahead in a move, something anywhere in a turn."""
        return Contact("stall", 0.0, AROUND_SIGMA_RAD if turning else AHEAD_SIGMA_RAD, when_s)

    def sentence(self) -> str:
        sure = f"+-{words.degrees(self.sigma_rad)}"
        felt = "the bumper touched something" if self.by == "bumper" else "the wheels were held by something"
        if self.sigma_rad >= AROUND_SIGMA_RAD:
            return f"{felt} in an unknown direction; at {self.when_s:.1f} s"
        return f"{felt} {words.bearing(self.direction_rad)} ({sure}); at {self.when_s:.1f} s"


@observation(keep=2)
@dataclass(frozen=True, slots=True)
class Ranges:
    """One reading of a ring of range sensors; it is taken with a picture, and rests on the same request.

    Attributes:
        directions_rad: (n,) of each echo or, without one, of the sensor's axis; from the robot's heading,
            counter-clockwise.
        distances_m: (n,) from the robot's axis to the nearest thing that sends back an echo; None without an echo:
            nothing is there, or it throws the sound elsewhere.
        sigma_m: standard deviation of a distance.
        half_beam_rad: the echo comes from anywhere within this of its direction.
        max_range_m: what is further from the robot's axis sends back no echo.
        when_s: by the body's clock.
    """

    directions_rad: tuple[float, ...]
    distances_m: tuple[float | None, ...]
    sigma_m: float
    half_beam_rad: float
    max_range_m: float
    when_s: float

    def __post_init__(self) -> None:
        if len(self.directions_rad) != len(self.distances_m):
            raise ValueError(f"expected a distance for each of {len(self.directions_rad)} directions, got "
                             f"{len(self.distances_m)}")

    @property
    def echoes(self) -> tuple[tuple[float, float], ...]:
        """(direction [rad], distance [m]) of each sensor that has an echo."""
        both = zip(self.directions_rad, self.distances_m, strict=True)
        return tuple((direction, distance) for direction, distance in both if distance is not None)

    def sentence(self) -> str:
        echoes = self.echoes
        heard = f"{len(echoes)} of {words.count(len(self.distances_m), 'range sensor')} have an echo"
        if not echoes:
            return f"{heard}; at {self.when_s:.1f} s"
        direction, distance = min(echoes, key=lambda echo: echo[1])
        return f"{heard}, the nearest {words.metres(distance)} away, {words.bearing(direction)}; at {self.when_s:.1f} s"
