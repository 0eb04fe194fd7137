"""Missions between random places of a building: where each begins and ends, by its seed."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import shapely

from harvey.errors import BadInput
from knowledge_sources.methods.motion.routes import compute_free_space
from sim.body.collision import ROBOT_RADIUS_M
from sim.scenario import Scenario
from sim.scenario_changes import load_true_world
from world_models.building.world import World
from world_models.entries import Place
from world_models.units import FOOT_M

MARGIN_M = 0.15
"""Free floor round the robot where a mission begins or ends [m]."""
MOST_DRAWS = 10_000


def format_mission(world: Path, goal: str = "Go from anywhere to anywhere", heading_deg: str = "0") -> str:
    """The text of a mission file in a building, with the simulated robot and camera as they are by default."""
    return (f'description = "Between random places of {world.stem}."\nworld = "{world.resolve()}"\ngoal = "{goal}"\n\n'
            f'[start]\nheading_deg = {heading_deg}\nput_down_sigma_in = 0.5\nput_down_sigma_deg = 0.5\n')


def draw_missions(scenario: Scenario, seeds: tuple[int, ...]) -> list[tuple[tuple[str, str], ...]]:
    """For each seed, what to set of a scenario: its goal and the heading of its start.

    Both places are drawn by area from the free floor of the rooms that doorways join.

    Raises:
        BadInput: no two rooms with free floor are joined, nor is there a single one.
    """
    world = load_true_world(scenario)
    free = {room: compute_free_space(world.outline(room), world.obstacles(room), ROBOT_RADIUS_M + MARGIN_M)
            for room in world.rooms}
    free = {room: floor for room, floor in free.items() if floor.area > 0.0}
    if not free:
        raise BadInput(f"--random: expected a room of {world.name} with free floor for the robot, got none")
    return [_draw(world, free, np.random.default_rng(seed)) for seed in seeds]


def _draw(world: World, free: dict[str, shapely.Geometry], rng: np.random.Generator) -> tuple[tuple[str, str], ...]:
    """A start anywhere, and a goal in another room that can be walked to; in the same where there is none."""
    start = _choose(list(free), free, rng)
    others = [room for room in free if room != start and world.floor_m(room) == world.floor_m(start)
              and world.walk(start, room)]
    goal = _choose(others or [start], free, rng)
    ends = [f"({room} {_draw_place(world, room, free[room], rng)})" for room in (start, goal)]
    return ("goal", f"(ptrans {' '.join(ends)})"), ("start.heading_deg", f"{rng.uniform(-180.0, 180.0):.1f}")


def _choose(rooms: list[str], free: dict[str, shapely.Geometry], rng: np.random.Generator) -> str:
    areas = np.array([free[room].area for room in rooms])
    return str(rng.choice(rooms, p=areas / areas.sum()))


def _draw_place(world: World, room: str, free: shapely.Geometry, rng: np.random.Generator) -> str:
    """A free place in the room's frame, in feet, as a goal names it."""
    x0, y0, x1, y1 = free.bounds
    for _ in range(MOST_DRAWS):
        x, y = (float(one) for one in rng.uniform((x0, y0), (x1, y1)))
        if shapely.intersects_xy(free, x, y):
            place = Place.of_world(world, room, x, y)
            return f"({place.x_m / FOOT_M:.2f},{place.y_m / FOOT_M:.2f},0)"
    raise BadInput(f"--random: expected free floor in {room}, got next to none")
