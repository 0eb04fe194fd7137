"""Discrepancy raiser (§2, Figure 2): passes a discrepancy beyond its bound to the level above, so many times."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import replace

from blackboard import Change, Effect, Entry, Level, Post, Revise, View, Watch, rule
from knowledge_sources.priority import Priority
from knowledge_sources.reads import deepest_sketch, is_over
from world_models.entries import Discrepancy, Impasse, PlanSketch, last_escalated

MAX_CHECKS_PER_SUBGOAL = 20
"""So often the action level may ask the plan level on the way to one subgoal; then it is blocked."""
MAX_LOST_PER_MISSION = 12  # so often the robot may be lost in one mission
GIVEN_UP: Mapping[Level, tuple[str, str]] = {
    Level.PLAN: ("blocked", "on the way to one place it was not as expected {times} times, the last one:"),
    Level.GOAL: ("lost", "lost {times} times, the last one:"),
}
"""How the mission ends when a level was asked too often, and its reason."""


@rule(on=Watch(Discrepancy, where=lambda d: d.exceeds), writes=(Discrepancy, Impasse), level=Level.PLAN,
      priority=Priority.ENTER)
def discrepancy_raiser(view: View, case: Change) -> Iterable[Effect]:
    """Closes a discrepancy beyond its bound and posts it one level up; after too many, it sees no way on.

    The level above measures it by its own means. As each level is asked only so often, the same failure is not answered
    in the same way for ever.
    """
    found = case.entry
    closed, raised = found.value.escalated()
    sketch = deepest_sketch(view) if raised.level is Level.PLAN else None
    tried, last = _describe_attempt(sketch), last_escalated(view, closed.level)
    times = 1 + (last.value.times if last is not None and last.value.tried == tried else 0)
    counted = tuple(entry for entry in (sketch, last) if entry is not None)
    close = Revise(found, replace(closed, tried=tried, times=times), (*found.because, *counted))
    yield close
    yield Post(raised, (close,))
    most = MAX_CHECKS_PER_SUBGOAL if raised.level is Level.PLAN else MAX_LOST_PER_MISSION
    if times >= most and not is_over(view):
        kind, why = GIVEN_UP[raised.level]
        yield Post(Impasse(kind, f"{why.format(times=times)} {closed.what}"), (close,))


def _describe_attempt(sketch: Entry[PlanSketch] | None) -> str:
    """What the robot is at: a subgoal for the plan level, the mission for the goal level."""
    return "the mission" if sketch is None else f"subgoal {sketch.value.at} of {sketch.id}"
