"""From a scenario to a body in a building: the simulator loads the world with the details that the model lacks."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from sim.body import SimulatedBody
from sim.building import Building
from sim.collision import ROBOT_RADIUS_M, Obstacles
from sim.elevator import Elevators
from sim.faults import Displacement, Fault, placed
from sim.moved import with_moved
from sim.renderer import Renderer
from sim.scenario import Scenario, ScenarioError
from sim.settings import near
from sim.truth import Score, Truth, score
from world_models.faces import Face
from world_models.frames import Pose2
from world_models.locales import Link
from world_models.location import Place
from world_models.outlines import inside_polygon
from world_models.phrases import places_of
from world_models.store import WorldError, load_world
from world_models.world import World

SAME_FLOOR_M = 0.5
"""Rooms whose floors differ by less are on one floor."""


@dataclass(frozen=True, eq=False)
class Stage:
    """A scenario with its building: what every run of it shares.

    Attributes:
        scenario: as it was given.
        world: the building with its details; not what the robot believes.
        building: how it looks and what is solid.
        start_world, goal_world: where the robot is meant to begin and to end, in the world frame.
        goal_floor_m: height of the floor that the goal is on.
    """

    scenario: Scenario
    world: World
    building: Building
    start_world: Pose2
    goal_world: Pose2
    goal_floor_m: float = 0.0

    def body(self, seed: int) -> SimulatedBody:
        """The robot, put down for a run with this seed."""
        s = self.scenario
        return SimulatedBody(
            self.building, self.start_world, s.camera.camera, s.camera.mount,
            seed=seed, actuator=s.actuator, sensor=s.sensor,
            faults=tuple(placed(fault, self.world) for fault in s.faults),
            put_down_sigma_m=s.start.put_down_sigma_m, put_down_sigma_rad=s.start.put_down_sigma_rad,
        )

    def score(self, track: tuple[Truth, ...]) -> Score:
        """How a run with this true track ended; on another floor than the goal's it is that much further from it."""
        found = score(track, self.start_world, self.goal_world, heading_matters=self.scenario.arrival.matters)
        there = track[-1].locale
        up_m = self.world.floor_m(there) - self.goal_floor_m if there in self.world.locales else 0.0
        return replace(found, position_error_m=math.hypot(found.position_error_m, up_m)) if up_m else found


def set_stage(scenario: Scenario) -> Stage:
    """Load the scenario's world and building.

    Raises:
        ScenarioError: the world or details cannot be read, or lack a locale that the scenario names, or the robot
            would begin in a wall.
    """
    try:
        world = load_world(scenario.world, details=scenario.details)
        for fault in scenario.faults:
            _check_fault(scenario, world, fault)
        _check_rides(scenario, world)
        start, goal = _ends(scenario, world)
        around = _around(world, (start.locale, goal.locale, *_named(scenario)))
        faces = _faces(scenario, world.faces_within(around))
        elevators = Elevators.of_links(_links_in(world, around), world, scenario.rides)
        building = _storeys(world, around, faces, elevators, scenario.render.samples)(world.floor_m(start.locale))
        heading = scenario.arrival.heading_rad if scenario.arrival.matters else 0.0
        start_world, goal_world = _pose(world, start, scenario.start.heading_rad), _pose(world, goal, heading)
    except WorldError as error:
        raise ScenarioError(f"{scenario.name}: {error}") from None
    room_m = ROBOT_RADIUS_M + building.obstacles.clearance_m(start_world)
    if room_m < ROBOT_RADIUS_M:
        expected = f"expected {ROBOT_RADIUS_M} m of room at the start"
        raise ScenarioError(f"{scenario.name}: goal: {expected}, got {room_m:.2f} m")
    return Stage(scenario, world, building, start_world, goal_world, world.floor_m(goal.locale))


def _faces(scenario: Scenario, faces: Sequence[Face]) -> Sequence[Face]:
    """Those of the building, with what was moved where it is now. Raises WorldError where there is no such thing."""
    try:
        return with_moved(faces, scenario.moved)
    except ValueError as error:
        raise WorldError(f"moved: {error}") from None


def _ends(scenario: Scenario, world: World) -> tuple[Place, Place]:
    """Where a scenario's mission begins and ends. Raises WorldError where the world has no such place."""
    try:
        return places_of(scenario.goal, world)
    except ValueError as error:
        raise WorldError(f"goal: {error}") from None


def _around(world: World, locales: Sequence[str]) -> str:
    """The smallest locale with all that a scenario names in it, and more than one room: what need be built of it."""
    around = world.common(*locales)
    return world.locale(around).parent or around if world.is_room(around) else around


def _storeys(
    world: World, around: str, faces: Sequence[Face], elevators: Elevators, samples: int
) -> Callable[[float], Building]:
    """The building by the height of the floor that a body stands on; each storey is worked out once."""
    renderer = Renderer.of_faces(faces, samples)
    known: dict[float, Building] = {}

    def on_floor(floor_m: float) -> Building:
        storey = round(floor_m, 3)
        if storey not in known:
            known[storey] = Building(renderer, Obstacles.of_faces(faces, floor_m),
                                     _locale_finder(world, around, floor_m), floor_m, elevators, on_floor)
        return known[storey]

    return on_floor


def _links_in(world: World, around: str) -> tuple[Link, ...]:
    """The elevators and stairs between rooms of a locale."""
    found = {link.name: link for room in world.rooms_in(around) for link in world.links_of(room)}
    return tuple(found.values())


def _locale_finder(world: World, around: str, floor_m: float) -> Callable[[Pose2], str]:
    """As ``world.locale_at``, but quick in the middle of a room: it is asked every two centimetres."""
    rooms = [name for name in world.rooms_in(around) if abs(world.floor_m(name) - floor_m) < SAME_FLOOR_M]
    outlines = [(name, world.outline(name)) for name in rooms]
    boxes = np.array([[*outline.min(axis=0), *outline.max(axis=0)] for _, outline in outlines]).reshape(-1, 4)

    def locale_at(pose: Pose2) -> str:
        p = pose.position
        near_rooms = np.flatnonzero(np.all((boxes[:, :2] <= p) & (p <= boxes[:, 2:]), axis=1))
        inside = [outlines[i][0] for i in near_rooms if inside_polygon(p, outlines[i][1])]
        return inside[0] if inside else world.locale_at([*p, floor_m]) or ""

    return locale_at


def _pose(world: World, place: Place, heading_rad: float) -> Pose2:
    try:
        return replace(place, heading_rad=heading_rad).in_world(world)
    except ValueError as error:
        raise WorldError(f"goal: {error}") from None


def _named(scenario: Scenario) -> list[str]:
    """The locales that the faults of a scenario name."""
    return [name for fault in scenario.faults for name in _named_by(fault)]


def _named_by(fault: Fault) -> list[str]:
    named = [fault.moment.in_locale]
    if isinstance(fault, Displacement) and fault.place is not None:
        named.append(fault.place.locale)
    return [name for name in named if name]


def _check_fault(scenario: Scenario, world: World, fault: Fault) -> None:
    for name in _named_by(fault):
        if name not in world.locales:
            raise ScenarioError(f"{scenario.name}: faults: expected {near(name, world.locales)}, got {name!r}")


def _check_rides(scenario: Scenario, world: World) -> None:
    if not scenario.rides:
        return
    rides = {link.name: link.between for link in world.links if link.kind == "elevator"}
    landings = sorted({name for between in rides.values() for name in between})
    for helper in scenario.rides:
        for name, known in ((helper.passage, list(rides)), (helper.presses, landings)):
            if name and name not in known:
                raise ScenarioError(f"{scenario.name}: rides: expected {near(name, known)}, got {name!r}")
