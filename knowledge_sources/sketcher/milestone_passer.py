"""Milestone passer (§3.3, §6): a milestone of a sketch holds: on from it, or the same subgoal again."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from typing import NamedTuple

from blackboard import Change, Effect, Entry, Level, Post, Revise, Revised, View, Watch
from knowledge_sources.methods.verification import is_last_look
from knowledge_sources.priority import Priority
from knowledge_sources.reads import HELD, declare_lost, find_building, find_search_here, has_missed, tell_missed
from knowledge_sources.reads.sketches import MAX_ADJUSTMENTS
from knowledge_sources.robot_knowledge_source import RobotKnowledgeSource
from world_models.entries import Discrepancy, Goal, Hypothesis, Impasse, Milestone, Place, PlaceSearch, PlanSketch


class Case(NamedTuple):
    """A milestone, the sketch that has reached it, the goal, and by what it holds but by being verified."""

    milestone: Entry[Milestone]
    sketch: Entry[PlanSketch]
    goal: Entry[Goal]
    found: tuple[Entry[PlaceSearch], ...]


class MilestonePasser(RobotKnowledgeSource):
    """Lets the next subgoal begin once the milestone before it is verified; after the last one the sketch is done.

    A subgoal whose end was missed is repeated from where the robot turned out to be: plan-level servoing (§6). Where
    that fails for the first goal, the robot may be elsewhere, and the goal level looks; a later goal, which began
    at a place that was just found, is given up. One that is not testable where a search has just found the robot holds
    by the looks of the search; but not the last one, which is what arriving means.
    """

    level, priority = Level.PLAN, Priority.ADVANCE
    on = (Watch(Milestone, (Revised,), lambda m: m.status in ("verified", "not testable")),)
    needs = (HELD,)
    writes = (PlanSketch, Discrepancy, Impasse)

    def bind(self, view: View, trigger: Change) -> Case | None:
        milestone = trigger.entry
        sketch = view.get(milestone.value.sketch)
        goal = None if sketch is None else view.get(sketch.value.goal)
        if sketch is None or goal is None or not sketch.value.is_active:
            return None
        here = None if milestone.value.status == "verified" else find_search_here(view, sketch.id)
        is_open = here is None or (sketch.value.at_end and not is_last_look(milestone.value))
        if sketch.value.at != milestone.value.index or (milestone.value.status == "not testable" and is_open):
            return None
        return Case(milestone, sketch, goal, () if here is None else (here,))

    def act(self, view: View, case: Case) -> Iterable[Effect]:
        (milestone, sketch, goal, found), belief = case, HELD.of(view).entry
        s = sketch.value
        if found and s.at_end:
            reason = f"{milestone.value.what} is not testable, where a search has found it"
            yield Post(Impasse("blocked", reason, goal.id), (milestone, sketch, *found))
            return
        if not has_missed(view, belief.value, s, is_inexact=milestone.value.is_inexact):
            passed = replace(s, status="done") if s.at_end else replace(s, adjustments=0)
            yield Revise(sketch, replace(passed, verified=True), (milestone, belief, *found))
            return
        if s.adjustments < MAX_ADJUSTMENTS:
            yield Revise(sketch, _repeat(view, s, belief.value), (milestone, belief, *found))
            return
        (has_failed, taking), is_first = tell_missed(view, belief.value, s), len(view.all(Goal)) == 1
        if is_first:
            yield declare_lost(has_failed, (milestone, goal, *taking))
        else:
            yield Post(Impasse("blocked", has_failed, goal.id), (milestone, sketch, *taking))


def _repeat(view: View, sketch: PlanSketch, belief: Hypothesis) -> PlanSketch:
    """The sketch with its last subgoal once more, from here."""
    k, building = sketch.at - 1, find_building(view)
    pose = belief.world_from_robot(building)
    origin = Place.of_world(building, sketch.subgoals[k].destination.locale, pose.x_m, pose.y_m)
    again = replace(sketch.subgoals[k], origin=origin, primitive=True)
    subgoals = (*sketch.subgoals[:k], again, *sketch.subgoals[k + 1:])
    return replace(sketch, subgoals=subgoals, at=k, verified=True, adjustments=sketch.adjustments + 1)
