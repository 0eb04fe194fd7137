"""Problem solver (§3.3): turns a task into goals and waits, one after the other; several places by the shortest way."""

from __future__ import annotations

import math
from collections.abc import Iterable
from itertools import pairwise, takewhile

import numpy as np

from blackboard import Change, Effect, Entry, Level, Post, Posted, Revise, Revised, View, Watch
from harvey_words.tasks.task_entries import ToldTask, active_task, find_time_s, leave_goal
from harvey_words.tasks.task_tour import order_stops
from knowledge_sources.methods.motion import SubgoalPlanner
from knowledge_sources.priority import Priority
from knowledge_sources.reads import HELD, NOT_ENDED, NOT_LOST, find_building, find_planner, place_of
from knowledge_sources.reads.sketches import GOAL_TOLERANCE_M
from knowledge_sources.robot_knowledge_source import RobotKnowledgeSource
from world_models.building.building import Building
from world_models.building.locale_frame import FrameRequest
from world_models.entries import Goal, Milestone, Place, Recovery

LOOK_FOR_WORD_S = 1.0  # so long it waits before it looks again whether somebody has said a word


class ProblemSolver(RobotKnowledgeSource):
    """Begins the next step of a task when none is under way: a new goal, or a wait for a helper, a word or some time.

    Of places in any order it takes the first of the shortest way through all of them to what comes after, and thinks
    again at each: a door may be shut by then. What was pursued is abandoned, as by somebody who asks for another goal.
    """

    level, priority = Level.PLAN, Priority.ENTER
    on = (Watch(ToldTask, (Posted, Revised), lambda one: one.is_active), Watch(Goal, (Posted,), lambda g: g.is_active))
    needs = (NOT_ENDED, HELD, NOT_LOST)
    writes = (ToldTask, Goal, Milestone, Recovery, FrameRequest)

    def bind(self, view: View, trigger: Change) -> Entry[ToldTask] | None:
        """The task, where none of its steps is under way."""
        task = active_task(view)
        return None if task is None or task.value.under_way is not None else task

    def act(self, view: View, case: Entry[ToldTask]) -> Iterable[Effect]:
        number = self._choose(view, case.value)
        step, begun = case.value.steps[number], Revise(case, case.value.with_step(number, status="under way"), (case,))
        yield begun
        yield from leave_goal(view, begun)
        if step.place is None:
            wait_s = min(step.wait_s or LOOK_FOR_WORD_S, LOOK_FOR_WORD_S)
            yield Post(Recovery(case.id, "", find_time_s(view), wait_s), (begun,))
            return
        belief = HELD.of(view)
        yield Post(Goal(place_of(belief.value), step.place), (begun, belief.entry))

    def _choose(self, view: View, task: ToldTask) -> int:
        """The number of the step that comes next."""
        first, *others = (number for number, step in enumerate(task.steps) if step.status == "to do")
        group = task.steps[first].group
        stops = [first, *takewhile(lambda number: group and task.steps[number].group == group, others)]
        if len(stops) < 2:
            return first
        after = next((task.steps[number].place for number in others if number not in stops), None)
        planner, world = find_planner(view, self._settings.plan), find_building(view)
        places = [place_of(HELD.of(view).value), *(place for stop in stops if (place := task.steps[stop].place))]
        ways = np.array([[measure_way(planner, world, a, b) for b in places] for a in places])
        ends = [0.0 if after is None else measure_way(planner, world, place, after) for place in places[1:]]
        return stops[order_stops(ways, np.array(ends))[0]]


def measure_way(planner: SubgoalPlanner, world: Building, origin: Place, destination: Place) -> float:
    """The length of the way between two places, from passage to passage; infinite where there is none [m]."""
    if origin == destination:
        return 0.0
    way = planner.plan_between_locales(origin, destination, GOAL_TOLERANCE_M)
    if way is None:
        return math.inf
    poses = [place.in_world(world) for place in (origin, *(subgoal.destination for subgoal in way))]
    return math.fsum(a.distance_to(b) for a, b in pairwise(poses))
