"""Goal closer (§3.3): a goal is reached when the last milestone on the way to it holds."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from typing import NamedTuple

from blackboard import Change, Effect, Entry, Level, Revise, Revised, View, Watch
from knowledge_sources.priority import Priority
from knowledge_sources.robot_knowledge_source import RobotKnowledgeSource
from world_models.entries import Goal, PlanSketch


class Case(NamedTuple):
    """A sketch that is done, and the goal to which it led."""

    done: Entry[PlanSketch]
    goal: Entry[Goal]


class GoalCloser(RobotKnowledgeSource):
    """Says that a goal is reached when the sketch that leads to it from locale to locale is done."""

    level, priority = Level.GOAL, Priority.ENTER
    on = (Watch(PlanSketch, (Revised,), lambda s: s.status == "done" and not s.path and not s.is_look),)
    writes = (Goal,)

    def bind(self, view: View, trigger: Change) -> Case | None:
        goal = view.get(trigger.entry.value.goal)
        return Case(trigger.entry, goal) if goal is not None and goal.value.is_active else None

    def act(self, view: View, case: Case) -> Iterable[Effect]:
        yield Revise(case.goal, replace(case.goal.value, status="reached"), (case.done,))
