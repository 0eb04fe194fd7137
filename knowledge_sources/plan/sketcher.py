"""Sketcher (§3.3, §4): plan sketches, drawn lazily and depth first, and adjusted at milestones."""

from __future__ import annotations

import math
from collections.abc import Collection, Iterable, Sequence
from dataclasses import replace

import shapely

from blackboard.board import View
from blackboard.change import Change, Posted, Revised, Watch
from blackboard.effect import Effect, Post, Revise
from blackboard.entry import Entry
from blackboard.level import Level
from blackboard.servoing import Discrepancy
from knowledge_sources.methods.motion.footprints import MIN_SIDE_M, build_polygon, list_corners
from knowledge_sources.methods.motion.subgoals import SubgoalPlanner
from knowledge_sources.questions import ACTIVE_SKETCH, active_goal, find_belief, find_building, find_frames, find_robot
from knowledge_sources.robot_knowledge_source import OlderSource
from world_models.entries.location import Hypothesis, Place
from world_models.entries.obstacle import Obstacle
from world_models.entries.task import Goal, Leg, Milestone, Outcome, PlanSketch, Subgoal
from world_models.frames import wrap_angle

GOAL_TOLERANCE_M = 0.010  # tolerance at the goal
GOAL_HEADING_TOLERANCE_RAD = 0.02  # tolerance of a heading that the goal states
MAX_WALKED_ROOMS = 200  # so many rooms are searched for a way that people can walk, to say so where wheels have none
INEXACT_TOLERANCE_SIGMAS = 2.0
"""Deviations of the belief that are added to the tolerance of a goal where the model is inexact."""


class Sketcher(OlderSource):
    """Draws (M0 (ptrans a b) M1 ... Mg) for a goal, then for the current subgoal, until that is primitive (Figure 9).

    It acts on a new goal, a verified milestone (go on, refine, or repeat a subgoal whose end was missed), a leg that
    has arrived, a sketch that is done, and one that was withdrawn (then it draws anew, from where the robot is).
    """

    level = Level.PLAN
    on = (
        Watch(Goal, (Posted,), lambda goal: goal.is_active),
        Watch(Milestone, (Revised,), lambda m: m.status == "verified" and m.sketch != ""),
        Watch(Leg, (Revised,), lambda leg: leg.status != "moving"),
        Watch(PlanSketch, (Revised,), lambda sketch: sketch.status == "done"),
        Watch(PlanSketch, (Revised,), lambda sketch: sketch.status == "superseded" and not sketch.path),
    )
    writes = (PlanSketch, Goal, Outcome, Discrepancy)

    def judge(self, view: View, trigger: Change) -> float | None:
        value = trigger.entry.value
        if isinstance(value, Goal):
            return 0.8 if find_belief(view) else None
        if isinstance(value, PlanSketch) and value.status == "superseded":
            return 0.8 if _find_goal_without_sketch(view, value) is not None and find_belief(view) else None
        return 0.6 if self._sketch_of(view, value) else None

    def answer(self, view: View, trigger: Change) -> Iterable[Effect]:
        value = trigger.entry.value
        if isinstance(value, Goal):
            yield from self._begin(view, trigger.entry)
        elif isinstance(value, PlanSketch) and value.status == "superseded":
            goal = _find_goal_without_sketch(view, value)
            if goal is not None:
                yield from self._begin(view, goal, trigger.entry)
        elif isinstance(value, PlanSketch):
            yield from self._close(view, trigger.entry)
        else:
            sketch = self._sketch_of(view, value)
            if sketch is not None and isinstance(value, Leg) and value.status == "halted":
                yield from self._go_otherwise(view, trigger.entry, sketch)
            elif sketch is not None and isinstance(value, Leg):
                yield Revise(sketch, sketch.value.advanced(), (trigger.entry,))
            elif sketch is not None:
                yield from self._continue(view, trigger.entry, sketch)

    def _sketch_of(self, view: View, value: Milestone | Leg | PlanSketch) -> Entry[PlanSketch] | None:
        """The active sketch that a milestone or a leg belongs to; for a sketch that is done, its parent."""
        if isinstance(value, PlanSketch):
            return _find_parent(view, value) if value.path else _find_goal_sketch(view, value)
        entry = view.get(value.sketch)
        if entry is None or not entry.value.is_active or entry.value.at != value.index:
            return None
        return entry

    def _begin(
        self, view: View, goal: Entry[Goal], withdrawn: Entry[PlanSketch] | None = None, halts: int = 0
    ) -> Iterable[Effect]:
        """The first level: from locale to locale; sketches for earlier goals are superseded (§2).

        ``halts``: how often in a row a leg was halted, and the sketch drawn anew for it.
        """
        looks = _count_looks(view, goal, withdrawn)
        yield from _supersede(view, goal)
        belief = find_belief(view)
        if belief is None:
            return
        because = (goal, belief) if withdrawn is None else (goal, belief, withdrawn)
        here, planners = _place_of(belief.value), self._list_planners(view)
        unfit = planners[-1].explain_unfit(goal.value.destination)
        if unfit:
            near = _find_obstacles(view, (goal.value.destination.locale,))
            named = [entry for entry in near if entry.value.name in unfit]
            reason = f"the goal {goal.value.destination} {unfit}{_name_obstacles(named)}"
            yield self._look_again(view, goal, named, looks) or Post(Outcome("blocked", reason), (*because, *named))
            return
        subgoals = _find_first(planner.plan_between_locales(
            here, goal.value.destination, GOAL_TOLERANCE_M) for planner in planners)
        if subgoals is None:
            obstacles = _find_obstacles(view)
            why = self._explain_no_way(view, here.locale, goal.value.destination.locale)
            again = self._look_again(view, goal, obstacles, looks)
            yield again or Post(Outcome("blocked", why), (*because, *obstacles))
        else:
            drawn = PlanSketch(goal.id, (), "", subgoals, halts=halts, lookout_count=looks)
            yield Post(drawn, (*because, *find_frames(view, _list_locales(subgoals))))

    def _look_again(
        self, view: View, goal: Entry[Goal], obstacles: Sequence[Entry[Obstacle]], looks: int
    ) -> Post | None:
        """A sketch that leads to where one of the obstacles can be looked at from elsewhere.

        First those without which there is a way, the nearest of them first. What was seen of it, from one place or when
        it was too near, may be wrong. None where it was looked at often enough, or no place is left.
        """
        belief = find_belief(view)
        if belief is None or not obstacles or looks >= self._settings.plan.max_lookouts:
            return None
        here = shapely.Point(belief.value.world_from_robot(find_building(view)).position)
        nearest = sorted(obstacles, key=lambda o: (build_polygon(o.value.footprint).distance(here), o.value.name))
        alone = [o for o in nearest if self._leads_without(view, goal.value, belief.value, o)]
        first = looks % len(alone or nearest)
        nearest = [*alone, *(o for o in nearest if o not in alone)]
        planner = self._list_planners(view)[0]
        for obstacle in (*nearest[first:], *nearest[:first]):
            subgoal = planner.plan_look(belief.value, obstacle.value)
            if subgoal is not None:
                frames = find_frames(view, {belief.value.locale})
                drawn = PlanSketch(goal.id, (), "", (subgoal,), lookout_count=looks + 1, is_look=True)
                return Post(drawn, (goal, belief, obstacle, *frames))
        return None

    def _leads_without(self, view: View, goal: Goal, belief: Hypothesis, without: Entry[Obstacle]) -> bool:
        """Whether a way would lead to the goal if one obstacle were next to nothing."""
        middle = build_polygon(without.value.footprint).centroid
        least = list_corners(middle.buffer(MIN_SIDE_M))
        obstacles = [replace(o.value, core=least if o.id == without.id else ()) for o in _find_obstacles(view)]
        planner = SubgoalPlanner(find_robot(view), self._settings.plan, obstacles, by_cores=True)
        tolerance_m = GOAL_TOLERANCE_M
        return not planner.explain_unfit(goal.destination) and planner.plan_between_locales(
            _place_of(belief), goal.destination, tolerance_m) is not None

    def _continue(self, view: View, milestone: Entry[Milestone], sketch: Entry[PlanSketch]) -> Iterable[Effect]:
        """Go on after a verified milestone: adjust, finish, or begin the next subgoal, refined if not primitive."""
        s, belief = sketch.value, find_belief(view)
        if belief is None:
            return
        is_inexact = bool(milestone.value.displacement_modes)
        if s.at > 0 and self._is_off(view, belief.value, s.subgoals[s.at - 1], is_inexact):
            yield from self._adjust(view, milestone, sketch, belief)
        elif s.at_end:
            yield Revise(sketch, replace(s, status="done", verified=True), (milestone, belief))
        else:
            go = Revise(sketch, replace(s, verified=True, adjustments=0), (milestone, belief))
            current = s.subgoals[s.at]
            if current.primitive or current.is_ride:
                yield go
            else:
                yield from self._refine(view, sketch, current, belief, go)

    def _is_off(self, view: View, belief: Hypothesis, subgoal: Subgoal, is_inexact: bool) -> bool:
        """Whether the end of a subgoal is further than its tolerance, which a model that is inexact makes wider."""
        building = find_building(view)
        here, there = belief.world_from_robot(building), subgoal.destination.in_world(building)
        heading = subgoal.destination.heading_rad
        error = 0.0 if heading is None else wrap_angle(here.heading_rad - there.heading_rad)
        turned = abs(error) > GOAL_HEADING_TOLERANCE_RAD
        wider_m = INEXACT_TOLERANCE_SIGMAS * belief.sigma_m if is_inexact else 0.0
        return here.distance_to(there) > math.hypot(subgoal.tolerance_m, wider_m) or turned

    def _adjust(
        self, view: View, milestone: Entry[Milestone], sketch: Entry[PlanSketch], belief: Entry[Hypothesis]
    ) -> Iterable[Effect]:
        """Plan-level servoing: repeat the subgoal from where the robot turned out to be (§6).

        Where that is in vain for the first goal, the robot may be elsewhere: the goal level looks.
        """
        s = sketch.value
        if s.adjustments >= self._settings.plan.max_adjustments:
            in_vain, goal = f"{sketch.id} was adjusted {s.adjustments} times in vain", active_goal(view)
            if goal is not None and goal.id == f"{Goal.__name__}-1":
                yield Post(Discrepancy(Level.GOAL, in_vain, None, (0.0, 0.0), "px"), (milestone, goal))
            else:
                yield Post(Outcome("blocked", in_vain), (milestone,))
            return
        k = s.at - 1
        building = find_building(view)
        pose = belief.value.world_from_robot(building)
        origin = Place.of_world(building, s.subgoals[k].destination.locale, pose.x_m, pose.y_m)
        again = replace(s.subgoals[k], origin=origin, primitive=True)
        subgoals = (*s.subgoals[:k], again, *s.subgoals[k + 1 :])
        adjusted = replace(s, subgoals=subgoals, at=k, verified=True, adjustments=s.adjustments + 1)
        yield Revise(sketch, adjusted, (milestone, belief))

    def _refine(
        self, view: View, sketch: Entry[PlanSketch], subgoal: Subgoal, belief: Entry[Hypothesis], go: Revise
    ) -> Iterable[Effect]:
        """Draw a more detailed sketch for the current subgoal, only now that its locale is entered."""
        s, planners = sketch.value, self._list_planners(view)
        locale = find_building(view).common(subgoal.origin.locale, subgoal.destination.locale)
        if subgoal.origin.locale == subgoal.destination.locale:
            parts = _find_first(planner.plan_across(subgoal, belief.value) for planner in planners)
        else:
            here = _place_of(belief.value)
            parts = _find_first(planner.plan_between_locales(here, subgoal.destination, subgoal.tolerance_m)
                                for planner in planners)
        if parts is None:
            obstacles, goal = _find_obstacles(view, (locale,)) or _find_obstacles(view), view.get(s.goal)
            if obstacles and goal is not None and self._leads_otherwise(view, goal.value, belief.value):
                yield from self._begin(view, goal)
                return
            again = None if goal is None else self._look_again(view, goal, obstacles, _count_looks(view, goal))
            if goal is not None and again is not None:
                yield from _supersede(view, goal)
                yield again
                return
            yield go
            reason = f"no way through {locale} to {subgoal.destination}{_name_obstacles(obstacles)}"
            yield Post(Outcome("blocked", reason), (go, *obstacles))
        else:
            yield go
            frames = find_frames(view, _list_locales(parts))
            yield Post(PlanSketch(s.goal, (*s.path, s.at), locale, parts), (go, belief, *frames))

    def _leads_otherwise(self, view: View, goal: Goal, belief: Hypothesis) -> bool:
        """Whether a way leads to the goal by other passages than those of the sketch that is being carried out."""
        drawn = view.latest(PlanSketch, lambda s: s.is_active and not s.path)
        parts = _find_first(planner.plan_between_locales(
            _place_of(belief), goal.destination, GOAL_TOLERANCE_M)
            for planner in self._list_planners(view))
        if parts is None:
            return False
        left = () if drawn is None else drawn.value.subgoals[drawn.value.at:]
        return [step.passage for step in parts if step.passage] != [step.passage for step in left if step.passage]

    def _close(self, view: View, done: Entry[PlanSketch]) -> Iterable[Effect]:
        """A sketch is done: so is the subgoal of its parent, or the goal itself."""
        if done.value.path:
            parent = _find_parent(view, done.value)
            if parent is not None:
                yield Revise(parent, parent.value.advanced(), (done,))
            return
        goal = view.get(done.value.goal)
        if goal is not None and done.value.is_look:
            yield from self._begin(view, goal, done)
        elif goal is not None and goal.value.is_active:
            yield Revise(goal, replace(goal.value, status="reached"), (done,))

    def _go_otherwise(self, view: View, leg: Entry[Leg], sketch: Entry[PlanSketch]) -> Iterable[Effect]:
        """A leg was halted before what may stand in floor that is not seen: another way, or none is left."""
        belief, goal = find_belief(view), view.get(sketch.value.goal)
        if belief is None or goal is None:
            return
        here, there = _place_of(belief.value), goal.value.destination
        planner, drawn = self._list_planners(view)[0], view.latest(PlanSketch, lambda s: s.is_active and not s.path)
        halts = 1 if drawn is None else drawn.value.halts + 1
        leads_there = planner.plan_between_locales(here, there, GOAL_TOLERANCE_M) is not None
        if leads_there and halts <= self._settings.plan.max_adjustments:
            yield from self._begin(view, goal, halts=halts)
            return
        obstacles = _find_obstacles(view)
        again = self._look_again(view, goal, obstacles, _count_looks(view, goal))
        if again is not None:
            yield from _supersede(view, goal)
            yield again
            return
        reason = f"something may stand in floor that is not seen, before {here.words()}{_name_obstacles(obstacles)}"
        yield Post(Outcome("blocked", reason), (leg, belief, *obstacles))

    def _list_planners(self, view: View) -> list[SubgoalPlanner]:
        """Planners in the order in which they are asked: round all that obstacles may take, then what is seen of them.

        Where the feet of an obstacle were not seen, the floor round it may be free: the robot drives as if it were, and
        only into what it then sees to be free.
        """
        robot, obstacles = find_robot(view), [entry.value for entry in _find_obstacles(view)]
        ways = [False, *([True] if any(obstacle.core for obstacle in obstacles) else [])]
        return [SubgoalPlanner(robot, self._settings.plan, obstacles, by_cores=by_cores) for by_cores in ways]

    def _explain_no_way(self, view: View, here: str, there: str) -> str:
        """Why no sketch leads from one locale to another."""
        building = find_building(view)
        if building.route(here, there) is not None:
            obstacles = _find_obstacles(view)
            if obstacles:
                return f"no way is left from {here} to {there}{_name_obstacles(obstacles)}"
            return f"something stands before a passage on the way from {here} to {there}"
        shut = "".join(f"; {doorway.name} is shut" for doorway in building.shut_doorways())
        by_stairs = building.is_walkable(here, there, MAX_WALKED_ROOMS)
        stairs = "; people can walk there, by stairs" * by_stairs
        return f"no passage for wheels leads from {here} to {there}{shut}{stairs}"


def _supersede(view: View, goal: Entry[Goal]) -> Iterable[Effect]:
    """All active sketches are superseded, before another one is drawn for a goal."""
    for old in view.where(PlanSketch, lambda s: s.is_active):
        yield Revise(old, replace(old.value, status="superseded"), (goal,))


def _count_looks(view: View, goal: Entry[Goal], before: Entry[PlanSketch] | None = None) -> int:
    """How often the robot went to look again at what left no way to a goal; ``before``: its last sketch, if it ended.
    """
    last = before or view.latest(PlanSketch, lambda s: s.is_active and not s.path and s.goal == goal.id)
    return 0 if last is None else last.value.lookout_count


def _find_first(plans: Iterable[tuple[Subgoal, ...] | None]) -> tuple[Subgoal, ...] | None:
    """The first plan that leads anywhere."""
    return next((plan for plan in plans if plan is not None), None)


def _find_obstacles(view: View, locales: Collection[str] | None = None) -> tuple[Entry[Obstacle], ...]:
    """What stands in the way in some locales, or in any, and is not in the file."""
    return view.where(Obstacle, lambda o: o.is_there and (locales is None or o.locale in locales))


def _name_obstacles(obstacles: Sequence[Entry[Obstacle]]) -> str:
    return f"; blocked by {' and '.join(entry.value.words() for entry in obstacles)}" if obstacles else ""


def _list_locales(subgoals: Iterable[Subgoal]) -> set[str]:
    """The locales through which subgoals lead."""
    return {place.locale for subgoal in subgoals for place in (subgoal.origin, subgoal.destination)}


def _find_goal_without_sketch(view: View, superseded: PlanSketch) -> Entry[Goal] | None:
    """The active goal of a sketch, as long as nobody has drawn another one for it."""
    goal = view.get(superseded.goal)
    if goal is None or not goal.value.is_active or view.having(ACTIVE_SKETCH, goal.id):
        return None
    return goal


def _place_of(belief: Hypothesis) -> Place:
    """The believed place, without a heading."""
    return Place(belief.locale, belief.locale_from_robot.x_m, belief.locale_from_robot.y_m)


def _find_parent(view: View, sketch: PlanSketch) -> Entry[PlanSketch] | None:
    """The active sketch whose current subgoal a sketch refines."""
    path = sketch.path
    return view.latest(
        PlanSketch, lambda s: s.is_active and s.goal == sketch.goal and s.path == path[:-1] and s.at == path[-1]
    )


def _find_goal_sketch(view: View, sketch: PlanSketch) -> Entry[PlanSketch] | None:
    goal = view.get(sketch.goal)
    return view.latest(PlanSketch, lambda s: s == sketch) if goal is not None and goal.value.is_active else None
