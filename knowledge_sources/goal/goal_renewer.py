"""Goal renewer (§2): a robot that was lost and knows its place again has a new top-level goal from there."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from typing import NamedTuple

from blackboard import Change, Discrepancy, Effect, Entry, Level, Post, Revise, Revised, View, Watch
from knowledge_sources.priority import Priority
from knowledge_sources.reads import active_goal, find_building, open_discrepancy
from knowledge_sources.robot_knowledge_source import RobotKnowledgeSource
from world_models.entries import Goal, Hypothesis, Place


class Case(NamedTuple):
    """The place that was found, the doubts that it ends, and the goals that it has: one or none."""

    found: Entry[Hypothesis]
    doubts: tuple[Entry[Discrepancy], ...]
    goals: tuple[Entry[Goal], ...]


class GoalRenewer(RobotKnowledgeSource):
    """Ends the doubts of all levels once the place is found, and sets a new top-level goal from there to the old end.

    Both at once: nothing may drive by the sketches of the old goal.
    """

    level = closes = Level.GOAL
    priority = Priority.ENTER
    on = (Watch(Hypothesis, (Revised,), lambda h: h.is_held and h.basis == "relocalization"),)
    writes = (Discrepancy, Goal)

    def bind(self, view: View, trigger: Change) -> Case | None:
        open_ones = [open_discrepancy(view, level) for level in (Level.GOAL, Level.ACTION, Level.PLAN)]
        if open_ones[0] is None:
            return None
        goal = active_goal(view)
        doubts = tuple(doubt for doubt in open_ones if doubt is not None)
        return Case(trigger.entry, doubts, () if goal is None else (goal,))

    def act(self, view: View, case: Case) -> Iterable[Effect]:
        found, doubts, goals = case
        for doubt in doubts:
            yield Revise(doubt, doubt.value.corrected(), (found,))
        building = find_building(view)
        here = found.value.world_from_robot(building)
        origin = Place.of_world(building, found.value.locale, here.x_m, here.y_m)
        for goal in goals:
            abandon = Revise(goal, replace(goal.value, status="abandoned"), (found,))
            yield abandon
            yield Post(Goal(origin, goal.value.destination), (found, abandon))
