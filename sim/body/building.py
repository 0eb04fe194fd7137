"""The building: what is seen of it, what is solid, and which locale is where."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

from sim.body.collision import Obstacles
from sim.body.elevator import Elevators
from sim.render.mesh import FaceLike
from sim.render.renderer import Renderer
from world_models.frames import Pose2

NO_ELEVATORS = Elevators({}, {})


def nowhere(_: Pose2) -> str:
    """For a building without named locales."""
    return ""


@dataclass(frozen=True, eq=False)
class Building:
    """A building for one body to be in.

    Attributes:
        renderer: how it looks.
        obstacles: what is solid.
        locale_at: the name of the locale at a pose in the world frame, "" outside all of them.
        floor_m: height of the floor that the body stands on; obstacles and locales are those of this floor.
        elevators: how one comes to another.
        on_floor: the building for a body that stands on the floor of this height.
    """

    renderer: Renderer
    obstacles: Obstacles
    locale_at: Callable[[Pose2], str] = nowhere
    floor_m: float = 0.0
    elevators: Elevators = NO_ELEVATORS
    on_floor: Callable[[float], Building] | None = field(default=None, repr=False)

    @staticmethod
    def of_faces(
        faces: Sequence[FaceLike], locale_at: Callable[[Pose2], str] = nowhere, samples: int = 8
    ) -> Building:
        """A building with these faces; see :meth:`~sim.render.renderer.Renderer.of_faces` for ``samples``."""
        return Building(Renderer.of_faces(faces, samples), Obstacles.of_faces(faces), locale_at)
