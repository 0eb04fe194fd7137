"""Things that stand in rooms, and findings about a world."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

ROBOT_TOP_M = 1.4
"""A thing that begins higher than this above the floor is no obstacle."""

STEP_M = 0.03
"""A thing no higher than this is driven over."""

MAX_FLUSH_M = 0.06
"""A thing that protrudes from its wall by no more than this is no obstacle: the robot keeps clear of the wall."""

EXTRA_KIND = "obstacle"
"""The kind of a thing that the file lacks."""


@dataclass(frozen=True, slots=True)
class Finding:
    """A fault of a world that could be read: where (file:line) and what."""

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
        footprint_world: (4, 2) rectangle on the floor round all of it, or round what the robot could hit [m]; a
            polygon (k, 2) where the file lacks it.
        low_m, high_m: its vertical extent above the floor.
        protrusion_m: how far it protrudes from its wall; ``None`` for a free-standing thing.
        source: file:line where it is placed.
    """

    name: str
    locale: str
    kind: str
    footprint_world: NDArray[np.float64]
    low_m: float
    high_m: float
    protrusion_m: float | None
    source: str

    @property
    def is_obstacle(self) -> bool:
        """Whether the robot could hit it."""
        is_flush = self.protrusion_m is not None and self.protrusion_m <= MAX_FLUSH_M
        return self.low_m < ROBOT_TOP_M and self.high_m > STEP_M and not is_flush
