"""Floor changer (§4, Figure 8): after a ride the robot is on another floor."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from blackboard import Change, Effect, Entry, Level, Posted, Revise, View, Watch
from knowledge_sources.priority import Priority
from knowledge_sources.reads import GOING_ON, HELD, Belief, find_building
from knowledge_sources.robot_knowledge_source import RobotKnowledgeSource
from world_models.entries import Hypothesis, PlanSketch, Ride, RideReport, Tracks
from world_models.frames import Pose2

ELEVATOR_SIGMA_M = 0.01  # standard deviation of where an elevator car stops, from floor to floor
ELEVATOR_SIGMA_RAD = 0.003  # standard deviation of the heading of an elevator car, from floor to floor


class Case(NamedTuple):
    """What was reported of a ride, the ride, and the belief from before it."""

    report: Entry[RideReport]
    ride: Entry[Ride]
    belief: Belief


class FloorChanger(RobotKnowledgeSource):
    """Moves the belief to the floor where the doors open.

    It takes the reported floor for true. So nothing else is done there before a milestone is verified.
    """

    level, priority = Level.ACTION, Priority.ENTER
    on = (Watch(RideReport, (Posted,)),)
    needs = (GOING_ON, HELD)
    writes = (Hypothesis, PlanSketch, Tracks)

    def bind(self, view: View, trigger: Change) -> Case | None:
        """The ride that was asked for last."""
        ride = view.latest(Ride)
        return None if ride is None else Case(trigger.entry, ride, HELD.of(view))

    def act(self, view: View, case: Case) -> Iterable[Effect]:
        report, ride, belief = case
        there = Revise(belief.entry, self._predict_hypothesis(view, belief.value, ride.value), (report, belief.entry))
        yield there
        tracks = view.latest(Tracks)
        if tracks is not None:  # the landmarks are on the other floor
            yield Revise(tracks, replace(tracks.value, items=(), anchors=()), (report,))
        sketch = view.get(ride.value.sketch)
        if sketch is not None and sketch.value.is_active and sketch.value.at == ride.value.index:
            yield Revise(sketch, sketch.value.advanced(), (report, there))

    def _predict_hypothesis(self, view: View, belief: Hypothesis, ride: Ride) -> Hypothesis:
        """The belief after a ride: the pose relative to the car's stop is the same on both floors."""
        world, destination = find_building(view), ride.destination
        link = next(link for link in world.links_of(ride.origin) if link.name == ride.passage)
        before, behind = (Pose2(*link.stop_of(name)) for name in (ride.origin, destination))
        pose = behind @ (before.inverse() @ belief.world_from_robot(world))
        turn = behind.heading_rad - before.heading_rad
        c, s = np.cos(turn), np.sin(turn)
        turned = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
        sigma_m, sigma_rad = ELEVATOR_SIGMA_M, ELEVATOR_SIGMA_RAD
        uneven = np.diag([sigma_m**2, sigma_m**2, sigma_rad**2])
        covariance = turned @ belief.covariance_world(world) @ turned.T + uneven
        return Hypothesis.of_world(world, destination, pose, covariance, "ride", motion=belief.motion)
