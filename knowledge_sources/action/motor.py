"""Motor (§5): a primitive subgoal becomes (TURN angle) and (MOVE distance), one increment at a time."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from typing import Any, NamedTuple

from blackboard import Change, Effect, Entry, Level, Post, Posted, Revise, Revised, View, Watch
from knowledge_sources.methods.motion import (
    MAX_HEADING_ERROR_RAD,
    MAX_LOOK_ERROR_RAD,
    count_increment,
    find_aim,
    lay_leg,
    plan_increment,
    plan_turn,
    update_leg,
)
from knowledge_sources.priority import Priority
from knowledge_sources.reads import (
    GOING_ON,
    HELD,
    SOUND,
    STANDING,
    Belief,
    FloorAhead,
    current_leg,
    deepest_sketch,
    is_in_doubt,
    open_discrepancy,
    open_milestone,
    unmeasured_doubt,
)
from knowledge_sources.robot_knowledge_source import RobotKnowledgeSource
from world_models.entries import BodyFault, Drift, Hypothesis, Leg, Milestone, MotorCommand, PlanSketch
from world_models.entries.discrepancy import Discrepancy, correct

LOOKAHEAD_M = 1.2  # distance ahead on the line at which the motor steers (pure pursuit): two increments


class Turn(NamedTuple):
    """A milestone that the robot has to turn to, and by which increment it does."""

    milestone: Entry[Milestone]
    belief: Belief
    command: MotorCommand


class Begin(NamedTuple):
    """A verified sketch, the first step of which is primitive: its leg is to begin."""

    sketch: Entry[PlanSketch]
    belief: Belief


class Drive(NamedTuple):
    """A leg under way."""

    leg: Entry[Leg]
    belief: Belief


class Motor(RobotKnowledgeSource):
    """Commands the next increment of a leg, steered from the believed pose by pure pursuit.

    It begins a leg when a verified sketch has a primitive subgoal, and turns to where a milestone is to be looked for.
    It stands still while a command is being carried out or the body is at fault. While anything above the action level
    is in doubt it does not drive, and turns only for the look that is to end the doubt. It moves only as far as the
    floor is seen to be free; it looks at the floor behind a corner before it is there, and creeps where it cannot see.
    It does not creep to where something may stand: there it halts the leg.
    """

    level, priority = Level.ACTION, Priority.MOVE
    on = (
        Watch(PlanSketch, (Posted, Revised), lambda s: s.is_active and s.verified),
        Watch(Leg, (Posted,)),
        Watch(Hypothesis, (Posted, Revised), lambda h: h.is_held),
        Watch(Milestone),
        Watch(Discrepancy, (Revised,)),
        Watch(BodyFault, (Revised,)),
    )
    needs = (GOING_ON, HELD, SOUND, STANDING)
    writes = (MotorCommand, Leg, Discrepancy)

    def bind(self, view: View, trigger: Change) -> Turn | Begin | Drive | None:
        """A milestone to turn to, else a leg under way, else one to begin; in doubt only one that is to end it."""
        belief, milestone = HELD.of(view), open_milestone(view)
        if is_in_doubt(view) and (milestone is None or not _ends_doubt(view, milestone)):
            return None
        if milestone is not None:
            if milestone.value.status != "turning":
                return None
            heading_rad, most_rad = milestone.value.look_heading_rad, MAX_HEADING_ERROR_RAD
            turn = plan_turn(heading_rad, belief.pose, belief.robot.actuator, most_rad)
            return None if turn is None else Turn(milestone, belief, turn)
        driving, sketch = current_leg(view), _sketch_for_leg(view)
        if driving is not None:
            return Drive(driving[0], belief)
        return None if sketch is None else Begin(sketch, belief)

    def act(self, view: View, case: Turn | Begin | Drive) -> Iterable[Effect]:
        match case:
            case Turn():
                yield Post(case.command, (case.milestone, case.belief.entry))
            case Begin(sketch, belief):
                yield Post(lay_leg(sketch.id, sketch.value, belief.pose, belief.world), (sketch, belief.entry))
            case Drive():
                yield from self._command_increment(view, case.leg, case.belief)

    def _command_increment(self, view: View, leg: Entry[Leg], held: Belief) -> Iterable[Effect]:
        (robot, here, belief), drift = (held.robot, held.pose, held.entry), view.latest(Drift)
        curvature_per_m = 0.0 if drift is None else drift.value.curvature_per_m
        lookahead_m = LOOKAHEAD_M
        seen = update_leg(leg.value, here, find_aim(leg.value, here, lookahead_m))
        reasons: tuple[Entry[Any], ...] = ()
        command = plan_turn(seen.looking_rad, here, robot.actuator, MAX_LOOK_ERROR_RAD)
        if command is None:
            seen = replace(seen, looking_rad=None)
            command = plan_increment(robot.actuator, seen, here, held.value.sigma_m, curvature_per_m, lookahead_m)
            if command is not None and command.move_m > 0.0 and self._settings.action.keeps_to_seen_floor:
                floor = FloorAhead(view, seen, belief, self._settings)
                (seen, command), reasons = floor.keep_to_seen(command), floor.because
                if command is None:
                    yield Revise(leg, replace(seen, status="halted"), (leg, belief, *reasons))
                    return
        corrected = correct(view, Level.ACTION, (belief,))
        yield from corrected
        if command is None:
            yield Revise(leg, replace(seen, status="arrived"), (leg, belief, *corrected))
            return
        step = Revise(leg, count_increment(seen, command), (leg, belief, *corrected))
        yield step
        yield Post(command, (step, belief, *(() if drift is None else (drift,)), *reasons))


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
