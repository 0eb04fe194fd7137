"""A building with people in it: they are drawn, they are solid, and they walk while time passes."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from harvey_people.simulated.walking import Pedestrian, Robot
from sim.body.collision import Obstacles
from sim.body.simulated_building import SimulatedBuilding
from sim.render.renderer import Renderer
from world_models.building.geometry.faces import Face
from world_models.camera import Camera
from world_models.frames import Pose, Pose2

STEP_S = 0.05
"""People walk in steps of this length at most [s]."""
People = tuple[Pedestrian, ...]


@dataclass(frozen=True, eq=False, kw_only=True)
class PeopledRenderer(Renderer):
    """A building with people; they are joined to it only for a picture."""

    people: People

    def radiance(self, camera: Camera, camera_from_world: Pose) -> NDArray[np.float32]:
        """The noiseless image (height, width, 3), RGB in 0..1."""
        still = Renderer(self.mesh, self.light, self.noise, self.samples, self.brightness)
        return still.with_faces(draw(self.people)).radiance(camera, camera_from_world)


def draw(people: People) -> tuple[Face, ...]:
    """What is drawn of people."""
    return tuple(face for person in people for face in person.figure.faces(person.corners(), person.floor_m))


def people_in(building: SimulatedBuilding) -> People:
    """Who is in a building, as of its moment."""
    return building.renderer.people if isinstance(building.renderer, PeopledRenderer) else ()


def people_building(still: SimulatedBuilding, people: People, now_s: float, robot: Robot | None = None,
                    ) -> SimulatedBuilding:
    """A building with people as of a moment; its ``at_time`` is the same later.

    Args:
        still: the building without people.
        robot: as it was at that moment, where that is known.
    """
    here = tuple(person for person in people if person.floor_m == still.floor_m)
    solid = np.concatenate([still.obstacles.segments_world, *(person.segments_world() for person in here)])
    base, on_floor = still.renderer, still.on_floor
    return replace(
        still, renderer=PeopledRenderer(mesh=base.mesh, light=base.light, noise=base.noise, samples=base.samples,
                                        brightness=base.brightness, people=people),
        obstacles=Obstacles(solid), added=(*still.added, *draw(here)), news=tuple(p.news for p in people if p.news),
        on_floor=None if on_floor is None else lambda floor_m: people_building(on_floor(floor_m), people, now_s),
        at_time=partial(let_walk, still, people, now_s, robot),
    )


def let_walk(still: SimulatedBuilding, people: People, since_s: float, was: Robot | None, time_s: float,
             robot: Pose2) -> SimulatedBuilding:
    """The building with people at a later time, with the robot there."""
    if time_s <= since_s:
        return people_building(still, people, since_s, was)
    later = still if still.at_time is None else still.at_time(time_s, robot)
    lasted_s = time_s - since_s
    known = Robot(robot, (0.0, 0.0) if was is None else ((robot.x_m - was.pose.x_m) / lasted_s,
                                                         (robot.y_m - was.pose.y_m) / lasted_s))
    steps = max(1, math.ceil(lasted_s / STEP_S - 1e-6))
    news: dict[str, str] = {}
    for step in range(steps):
        now_s = since_s + step * lasted_s / steps
        people = tuple(
            person.after(now_s, lasted_s / steps, [other for other in people if other is not person],
                         known if person.floor_m == still.floor_m else None,
                         later.obstacles if person.floor_m == still.floor_m else Obstacles(np.zeros((0, 2, 2))))
            for person in people)
        news |= {person.name: person.news for person in people if person.news}
    people = tuple(replace(person, news=news.get(person.name, "")) for person in people)
    return people_building(later, people, time_s, known)
