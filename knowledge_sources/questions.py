"""Questions that several experts ask of the board; pure reads."""

from __future__ import annotations

from blackboard.board import View
from blackboard.entry import Entry
from blackboard.index import Index
from blackboard.level import Level
from blackboard.servoing import OPEN, Discrepancy
from world_models.body import BodyFault, MotionReport, MotorCommand
from world_models.location import Hypothesis
from world_models.task import Goal, Leg, Milestone, Outcome, PlanSketch

HELD: Index[Hypothesis] = Index(Hypothesis, lambda h: h.is_held or None)
ACTIVE_GOAL: Index[Goal] = Index(Goal, lambda g: g.is_active or None)
OPEN_MILESTONE: Index[Milestone] = Index(Milestone, lambda m: m.is_open or None)
ACTIVE_SKETCH: Index[PlanSketch] = Index(PlanSketch, lambda s: s.goal if s.is_active else None)
OPEN_FAULT: Index[BodyFault] = Index(BodyFault, lambda f: f.is_open or None)


def held(view: View) -> Entry[Hypothesis] | None:
    """Where the robot believes it is."""
    return view.newest(HELD, True)


def active_goal(view: View) -> Entry[Goal] | None:
    return view.newest(ACTIVE_GOAL, True)


def open_milestone(view: View) -> Entry[Milestone] | None:
    """The milestone that is being looked for."""
    return view.newest(OPEN_MILESTONE, True)


def open_discrepancy(view: View, level: Level) -> Entry[Discrepancy] | None:
    """The newest discrepancy that is open at a level."""
    return view.newest(OPEN, level)


def deepest_sketch(view: View) -> Entry[PlanSketch] | None:
    """The most detailed active sketch for the active goal: the one that is being carried out (Figure 3)."""
    goal = active_goal(view)
    if goal is None:
        return None
    active = view.having(ACTIVE_SKETCH, goal.id)
    return max(active, key=lambda entry: len(entry.value.path), default=None)


def under_way(view: View) -> tuple[Entry[Leg], Entry[PlanSketch]] | None:
    """The leg that is being driven and the sketch that wants it; None when there is none."""
    leg, sketch = view.latest(Leg), deepest_sketch(view)
    if leg is None or sketch is None or leg.value.status != "moving":
        return None
    s = sketch.value
    return (leg, sketch) if s.verified and leg.value.sketch == sketch.id and s.at == leg.value.index else None


def is_settled(view: View) -> bool:
    """Whether every motor command was reported and every report is in the belief: the robot stands where it thinks."""
    belief, command, report = held(view), view.latest(MotorCommand), view.latest(MotionReport)
    if belief is None or command is None:
        return belief is not None
    return report is not None and report.because == (command.ref,) and belief.value.motion == report.id


def open_fault(view: View) -> Entry[BodyFault] | None:
    """What is wrong with the body now; nobody moves while anything is."""
    return view.newest(OPEN_FAULT, True)


def is_over(view: View) -> bool:
    """Whether the mission has ended."""
    return view.latest(Outcome) is not None
