"""The lights go off for a while."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

from sim.faults.fault import DURATION, Fault, FaultTarget
from world_models.units import Bounds


@dataclass(frozen=True, slots=True)
class LightsOff(Fault):
    """The building's lights go off.

    Attributes:
        duration_s: for how long [s].
    """

    kind: ClassVar[str] = "lights_off"
    bounds: ClassVar[Mapping[str, Bounds]] = {"duration_s": DURATION}

    duration_s: float = 10.0

    def apply(self, body: FaultTarget) -> None:
        body.turn_lights_off(self.duration_s)
