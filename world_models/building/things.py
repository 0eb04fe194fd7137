"""What stands in the rooms, and what is wrong with a world."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

ROBOT_TOP_M = 1.4
"""What hangs higher than this is no obstacle."""

STEP_M = 0.03
"""What is no higher than this is driven over."""

FLUSH_M = 0.06
"""What stands out from its wall by no more than this is no obstacle: the robot keeps clear of the wall itself."""


@dataclass(frozen=True, slots=True)
class Finding:
    """Something wrong with a world that could be read: where (file:line) and what."""

    source: str
    what: str

    def __str__(self) -> str:
        return f"{self.source}: {self.what}"


@dataclass(frozen=True, slots=True, eq=False)
class Thing:
    """Furniture, a pillar, a board on the wall.

    Attributes:
        name: unique in the world.
        locale: where it stands.
        kind: the part that it is made from.
        footprint_world: (4, 2) rectangle on the floor [m] that holds it, or what of it the robot could hit.
        low_m, high_m: its extent above the floor.
        proud_m: how far it stands out from its wall; ``None`` for one that stands free.
        source: file:line where it is placed.
    """

    name: str
    locale: str
    kind: str
    footprint_world: NDArray[np.float64]
    low_m: float
    high_m: float
    proud_m: float | None
    source: str

    @property
    def in_the_way(self) -> bool:
        """Whether the robot could hit it."""
        return self.low_m < ROBOT_TOP_M and self.high_m > STEP_M and (self.proud_m is None or self.proud_m > FLUSH_M)
