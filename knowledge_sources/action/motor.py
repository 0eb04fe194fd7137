"""Motor (§5): a primitive subgoal becomes (TURN angle) and (MOVE distance), one increment at a time."""

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
from knowledge_sources.floor_ahead import MIN_CREEP_M, FloorAhead
from knowledge_sources.methods.motion.pure_pursuit import (
    compute_bearing,
    compute_chord_turn,
    find_aim_point,
    measure_progress,
    update_leg,
)
from knowledge_sources.questions import (
    current_leg,
    deepest_sketch,
    find_belief,
    find_building,
    find_robot,
    is_in_doubt,
    is_over,
    is_standing,
    open_discrepancy,
    open_fault,
    open_milestone,
    unmeasured_doubt,
)
from knowledge_sources.robot_knowledge_source import OlderSource
from world_models.actuator import ActuatorModel
from world_models.entries.body import BodyFault, MotorCommand
from world_models.entries.location import Hypothesis
from world_models.entries.robot_state import Drift
from world_models.entries.task import Leg, Milestone, PlanSketch
from world_models.frames import Pose2, wrap_angle

MAX_HEADING_ERROR_RAD = math.radians(3.0)  # the motor moves when it faces its aim to within this; else it turns
MAX_ARRIVAL_HEADING_ERROR_RAD = math.radians(0.5)  # largest error of a heading that the goal states
MAX_START_OFFSET_M = 0.15
"""From nearer than this the robot returns to the planned line; from further off it draws a new one."""
AIM_AT_END_M = 0.25  # with less than this to go, the motor steers at the end of the leg itself
ARRIVAL_PART = 0.8  # part of a leg's tolerance within which it has arrived
MAX_LOOK_ERROR_RAD = math.radians(6.0)
"""The robot looks where the floor is to be seen when it faces there to within this."""


class Motor(OlderSource):
    """Commands the next increment of a leg, steered from the believed pose by pure pursuit.

    It begins a leg when a verified sketch has a primitive subgoal, and turns to where a milestone is to be looked for.
    It stands still while a command is being carried out or the body is at fault. While anything above the action level
    is in doubt it does not drive, and turns only for the look that is to end the doubt. It moves only as far as the
    floor is seen to be free; it looks at the floor behind a corner before it is there, and creeps where it cannot see.
    It does not creep to where something may stand: there it halts the leg.
    """

    level = Level.ACTION
    on = (
        Watch(PlanSketch, (Posted, Revised), lambda s: s.is_active and s.verified),
        Watch(Leg, (Posted,)),
        Watch(Hypothesis, (Posted, Revised), lambda h: h.is_held),
        Watch(Milestone),
        Watch(Discrepancy, (Revised,)),
        Watch(BodyFault, (Revised,)),
    )
    writes = (MotorCommand, Leg, Discrepancy)

    def judge(self, view: View, trigger: Change) -> float | None:
        if is_over(view) or open_fault(view) is not None or not is_standing(view):
            return None
        milestone = open_milestone(view)
        if is_in_doubt(view) and (milestone is None or not _ends_doubt(view, milestone)):
            return None
        if milestone is not None:
            return 0.3 if milestone.value.status == "turning" and self._look_error(view, milestone.value) else None
        if current_leg(view) is not None:
            return 0.3
        return 0.3 if _sketch_for_leg(view) is not None else None

    def answer(self, view: View, trigger: Change) -> Iterable[Effect]:
        belief, milestone = find_belief(view), open_milestone(view)
        if belief is None:
            return
        if milestone is not None:
            turn = _limit_turn(self._look_error(view, milestone.value) or 0.0, find_robot(view).actuator)
            yield Post(MotorCommand(turn, 0.0), (milestone, belief))
            return
        driving = current_leg(view)
        if driving is None:
            yield from self._begin_leg(view, belief)
            return
        yield from self._command_increment(view, driving[0], belief)

    def _look_error(self, view: View, milestone: Milestone) -> float | None:
        """The turn to face a milestone's landmarks [rad]; None when the robot faces them."""
        belief = find_belief(view)
        if belief is None:
            return None
        here = belief.value.world_from_robot(find_building(view))
        error = wrap_angle(milestone.look_heading_rad - here.heading_rad)
        return error if abs(error) > MAX_HEADING_ERROR_RAD else None

    def _begin_leg(self, view: View, belief: Entry[Hypothesis]) -> Iterable[Effect]:
        sketch = _sketch_for_leg(view)
        if sketch is None or sketch.value.current is None:
            return
        subgoal, world = sketch.value.current, find_building(view)
        here, end = belief.value.world_from_robot(world), subgoal.destination.in_world(world)
        planned = subgoal.origin.in_world(world)
        start = planned if planned.distance_to(here) <= MAX_START_OFFSET_M else here
        heading = None if subgoal.destination.heading_rad is None else end.heading_rad
        leg = Leg(sketch.id, sketch.value.at, start.x_m, start.y_m, end.x_m, end.y_m, subgoal.tolerance_m, heading)
        yield Post(leg, (sketch, belief))

    def _command_increment(self, view: View, leg: Entry[Leg], belief: Entry[Hypothesis]) -> Iterable[Effect]:
        robot, drift = find_robot(view), view.latest(Drift)
        here = belief.value.world_from_robot(robot.world)
        curvature_per_m = 0.0 if drift is None else drift.value.curvature_per_m
        seen = update_leg(leg.value, here, self._aim(leg.value, here))
        told: tuple[Entry[Any], ...] = ()
        command = self._go_on_looking(seen, here, robot.actuator)
        if command is None:
            seen = replace(seen, looking_rad=None)
            command = self._plan_increment(robot.actuator, seen, here, curvature_per_m)
            if command is not None and command.move_m > 0.0 and self._settings.action.keeps_to_seen_floor:
                seen, command, told = self._keep_to_seen_floor(view, seen, belief, command)
                if command is None:
                    yield Revise(leg, replace(seen, status="halted"), (leg, belief, *told))
                    return
        discrepancy = open_discrepancy(view, Level.ACTION)
        corrected = () if discrepancy is None else (Revise(discrepancy, discrepancy.value.corrected(), (belief,)),)
        yield from corrected
        if command is None:
            yield Revise(leg, replace(seen, status="arrived"), (leg, belief, *corrected))
            return
        step = Revise(leg, replace(seen, increments=seen.increments + 1), (leg, belief, *corrected))
        yield step
        yield Post(command, (step, belief, *(() if drift is None else (drift,)), *told))

    def _go_on_looking(self, leg: Leg, here: Pose2, actuator: ActuatorModel) -> MotorCommand | None:
        """The turn to where the floor is to be seen; None when the robot faces there, or looks for none."""
        if leg.looking_rad is None:
            return None
        turn = wrap_angle(leg.looking_rad - here.heading_rad)
        most = MAX_LOOK_ERROR_RAD
        return MotorCommand(_limit_turn(turn, actuator), 0.0) if abs(turn) > most else None

    def _keep_to_seen_floor(
        self, view: View, leg: Leg, belief: Entry[Hypothesis], command: MotorCommand
    ) -> tuple[Leg, MotorCommand | None, tuple[Entry[Any], ...]]:
        """A move only as far as the floor is seen to be free; before it a look at what will be needed behind the leg.

        Returns the leg, the command, and what of the floor both rest on. The command is None where something may
        stand in floor that is not seen, right before the robot.
        """
        s, actuator = self._settings.action, find_robot(view).actuator
        floor = FloorAhead(view, leg, belief, self._settings)
        here = belief.value.world_from_robot(find_building(view))
        look = floor.choose_look()
        if look is not None:
            looking = replace(leg, looking_rad=look.heading_rad, looked_at=(
                *leg.looked_at, (here.x_m, here.y_m, look.heading_rad)))
            turned = self._go_on_looking(looking, here, actuator)
            if turned is not None:
                return looking, turned, floor.because
        wanted_m = actuator.reach * command.move_m
        caution = floor.limit_move(wanted_m)
        if caution.creeps and caution.move_m < min(MIN_CREEP_M, wanted_m):
            return leg, None, floor.because
        move_m = min(command.move_m, actuator.compute_command_m(caution.move_m))
        slowly = s.creep_speed_m_per_s if caution.creeps else None
        return leg, MotorCommand(command.turn_rad, move_m, slowly), floor.because

    def _plan_increment(
        self, actuator: ActuatorModel, leg: Leg, here: Pose2, curvature_per_m: float
    ) -> MotorCommand | None:
        """The next increment; None on arrival. A move is an arc whose chord points at the aim."""
        along, left = measure_progress(leg, here)
        within_m = leg.tolerance_m * ARRIVAL_PART
        away = math.hypot(leg.x1_m - here.x_m, leg.y1_m - here.y_m)
        if away <= within_m or (along <= 0.0 and abs(left) <= within_m):
            return self._final_turn(leg, here, actuator)
        turn = compute_bearing(self._aim(leg, here), here)
        if abs(turn) > MAX_HEADING_ERROR_RAD:
            return MotorCommand(_limit_turn(turn, actuator), 0.0)
        distance = min(actuator.increment_m, actuator.compute_command_m(away))
        turn = compute_chord_turn(turn, curvature_per_m, actuator.reach * distance)
        return MotorCommand(turn if abs(turn) > MAX_ARRIVAL_HEADING_ERROR_RAD / 10 else 0.0, distance)

    def _aim(self, leg: Leg, here: Pose2) -> tuple[float, float]:
        """The point of the line to steer at [m, world]: ahead by ``lookahead_m``, near the end the end itself."""
        along, _ = measure_progress(leg, here)
        if along < AIM_AT_END_M:
            return leg.x1_m, leg.y1_m
        return find_aim_point(leg, along, self._settings.action.lookahead_m)

    def _final_turn(self, leg: Leg, here: Pose2, actuator: ActuatorModel) -> MotorCommand | None:
        if leg.heading_rad is None:
            return None
        turn = wrap_angle(leg.heading_rad - here.heading_rad)
        most = MAX_ARRIVAL_HEADING_ERROR_RAD
        return MotorCommand(_limit_turn(turn, actuator), 0.0) if abs(turn) > most else None


def _limit_turn(turn_rad: float, actuator: ActuatorModel) -> float:
    """One increment of a turn; a long turn is divided equally, so that landmarks stay in view."""
    return turn_rad / max(1, math.ceil(abs(turn_rad) / actuator.turn_increment_rad))


def _ends_doubt(view: View, milestone: Entry[Milestone]) -> bool:
    """Whether a milestone was chosen after the plan level's doubt, to measure it."""
    doubt = unmeasured_doubt(view)
    return (doubt is not None and milestone.cycle >= doubt.cycle and open_discrepancy(view, Level.GOAL) is None)


def _sketch_for_leg(view: View) -> Entry[PlanSketch] | None:
    """The deepest sketch, if its milestone is verified and its current subgoal is primitive."""
    sketch = deepest_sketch(view)
    if sketch is None:
        return None
    s = sketch.value
    return sketch if s.verified and s.current is not None and s.current.primitive else None
