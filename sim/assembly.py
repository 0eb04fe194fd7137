"""From a scenario to a body in a building: the simulator loads the world with the details that the model lacks."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial

from sim.body import SimulatedBody
from sim.building import Building
from sim.collision import ROBOT_RADIUS_M
from sim.faults import Displacement, Fault, placed
from sim.places import Place, places
from sim.scenario import Scenario, ScenarioError
from sim.truth import Score, Truth, score
from world_models.frames import Pose2
from world_models.store import WorldError, load_world
from world_models.world import World


@dataclass(frozen=True, eq=False)
class Stage:
    """A scenario with its building: what every run of it shares.

    Attributes:
        scenario: as it was given.
        world: the building with its details; not what the robot believes.
        building: how it looks and what is solid.
        start_world, goal_world: where the robot is meant to begin and to end, in the world frame.
    """

    scenario: Scenario
    world: World
    building: Building
    start_world: Pose2
    goal_world: Pose2

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
        """How a run with this true track ended."""
        return score(track, self.start_world, self.goal_world, heading_matters=self.scenario.arrival.matters)


def set_stage(scenario: Scenario) -> Stage:
    """Load the scenario's world and building.

    Raises:
        ScenarioError: the world or details cannot be read, or lack a locale that the scenario names, or the robot
            would begin in a wall.
    """
    try:
        world = load_world(scenario.world, details=scenario.details)
        building = Building.of_faces(world.faces, partial(_locale_at, world), scenario.render.samples)
        start, goal = places(scenario.goal)
        heading = scenario.arrival.heading_rad if scenario.arrival.matters else 0.0
        stage = Stage(scenario, world, building, _pose(world, start, scenario.start.heading_rad), _pose(world, goal, heading))
    except WorldError as error:
        raise ScenarioError(f"{scenario.name}: {error}") from None
    for fault in scenario.faults:
        _check_fault(scenario, world, fault)
    room = building.obstacles.clearance_m(stage.start_world)
    if room < 0:
        raise ScenarioError(f"{scenario.name}: goal: expected a start with {ROBOT_RADIUS_M} m of room, got {room:.2f} m less")
    return stage


def _locale_at(world: World, pose: Pose2) -> str:
    return world.locale_at(pose.position) or ""


def _pose(world: World, place: Place, heading_rad: float) -> Pose2:
    try:
        return place.pose_in_world(world, heading_rad)
    except ValueError as error:
        raise WorldError(f"goal: {error}") from None


def _check_fault(scenario: Scenario, world: World, fault: Fault) -> None:
    named = [fault.moment.in_locale]
    if isinstance(fault, Displacement) and fault.place is not None:
        named.append(fault.place.locale)
    for name in named:
        if name and name not in world.locales:
            raise ScenarioError(f"{scenario.name}: faults: expected one of the locales {', '.join(world.locales)}, got {name!r}")
