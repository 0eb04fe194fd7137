"""Lookout planner (§4: models are incomplete): what leaves no way is looked at again, from elsewhere."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace
from typing import NamedTuple

import shapely

from blackboard.board import View
from blackboard.change import Change, Posted, Watch
from blackboard.effect import Effect, Post, Revise
from blackboard.entry import Entry
from blackboard.level import Level
from knowledge_sources.methods.motion.footprints import MIN_SIDE_M, build_polygon, list_corners
from knowledge_sources.methods.motion.subgoals import SubgoalPlanner
from knowledge_sources.priority import Priority
from knowledge_sources.questions import find_belief, find_building, find_frames, find_robot
from knowledge_sources.robot_knowledge_source import RobotKnowledgeSource
from knowledge_sources.sketching import find_obstacles, find_way_to_goal, list_planners, supersede
from world_models.entries.location import Hypothesis
from world_models.entries.obstacle import Obstacle
from world_models.entries.task import Goal, Impasse, PlanSketch, Subgoal


class Case(NamedTuple):
    """An impasse, the goal, the belief, an obstacle that may be behind it, and the way to where that is seen."""

    impasse: Entry[Impasse]
    goal: Entry[Goal]
    belief: Entry[Hypothesis]
    obstacle: Entry[Obstacle]
    subgoal: Subgoal


class LookoutPlanner(RobotKnowledgeSource):
    """Leads to where one of the obstacles that leave no way can be looked at from elsewhere, so often a goal.

    First those without which there is a way, the nearest of them first, then the next ones. What was seen of one, from
    one place or when it was too near, may be wrong. Where no look is left, the mission monitor ends the mission.
    """

    level, priority = Level.PLAN, Priority.ADVANCE
    on = (Watch(Impasse, (Posted,), lambda impasse: impasse.is_open and bool(impasse.behind)),)
    writes = (PlanSketch, Impasse)

    def bind(self, view: View, trigger: Change) -> Case | None:
        impasse, belief = trigger.entry, find_belief(view)
        goal, looked = view.get(impasse.value.goal), _count_looks(view, impasse.value.goal)
        if goal is None or belief is None or looked >= self._settings.plan.max_lookouts:
            return None
        planner = list_planners(view, self._settings.plan)[0]
        for obstacle in self._list_in_order(view, impasse.value, goal.value, belief.value, looked):
            subgoal = planner.plan_look(belief.value, obstacle.value)
            if subgoal is not None:
                return Case(impasse, goal, belief, obstacle, subgoal)
        return None

    def act(self, view: View, case: Case) -> Iterable[Effect]:
        impasse, goal, belief, obstacle, subgoal = case
        yield from supersede(view, impasse)
        looked = Revise(impasse, replace(impasse.value, is_open=False), (impasse, obstacle, belief))
        yield looked
        frames = find_frames(view, {belief.value.locale})
        yield Post(PlanSketch(goal.id, (), "", (subgoal,), is_look=True), (goal, belief, obstacle, looked, *frames))

    def _list_in_order(
        self, view: View, impasse: Impasse, goal: Goal, belief: Hypothesis, looked: int
    ) -> Sequence[Entry[Obstacle]]:
        """The obstacles in the order in which they are worth a look; a look further each time."""
        here = shapely.Point(belief.world_from_robot(find_building(view)).position)
        behind = [o for o in find_obstacles(view) if o.id in impasse.behind]
        nearest = sorted(behind, key=lambda o: (build_polygon(o.value.footprint).distance(here), o.value.name))
        alone = [o for o in nearest if self._leads_without(view, goal, belief, o)]
        first = looked % max(1, len(alone or nearest))
        ordered = [*alone, *(o for o in nearest if o not in alone)]
        return (*ordered[first:], *ordered[:first])

    def _leads_without(self, view: View, goal: Goal, belief: Hypothesis, without: Entry[Obstacle]) -> bool:
        """Whether a way would lead to the goal if one obstacle were next to nothing."""
        middle = build_polygon(without.value.footprint).centroid
        least = list_corners(middle.buffer(MIN_SIDE_M))
        obstacles = [replace(o.value, core=least if o.id == without.id else ()) for o in find_obstacles(view)]
        planner = SubgoalPlanner(find_robot(view), self._settings.plan, obstacles, by_cores=True)
        return not planner.explain_unfit(goal.destination) and find_way_to_goal((planner,), belief, goal) is not None


def _count_looks(view: View, goal: str) -> int:
    """How often the robot went to look again at what left no way to a goal."""
    return len(view.where(Impasse, lambda impasse: impasse.goal == goal and not impasse.is_open))
