"""The building: what is seen of it, what is solid, and which locale is where."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from sim.collision import Obstacles
from sim.mesh import FaceLike
from sim.renderer import Renderer
from world_models.frames import Pose2


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
    """

    renderer: Renderer
    obstacles: Obstacles
    locale_at: Callable[[Pose2], str] = nowhere

    @staticmethod
    def of_faces(
        faces: Sequence[FaceLike], locale_at: Callable[[Pose2], str] = nowhere, samples: int = 8
    ) -> Building:
        """A building with these faces; see :meth:`sim.renderer.Renderer.of_faces` for ``samples`` and the errors."""
        return Building(Renderer.of_faces(faces, samples), Obstacles.of_faces(faces), locale_at)
