"""Questions that several experts ask of the board; pure reads."""

from __future__ import annotations

from blackboard.board import View
from blackboard.entry import Entry
from blackboard.index import Index
from blackboard.level import Level
from blackboard.servoing import OPEN, Discrepancy
from knowledge_sources.settings.action import ActionSettings
from world_models.entries.body import BodyFault, Course, MotionReport, MotorCommand
from world_models.entries.location import Hypothesis
from world_models.entries.obstruction import Obstruction
from world_models.entries.percepts import Tracks
from world_models.entries.task import Goal, Leg, Milestone, Outcome, PlanSketch
from world_models.robot import RobotModel

HELD: Index[Hypothesis] = Index(Hypothesis, lambda h: h.is_held or None)
ACTIVE_GOAL: Index[Goal] = Index(Goal, lambda g: g.is_active or None)
OPEN_MILESTONE: Index[Milestone] = Index(Milestone, lambda m: m.is_open or None)
ACTIVE_SKETCH: Index[PlanSketch] = Index(PlanSketch, lambda s: s.goal if s.is_active else None)
OPEN_FAULT: Index[BodyFault] = Index(BodyFault, lambda f: f.is_open or None)


def held(view: View) -> Entry[Hypothesis] | None:
    """Where the robot believes it is."""
    return view.newest(HELD, True)


def standing_in(view: View, robot: RobotModel, locale: str) -> RobotModel:
    """The robot on the floor of a locale, behind whatever is known to stand before its camera."""
    obstruction = view.latest(Obstruction)
    return robot.with_obstruction(None if obstruction is None else obstruction.value).on_floor_of(locale)


def has_followed(view: View, settings: ActionSettings) -> bool:
    """Whether enough landmarks were in sight in the last tracked frame.

    A robot that holds so many landmarks in sight is at no other door: when they are not where they should be, all are
    given up.
    """
    tracks = view.latest(Tracks)
    if tracks is None:
        return False
    return sum(track.found_px is not None for track in tracks.value.items) >= settings.min_followed_landmarks


def active_goal(view: View) -> Entry[Goal] | None:
    return view.newest(ACTIVE_GOAL, True)


def open_milestone(view: View) -> Entry[Milestone] | None:
    """The milestone that is being looked for."""
    return view.newest(OPEN_MILESTONE, True)


def open_discrepancy(view: View, level: Level) -> Entry[Discrepancy] | None:
    """The newest discrepancy that is open at a level."""
    return view.newest(OPEN, level)


def unmeasured_doubt(view: View) -> Entry[Discrepancy] | None:
    """What the action level has passed up, while the plan level has not yet looked how far off it is."""
    doubt = open_discrepancy(view, Level.PLAN)
    return doubt if doubt is not None and doubt.value.magnitude is None else None


def deepest_sketch(view: View) -> Entry[PlanSketch] | None:
    """The most detailed active sketch for the active goal: the one that is being carried out (Figure 3)."""
    goal = active_goal(view)
    if goal is None:
        return None
    active = view.having(ACTIVE_SKETCH, goal.id)
    return max(active, key=lambda entry: len(entry.value.path), default=None)


def under_way(view: View) -> tuple[Entry[Leg], Entry[PlanSketch]] | None:
    """The leg that is being driven and the sketch that wants it; None when there is none."""
    leg, sketch = view.latest(Leg), deepest_sketch(view)
    if leg is None or sketch is None or leg.value.status != "moving":
        return None
    s = sketch.value
    return (leg, sketch) if s.verified and leg.value.sketch == sketch.id and s.at == leg.value.index else None


def last_motion(view: View) -> Entry[MotorCommand] | Entry[Course] | None:
    """What was asked of the wheels last."""
    command, course = view.latest(MotorCommand), view.latest(Course)
    if command is None or course is None:
        return command or course
    return course if course.cycle > command.cycle else command


def rolling(view: View) -> Entry[Course] | None:
    """The motion that goes on at present; None while the robot stands, or is to come to a stand."""
    last, course = last_motion(view), view.latest(Course)
    return course if course is not None and course is last and course.value.is_rolling else None


def is_heard(view: View) -> bool:
    """Whether what was asked of the wheels last was reported, and every report is in the belief."""
    belief, motion, report = held(view), last_motion(view), view.latest(MotionReport)
    if belief is None or motion is None:
        return belief is not None
    return report is not None and report.because == (motion.ref,) and belief.value.motion == report.id


def is_settled(view: View) -> bool:
    """Whether the robot stands, and where it thinks: no motion goes on, and every report is in the belief."""
    return is_heard(view) and rolling(view) is None


def is_in_doubt(view: View) -> bool:
    """Whether something is open above the action level that its level has not measured within its bound."""
    for level in (Level.PLAN, Level.GOAL):
        found = open_discrepancy(view, level)
        if found is not None and (found.value.magnitude is None or found.value.exceeds or level is Level.GOAL):
            return True
    action = open_discrepancy(view, Level.ACTION)
    return action is not None and action.value.exceeds


def open_fault(view: View) -> Entry[BodyFault] | None:
    """What is wrong with the body now; nobody moves while anything is."""
    return view.newest(OPEN_FAULT, True)


def is_over(view: View) -> bool:
    """Whether the mission has ended."""
    return view.latest(Outcome) is not None
