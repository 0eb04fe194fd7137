"""Obstacles: what stands in the way and is not in the model of the building."""

from __future__ import annotations

from dataclasses import dataclass

from blackboard.kinds import inference
from world_models import words


@inference()
@dataclass(frozen=True, slots=True)
class Obstacle:
    """Something on the floor that the model of the building lacks.

    Attributes:
        name: under which the frame of its locale has it, as ``hallway/obstacle-1``.
        locale: where it stands.
        footprint: (4, 2) corners of what it is taken to cover of the floor [m, world].
        sigma_m: standard deviation of the place of its near side.
        x_m, y_m: middle of its near side, where it was touched, in the locale's frame.
        width_m: how wide it is taken to be.
    """

    name: str
    locale: str
    footprint: tuple[tuple[float, float], ...]
    sigma_m: float
    x_m: float
    y_m: float
    width_m: float

    def words(self) -> str:
        """``something about 0.4 m wide at (12.30, 0.90) m of hallway``."""
        return f"something about {self.width_m:.1f} m wide at {words.point(self.x_m, self.y_m)} of {self.locale}"

    def sentence(self) -> str:
        return f"{self.words()} is in the way ({self.name}); its near side is known to {words.metres(self.sigma_m)}"
