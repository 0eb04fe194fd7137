"""Conditions that several knowledge sources need, and what they bind: each declared once, with the words that tell it.

``harvey why RUN --not NAME`` says them: "it needs: standing; it was rolling".
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

from blackboard import Condition, Entry, Level, View
from knowledge_sources.methods.arrays import Floats
from knowledge_sources.reads.questions import (
    active_goal,
    deepest_sketch,
    find_belief,
    find_building,
    find_robot,
    find_robot_in,
    find_stop,
    is_given_up,
    is_in_doubt,
    is_over,
    is_standing,
    is_up_to_date,
    open_discrepancies,
    open_discrepancy,
    open_milestone,
    rolling_course,
    unmeasured_doubt,
)
from world_models.entries import CameraPicture, CameraState, Discrepancy, Hypothesis, Outcome, Travel
from world_models.frame_building import FrameBuilding
from world_models.frames import Pose2
from world_models.robot import RobotModel


@dataclass(frozen=True, eq=False)
class Belief:
    """Where the robot believes it is, with what follows from that for the moment of one act.

    Attributes:
        view: the board, as it is now.
        entry: the hypothesis that is held.
    """

    view: View
    entry: Entry[Hypothesis]

    @property
    def value(self) -> Hypothesis:
        return self.entry.value

    @property
    def locale(self) -> str:
        return self.entry.value.locale

    @cached_property
    def robot(self) -> RobotModel:
        """The robot on the floor of its locale, in the building as the board knows it."""
        return find_robot(self.view).on_floor_of(self.locale)

    @cached_property
    def seeing(self) -> RobotModel:
        """The same, with what is known to stand before its camera."""
        return find_robot_in(self.view, self.locale)

    @cached_property
    def world(self) -> FrameBuilding:
        """The building as far as its frames are on the board."""
        return find_building(self.view)

    @cached_property
    def pose(self) -> Pose2:
        """World frame."""
        return self.entry.value.world_from_robot(self.world)

    @cached_property
    def covariance(self) -> Floats:
        """(3, 3) over (x, y, heading), world frame."""
        return self.entry.value.covariance_world(self.world)

    def moved_to(
        self, pose: Pose2, covariance: Floats, basis: str, *, locale: str = "", motion: str = ""
    ) -> Hypothesis:
        """What is believed from now on: another pose with its covariance (3, 3), world frame, and what that rests on.

        In the same locale, and with the same motion taken into account, where no other is given. What may be false in
        the place that it starts from may be false in this one.
        """
        moved = Hypothesis.of_world(
            self.world, locale or self.locale, pose, covariance, basis, motion=motion or self.value.motion)
        return replace(moved, excess_m=self.value.excess_m, excess_rad=self.value.excess_rad)


def find_held(view: View) -> Belief | None:
    """The belief that is held."""
    found = find_belief(view)
    return None if found is None else Belief(view, found)


def _none_open(find: Callable[[View], Entry[Any] | None]) -> Callable[[View], bool]:
    return lambda view: find(view) is None


def _tell_open(find: Callable[[View], Entry[Any] | None], what: str) -> Callable[[View], str]:
    def tell(view: View) -> str:
        found = find(view)
        return what if found is None else f"{found.ref} was {what}"

    return tell


def _find_lost(view: View) -> Entry[Discrepancy] | None:
    return open_discrepancy(view, Level.GOAL)


def _list_doubts_above(view: View) -> list[Entry[Discrepancy]]:
    return [entry for entry in open_discrepancies(view) if entry.value.level is not Level.ACTION]


def _tell_motion(view: View) -> str:
    course = rolling_course(view)
    if course is not None:
        return f"it was rolling ({course.ref})"
    return "the last motion was not reported yet, or not in the belief"


def _tell_doubt(view: View) -> str:
    found = reversed(open_discrepancies(view))
    return ", ".join(f"{entry.ref} was open at the {entry.value.level} level" for entry in found)


NOT_ENDED = Condition("not ended", lambda view: view.latest(Outcome) is None, "it had")
NOT_GIVEN_UP = Condition("not given up", lambda view: not is_given_up(view), "it had ended")
GOING_ON = Condition("not over", lambda view: not is_over(view), "it had ended")
HELD = Condition("a belief", find_held, "none was held")
PICTURE: Condition[Entry[CameraPicture]] = Condition(
    "a picture", lambda view: view.latest(CameraPicture), "none was taken")
UP_TO_DATE = Condition("belief up to date", is_up_to_date, "the last one was not reported yet, or not in it")
STANDING = Condition("standing", is_standing, _tell_motion)
SURE = Condition("no doubt", lambda view: not is_in_doubt(view), _tell_doubt)
MEASURED = Condition("no unmeasured doubt", _none_open(unmeasured_doubt),
                     _tell_open(unmeasured_doubt, "not measured yet"))
NOT_LOST = Condition("not lost", _none_open(_find_lost), _tell_open(_find_lost, "open at the goal level"))
NO_DOUBT_ABOVE = Condition("no doubt above", lambda view: not _list_doubts_above(view), lambda view: (
    f"{', '.join(str(entry.ref) for entry in _list_doubts_above(view))} was open"))
DOUBTED = Condition("an unmeasured doubt", unmeasured_doubt, "none was open at the plan level")
PLAN_DOUBT = Condition(
    "a doubt at the plan level", lambda view: open_discrepancy(view, Level.PLAN), "none was open there")
LOST = Condition("lost", _find_lost, "nothing was open at the goal level")
SOUND = Condition("no fault", _none_open(find_stop), _tell_open(find_stop, "not over, or nobody has said go on since"))
MILESTONE = Condition("a milestone awaited", open_milestone, "none was")
NO_MILESTONE = Condition("no milestone awaited", _none_open(open_milestone), _tell_open(open_milestone, "awaited"))
GOAL = Condition("a goal", active_goal, "none was pursued")
SKETCH = Condition("a sketch", deepest_sketch, "there was none")
CAMERA: Condition[Entry[CameraState]] = Condition(
    "a camera", lambda view: view.latest(CameraState), "nobody has told of it")
WAY: Condition[Entry[Travel]] = Condition(
    "a way since a known place", lambda view: view.latest(Travel), "there was none")
