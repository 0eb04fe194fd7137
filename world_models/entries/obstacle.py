"""What is not in the model of the building: touch and range, by bumper, wheels or a ring of range sensors; obstacles in
the way."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

from blackboard import inference, observation
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


ObstacleStatus = Literal["suspected", "there", "gone"]
ObstacleSense = Literal["touch", "camera", "ranges"]

Corners = tuple[tuple[float, float], ...]


@inference()
@dataclass(frozen=True, slots=True)
class Obstacle:
    """Something on the floor that the model of the building lacks.

    Attributes:
        name: under which the frame of its locale has it, as ``hallway/obstacle-1``.
        locale: where it stands.
        footprint: (k, 2) corners, counter-clockwise, of what it is taken to cover of the floor [m, world].
        sigma_m: standard deviation of the place of its near side.
        x_m, y_m: where it is, in the locale's frame: where it was touched, or the middle of its footprint.
        width_m: how wide it is taken to be.
        height_m: of its top above the floor; sigma_height_m: standard deviation; infinite where nothing tells it.
        certainty: probability that it is there.
        seen_s: when it was last seen, ranged or touched, by the body's clock.
        touched_s: when it was last touched; None where it never was.
        by: what showed it first.
        evidence: what tells of it, in words: which pixels of which picture.
        status: suspected (not certain enough to act on), there, or gone.
        is_camouflaged: whether it looks like the floor: that it is not seen tells little.
        seen_from_m: from how near its shape was seen; infinite where its feet were not.
    """

    name: str
    locale: str
    footprint: Corners
    sigma_m: float
    x_m: float
    y_m: float
    width_m: float
    height_m: float = 0.0
    sigma_height_m: float = math.inf
    certainty: float = 1.0
    seen_s: float = 0.0
    touched_s: float | None = None
    by: ObstacleSense = "touch"
    evidence: str = ""
    status: ObstacleStatus = "there"
    is_camouflaged: bool = False
    seen_from_m: float = math.inf

    @property
    def is_there(self) -> bool:
        return self.status == "there"

    @property
    def is_height_known(self) -> bool:
        return math.isfinite(self.sigma_height_m)

    def words(self) -> str:
        """``something 0.6 m wide and 0.4 m high at (12.30, 0.90) m of hallway``."""
        high = f" and {self.height_m:.1f} m high" if self.is_height_known else ""
        return f"something {self.width_m:.1f} m wide{high} at {words.point(self.x_m, self.y_m)} of {self.locale}"

    def sentence(self) -> str:
        state = {"suspected": "may be in the way", "there": "is in the way", "gone": "is gone"}[self.status]
        sure = f"its near side is known to {words.metres(self.sigma_m)}, certainty {self.certainty:.2f}"
        last = {"touch": "touched", "camera": "seen", "ranges": "ranged"}[self.by]
        evidence = f"; {self.evidence}" if self.evidence else ""
        return f"{self.words()} {state} ({self.name}); first {last}, {sure}; last at {self.seen_s:.1f} s{evidence}"
