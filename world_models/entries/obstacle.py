"""Obstacles: what stands in the way and is not in the model of the building."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

from blackboard.kinds import inference
from world_models import words

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
        core: (k, 2) corners of the part of that which was seen, where its feet were not: the rest may be free floor.
            () where the footprint is what was seen.
        sigma_m: standard deviation of the place of its near side.
        x_m, y_m: where it is, in the locale's frame: where it was touched, or the middle of its footprint.
        width_m: how wide it is taken to be.
        height_m: of its top above the floor; sigma_height_m: standard deviation; infinite where nothing tells it.
        certainty: probability that it is there.
        seen_s: when it was last seen, ranged or touched, by the body's clock.
        looked_s: when its place was last seen or ranged, whether or not it was there still.
        touched_s: when it was last touched; None where it never was.
        by: what told of it first.
        evidence: what tells of it, in words: which pixels of which picture.
        status: suspected (not certain enough to act on), there, or gone.
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
    looked_s: float = 0.0
    touched_s: float | None = None
    by: ObstacleSense = "touch"
    evidence: str = ""
    status: ObstacleStatus = "there"
    core: Corners = ()

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
