"""Sketcher (§3.3, §4): plan sketches, drawn lazily and depth first, and adjusted at milestones."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from shapely import Geometry, Point

from blackboard.board import View
from blackboard.change import Change, Posted, Revised, Watch
from blackboard.effect import Effect, Post, Revise
from blackboard.entry import Entry
from blackboard.level import Level
from knowledge_sources.methods.motion.routes import (
    compute_free_space,
    find_shortest_route,
    is_clear,
    measure_thing_distance_m,
    measure_wall_distance_m,
)
from knowledge_sources.questions import find_belief
from knowledge_sources.robot_knowledge_source import RobotKnowledgeSource
from knowledge_sources.settings import DEFAULT, Settings
from world_models.building.locales import Link, Passage
from world_models.entries.location import Hypothesis, Place
from world_models.entries.task import Goal, Leg, Milestone, Outcome, PlanSketch, Subgoal
from world_models.frames import wrap_angle
from world_models.robot import RobotModel


class Sketcher(RobotKnowledgeSource):
    """Draws (M0 (ptrans a b) M1 ... Mg) for a goal, then for the current subgoal, until that is primitive (Figure 9).

    It acts on a new goal, a verified milestone (go on, refine, or repeat a subgoal whose end was missed), a leg that
    has arrived, and a sketch that is done.
    """

    level = Level.PLAN
    watches = (
        Watch(Goal, (Posted,), lambda goal: goal.is_active),
        Watch(Milestone, (Revised,), lambda m: m.status == "verified" and m.sketch != ""),
        Watch(Leg, (Revised,), lambda leg: leg.status == "arrived"),
        Watch(PlanSketch, (Revised,), lambda sketch: sketch.status == "done"),
    )
    writes = (PlanSketch, Goal, Outcome)

    def __init__(self, robot: RobotModel, settings: Settings = DEFAULT) -> None:
        super().__init__(robot, settings)
        self._world, self._plan = robot.world, settings.plan
        self._free_spaces: dict[tuple[str, float], Geometry] = {}

    def rate(self, view: View, trigger: Change) -> float | None:
        value = trigger.entry.value
        if isinstance(value, Goal):
            return 0.8 if find_belief(view) else None
        return 0.6 if self._sketch_of(view, value) else None

    def act(self, view: View, trigger: Change) -> Iterable[Effect]:
        value = trigger.entry.value
        if isinstance(value, Goal):
            yield from self._begin(view, trigger.entry)
        elif isinstance(value, PlanSketch):
            yield from self._close(view, trigger.entry)
        else:
            sketch = self._sketch_of(view, value)
            if sketch is not None and isinstance(value, Leg):
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

    def _begin(self, view: View, goal: Entry[Goal]) -> Iterable[Effect]:
        """The first level: from locale to locale; sketches for earlier goals are superseded (§2)."""
        for old in view.where(PlanSketch, lambda s: s.is_active):
            yield Revise(old, replace(old.value, status="superseded"), (goal,))
        belief = find_belief(view)
        if belief is None:
            return
        here = _place_of(belief.value)
        unfit = self._why_not_at(goal.value.destination)
        if unfit:
            yield Post(Outcome("blocked", f"the goal {goal.value.destination} {unfit}"), (goal, belief))
            return
        subgoals = self._plan_between_locales(here, goal.value.destination, self._plan.goal_tolerance_m)
        if subgoals is None:
            yield Post(Outcome("blocked", self._why_not(here.locale, goal.value.destination.locale)), (goal, belief))
        else:
            yield Post(PlanSketch(goal.id, (), "", subgoals), (goal, belief))

    def _continue(self, view: View, milestone: Entry[Milestone], sketch: Entry[PlanSketch]) -> Iterable[Effect]:
        """Go on after a verified milestone: adjust, finish, or begin the next subgoal, refined if not primitive."""
        s, belief = sketch.value, find_belief(view)
        if belief is None:
            return
        if s.at > 0 and self._is_off(belief.value, s.subgoals[s.at - 1]):
            yield from self._adjust(milestone, sketch, belief)
        elif s.at_end:
            yield Revise(sketch, replace(s, status="done", verified=True), (milestone, belief))
        else:
            go = Revise(sketch, replace(s, verified=True, adjustments=0), (milestone, belief))
            yield go
            current = s.subgoals[s.at]
            if not current.primitive and not current.is_ride:
                yield from self._refine(sketch, current, belief, go)

    def _why_not_at(self, there: Place) -> str:
        """Why the robot cannot stand at a place, as far as it knows; "" where it can."""
        world, name = self._world, there.locale
        if not world.locale(name).contains((there.x_m, there.y_m)):
            return f"is not within {name}"
        point = there.in_world(world).position
        openings = [np.concatenate(doorway.thresholds_world) for doorway in world.doorways_of(name)]
        near = [(measure_wall_distance_m(world.outline(name), openings, point), "a wall")]
        near += [(measure_thing_distance_m(t.footprint_world, point), t.name)
                 for t in world.things_of(name) if t.is_obstacle]
        distance_m, what = min(near)
        radius_m, margin_m = self._robot.radius_m, self._plan.clearances_m[-1]
        if distance_m >= radius_m + margin_m:
            return ""
        return (f"is {distance_m:.2f} m from {what}: the robot cannot stand there, with a radius of {radius_m:.2f} m"
                f" and the {margin_m:.2f} m that it keeps round itself")

    def _why_not(self, here: str, there: str) -> str:
        """Why no sketch leads from one locale to another."""
        if self._world.route(here, there) is not None:
            return f"something stands before a passage on the way from {here} to {there}"
        stairs = "; people can walk there, by stairs" if self._world.walk(here, there) else ""
        return f"no passage for wheels leads from {here} to {there}{stairs}"

    def _is_off(self, belief: Hypothesis, subgoal: Subgoal) -> bool:
        here, there = belief.world_from_robot(self._world), subgoal.destination.in_world(self._world)
        heading = subgoal.destination.heading_rad
        error = 0.0 if heading is None else wrap_angle(here.heading_rad - there.heading_rad)
        turned = abs(error) > self._plan.goal_heading_tolerance_rad
        return here.distance_to(there) > subgoal.tolerance_m or turned

    def _adjust(
        self, milestone: Entry[Milestone], sketch: Entry[PlanSketch], belief: Entry[Hypothesis]
    ) -> Iterable[Effect]:
        """Plan-level servoing: repeat the subgoal from where the robot turned out to be (§6)."""
        s = sketch.value
        if s.adjustments >= self._plan.max_adjustments:
            yield Post(Outcome("blocked", f"{sketch.id} was adjusted {s.adjustments} times in vain"), (milestone,))
            return
        k = s.at - 1
        pose = belief.value.world_from_robot(self._world)
        origin = Place.of_world(self._world, s.subgoals[k].destination.locale, pose.x_m, pose.y_m)
        again = replace(s.subgoals[k], origin=origin, primitive=True)
        subgoals = (*s.subgoals[:k], again, *s.subgoals[k + 1 :])
        adjusted = replace(s, subgoals=subgoals, at=k, verified=True, adjustments=s.adjustments + 1)
        yield Revise(sketch, adjusted, (milestone, belief))

    def _refine(
        self, sketch: Entry[PlanSketch], subgoal: Subgoal, belief: Entry[Hypothesis], go: Revise
    ) -> Iterable[Effect]:
        """Draw a more detailed sketch for the current subgoal, only now that its locale is entered."""
        s, locale = sketch.value, self._world.common(subgoal.origin.locale, subgoal.destination.locale)
        if subgoal.origin.locale == subgoal.destination.locale:
            parts = self._plan_across(subgoal, belief.value)
        else:
            parts = self._plan_between_locales(_place_of(belief.value), subgoal.destination, subgoal.tolerance_m)
        if parts is None:
            yield Post(Outcome("blocked", f"no way through {locale} to {subgoal.destination}"), (go,))
        else:
            yield Post(PlanSketch(s.goal, (*s.path, s.at), locale, parts), (go, belief))

    def _close(self, view: View, done: Entry[PlanSketch]) -> Iterable[Effect]:
        """A sketch is done: so is the subgoal of its parent, or the goal itself."""
        if done.value.path:
            parent = _find_parent(view, done.value)
            if parent is not None:
                yield Revise(parent, parent.value.advanced(), (done,))
            return
        goal = view.get(done.value.goal)
        if goal is not None and goal.value.is_active:
            yield Revise(goal, replace(goal.value, status="reached"), (done,))

    def _plan_between_locales(self, here: Place, destination: Place, tolerance_m: float) -> tuple[Subgoal, ...] | None:
        """Subgoals through each passage to the destination, at the highest level where they differ (Figure 9)."""
        route = self._world.route(here.locale, destination.locale)
        if route is None:
            return None
        subgoals: list[Subgoal] = []
        for step in route.steps:
            before = self._find_place_before(step.passage, step.origin)
            behind = self._find_place_before(step.passage, step.destination)
            if before is None or behind is None:
                return None
            subgoals.append(self._build_subgoal(here, before, self._way_tolerance_m(step.passage)))
            on_wheels = not isinstance(step.passage, Link)  # else it is a ride: there is nothing to drive
            subgoals.append(Subgoal(before, behind, on_wheels, step.passage.name, self._plan.way_tolerance_m))
            here = behind
        subgoals.append(self._build_subgoal(here, destination, tolerance_m))
        return tuple(subgoals)

    def _way_tolerance_m(self, passage: Passage) -> float:
        """Tolerance at the place before a passage, so that the robot passes it straight without contact."""
        if isinstance(passage, Link):
            return self._plan.way_tolerance_m
        beside = passage.width_m / 2 - self._robot.radius_m
        if beside >= self._plan.min_doorway_clearance_m:
            return self._plan.way_tolerance_m
        return max(beside, self._plan.clearances_m[-1])

    def _find_place_before(self, passage: Passage, locale: str) -> Place | None:
        """The place from which a passage is passed straight; None where something is in the way."""
        if isinstance(passage, Link):
            x, y, heading = passage.stop_of(locale)
            return Place.of_world(self._world, locale, float(x), float(y), float(heading))
        middle, outward = passage.threshold_of(locale).mean(axis=0), passage.outward_from(locale)
        free = self._free_space(locale, self._plan.clearances_m[-1])
        distances = self._plan.doorway_distances_m
        away = next((m for m in distances if free.covers(Point(middle - m * outward))), distances[0])
        x, y = middle - away * outward
        if not is_clear(self._free_space(locale, -self._robot.radius_m), middle, (x, y)):
            return None
        return Place.of_world(self._world, locale, float(x), float(y))

    def _build_subgoal(self, origin: Place, destination: Place, tolerance_m: float) -> Subgoal:
        """A subgoal, primitive where a straight line leads there; between locales a later sketch refines it."""
        if origin.locale != destination.locale:
            return Subgoal(origin, destination, False, tolerance_m=tolerance_m)
        a, b = origin.in_world(self._world), destination.in_world(self._world)
        free = self._free_space(destination.locale, self._plan.clearances_m[-1])
        straight = a.distance_to(b) <= self._plan.max_leg_m and is_clear(free, a.position, b.position)
        return Subgoal(origin, destination, straight, tolerance_m=tolerance_m)

    def _plan_across(self, subgoal: Subgoal, belief: Hypothesis) -> tuple[Subgoal, ...] | None:
        """Straight legs round the obstacles of one locale, none longer than ``max_leg_m``."""
        locale = subgoal.destination.locale
        here, there = belief.world_from_robot(self._world), subgoal.destination.in_world(self._world)

        def floor() -> Geometry:
            return self._free_space(locale, -self._robot.radius_m)

        for clearance in self._plan.clearances_m:
            route = find_shortest_route(self._free_space(locale, clearance), here.position, there.position, floor)
            if route is not None:
                break
        else:
            return None
        points = _divide(route, self._plan.max_leg_m)
        places = [Place.of_world(self._world, locale, float(x), float(y)) for x, y in points]
        places[-1] = subgoal.destination
        last = len(places) - 2
        return tuple(
            Subgoal(a, b, True, tolerance_m=subgoal.tolerance_m if i == last else self._plan.way_tolerance_m)
            for i, (a, b) in enumerate(pairwise(places))
        )

    def _free_space(self, locale: str, margin_m: float) -> Geometry:
        if (locale, margin_m) not in self._free_spaces:
            clearance = self._robot.radius_m + margin_m
            self._free_spaces[locale, margin_m] = compute_free_space(
                self._world.outline(locale), self._world.obstacles(locale), clearance)
        return self._free_spaces[locale, margin_m]


def _place_of(belief: Hypothesis) -> Place:
    """The believed place, without a heading."""
    return Place(belief.locale, belief.locale_from_robot.x_m, belief.locale_from_robot.y_m)


def _divide(route: list[NDArray[np.float64]], max_leg_m: float) -> list[NDArray[np.float64]]:
    """The same route with way points in between, so that no leg is longer than ``max_leg_m``."""
    points = route[:1]
    for a, b in pairwise(route):
        parts = max(1, math.ceil(float(np.linalg.norm(b - a)) / max_leg_m))
        points += [a + (b - a) * (i / parts) for i in range(1, parts + 1)]
    return points


def _find_parent(view: View, sketch: PlanSketch) -> Entry[PlanSketch] | None:
    """The active sketch whose current subgoal a sketch refines."""
    path = sketch.path
    return view.latest(
        PlanSketch, lambda s: s.is_active and s.goal == sketch.goal and s.path == path[:-1] and s.at == path[-1]
    )


def _find_goal_sketch(view: View, sketch: PlanSketch) -> Entry[PlanSketch] | None:
    goal = view.get(sketch.goal)
    return view.latest(PlanSketch, lambda s: s == sketch) if goal is not None and goal.value.is_active else None
