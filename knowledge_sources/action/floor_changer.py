"""Floor changer (§4, Figure 8): after a ride the robot is on another floor."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

import numpy as np

from blackboard import Change, Effect, Entry, Posted, Revise, View, Watch, rule
from knowledge_sources.priority import Priority
from knowledge_sources.reads import GOING_ON, HELD, Belief
from world_models.building.locale_frame import FrameRequest
from world_models.entries import Hypothesis, PlanSketch, Ride, RideReport, Tracks
from world_models.frames import Pose2

ELEVATOR_SIGMA_M = 0.01  # standard deviation of where an elevator car stops, from floor to floor
ELEVATOR_SIGMA_RAD = 0.003  # standard deviation of the heading of an elevator car, from floor to floor


def find_ride(view: View, trigger: Change) -> tuple[Entry[RideReport], Entry[Ride]] | None:
    """What was reported, and the ride that was asked for last."""
    ride = view.latest(Ride)
    return None if ride is None else (trigger.entry, ride)


@rule(on=Watch(RideReport, (Posted,)), writes=(Hypothesis, PlanSketch, Tracks, FrameRequest), needs=(GOING_ON, HELD),
      bind=find_ride, priority=Priority.ENTER)
def floor_changer(view: View, case: tuple[Entry[RideReport], Entry[Ride]]) -> Iterable[Effect]:
    """Moves the belief to the floor where the doors open.

    It takes the reported floor for true. So nothing else is done there before a milestone is verified.
    """
    (report, ride), belief = case, HELD.of(view)
    there = Revise(belief.entry, _predict_hypothesis(belief, ride.value), (report, belief.entry))
    yield there
    tracks = view.latest(Tracks)
    if tracks is not None:  # the landmarks are on the other floor
        yield Revise(tracks, replace(tracks.value, items=(), anchors=()), (report,))
    sketch = view.get(ride.value.sketch)
    if sketch is not None and sketch.value.is_active and sketch.value.at == ride.value.index:
        yield Revise(sketch, sketch.value.advanced(), (report, there))


def _predict_hypothesis(belief: Belief, ride: Ride) -> Hypothesis:
    """The belief after a ride: the pose relative to the car's stop is the same on both floors."""
    link = next(link for link in belief.world.links_of(ride.origin) if link.name == ride.passage)
    before, behind = (Pose2(*link.stop_of(name)) for name in (ride.origin, ride.destination))
    turn = behind.heading_rad - before.heading_rad
    c, s = np.cos(turn), np.sin(turn)
    turned = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    uneven = np.diag([ELEVATOR_SIGMA_M**2, ELEVATOR_SIGMA_M**2, ELEVATOR_SIGMA_RAD**2])
    covariance = turned @ belief.covariance @ turned.T + uneven
    return belief.moved_to(behind @ (before.inverse() @ belief.pose), covariance, "ride", locale=ride.destination)
