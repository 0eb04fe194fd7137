"""What a change on the board amounts to in a few plain words, one line of the recording; and what Harvey is busy with,
in one word and one line: the headline of the story and the first lane."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from blackboard.change import Change, Retracted, Revised
from blackboard.level import Level
from blackboard.servoing import Discrepancy
from logs.recording.board_mirror import Mirror
from logs.recording.palette import BELIEVED, DONE, EXPECTED, MATCHED, NOT_TESTABLE, PLANNED, REJECTED, Colour
from world_models import words
from world_models.building.locale_frame import FrameRequest, LocaleFrame, has_answer
from world_models.entries.body import BodyFault
from world_models.entries.location import Hypothesis
from world_models.entries.robot import Drift
from world_models.entries.task import Goal, Leg, Milestone, Outcome, PlanSketch


class Messages:
    """Words changes in their order; it remembers the last pose hypotheses, to tell by how much each was corrected."""

    def __init__(self) -> None:
        self._hypotheses: dict[str, Hypothesis] = {}

    def message(self, change: Change) -> str:
        """The first clause of the entry's own sentence; "" for a change that is not worth a word."""
        value = change.entry.value
        if isinstance(change, Retracted):
            return f"no longer believes {change.entry.id}"
        if isinstance(value, Hypothesis):
            return self._hypothesis(change, value)
        if isinstance(value, LocaleFrame):
            return _describe_frame(change, value)
        if isinstance(value, FrameRequest) and has_answer(value):
            return _describe_answer(value)
        return "" if _is_detail(change) else words.brief(value)

    def _hypothesis(self, change: Change, new: Hypothesis) -> str:
        old = self._hypotheses.get(change.entry.id)
        self._hypotheses[change.entry.id] = new
        if not new.is_held or old is None or old.locale != new.locale or new.basis in ("command", "relocalization"):
            return words.brief(new)
        return f"the belief moves by {new.distance_from(old)}, by {new.basis}"


def _describe_frame(change: Change, frame: LocaleFrame) -> str:
    """What is believed otherwise; of a frame as filed the answered request tells, in the same cycle."""
    if frame.changes:
        return f"believes of {frame.name}: {words.listed([change.sentence() for change in frame.changes])}"
    return f"believes of {frame.name} again what the file says" if isinstance(change, Revised) else ""


def _describe_answer(request: FrameRequest) -> str:
    errors = {answer.asked: answer.error for answer in request.answers if answer.error}
    asked = [name or "the whole building" for name in request.locales if name not in errors]
    known = [f"what is known of {words.listed(asked)}"] * bool(asked)
    places = [f"{answer.asked} is in {words.listed(answer.locales)}" for answer in request.answers if answer.locales]
    return f"answer: {', '.join([*known, *places, *errors.values()])}"


def _is_detail(change: Change) -> bool:
    """What another entry of the same cycle says already, or what changes with every move."""
    value = change.entry.value
    if isinstance(change, Revised) and isinstance(value, Leg):
        return value.status == "moving"
    if isinstance(change, Revised) and isinstance(value, Milestone):
        return not value.is_open
    return isinstance(value, Drift)


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
