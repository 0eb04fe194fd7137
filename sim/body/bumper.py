"""The bumper of the simulated robot: a ring of sectors, each a switch; without it, it feels held wheels."""

from __future__ import annotations

import math
from dataclasses import dataclass

from world_models.entries.touch import Contact
from world_models.units import Bounds, check_bounds


@dataclass(frozen=True, slots=True)
class Bumper:
    """A ring of switches round the robot; the first sector has its middle straight ahead.

    Attributes:
        sectors: how many; 0 for a robot without a bumper.
    """

    sectors: int = 12

    def __post_init__(self) -> None:
        check_bounds(self, {"sectors": Bounds(0, 360)})

    def feel(self, direction_rad: float, when_s: float) -> Contact:
        """What is felt of a touch in this direction from the robot's heading; the touch may be anywhere in its sector.
        """
        if not self.sectors:
            return Contact.of_stall(when_s)
        width = math.tau / self.sectors
        middle = math.remainder(round(direction_rad / width) * width, math.tau)
        return Contact("bumper", middle, width / math.sqrt(12.0), when_s)
