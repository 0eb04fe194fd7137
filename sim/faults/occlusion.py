"""Something hides a part of the camera's view for a while."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

from sim.faults.fault import DURATION, Fault, FaultTarget
from sim.render.occluder import Occluder
from world_models.units import Bounds


@dataclass(frozen=True, slots=True)
class Occlusion(Fault):
    """A rectangle of the picture is hidden. Where it is, and how dark, is drawn at random.

    Attributes:
        duration_s: for how long [s].
        part: of the picture's area, 0..1.
    """

    kind: ClassVar[str] = "occluded"
    bounds: ClassVar[Mapping[str, Bounds]] = {"duration_s": DURATION, "part": Bounds(0.0, 0.99, above=True)}

    duration_s: float = 10.0
    part: float = 0.2

    def apply(self, body: FaultTarget) -> None:
        body.add_occluder(Occluder.draw(self.part, body.truth.time_s + self.duration_s, body.fault_rng))
