"""Goal renewer (§2): a robot that was lost and knows its place again has a new top-level goal from there."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

from blackboard import Change, Effect, Level, Post, Revise, Revised, View, Watch, rule
from knowledge_sources.priority import Priority
from knowledge_sources.reads import LOST, active_goal, find_building
from world_models.building.locale_frame import FrameRequest
from world_models.entries import Discrepancy, Goal, Hypothesis, Place, correct


@rule(on=Watch(Hypothesis, (Revised,), lambda h: h.is_held and h.basis == "relocalization"),
      writes=(Discrepancy, Goal, FrameRequest), needs=(LOST,), level=Level.GOAL, closes=Level.GOAL,
      priority=Priority.ENTER)
def goal_renewer(view: View, trigger: Change) -> Iterable[Effect]:
    """Ends the doubts of all levels once the place is found, and sets a new top-level goal from there to the old end.

    Both at once: nothing may drive by the sketches of the old goal.
    """
    found, goal, building = trigger.entry, active_goal(view), find_building(view)
    for level in (Level.GOAL, Level.ACTION, Level.PLAN):
        yield from correct(view, level, (found,))
    here = found.value.world_from_robot(building)
    origin = Place.of_world(building, found.value.locale, here.x_m, here.y_m)
    if goal is not None:
        abandon = Revise(goal, replace(goal.value, status="abandoned"), (found,))
        yield abandon
        yield Post(Goal(origin, goal.value.destination), (found, abandon))
