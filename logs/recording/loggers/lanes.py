"""Lanes: what Harvey is busy with, the servo level in focus, when each knowledge source acts, faults of the body."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import rerun as rr
import rerun.blueprint as rrb

from blackboard import Activation, Level, View
from logs.recording.logger import NEAR, Logger, Moment, Panel, Subject
from logs.recording.palette import ACTIVITIES, LEVELS, REJECTED, Colour
from logs.recording.paths import FAULTS, FOCUS, HARVEY
from logs.recording.stream import RecordingStream, viewable
from world_models.entries import BodyFault, Discrepancy, Goal, Leg, Milestone, Outcome, PlanSketch

ACTS, GAP = "acts", ""
ACTIVITY_KINDS = (Outcome, BodyFault, Discrepancy, Milestone, Leg, PlanSketch, Goal)
"""What an activity follows from."""

def activity(board: View) -> tuple[str, str]:
    """One of :data:`ACTIVITIES` and a headline, by what matters most: the end, a fault, a doubt, a look, a drive."""
    if (end := board.latest(Outcome)) is not None:
        return end.value.kind, f"The end: {end.value.kind}"
    if (fault := board.latest(BodyFault, lambda f: f.is_open)) is not None:
        return "is in trouble", f"Trouble: {fault.value.what}"
    levels = {doubt.level for doubt in doubts(board)}
    if Level.GOAL in levels:
        return "is lost", "Lost: nothing fits; finding out where it is"
    if levels:
        return "doubts", "In doubt: checking where it is before it goes on"
    if board.latest(Milestone, lambda m: m.is_open) is not None:
        return "looks", "Looking for a milestone"
    if board.latest(Goal) is None:
        return "waits", "Waiting for a goal"
    leg = leg_under_way(board)
    sketch = board.get(leg.sketch) if leg else None
    return ("drives", f"Driving through {sketch.value.locale}") if sketch else ("plans", "Planning what comes next")


def doubts(board: View) -> list[Discrepancy]:
    """What is open and not measured yet by its level, or beyond what its level may correct."""
    return [d for e in board.all(Discrepancy) if (d := e.value).is_open and (d.magnitude is None or d.exceeds)]


def leg_under_way(board: View) -> Leg | None:
    """The straight line that it is on, if it is on one for the goal that it has now."""
    leg, goal = board.latest(Leg), board.latest(Goal)
    if leg is None or goal is None or leg.value.status != "moving":
        return None
    sketch = board.get(leg.value.sketch)
    serves = sketch is not None and sketch.value.goal == goal.id and sketch.value.status != "superseded"
    return leg.value if serves else None


class Lanes(Logger):
    """Logs a lane only when its state changes."""

    def __init__(self, subject: Subject) -> None:
        super().__init__(subject)
        self._known: set[tuple[str, str]] = set()
        self._acting = ""

    def panels(self) -> Sequence[Panel]:
        contents = [f"+ /{path}" for path in (HARVEY, FOCUS, FAULTS, *(f"{level}/**" for level in LEVELS))]
        view = rrb.StateTimelineView(origin="/", contents=contents, name="Who acts when, by level", time_view=NEAR)
        return (Panel(view, order=1, share=24),)

    def begin(self, stream: RecordingStream) -> None:
        stream.fix(HARVEY, style(ACTIVITIES))
        stream.fix(FOCUS, style(LEVELS))

    def log(self, stream: RecordingStream, moment: Moment) -> None:
        decision, board = moment.decision, moment.mirror
        for activation in decision.activated:
            self._meet(stream, lane(activation), {ACTS: LEVELS[str(activation.source.level)]})
        acting = lane(decision.chosen) if decision.chosen else ""
        if self._acting and self._acting != acting:
            self._set(stream, self._acting, GAP)
        if acting:
            self._set(stream, acting, ACTS)
        self._acting = acting
        self._set(stream, FOCUS, str(decision.focus))
        if moment.touched(*ACTIVITY_KINDS):
            self._set(stream, HARVEY, activity(board)[0])
        if moment.touched(BodyFault):  # a lane for the body, once something is wrong with it
            self._meet(stream, FAULTS, {fault.value.what: REJECTED for fault in board.all(BodyFault)})
            fault = board.latest(BodyFault, lambda f: f.is_open)
            self._set(stream, FAULTS, fault.value.what if fault else GAP)

    def _meet(self, stream: RecordingStream, path: str, states: Mapping[str, Colour]) -> None:
        """A lane needs its style before its first state."""
        new = {(path, state) for state in states} - self._known
        if new:
            self._known |= new
            stream.fix(path, style(states))

    def _set(self, stream: RecordingStream, path: str, state: str) -> None:
        if self.is_new(path, state):
            stream.log(path, rr.StateChange, state=[state])


def lane(activation: Activation) -> str:
    """Entity path of a knowledge source's lane; sources of one level lie together."""
    return f"{activation.source.level}/{viewable(activation.source.name)}"


def style(states: Mapping[str, Colour]) -> rr.StateConfiguration:
    """How the states of a lane look."""
    names = [viewable(state) for state in (*states, GAP)]
    return rr.StateConfiguration(
        values=names, labels=names, colors=[*states.values(), (0, 0, 0, 0)],
        visible=[True] * len(states) + [False])


LOGGERS = (Lanes,)
