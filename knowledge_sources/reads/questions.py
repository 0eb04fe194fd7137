"""Questions that several knowledge sources ask of the board; pure reads."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from functools import lru_cache
from typing import Any

from blackboard import Blackboard, Entry, Index, Level, View
from world_models import words
from world_models.building.locale_frame import CHANGED, FRAME_OF, REDRAWN, LocaleFrame
from world_models.building.model_errors import WALL
from world_models.entries import (
    AROUND_SIGMA_RAD,
    GO_ON,
    OPEN,
    SENSES,
    BodyFault,
    CameraState,
    Command,
    Contact,
    Course,
    Difference,
    Discrepancy,
    Explanation,
    Footprint,
    Goal,
    Hypothesis,
    Impasse,
    Leg,
    Milestone,
    MotionReport,
    MotorCommand,
    Obstruction,
    Outcome,
    PlanSketch,
    Redirection,
    Tracks,
    Wheels,
)
from world_models.entries.difference import MODEL
from world_models.frame_building import FrameBuilding
from world_models.robot import RobotModel

MIN_FOLLOWED_LANDMARKS = 4
"""With so many landmarks in the last tracked frame, the robot is taken to be still in its room."""
WORTH_TELLING = 2.0
"""Below this log ratio of a sense everything is as expected."""
HELD: Index[Hypothesis] = Index(Hypothesis, lambda h: h.is_held or None, "held")
ACTIVE_GOAL: Index[Goal] = Index(Goal, lambda g: g.is_active or None, "active")
OPEN_MILESTONE: Index[Milestone] = Index(Milestone, lambda m: m.is_open or None, "open")
ACTIVE_SKETCH: Index[PlanSketch] = Index(PlanSketch, lambda s: s.goal if s.is_active else None, "active")
BUMPER, MAX_P_STUCK = "bumper", 0.03
"""What differs where the bumper feels what is not there; a touch tells nothing while that is likelier than this."""
NOWHERE = FrameBuilding(Blackboard().view)
"""A building of which nothing is known."""

EMERGENCY_STOPS = ("stopped", "base refuses")
"""What drivers call a fault that a person may have made by the robot's stop."""
OPEN_FAULT: Index[BodyFault] = Index(BodyFault, lambda f: f.is_open or None, "open")


def find_belief(view: View) -> Entry[Hypothesis] | None:
    """The hypothesis that is held: where the robot believes it is."""
    return view.newest(HELD, True)


def find_difference(view: View, about: str) -> Difference:
    """What is known of a difference."""
    known = view.latest(Difference, lambda difference: difference.about == about)
    return Difference.unknown(about) if known is None else known.value


def name_model(view: View) -> str:
    """What the difference of the whole building is called: of a model whose walls are redrawn little is known yet."""
    walls = {change.name for frame in view.having(REDRAWN, True) for change in frame.value.changes
             if change.what == "beside" and WALL in change.name}
    return f"{MODEL} with {words.count(len(walls), 'wall')} redrawn" if walls else MODEL


def rests_on(view: View, entry: Entry[Any], picture: str, steps: int = 4) -> bool:
    """Whether an entry rests on a picture by so few steps, as a belief on that of its milestone; not by older beliefs.
    """
    causes = (view.get(ref.id) for ref in entry.because if steps > 1)
    return any(ref.id == picture for ref in entry.because) or any(
        rests_on(view, cause, picture, steps - 1) for cause in causes
        if cause is not None and not isinstance(cause.value, Hypothesis))


def find_camera(view: View) -> CameraState:
    """The camera as the board knows it. Raises LookupError where it is not posted."""
    camera = view.latest(CameraState)
    if camera is None:
        raise LookupError("expected the robot's camera on the board, got none")
    return camera.value


def find_robot(view: View, camera: CameraState | None = None) -> RobotModel:
    """The robot as the board knows it, in the building as the board knows it; with another ``camera`` if one is given.

    Raises:
        LookupError: its camera, wheels or footprint is not posted.
    """
    known, wheels, footprint = view.latest(CameraState), view.latest(Wheels), view.latest(Footprint)
    if known is None or wheels is None or footprint is None:
        raise LookupError("expected the robot's camera, wheels and footprint on the board, got not all of them")
    return _build_robot(camera or known.value, wheels.value, footprint.value).in_building(FrameBuilding(view))


@lru_cache(maxsize=8)
def _build_robot(camera: CameraState, wheels: Wheels, footprint: Footprint) -> RobotModel:
    """A robot in no building yet; the same cameras for the same state, as views are cached by them."""
    return RobotModel(NOWHERE, camera.pinhole, camera.mount, wheels.actuator, footprint.radius_m, camera.lens,
                      wheels.continuous)


def find_robot_in(view: View, locale: str, camera: CameraState | None = None) -> RobotModel:
    """The robot on the floor of a locale, with what is known to stand before its camera; with another ``camera``."""
    obstruction, robot = view.latest(Obstruction), find_robot(view, camera)
    return robot.with_obstruction(None if obstruction is None else obstruction.value).on_floor_of(locale)


def find_building(view: View) -> FrameBuilding:
    """The building as far as its frames are on the board; asking for more asks the world for it."""
    return FrameBuilding(view)


def find_building_as_filed(view: View) -> FrameBuilding | None:
    """The building without the things that it was found to have besides; None where it was found to have none."""
    changed = [entry.value for entry in view.having(CHANGED, True)]
    instead = [bare for frame in changed if (bare := frame.without_finds()) is not frame]
    return FrameBuilding(view, instead, "without finds") if instead else None


def find_frames(view: View, locales: Iterable[str]) -> tuple[Entry[LocaleFrame], ...]:
    """The frames of locales, by name. Raises MissingEntryError for those that are not on the board."""
    names = sorted(set(locales))
    find_building(view).require(names)
    return tuple(entry for name in names if (entry := view.newest(FRAME_OF, name)) is not None)


def find_followed(view: View) -> tuple[Entry[Tracks], ...]:
    """The landmarks that are followed, if enough of them were in sight in the last tracked frame; else ().

    With so many landmarks in sight the robot is at no other door: the correlator tracker drops all of them when
    they are not where they should be.
    """
    tracks = view.latest(Tracks)
    if tracks is None:
        return ()
    in_sight = sum(track.found_px is not None for track in tracks.value.items)
    return (tracks,) if in_sight >= MIN_FOLLOWED_LANDMARKS else ()


def active_goal(view: View) -> Entry[Goal] | None:
    """The goal that is pursued."""
    return view.newest(ACTIVE_GOAL, True)


def open_milestone(view: View) -> Entry[Milestone] | None:
    """The milestone that is being looked for."""
    return view.newest(OPEN_MILESTONE, True)


def open_discrepancy(view: View, level: Level) -> Entry[Discrepancy] | None:
    """The newest discrepancy that is open at a level."""
    return view.newest(OPEN, level)


def open_discrepancies(view: View) -> tuple[Entry[Discrepancy], ...]:
    """The newest open discrepancy of each level that has one, the lowest level first."""
    found = (open_discrepancy(view, level) for level in Level)
    return tuple(entry for entry in found if entry is not None)


def unmeasured_doubt(view: View) -> Entry[Discrepancy] | None:
    """What the action level has passed up and the plan level has not measured yet."""
    doubt = open_discrepancy(view, Level.PLAN)
    return doubt if doubt is not None and doubt.value.magnitude is None else None


def deepest_sketch(view: View) -> Entry[PlanSketch] | None:
    """The most detailed active sketch for the active goal: the one that is being carried out (Figure 3)."""
    goal = active_goal(view)
    if goal is None:
        return None
    active = view.having(ACTIVE_SKETCH, goal.id)
    return max(active, key=lambda entry: len(entry.value.path), default=None)


def current_leg(view: View) -> tuple[Entry[Leg], Entry[PlanSketch]] | None:
    """The leg that is being driven, and its sketch; None when no leg is."""
    leg, sketch = view.latest(Leg), deepest_sketch(view)
    if leg is None or sketch is None or leg.value.status != "moving":
        return None
    s = sketch.value
    return (leg, sketch) if s.verified and leg.value.sketch == sketch.id and s.at == leg.value.index else None


def last_motion(view: View) -> Entry[MotorCommand] | Entry[Course] | None:
    """The last motion that was asked of the wheels."""
    command, course = view.latest(MotorCommand), view.latest(Course)
    if command is None or course is None:
        return command or course
    return course if course.cycle > command.cycle else command


def list_touches(view: View) -> list[Entry[Contact]]:
    """What was touched in a known direction, the oldest first; nothing while the bumper may stay pressed."""
    stuck = find_difference(view, BUMPER).find("bumper")
    return [] if stuck is not None and stuck.p > MAX_P_STUCK else list(
        view.where(Contact, lambda touch: touch.sigma_rad < AROUND_SIGMA_RAD))


def find_contact(view: View, request: str) -> Entry[Contact] | None:
    """The newest contact of the motion that this request asked for."""
    return next((entry for entry in view.newest_first(Contact) if entry.because[0].id == request), None)


def rolling_course(view: View) -> Entry[Course] | None:
    """The course that is being driven; None while the robot stands or is to stop."""
    last, course = last_motion(view), view.latest(Course)
    return course if course is not None and course is last and course.value.is_rolling else None


def is_up_to_date(view: View) -> bool:
    """Whether the last motion was reported, and the belief includes the report."""
    belief, motion, report = find_belief(view), last_motion(view), view.latest(MotionReport)
    if belief is None or motion is None:
        return belief is not None
    return report is not None and report.because == (motion.ref,) and belief.value.motion == report.id


def is_standing(view: View) -> bool:
    """Whether the robot stands, and the belief includes every motion."""
    return is_up_to_date(view) and rolling_course(view) is None


def is_in_doubt(view: View) -> bool:
    """Whether a discrepancy is open that its level has not measured within its bound."""
    for level in (Level.PLAN, Level.GOAL):
        found = open_discrepancy(view, level)
        if found is not None and (found.value.magnitude is None or found.value.exceeds or level is Level.GOAL):
            return True
    action = open_discrepancy(view, Level.ACTION)
    return action is not None and action.value.exceeds


def find_stop(view: View) -> Entry[Contact] | Entry[BodyFault] | None:
    """Why the robot does not move: a fault of the body that is open; or, where the mission asks for that, a contact or
    an emergency stop after which nobody has said go on yet.
    """
    fault, command = view.newest(OPEN_FAULT, True), view.latest(Command)
    if fault is not None or command is None or not command.value.asks_to_restart:
        return fault
    word = view.latest(Redirection, lambda asked: asked.text == GO_ON)
    stops = view.latest(Contact), view.latest(BodyFault, lambda fault: fault.what in EMERGENCY_STOPS)
    return next((stop for stop in stops if stop is not None and (word is None or stop.cycle > word.cycle)), None)


def is_over(view: View) -> bool:
    """Whether the mission has ended, or does unless somebody sees a way on."""
    return view.latest(Outcome) is not None or open_impasse(view) is not None


def is_given_up(view: View) -> bool:
    """Whether the mission has ended, or does by what no other look can change."""
    return view.latest(Outcome) is not None or view.latest(Impasse, lambda i: i.is_open and not i.behind) is not None


def open_impasse(view: View) -> Entry[Impasse] | None:
    """What ends the mission unless somebody sees a way on."""
    return view.latest(Impasse, lambda impasse: impasse.is_open)


def is_worth_telling(view: View, about: str, explained: Sequence[Explanation]) -> bool:
    """Whether a sense would explain something better than chance; what acquits it is told once it was accused."""
    accused = bool(find_difference(view, about).rivals)
    return bool(explained) and (
        accused or any(e.log_ratio > WORTH_TELLING for e in explained if e.kind in SENSES))
