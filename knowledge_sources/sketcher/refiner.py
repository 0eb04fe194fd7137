"""Refiner (§3.3, Figure 9): a more detailed plan sketch for the current subgoal, depth first and only now."""

from __future__ import annotations

from collections.abc import Iterable
from typing import NamedTuple

from blackboard import Change, Effect, Entry, Level, Post, Posted, Revised, View, Watch
from knowledge_sources.methods.motion import SubgoalPlanner
from knowledge_sources.priority import Priority
from knowledge_sources.reads import (
    GOING_ON,
    HELD,
    Way,
    find_building,
    find_first_level,
    find_frames,
    find_obstacles,
    find_planner,
    find_way_to_goal,
    is_just_found,
    list_locales,
    name_obstacles,
    place_of,
    supersede,
)
from knowledge_sources.robot_knowledge_source import RobotKnowledgeSource
from world_models.entries import Goal, Hypothesis, Impasse, PlanSketch, Subgoal


class Case(NamedTuple):
    """A sketch whose next subgoal is to be refined, that subgoal, and the goal."""

    sketch: Entry[PlanSketch]
    subgoal: Subgoal
    goal: Entry[Goal]


class Refiner(RobotKnowledgeSource):
    """Draws a sketch for the next subgoal of another, once its milestone holds, until that is primitive.

    Only then its locale is entered. Where no way passes through it but another to the goal, the sketch is superseded
    for that one.
    """

    level, priority = Level.PLAN, Priority.ADVANCE
    on = (Watch(PlanSketch, (Posted, Revised), lambda s: s.is_active and s.verified and s.is_refinable),)
    needs = (GOING_ON, HELD)
    writes = (PlanSketch, Impasse)

    def bind(self, view: View, trigger: Change) -> Case | None:
        s: PlanSketch = trigger.entry.value
        goal, below = view.get(s.goal), (*s.path, s.at)
        is_refined = view.latest(PlanSketch, lambda o: o.is_active and o.goal == s.goal and o.path == below) is not None
        if goal is None or s.current is None or is_refined:
            return None
        return Case(trigger.entry, s.current, goal)

    def act(self, view: View, case: Case) -> Iterable[Effect]:
        (sketch, subgoal, goal), planner, belief = case, find_planner(view, self._settings.plan), HELD.of(view).entry
        s, locale = sketch.value, find_building(view).common(subgoal.origin.locale, subgoal.destination.locale)
        way = _plan(planner, subgoal, belief.value)
        if way is not None:
            frames = find_frames(view, list_locales(way))
            found = is_just_found(belief.value)
            yield Post(PlanSketch(s.goal, (*s.path, s.at), locale, way, verified=found), (sketch, belief, *frames))
            return
        obstacles = find_obstacles(view, (locale,)) or find_obstacles(view)
        if obstacles and _takes_another_way(view, find_way_to_goal(planner, belief.value, goal.value)):
            yield from supersede(view, sketch)
            return
        reason = f"no way through {locale} to {subgoal.destination}{name_obstacles(obstacles)}"
        yield Post(Impasse("blocked", reason, goal.id, tuple(o.id for o in obstacles)), (sketch, belief, *obstacles))


def _plan(planner: SubgoalPlanner, subgoal: Subgoal, belief: Hypothesis) -> Way | None:
    """Across a locale, or from locale to locale within a larger one."""
    if subgoal.origin.locale == subgoal.destination.locale:
        return planner.plan_across(subgoal, belief)
    return planner.plan_between_locales(place_of(belief), subgoal.destination, subgoal.tolerance_m)


def _takes_another_way(view: View, way: Way | None) -> bool:
    """Whether a way leads to the goal by other passages than those of the sketch that is being carried out."""
    if way is None:
        return False
    drawn = find_first_level(view)
    left = () if drawn is None else drawn.value.subgoals[drawn.value.at:]
    return [step.passage for step in way if step.passage] != [step.passage for step in left if step.passage]
