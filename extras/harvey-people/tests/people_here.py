"""People in a bare hall, for tests."""

from __future__ import annotations

import numpy as np

from harvey_people.simulated.figure import Figure
from harvey_people.simulated.peopled import people_building
from harvey_people.simulated.walking import Pedestrian
from sim.body.simulated_body import SimulatedBody
from sim.body.simulated_building import SimulatedBuilding
from sim.scenario import CameraSettings
from world_models.building.geometry.faces import Finish, build_barrier
from world_models.frames import Pose2

GREY = Finish((0.5, 0.5, 0.5))


def figure(seed: int = 0) -> Figure:
    return Figure.draw(f"people/{seed}", "room", np.random.default_rng(seed))


def person(way: list[tuple[float, float]], speed: float = 1.2, makes_way: bool = True, seed: int = 0,
           again: bool = False) -> Pedestrian:
    return Pedestrian.start(figure(seed), way, 0.0, speed, starts_s=0.0, stays_s=0.0, again=again, makes_way=makes_way)


def hall(half_m: float = 6.0) -> SimulatedBuilding:
    """A square room of walls."""
    corners = [(-half_m, -half_m), (half_m, -half_m), (half_m, half_m), (-half_m, half_m)]
    return SimulatedBuilding.of_faces([
        build_barrier(f"wall-{i}", "room", [(*a, 0.0), (*a, 2.5), (*b, 2.5), (*b, 0.0)], GREY)
        for i, (a, b) in enumerate(zip(corners, corners[1:] + corners[:1], strict=True))])


def body_among(*people: Pedestrian, at: Pose2 | None = None) -> SimulatedBody:
    camera = CameraSettings(width_px=64, height_px=64)
    return SimulatedBody(people_building(hall(), people, 0.0), at or Pose2(0.0, 0.0, 0.0), camera.camera, camera.mount,
                         seed=0)


def people_of(body: SimulatedBody) -> dict[str, np.ndarray]:
    """The corners on the floor plane of all that is drawn of each person, by name."""
    names = {"/".join(face.name.split("/")[:2]) for face in body.building.added}
    return {name: np.concatenate([face.polygon_world for face in body.building.added
                                  if face.name.startswith(f"{name}/")]) for name in names}
