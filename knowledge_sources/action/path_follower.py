"""Path follower (§5): steers on the move by pure pursuit, corrected by each picture."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import replace
from typing import Any

from blackboard.board import View
from blackboard.change import Change, Posted, Revised, Watch
from blackboard.effect import Effect, Post, Revise
from blackboard.entry import Entry
from blackboard.level import Level
from blackboard.servoing import Discrepancy
from knowledge_sources.floor_ahead import FloorAhead
from knowledge_sources.methods.motion.pure_pursuit import (
    compute_bearing,
    compute_curvature_to,
    find_aim_point,
    measure_progress,
    update_leg,
)
from knowledge_sources.questions import (
    current_leg,
    find_belief,
    find_robot,
    is_in_doubt,
    is_over,
    is_standing,
    is_up_to_date,
    open_discrepancy,
    open_fault,
    open_milestone,
    rolling_course,
)
from knowledge_sources.robot_knowledge_source import OlderSource
from world_models.actuator import ActuatorModel
from world_models.entries.body import Course
from world_models.entries.location import Hypothesis
from world_models.entries.robot_state import Drift
from world_models.entries.task import Leg, Milestone, PlanSketch
from world_models.frames import Pose2

ROLLING_LOOKAHEAD_M = 0.75  # distance ahead on the line at which the path follower steers (pure pursuit)
MIN_ROLLING_LEG_M = 0.3  # shortest rest of a leg, beyond the stopping distance, that is driven without stopping
ROLLING_STOP_MARGIN_M = 0.1  # the path follower stops so far before floor that was not seen to be free
MAX_ROLLING_START_ERROR_RAD = math.radians(3.0)  # the path follower starts when it faces its aim to within this
MAX_ROLLING_ERROR_RAD = math.radians(12.0)  # the path follower stops when its aim is further to the side than this
MAX_CURVATURE_PER_M = 1.0  # largest curvature that is steered on the move


class PathFollower(OlderSource):
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
    writes = (Course, Leg, Discrepancy)

    def judge(self, view: View, trigger: Change) -> float | None:
        if open_fault(view) is not None:
            return None
        if rolling_course(view) is not None:
            return (1.0 if self._must_stop(view) else 0.3) if is_up_to_date(view) else None
        return 0.4 if self._may_start(view) else None

    def answer(self, view: View, trigger: Change) -> Iterable[Effect]:
        belief, course, driving = find_belief(view), rolling_course(view), current_leg(view)
        if belief is None:
            return
        if course is not None and (driving is None or self._must_stop(view)):
            reasons = () if driving is None else self._look_ahead(
                view, driving[0].value, belief, find_robot(view).actuator)[1]
            yield Revise(course, replace(course.value, speed_m_per_s=0.0), (course, belief, *_reasons(view), *reasons))
        elif driving is not None:
            yield from self._steer(view, course, driving[0], belief)

    def _steer(
        self, view: View, course: Entry[Course] | None, leg: Entry[Leg], belief: Entry[Hypothesis]
    ) -> Iterable[Effect]:
        """Steer an arc to the point of the line ahead, less the curvature that the wheels add."""
        robot, drift = find_robot(view), view.latest(Drift)
        here = belief.value.world_from_robot(robot.world)
        along, _ = measure_progress(leg.value, here)
        point = find_aim_point(leg.value, along, ROLLING_LOOKAHEAD_M)
        discrepancy = open_discrepancy(view, Level.ACTION)
        corrected = () if discrepancy is None else (Revise(discrepancy, discrepancy.value.corrected(), (belief,)),)
        yield from corrected
        seen = update_leg(leg.value, here, point)
        step = Revise(leg, replace(seen, increments=seen.increments + (course is None)), (leg, belief, *corrected))
        yield step
        wanted = compute_curvature_to(point, here) - (0.0 if drift is None else drift.value.curvature_per_m)
        curvature = min(max(wanted, -MAX_CURVATURE_PER_M), MAX_CURVATURE_PER_M)
        free_m, reasons = self._look_ahead(view, leg.value, belief, robot.actuator)
        new = Course(leg.id, self._choose_speed(free_m, robot.actuator), curvature)
        because = (step, belief, *(() if drift is None else (drift,)), *reasons)
        yield Post(new, because) if course is None else Revise(course, new, (course, *because))

    def _choose_speed(self, free_m: float, actuator: ActuatorModel) -> float:
        """The full speed, or what can be stopped from before the floor ends that is seen to be free."""
        room_m = max(0.0, free_m - ROLLING_STOP_MARGIN_M)
        fastest = math.sqrt(2.0 * actuator.brake_m_per_s2 * room_m)
        return min(actuator.speed_m_per_s, max(fastest, self._settings.action.creep_speed_m_per_s))

    def _look_ahead(
        self, view: View, leg: Leg, belief: Entry[Hypothesis], actuator: ActuatorModel
    ) -> tuple[float, tuple[Entry[Any], ...]]:
        """How far ahead the floor is seen to be free, as far as that matters at full speed; and what tells that."""
        most_m = actuator.stopping_distance_m() + MIN_ROLLING_LEG_M
        if not self._settings.action.keeps_to_seen_floor:
            return most_m, ()
        floor = FloorAhead(view, leg, belief, self._settings)
        return floor.measure_free_m(most_m), floor.because

    def _is_floor_ahead(self, view: View, leg: Leg, belief: Entry[Hypothesis], actuator: ActuatorModel) -> bool:
        """Whether enough floor ahead is seen to be free to roll on."""
        free_m, _ = self._look_ahead(view, leg, belief, actuator)
        return free_m > 2.0 * ROLLING_STOP_MARGIN_M

    def _may_start(self, view: View) -> bool:
        """Whether the robot stands before a leg that is long enough, and faces along it."""
        belief, driving, robot = find_belief(view), current_leg(view), find_robot(view)
        if not robot.continuous or belief is None or driving is None:
            return False
        if is_over(view) or not is_standing(view) or is_in_doubt(view) or open_milestone(view) is not None:
            return False
        here = belief.value.world_from_robot(robot.world)
        leg = driving[0].value
        is_long = self._is_long_enough(leg, here, robot.actuator)
        is_ready = is_long and abs(self._aim_error(leg, here)) <= MAX_ROLLING_START_ERROR_RAD
        return is_ready and leg.looking_rad is None and self._is_floor_ahead(view, leg, belief, robot.actuator)

    def _must_stop(self, view: View) -> bool:
        belief, driving = find_belief(view), current_leg(view)
        if belief is None or driving is None or is_over(view) or is_in_doubt(view) or open_milestone(view) is not None:
            return True
        robot = find_robot(view)
        here = belief.value.world_from_robot(robot.world)
        leg = driving[0].value
        is_long = self._is_long_enough(leg, here, robot.actuator)
        is_astray = not is_long or abs(self._aim_error(leg, here)) > MAX_ROLLING_ERROR_RAD
        return is_astray or not self._is_floor_ahead(view, leg, belief, robot.actuator)

    def _is_long_enough(self, leg: Leg, here: Pose2, actuator: ActuatorModel) -> bool:
        """Whether the robot can drive and still stop before the end of the leg."""
        least_m = actuator.stopping_distance_m() + MIN_ROLLING_LEG_M
        return measure_progress(leg, here)[0] > least_m

    def _aim_error(self, leg: Leg, here: Pose2) -> float:
        """Angle from the robot's heading to the point that it steers at, to the left [rad]."""
        along, _ = measure_progress(leg, here)
        return compute_bearing(find_aim_point(leg, along, ROLLING_LOOKAHEAD_M), here)


def _reasons(view: View) -> tuple[Entry[Discrepancy], ...]:
    """The open discrepancies: why it stops, where they are the reason."""
    found = (open_discrepancy(view, level) for level in Level)
    return tuple(entry for entry in found if entry is not None)
