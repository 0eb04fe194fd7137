"""Goal closer (§3.3): a goal is reached when the last milestone on the way to it holds."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

from blackboard import Change, Effect, Entry, Level, Revise, Revised, View, Watch, rule
from knowledge_sources.priority import Priority
from world_models.entries import Goal, PlanSketch


def find_goal(view: View, trigger: Change) -> tuple[Entry[PlanSketch], Entry[Goal]] | None:
    """The sketch that is done, and the goal to which it led."""
    goal = view.get(trigger.entry.value.goal)
    return (trigger.entry, goal) if goal is not None and goal.value.is_active else None


@rule(on=Watch(PlanSketch, (Revised,), lambda s: s.status == "done" and not s.path and not s.is_look), writes=Goal,
      bind=find_goal, level=Level.GOAL, priority=Priority.ENTER)
def goal_closer(_view: View, case: tuple[Entry[PlanSketch], Entry[Goal]]) -> Iterable[Effect]:
    """Says that a goal is reached when the sketch that leads to it from locale to locale is done."""
    done, goal = case
    yield Revise(goal, replace(goal.value, status="reached"), (done,))
