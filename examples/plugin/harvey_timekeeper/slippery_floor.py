"""A fault of one's own: the robot slides ahead on a wet floor, and its wheels count nothing of it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

from sim.faults.fault import Fault, FaultTarget
from world_models.frames import Pose2
from world_models.units import Bounds


@dataclass(frozen=True, slots=True)
class SlipperyFloor(Fault):
    """The robot slides straight ahead.

    Attributes:
        slide_m: how far [m].
    """

    kind: ClassVar[str] = "slippery_floor"
    bounds: ClassVar[Mapping[str, Bounds]] = {"slide_m": Bounds(0.0, 2.0)}

    slide_m: float = 0.1

    def apply(self, body: FaultTarget) -> None:
        there = body.truth.world_from_robot @ Pose2(self.slide_m, 0.0, 0.0)
        if body.is_free(there):
            body.put_robot(there)
        else:
            body.report_missed(f"there was no room to slide {self.slide_m:.2f} m")
