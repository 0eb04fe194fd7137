"""Path follower (§5): steers on the move by pure pursuit, corrected by each picture."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import replace
from typing import Any, NamedTuple

from blackboard import Change, Effect, Entry, Level, Post, Posted, Revise, Revised, View, Watch
from knowledge_sources.methods.motion import (
    ROLLING_STOP_MARGIN_M,
    compute_bearing,
    find_aim_point,
    limit_speed,
    measure_progress,
    steer_to,
    update_leg,
)
from knowledge_sources.priority import Priority
from knowledge_sources.reads import (
    HELD,
    SOUND,
    Belief,
    FloorAhead,
    current_leg,
    is_in_doubt,
    is_over,
    is_standing,
    is_up_to_date,
    open_discrepancies,
    open_milestone,
    rolling_course,
)
from knowledge_sources.robot_knowledge_source import RobotKnowledgeSource
from world_models.entries import Course, Discrepancy, Drift, Hypothesis, Leg, Milestone, PlanSketch, correct

ROLLING_LOOKAHEAD_M = 0.75  # distance ahead on the line at which the path follower steers (pure pursuit)
MIN_ROLLING_LEG_M = 0.3  # shortest rest of a leg, beyond the stopping distance, that is driven without stopping
MAX_ROLLING_START_ERROR_RAD = math.radians(3.0)  # the path follower starts when it faces its aim to within this
MAX_ROLLING_ERROR_RAD = math.radians(12.0)  # the path follower stops when its aim is further to the side than this
MIN_FREE_M = 2.0 * ROLLING_STOP_MARGIN_M  # with less floor seen to be free ahead it stops, or does not start


class Ahead(NamedTuple):
    """How far ahead the floor is seen to be free, as far as that matters; the speed that it allows; what tells that."""

    free_m: float
    speed_m_per_s: float
    because: tuple[Entry[Any], ...]


class Case(NamedTuple):
    """The course that is driven, None where the robot stands; the leg, if one is under way, and the way ahead on it."""

    course: Entry[Course] | None
    leg: tuple[Entry[Leg], Ahead] | None
    must_stop: bool


class PathFollower(RobotKnowledgeSource):
    """Drives a leg without stopping at each increment, and corrects the course by each picture.

    It stops at once when anything is in doubt, above the action level or beyond the action level's bound. It also stops
    before the end of the leg: the motor drives the rest; and before floor that was not seen to be free, after it has
    slowed.
    """

    level = Level.ACTION
    on = (
        Watch(Leg, (Posted,)),
        Watch(Hypothesis, (Revised,), lambda h: h.is_held),
        Watch(Discrepancy, (Posted, Revised), lambda d: d.is_open),
        Watch(Milestone, (Posted,)),
        Watch(PlanSketch, (Revised,)),
    )
    needs = (HELD, SOUND)
    writes = (Course, Leg, Discrepancy)

    def bind(self, view: View, trigger: Change) -> Case | None:
        """A course to stop or to correct; or a leg that is long enough, where the robot stands and faces along it."""
        belief, course, driving = HELD.of(view), rolling_course(view), current_leg(view)
        if course is not None:
            if not is_up_to_date(view):
                return None
            if driving is None:
                return Case(course, None, True)
            leg, ahead = driving[0], self._look_ahead(view, driving[0].value, belief)
            goes_on = not _is_hindered(view) and _is_on_line(leg.value, belief, MAX_ROLLING_ERROR_RAD)
            return Case(course, (leg, ahead), not goes_on or ahead.free_m <= MIN_FREE_M)
        if driving is None or driving[0].value.looking_rad is not None or not belief.robot.continuous:
            return None
        leg = driving[0]
        is_free_to_go = is_standing(view) and not _is_hindered(view)
        if not is_free_to_go or not _is_on_line(leg.value, belief, MAX_ROLLING_START_ERROR_RAD):
            return None
        ahead = self._look_ahead(view, leg.value, belief)
        return Case(None, (leg, ahead), False) if ahead.free_m > MIN_FREE_M else None

    def rate(self, case: Case) -> float:
        if case.must_stop:
            return Priority.ENTER
        return Priority.STEER if case.course is None else Priority.MOVE

    def act(self, view: View, case: Case) -> Iterable[Effect]:
        (course, leg, must_stop), held = case, HELD.of(view)
        if course is not None and must_stop:
            because = (course, held.entry, *open_discrepancies(view), *(() if leg is None else leg[1].because))
            yield Revise(course, replace(course.value, speed_m_per_s=0.0), because)
        elif leg is not None:
            yield from self._steer(view, course, *leg, held)

    def _steer(
        self, view: View, course: Entry[Course] | None, leg: Entry[Leg], ahead: Ahead, held: Belief
    ) -> Iterable[Effect]:
        """Steer an arc to the point of the line ahead, less the curvature that the wheels add."""
        (here, belief), drift = (held.pose, held.entry), view.latest(Drift)
        point = find_aim_point(leg.value, measure_progress(leg.value, here)[0], ROLLING_LOOKAHEAD_M)
        corrected = correct(view, Level.ACTION, (belief,))
        yield from corrected
        seen = update_leg(leg.value, here, point)
        step = Revise(leg, replace(seen, increments=seen.increments + (course is None)), (leg, belief, *corrected))
        yield step
        bend_per_m = steer_to(point, here, 0.0 if drift is None else drift.value.curvature_per_m)
        new = Course(leg.id, ahead.speed_m_per_s, bend_per_m)
        because = (step, belief, *(() if drift is None else (drift,)), *ahead.because)
        yield Post(new, because) if course is None else Revise(course, new, (course, *because))

    def _look_ahead(self, view: View, leg: Leg, belief: Belief) -> Ahead:
        wheels = belief.robot.actuator
        full, most_m = wheels.speed_m_per_s, wheels.stopping_distance_m() + MIN_ROLLING_LEG_M
        if not self._settings.action.keeps_to_seen_floor:
            return Ahead(most_m, full, ())
        floor = FloorAhead(view, leg, belief.entry, self._settings)
        clearance = floor.measure_clearance(most_m)
        borne, before = self._settings.action.creep_speed_m_per_s, clearance.nearer(ROLLING_STOP_MARGIN_M)
        return Ahead(clearance.free_m, limit_speed(before, 0.0, 0.0, wheels, borne), floor.because)


def _is_on_line(leg: Leg, belief: Belief, most_rad: float) -> bool:
    """Whether the robot can roll along a leg, and stop before its end: it faces its aim."""
    along, _ = measure_progress(leg, belief.pose)
    if along <= belief.robot.actuator.stopping_distance_m() + MIN_ROLLING_LEG_M:
        return False
    return abs(compute_bearing(find_aim_point(leg, along, ROLLING_LOOKAHEAD_M), belief.pose)) <= most_rad


def _is_hindered(view: View) -> bool:
    """Whether the mission has ended, something is in doubt, or a milestone is awaited."""
    return is_over(view) or is_in_doubt(view) or open_milestone(view) is not None
