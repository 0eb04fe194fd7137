"""Activity: what Harvey is busy with, in one word and one line; the headline of the story and the first lane."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from blackboard.level import Level
from blackboard.servoing import Discrepancy
from logs.recording.board_mirror import Mirror
from logs.recording.palette import BELIEVED, DONE, EXPECTED, MATCHED, NOT_TESTABLE, PLANNED, REJECTED, Colour
from world_models.entries.body import BodyFault
from world_models.entries.task import Goal, Leg, Milestone, Outcome, PlanSketch

ACTIVITY_KINDS = (Outcome, BodyFault, Discrepancy, Milestone, Leg, PlanSketch, Goal)
"""What an activity follows from."""

ACTIVITIES: Mapping[str, Colour] = {
    "waits": DONE, "plans": PLANNED, "drives": BELIEVED, "looks": EXPECTED, "doubts": NOT_TESTABLE, "is lost": REJECTED,
    "is in trouble": REJECTED, "reached": MATCHED, "lost": REJECTED, "blocked": REJECTED, "failed": REJECTED,
    "stopped": DONE,
}


@dataclass(frozen=True, slots=True)
class Activity:
    """One of :data:`ACTIVITIES`, and a sentence."""

    word: str
    line: str


def activity(mirror: Mirror) -> Activity:
    """What it is busy with, by what matters most: the end, a fault, a doubt, a look, a drive, a plan."""
    if (end := mirror.latest(Outcome)) is not None:
        return Activity(end.value.kind, f"The end: {end.value.kind}")
    if (fault := mirror.latest(BodyFault, lambda f: f.is_open)) is not None:
        return Activity("is in trouble", f"Trouble: {fault.value.what}")
    doubts = [e.value for e in mirror.all(Discrepancy) if e.value.is_open and is_doubt(e.value)]
    if any(d.level is Level.GOAL for d in doubts):
        return Activity("is lost", "Lost: nothing fits; finding out where it is")
    if doubts:
        return Activity("doubts", "In doubt: checking where it is before it goes on")
    if mirror.latest(Milestone, lambda m: m.is_open) is not None:
        return Activity("looks", "Looking for a milestone")
    return _under_way(mirror)


def is_doubt(found: Discrepancy) -> bool:
    """Whether its level has not measured it, or may not correct it."""
    return found.magnitude is None or found.exceeds


def _under_way(mirror: Mirror) -> Activity:
    if mirror.latest(Goal) is None:
        return Activity("waits", "Waiting for a goal")
    leg = leg_under_way(mirror)
    sketch = mirror.get(leg.sketch) if leg else None
    if sketch is None:
        return Activity("plans", "Planning what comes next")
    return Activity("drives", f"Driving through {sketch.value.locale}")


def leg_under_way(mirror: Mirror) -> Leg | None:
    """The straight line that it is on, if it is on one for the goal that it has now."""
    leg, goal = mirror.latest(Leg), mirror.latest(Goal)
    if leg is None or leg.value.status != "moving":
        return None
    sketch = mirror.get(leg.value.sketch)
    serves = sketch is not None and goal is not None and sketch.value.goal == goal.id
    return leg.value if serves and sketch is not None and sketch.value.status != "superseded" else None
