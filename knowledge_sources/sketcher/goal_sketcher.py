"""Goal sketcher (§3.3, §4): the first plan sketch for a goal, from locale to locale."""

from __future__ import annotations

from collections.abc import Iterable

from blackboard import Change, Effect, Entry, Level, Post, Posted, Revised, View, Watch
from knowledge_sources.priority import Priority
from knowledge_sources.reads import (
    ACTIVE_SKETCH,
    GOAL,
    GOING_ON,
    HELD,
    find_building,
    find_frames,
    find_obstacles,
    find_planner,
    find_way_to_goal,
    is_just_found,
    list_locales,
    name_obstacles,
    supersede,
)
from knowledge_sources.robot_knowledge_source import RobotKnowledgeSource
from world_models.entries import Goal, Impasse, PlanSketch

MAX_WALKED_ROOMS = 200  # so many rooms are searched for a way that people can walk, to say so where wheels have none


Ended = tuple[Entry[PlanSketch], ...]


class GoalSketcher(RobotKnowledgeSource):
    """Draws (M0 (ptrans a b) M1 ... Mg) from locale to locale for a goal that has no sketch (Figure 9).

    So it does for a new goal, and again from where the robot is when the last sketch was withdrawn, was halted, or led
    only to where something could be looked at again. Sketches for earlier goals are superseded (§2).
    """

    level, priority = Level.PLAN, Priority.SEE
    on = (
        Watch(Goal, (Posted,), lambda goal: goal.is_active),
        Watch(PlanSketch, (Revised,), lambda s: not s.path and s.leaves_goal_open),
    )
    needs = (GOING_ON, GOAL, HELD)
    writes = (PlanSketch, Impasse)

    def bind(self, view: View, trigger: Change) -> Ended | None:
        """The last sketch for a goal that has none any more; nothing where it had none yet."""
        goal = GOAL.of(view)
        if view.having(ACTIVE_SKETCH, goal.id):
            return None
        ended = view.latest(PlanSketch, lambda s: s.goal == goal.id and not s.path)
        return () if ended is None else (ended,)

    def act(self, view: View, case: Ended) -> Iterable[Effect]:
        pursued, belief = GOAL.of(view), HELD.of(view).entry
        goal, here, because = pursued.value, belief.value, (pursued, belief, *case)
        yield from supersede(view, pursued)
        planner = find_planner(view, self._settings.plan)
        unfit = planner.explain_unfit(goal.destination)
        if unfit:
            taking = [o for o in find_obstacles(view, (goal.destination.locale,)) if o.value.name in unfit]
            occupied = f"is occupied by {' and '.join(o.value.words() for o in taking)}: it " if taking else ""
            reason = f"the goal {goal.destination} {occupied}{unfit}"
            yield Post(Impasse("blocked", reason, pursued.id, tuple(o.id for o in taking)), (*because, *taking))
            return
        way = find_way_to_goal(planner, here, goal)
        if way is None:
            obstacles, why = find_obstacles(view), self._explain_no_way(view, here.locale, goal.destination.locale)
            behind = tuple(o.id for o in obstacles)
            yield Post(Impasse("blocked", why, pursued.id, behind), (*because, *obstacles))
            return
        halted = [sketch.value.halts + 1 for sketch in case if sketch.value.status == "halted"]
        drawn = PlanSketch(pursued.id, (), "", way, verified=is_just_found(here), halts=max(halted, default=0))
        yield Post(drawn, (*because, *find_frames(view, list_locales(way))))

    def _explain_no_way(self, view: View, here: str, there: str) -> str:
        """Why no sketch leads from one locale to another."""
        building = find_building(view)
        if building.route(here, there) is not None:
            obstacles = find_obstacles(view)
            if obstacles:
                return f"no way is left from {here} to {there}{name_obstacles(obstacles)}"
            return f"something stands before a passage on the way from {here} to {there}"
        shut = "".join(f"; {doorway.name} is shut" for doorway in building.shut_doorways())
        by_stairs = building.is_walkable(here, there, MAX_WALKED_ROOMS)
        stairs = "; people can walk there, by stairs" * by_stairs
        return f"no passage for wheels leads from {here} to {there}{shut}{stairs}"
