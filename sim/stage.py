"""From a scenario to a body in a building, with the details that the robot's model lacks."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial

from sim.body.simulated_body import SimulatedBody
from sim.body.simulated_building import Elevators, SimulatedBuilding
from sim.ground_truth.table import START_AS_STATED
from sim.ground_truth.true_changes import ChangingFaces, State
from sim.render.lights import Lights, Room, check_light
from sim.render.optics import check_lens
from sim.scenario import Scenario
from sim.scenario_changes import (
    check_names,
    check_room,
    find_changed_locales,
    find_changes,
    find_named_locales,
    load_true_world,
    move_scenario_things,
)
from sim.truth import Score, Truth, score
from world_models.building.geometry.outlines import inside_polygon
from world_models.building.locales import Link
from world_models.building.world import World
from world_models.camera import Camera, CameraMount
from world_models.commands import parse_command
from world_models.entries import Place
from world_models.files.toml.mission import Arrival
from world_models.files.world_files import WorldError
from world_models.frames import Pose2

MAX_FLOOR_STEP_M = 0.5
"""Rooms whose floors differ by less are on one storey [m]."""


@dataclass(frozen=True, eq=False)
class Stage:
    """A scenario with its building: what all runs of it share.

    Attributes:
        scenario: as it was given.
        world: the building with its details; not what the robot believes.
        building: the same for the simulated body.
        start_world, goal_world: intended poses at start and goal, in the world frame.
        put_down_world: where it is put down, before the errors of putting it down: at the start, as a rule.
        goal_floor_m: height of the goal's floor [m].
        part: the locale that contains all that was built; elsewhere the camera sees nothing.
    """

    scenario: Scenario
    world: World
    building: SimulatedBuilding
    start_world: Pose2
    goal_world: Pose2
    put_down_world: Pose2
    goal_floor_m: float = 0.0
    part: str = ""

    def body(self, seed: int) -> SimulatedBody:
        """A new body, put down at the start, for a run with this seed."""
        s = self.scenario
        camera, mount = _true_camera(s)
        return SimulatedBody(
            _people(s, self.world, self.building, seed), self.put_down_world, camera, mount,
            seed=seed, actuator=s.actuator, sensor=s.sensor, bumper=s.bumper, ranges=s.ranges,
            faults=s.faults, lighting=s.light,
            put_down_sigma_m=s.start.put_down_sigma_m, put_down_sigma_rad=s.start.put_down_sigma_rad,
        )

    def score(self, track: tuple[Truth, ...]) -> Score:
        """Score a run's true track; a difference in height to the goal's floor counts as distance."""
        found = score(track, self.start_world, self.goal_world, heading_matters=self.scenario.arrival.matters)
        there = track[-1].locale
        up_m = self.world.floor_m(there) - self.goal_floor_m if there in self.world.frames else 0.0
        return replace(found, position_error_m=math.hypot(found.position_error_m, up_m)) if up_m else found

    def going_to(self, place: Place) -> Stage:
        """The same for a robot that was asked on its way to go elsewhere, and may arrive at any heading."""
        return replace(self, scenario=replace(self.scenario, arrival=Arrival()),
                       goal_world=replace(place, heading_rad=0.0).in_world(self.world),
                       goal_floor_m=self.world.floor_m(place.locale))


def build_stage(scenario: Scenario) -> Stage:
    """Load a scenario's world and build what its runs share.

    Raises:
        ScenarioError: the world or its details cannot be read, or the scenario does not fit the building.
    """
    world = _world(scenario)
    _true_camera(scenario)
    check_names(scenario, world)
    start, goal = _ends(scenario, world)
    down = _put_down(scenario, world, start)
    named = (down.locale, *find_named_locales(scenario, world), *find_changed_locales(scenario, world))
    around = _around(world, (start.locale, goal.locale, *named))
    faces = move_scenario_things(scenario, world, world.faces_within(around))
    changes = find_changes(scenario, world, around, faces)
    lights = _lights(scenario, world, around)
    changing = ChangingFaces(faces, changes, scenario.render.samples, lights)
    elevators = Elevators.of_links(_links_in(world, around), world, scenario.rides)
    on_floor = _storeys(world, around, changing, elevators)
    building = on_floor(world.floor_m(start.locale))
    check_room(scenario, world, down, building, on_floor)
    _people(scenario, world, building)
    heading = scenario.arrival.heading_rad if scenario.arrival.matters else 0.0
    start_world = replace(start, heading_rad=scenario.start.heading_rad).in_world(world)
    goal_world = replace(goal, heading_rad=heading).in_world(world)
    return Stage(scenario, world, building, start_world, goal_world, down.in_world(world), world.floor_m(goal.locale),
                 around)


def _people(scenario: Scenario, world: World, building: SimulatedBuilding, seed: int = 0) -> SimulatedBuilding:
    """The building with who walks there. Raises ScenarioError where they do not fit it."""
    try:
        return scenario.walkers.enter(building, world, seed) if scenario.walkers else building
    except ValueError as error:
        raise scenario.refused(("walkers",), str(error)) from None


def _world(scenario: Scenario) -> World:
    """Load the world with its details. Raises ScenarioError where one cannot be read."""
    try:
        return load_true_world(scenario)
    except WorldError as error:
        of_details = str(error).startswith(tuple(map(str, scenario.details)))
        raise scenario.refused(("details" if of_details else "world",), str(error)) from None


def _true_camera(scenario: Scenario) -> tuple[Camera, CameraMount]:
    """The camera and its mounting as they are. Raises ScenarioError where there is no such camera."""
    try:
        camera, mount = scenario.truth.camera.mounted(scenario.camera.camera, scenario.camera.mount)
        check_lens(camera)
        return camera, mount
    except ValueError as error:
        raise scenario.refused(("truth", "camera"), str(error)) from None


def _ends(scenario: Scenario, world: World) -> tuple[Place, Place]:
    """The places where the mission begins and ends. Raises ScenarioError where the world has no such place."""
    try:
        return parse_command(scenario.goal, world)
    except ValueError as error:
        raise scenario.refused(("goal",), str(error)) from None


def _put_down(scenario: Scenario, world: World, start: Place) -> Place:
    """Where the robot is put down. Raises ScenarioError where the world has no such place."""
    true = scenario.truth.start
    if true == START_AS_STATED:
        return replace(start, heading_rad=scenario.start.heading_rad)
    if true.locale not in world.frames:
        raise scenario.refused(("truth", "start", "locale"), f"expected a room of the world, got {true.locale!r}")
    return Place(true.locale, true.x_m, true.y_m, true.heading_rad)


def _around(world: World, locales: Sequence[str]) -> str:
    """The smallest locale, of more than one room, that contains these: only this part of the world is built."""
    around = world.common(*locales)
    return world.locale(around).parent or around if world.is_room(around) else around


def _storeys(
    world: World, around: str, changing: ChangingFaces, elevators: Elevators
) -> Callable[[float], SimulatedBuilding]:
    """A function from the height of the body's floor [m] to the building there at the start of the run.

    Each state of each storey is built once.
    """
    known: dict[tuple[float, State], SimulatedBuilding] = {}
    finders: dict[float, Callable[[Pose2], str]] = {}

    def at_time(floor_m: float, time_s: float, _robot: Pose2 | None = None) -> SimulatedBuilding:
        key = round(floor_m, 3), changing.state_at(time_s)
        if key not in known:
            storey, state = key
            if storey not in finders:
                finders[storey] = _locale_finder(world, around, floor_m)
            known[key] = SimulatedBuilding(
                changing.renderer(state), changing.obstacles(state, floor_m), finders[storey],
                lambda place: place.in_world(world), floor_m, elevators, on_floor,
                partial(at_time, floor_m) if changing.is_changing else None,
                changing.added(state), changing.gone(state),
            )
        return known[key]

    def on_floor(floor_m: float) -> SimulatedBuilding:
        return at_time(floor_m, 0.0)

    return on_floor


def _lights(scenario: Scenario, world: World, around: str) -> Lights | None:
    """What lights the building; None without ``[light]``. Raises ScenarioError where it needs what is not installed."""
    if scenario.light is None:
        return None
    try:
        check_light(scenario.light)
    except ValueError as error:
        raise scenario.refused(("light",), str(error)) from None
    return Lights(scenario.light, _lit_rooms(world, around))


def _lit_rooms(world: World, around: str) -> tuple[Room, ...]:
    """The rooms in a locale and those beyond their doorways: whose faces are built."""
    inside = tuple(world.rooms_in(around))
    beyond = [doorway.other(room) for room in inside for doorway in world.doorways_of(room)]
    return tuple(
        Room(world.outline(name), world.floor_m(name), world.floor_m(name) + world.locale(name).height_m)
        for name in dict.fromkeys((*inside, *beyond)))


def _links_in(world: World, around: str) -> tuple[Link, ...]:
    """The elevators and stairs between the rooms of a locale."""
    found = {link.name: link for room in world.rooms_in(around) for link in world.links_of(room)}
    return tuple(found.values())


def _locale_finder(world: World, around: str, floor_m: float) -> Callable[[Pose2], str]:
    """As ``world.locale_at``, but fast inside a room: it is called every two centimetres of the path."""
    rooms = [name for name in world.rooms_in(around) if abs(world.floor_m(name) - floor_m) < MAX_FLOOR_STEP_M]
    outlines = [(name, world.outline(name)) for name in rooms]
    boxes = [(*outline.min(axis=0).tolist(), *outline.max(axis=0).tolist()) for _, outline in outlines]

    def locale_at(pose: Pose2) -> str:
        x, y = pose.x_m, pose.y_m
        for (name, outline), (left, low, right, high) in zip(outlines, boxes, strict=True):
            if left <= x <= right and low <= y <= high and inside_polygon(pose.position, outline):
                return name
        return world.locale_at([x, y, floor_m]) or ""

    return locale_at
