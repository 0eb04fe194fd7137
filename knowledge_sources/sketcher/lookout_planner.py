"""Lookout planner (§4: models are incomplete): what leaves no way is looked at again, from elsewhere."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace
from typing import NamedTuple

import shapely

from blackboard import Change, Effect, Entry, Level, Post, Posted, Revise, View, Watch
from knowledge_sources.methods.floor import build_polygon
from knowledge_sources.methods.motion import SubgoalPlanner
from knowledge_sources.priority import Priority
from knowledge_sources.reads import (
    HELD,
    Belief,
    find_building,
    find_frames,
    find_obstacles,
    find_planner,
    find_robot,
    find_way_to_goal,
    supersede,
)
from knowledge_sources.reads.sketches import list_lookouts, plan_door_look
from knowledge_sources.robot_knowledge_source import RobotKnowledgeSource
from world_models.entries import DoorState, Goal, Hypothesis, Impasse, Obstacle, PlanSketch, Subgoal
from world_models.frame_building import FrameBuilding


class Case(NamedTuple):
    """An impasse, the goal, the obstacle or door that may be behind it, and the way to where it is seen."""

    impasse: Entry[Impasse]
    goal: Entry[Goal]
    about: Entry[Obstacle] | Entry[DoorState]
    subgoal: Subgoal


class LookoutPlanner(RobotKnowledgeSource):
    """Leads to where a door that may be shut is seen from the front, or an obstacle from elsewhere; so often a goal.

    A leaf is a thing in the way, too: so first the doors of this room. Then the obstacles that leave no way; those
    without which there is one first, and the nearest of them. What was seen of one, from one place or when it was too
    near, may be wrong. Where no look is left, the mission monitor ends the mission.
    """

    level, priority = Level.PLAN, Priority.ADVANCE
    on = (Watch(Impasse, (Posted,), lambda impasse: impasse.is_open and bool(impasse.behind)),)
    needs = (HELD,)
    writes = (PlanSketch, Impasse)

    def bind(self, view: View, trigger: Change) -> Case | None:
        impasse, belief = trigger.entry, HELD.of(view)
        goal, lookouts = view.get(impasse.value.goal), list_lookouts(view, impasse.value.goal)
        looked = len(lookouts)
        if goal is None or looked >= self._settings.plan.max_lookouts:
            return None
        planner = find_planner(view, self._settings.plan)
        for door in view.where(DoorState, lambda d: d.may_be_shut and belief.locale in d.between):
            subgoal = plan_door_look(view, planner, belief.value, door.value)
            if subgoal is not None:
                return Case(impasse, goal, door, subgoal)
        for obstacle in self._list_in_order(view, impasse.value, goal.value, belief, looked):
            subgoal = planner.plan_look(belief.value, obstacle.value, lookouts)
            if subgoal is not None:
                return Case(impasse, goal, obstacle, subgoal)
        return None

    def act(self, view: View, case: Case) -> Iterable[Effect]:
        (impasse, goal, about, subgoal), belief = case, HELD.of(view).entry
        yield from supersede(view, impasse)
        there = subgoal.destination.in_world(find_building(view))
        closed = replace(impasse.value, is_open=False, lookout=(there.x_m, there.y_m))
        looked = Revise(impasse, closed, (impasse, about, belief))
        yield looked
        frames = find_frames(view, {belief.value.locale})
        yield Post(PlanSketch(goal.id, (), "", (subgoal,), is_look=True), (goal, belief, about, looked, *frames))

    def _list_in_order(
        self, view: View, impasse: Impasse, goal: Goal, belief: Belief, looked: int
    ) -> Sequence[Entry[Obstacle]]:
        """The obstacles in the order in which they are worth a look, a look further each time; none where no way would
        lead without any, as behind a shut door.
        """
        here = shapely.Point(belief.pose.position)
        behind = [o for o in find_obstacles(view) if o.id in impasse.behind]
        nearest = sorted(behind, key=lambda o: (build_polygon(o.value.footprint).distance(here), o.value.name))
        alone = [o for o in nearest if self._leads_without(view, goal, belief.value, (o,))]
        if not alone and not self._leads_without(view, goal, belief.value, tuple(find_obstacles(view))):
            return ()
        first = looked % max(1, len(alone or nearest))
        ordered = [*alone, *(o for o in nearest if o not in alone)]
        return (*ordered[first:], *ordered[:first])

    def _leads_without(
        self, view: View, goal: Goal, belief: Hypothesis, without: Sequence[Entry[Obstacle]]
    ) -> bool:
        """Whether a way would lead to the goal if some obstacles were not there."""
        names, frames = {o.value.name for o in without}, find_frames(view, {o.value.locale for o in without})
        bare = [frame.value.with_changes(c for c in frame.value.changes if c.what != "extra" or c.name not in names)
                for frame in frames]
        robot = find_robot(view).in_building(FrameBuilding(view, bare, "without some"))
        rest = [o.value for o in find_obstacles(view) if o not in without]
        planner = SubgoalPlanner(robot, self._settings.plan, rest)
        return not planner.explain_unfit(goal.destination) and find_way_to_goal(planner, belief, goal) is not None
