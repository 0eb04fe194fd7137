"""Elevator rider (§4, Figure 8): the robot asks for a ride between floors, as it cannot drive there."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

import numpy as np

from blackboard.board import View
from blackboard.change import Change, Posted, Revised, Watch
from blackboard.effect import Effect, Post, Revise
from blackboard.entry import Entry
from blackboard.level import Level
from knowledge_sources.questions import (
    deepest_sketch,
    find_belief,
    find_building,
    is_over,
    is_standing,
    open_discrepancy,
    open_fault,
)
from knowledge_sources.robot_knowledge_source import OlderSource
from world_models.entries.body import BodyFault, Ride, RideReport
from world_models.entries.location import Hypothesis
from world_models.entries.percepts import Tracks
from world_models.entries.task import PlanSketch
from world_models.frames import Pose2

ELEVATOR_SIGMA_M = 0.01  # standard deviation of where an elevator car stops, from floor to floor
ELEVATOR_SIGMA_RAD = 0.003  # standard deviation of the heading of an elevator car, from floor to floor


class ElevatorRider(OlderSource):
    """Asks for the ride that a verified sketch needs, and moves the belief to the floor where the doors open.

    It takes the reported floor for true. So nothing else is done there before a milestone is verified.
    """

    level = Level.ACTION
    on = (
        Watch(PlanSketch, (Posted, Revised), lambda s: s.is_active and s.verified),
        Watch(RideReport, (Posted,)),
        Watch(BodyFault, (Revised,)),
    )
    writes = (Ride, Hypothesis, PlanSketch, Tracks)

    def judge(self, view: View, trigger: Change) -> float | None:
        if is_over(view) or find_belief(view) is None:
            return None
        if isinstance(trigger.entry.value, RideReport):
            return 1.0
        return 0.3 if self._find_wanted_ride(view) is not None else None

    def answer(self, view: View, trigger: Change) -> Iterable[Effect]:
        if isinstance(trigger.entry.value, RideReport):
            yield from self._take_over_belief(view, trigger.entry)
            return
        wanted, belief = self._find_wanted_ride(view), find_belief(view)
        if wanted is not None and belief is not None:
            ride = wanted.value.subgoals[wanted.value.at]
            here, there = ride.origin.locale, ride.destination.locale
            yield Post(Ride(wanted.id, wanted.value.at, ride.passage, here, there), (wanted, belief))

    def _find_wanted_ride(self, view: View) -> Entry[PlanSketch] | None:
        """The sketch whose next subgoal is a ride that was not asked for, if nothing is in doubt."""
        sketch = deepest_sketch(view)
        if sketch is None or not sketch.value.verified or not is_standing(view) or open_fault(view) is not None:
            return None
        if any(open_discrepancy(view, level) is not None for level in (Level.PLAN, Level.GOAL)):
            return None
        s = sketch.value
        if s.current is None or not s.current.is_ride:
            return None
        asked = view.latest(Ride, lambda r: r.sketch == sketch.id and r.index == s.at)
        return sketch if asked is None else None

    def _take_over_belief(self, view: View, report: Entry[RideReport]) -> Iterable[Effect]:
        ride, belief = view.latest(Ride), find_belief(view)
        if ride is None or belief is None:
            return
        there = Revise(belief, self._predict_hypothesis(view, belief.value, ride.value), (report, belief))
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
