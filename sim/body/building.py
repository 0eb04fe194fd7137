"""The building as the body needs it: what is seen, what is solid, and where its locales are."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

from sim.body.collision import Obstacles
from sim.body.elevator import Elevators
from sim.render.mesh import FaceLike
from sim.render.renderer import Renderer
from world_models.building.geometry.faces import Face
from world_models.entries.location import Place
from world_models.frames import Pose2

NO_ELEVATORS = Elevators({}, {})


def no_locale_at(_: Pose2) -> str:
    """For a building without named locales."""
    return ""


def no_world_from_place(place: Place) -> Pose2:
    """For a building without named locales. Raises ValueError."""
    raise ValueError(f"expected a place of the building, which has no named locales, got {place}")


@dataclass(frozen=True, eq=False)
class Building:
    """A building for one body to be in.

    Attributes:
        renderer: how it looks.
        obstacles: what is solid.
        locale_at: the name of the locale at a pose in the world frame, "" outside all of them.
        world_from_place: the pose of a robot at a place in a locale.
        floor_m: height of the floor that the body stands on [m]; obstacles and locales are those of this floor.
        elevators: the rides to other floors.
        on_floor: the building for a body on the floor of this height [m].
        at_time: the building on this floor at a time of the run [s]; None where nothing changes.
        added, gone: faces that are there, or not, otherwise than in the building's files.
    """

    renderer: Renderer
    obstacles: Obstacles
    locale_at: Callable[[Pose2], str] = no_locale_at
    world_from_place: Callable[[Place], Pose2] = no_world_from_place
    floor_m: float = 0.0
    elevators: Elevators = NO_ELEVATORS
    on_floor: Callable[[float], Building] | None = field(default=None, repr=False)
    at_time: Callable[[float], Building] | None = field(default=None, repr=False)
    added: tuple[Face, ...] = ()
    gone: tuple[Face, ...] = ()

    @staticmethod
    def of_faces(
        faces: Sequence[FaceLike], locale_at: Callable[[Pose2], str] = no_locale_at, samples: int = 8
    ) -> Building:
        """A building with these faces; see :meth:`~sim.render.renderer.Renderer.of_faces` for ``samples``."""
        return Building(Renderer.of_faces(faces, samples), Obstacles.of_faces(faces), locale_at=locale_at)
