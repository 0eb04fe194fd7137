"""PathFollower (§5): steers on the move, corrected by each picture; stops the robot on any doubt."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

from blackboard.board import View
from blackboard.change import Change, Posted, Revised, Watch
from blackboard.effect import Effect, Post, Revise
from blackboard.entry import Entry
from blackboard.level import Level
from blackboard.servoing import Discrepancy
from knowledge_sources.methods.motion.pure_pursuit import (
    compute_bearing,
    compute_curvature_to,
    find_aim_point,
    measure_progress,
    update_leg,
)
from knowledge_sources.questions import (
    held,
    is_heard,
    is_in_doubt,
    is_over,
    is_settled,
    open_discrepancy,
    open_fault,
    open_milestone,
    rolling,
    under_way,
)
from knowledge_sources.robot_knowledge_source import RobotKnowledgeSource
from world_models.entries.body import Course
from world_models.entries.location import Hypothesis
from world_models.entries.task import Leg, Milestone, PlanSketch
from world_models.entries.wheels import Drift
from world_models.frames import Pose2


class PathFollower(RobotKnowledgeSource):
    """Drives a leg without stopping at each increment, where the robot can: pictures on the move correct the course.

    It stops at once when anything is in doubt, above the action level or beyond its bound there, and before the end
    of the leg, whose rest is the motor's.
    """

    level = Level.ACTION
    watches = (
        Watch(Leg, (Posted,)),
        Watch(Hypothesis, (Revised,), lambda h: h.is_held),
        Watch(Discrepancy, (Posted, Revised), lambda d: d.is_open),
        Watch(Milestone, (Posted,)),
        Watch(PlanSketch, (Revised,)),
    )
    writes = (Course, Leg, Discrepancy)

    def rate(self, view: View, trigger: Change) -> float | None:
        if open_fault(view) is not None:
            return None
        if rolling(view) is not None:
            return (1.0 if self._must_stop(view) else 0.3) if is_heard(view) else None
        return 0.4 if self._may_set_off(view) else None

    def act(self, view: View, trigger: Change) -> Iterable[Effect]:
        belief, course, driving = held(view), rolling(view), under_way(view)
        if belief is None:
            return
        if course is not None and (driving is None or self._must_stop(view)):
            yield Revise(course, replace(course.value, speed_m_per_s=0.0), (course, belief, *_reasons(view)))
        elif driving is not None:
            yield from self._steered(view, course, driving[0], belief)

    def _steered(
        self, view: View, course: Entry[Course] | None, leg: Entry[Leg], belief: Entry[Hypothesis]
    ) -> Iterable[Effect]:
        """The arc to the point of the line ahead, less what the wheels bend it by themselves."""
        here, drift = belief.value.world_from_robot(self._robot.world), view.latest(Drift)
        s, (along, _) = self._settings.action, measure_progress(leg.value, here)
        point = find_aim_point(leg.value, along, s.rolling_lookahead_m)
        discrepancy = open_discrepancy(view, Level.ACTION)
        corrected = () if discrepancy is None else (Revise(discrepancy, discrepancy.value.corrected(), (belief,)),)
        yield from corrected
        seen = update_leg(leg.value, here, point)
        step = Revise(leg, replace(seen, increments=seen.increments + (course is None)), (leg, belief, *corrected))
        yield step
        wanted = compute_curvature_to(point, here) - (0.0 if drift is None else drift.value.curvature_per_m)
        curvature = min(max(wanted, -s.max_curvature_per_m), s.max_curvature_per_m)
        told = Course(leg.id, self._robot.actuator.speed_m_per_s, curvature)
        because = (step, belief, *(() if drift is None else (drift,)))
        yield Post(told, because) if course is None else Revise(course, told, (course, *because))

    def _may_set_off(self, view: View) -> bool:
        """Standing before a leg that is long enough, and facing along it."""
        belief, driving = held(view), under_way(view)
        if not self._robot.continuous or belief is None or driving is None:
            return False
        if is_over(view) or not is_settled(view) or is_in_doubt(view) or open_milestone(view) is not None:
            return False
        here = belief.value.world_from_robot(self._robot.world)
        leg, s = driving[0].value, self._settings.action
        return self._is_worth_it(leg, here) and abs(self._off(leg, here)) <= s.max_rolling_start_error_rad

    def _must_stop(self, view: View) -> bool:
        belief, driving = held(view), under_way(view)
        if belief is None or driving is None or is_over(view) or is_in_doubt(view) or open_milestone(view) is not None:
            return True
        here = belief.value.world_from_robot(self._robot.world)
        leg, s = driving[0].value, self._settings.action
        return not self._is_worth_it(leg, here) or abs(self._off(leg, here)) > s.max_rolling_error_rad

    def _is_worth_it(self, leg: Leg, here: Pose2) -> bool:
        """Whether there is way enough to come to a stand before the end of the leg."""
        least_m = self._robot.actuator.stopping_distance_m() + self._settings.action.min_rolling_leg_m
        return measure_progress(leg, here)[0] > least_m

    def _off(self, leg: Leg, here: Pose2) -> float:
        """How far to the left of the robot's heading the point lies that it steers at [rad]."""
        along, _ = measure_progress(leg, here)
        return compute_bearing(find_aim_point(leg, along, self._settings.action.rolling_lookahead_m), here)


def _reasons(view: View) -> tuple[Entry[Discrepancy], ...]:
    """What is open and in doubt, if that is why it stops."""
    found = (open_discrepancy(view, level) for level in Level)
    return tuple(entry for entry in found if entry is not None)
