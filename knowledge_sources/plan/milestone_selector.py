"""Milestone selector (§3.3, §4): chooses the view for a milestone, and predicts its landmarks."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from blackboard.board import View
from blackboard.change import Change, Posted, Revised, Watch
from blackboard.effect import Effect, Post, Revise
from blackboard.entry import Entry
from blackboard.level import Level
from blackboard.servoing import Discrepancy
from knowledge_sources.methods.localization.aliasing import precompute_views
from knowledge_sources.methods.verification.line_check import (
    ViewQuality,
    compute_view_quality,
    find_errors,
    predict_lines,
)
from knowledge_sources.methods.verification.predicted_colors import predict_face_colors
from knowledge_sources.questions import (
    deepest_sketch,
    find_belief,
    find_building,
    find_frames,
    find_robot_in,
    has_followed,
    is_over,
    is_standing,
    open_discrepancy,
    open_milestone,
    unmeasured_doubt,
)
from knowledge_sources.robot_knowledge_source import OlderSource
from knowledge_sources.settings import DEFAULT, Settings
from world_models.building.building import Building
from world_models.building.model_errors import pack_errors
from world_models.entries.body import PictureRequest
from world_models.entries.location import Hypothesis
from world_models.entries.obstacle import Obstruction
from world_models.entries.task import Certificate, Milestone, PlanSketch, Subgoal
from world_models.frames import Pose2, wrap_angle
from world_models.robot import RobotModel
from world_models.visibility.lines_and_points import VisibleLines

MAX_LOOK_ERROR_RAD = math.radians(3.5)  # the robot faces a milestone when its heading is off by no more than this
MAX_COUNTED_LENGTH_PX = 120.0  # a line longer than this is no clearer than one of this length
MAX_COUNTED_CONTRAST = 0.3  # a line of more contrast than this is no clearer than one of this contrast
MAX_SIGMA_PART = 0.3  # a view is good if it tells the place to this part of the subgoal's tolerance
MAX_SIGMA_RAD = math.radians(0.25)  # a view is good if it tells the heading to this standard deviation
MIN_LINES = 10  # fewest lines of a good view
CHECK_TOLERANCE_M = 0.1  # tolerance that a view is chosen by where no subgoal states one
MIN_LOOK_DIFFERENCE_RAD = math.radians(20.0)  # looks whose directions differ by less show much the same
INDEPENDENT_LOOK_RAD = math.radians(65.0)
"""Looks that differ by so much show nothing twice; nearer ones count less (the field of view)."""


class MilestoneSelector(OlderSource):
    """Predicts what should be seen before a subgoal (M0 first), and asks for the picture.

    It prefers the present view, then the next one on the way, then the one that tells the place best; before a leg that
    begins with a long turn the view along that leg, as the turn leaves the heading open. Where a view was not testable,
    it tries another. It also checks the belief when tracking failed, first in the present view. What an
    obstruction hides is not expected.
    """

    level = Level.PLAN
    on = (
        Watch(PlanSketch, (Posted, Revised), lambda s: s.is_active and not s.verified),
        Watch(Discrepancy, (Posted, Revised)),
        Watch(Hypothesis, (Revised,), lambda h: h.is_held),
        Watch(Milestone, (Revised,), lambda m: not m.is_open),
        Watch(Obstruction, (Posted, Revised)),
    )
    writes = (Milestone, PictureRequest)

    def judge(self, view: View, trigger: Change) -> float | None:
        if isinstance(trigger.entry.value, Obstruction):
            return 0.9 if find_belief(view) is not None and _awaited_milestone(view) is not None else None
        task = self._find_task(view)
        if task is None:
            return None
        return 0.7 if isinstance(task.value, Discrepancy) else 0.5

    def answer(self, view: View, trigger: Change) -> Iterable[Effect]:
        belief = find_belief(view)
        if belief is None:
            return
        if isinstance(trigger.entry.value, Obstruction):
            yield from self._expect_again(view, trigger.entry, belief)
            return
        task, waiting = self._find_task(view), open_milestone(view)
        if task is None:
            return
        if isinstance(task.value, PlanSketch):
            yield from self._propose(view, task, belief)
        elif waiting is None:
            yield from self._check_belief(view, task, belief)
        else:
            here = replace(waiting.value, look_heading_rad=_find_heading(view, belief.value))
            yield from self._look_for(view, waiting, here, task, belief, _car_of(view.get(here.sketch), here.index))

    def _find_task(self, view: View) -> Entry[Any] | None:
        """What needs a look now: a doubt, a milestone that is faced, or a sketch whose milestone is due."""
        belief, waiting = find_belief(view), open_milestone(view)
        if belief is None or is_over(view) or not is_standing(view) or open_discrepancy(view, Level.GOAL) is not None:
            return None
        if waiting is not None and waiting.value.status == "expected":
            return None
        doubt = unmeasured_doubt(view)
        if doubt is not None and (waiting is None or waiting.cycle < doubt.cycle):
            return doubt
        if waiting is not None:
            return waiting if self._faces(view, belief.value, waiting.value) else None
        sketch = deepest_sketch(view)
        return sketch if sketch is not None and not sketch.value.verified else None

    def _check_belief(self, view: View, doubt: Entry[Discrepancy], belief: Entry[Hypothesis]) -> Iterable[Effect]:
        """Check the belief in the present view; if that was not testable, in another one."""
        tried = _tried_headings(view, lambda m: m.cycle >= doubt.cycle)
        check = Milestone("", -1, f"check of the belief, because {doubt.value.what}", _find_heading(view, belief.value),
                          tried=tried)
        if not tried:
            yield from self._look_for(view, None, check, doubt, belief)
            return
        robot, pose = _find_robot_and_pose(view, belief.value)
        headings = self._find_untried(self._turned_headings(pose), tried) or [pose.heading_rad]
        heading = choose_heading(robot, pose, headings, CHECK_TOLERANCE_M, settings=self._settings)
        turned = replace(check, look_heading_rad=heading)
        yield Post(replace(turned, log_odds_so_far=self._sum_told(view, turned)), (doubt, belief))

    def _expect_again(self, view: View, hidden: Entry[Obstruction], belief: Entry[Hypothesis]) -> Iterable[Effect]:
        """Predict a milestone again whose picture is taken, without what the obstruction hides."""
        waiting = _awaited_milestone(view)
        if waiting is None:
            return
        m, (robot, pose) = waiting.value, _find_robot_and_pose(view, belief.value)
        seen = predict_milestone(robot, pose, m, _car_of(view.get(m.sketch), m.index), self._settings)
        frames = find_frames(view, _list_locales(robot, pose, belief.value, self._settings))
        yield Revise(waiting, seen, (hidden, waiting, belief, *frames))

    def _propose(self, view: View, sketch: Entry[PlanSketch], belief: Entry[Hypothesis]) -> Iterable[Effect]:
        """Propose the milestone before the sketch's next subgoal, seen in the first good direction."""
        robot, pose = _find_robot_and_pose(view, belief.value)
        s = sketch.value
        tried = _tried_headings(view, lambda m: (m.value.sketch, m.value.index) == (sketch.id, s.at))
        heading = self._choose_direction(robot, s, pose, tried)
        milestone = Milestone(sketch.id, s.at, f"M{s.at} of {s.locale or 'the route'}", heading, tried=tried)
        milestone = replace(milestone, log_odds_so_far=self._sum_told(view, milestone))
        if self._faces(view, belief.value, milestone):
            yield from self._look_for(view, None, milestone, sketch, belief, _car_of(sketch, s.at))
        else:
            yield Post(milestone, (sketch, belief))

    def _look_for(
        self, view: View, old: Entry[Milestone] | None, milestone: Milestone, task: Entry[Any],
        belief: Entry[Hypothesis], car: str = "",
    ) -> Iterable[Effect]:
        """Predict the landmarks from the believed pose, without those of an elevator's car, and ask for the picture."""
        hidden, (robot, pose) = view.latest(Obstruction), _find_robot_and_pose(view, belief.value)
        expected = predict_milestone(robot, pose, milestone, car, self._settings)
        if not has_followed(view, self._settings.action) or open_discrepancy(view, Level.PLAN) is not None:
            precompute_views(robot, belief.value.locale, pose, self._settings)  # the judge asks: another door?
        frames = find_frames(view, _list_locales(robot, pose, belief.value, self._settings))
        because = (task, belief, *frames) if hidden is None else (task, belief, hidden, *frames)
        wish = Post(expected, because) if old is None else Revise(old, expected, because)
        yield wish
        yield Post(PictureRequest("milestone"), (wish,))

    def _sum_told(self, view: View, milestone: Milestone) -> float:
        """The log odds of a wrong place by the looks for a milestone in other directions, of an inexact model.

        A look counts less the nearer its direction is to another's: what both show is no evidence twice.
        """
        last, s = view.latest(Milestone), self._settings.plan
        certificate = view.latest(Certificate)
        if not milestone.tried or last is None or certificate is None or certificate.value.milestone != last.id:
            return 0.0
        c = certificate.value
        if not last.value.displacement_modes or c.matched < self._settings.verification.min_matched_lines:
            return last.value.log_odds_so_far
        p = min(max(c.p_false, 1e-9), 1.0 - 1e-9)
        apart = min(abs(wrap_angle(milestone.look_heading_rad - heading)) for heading in milestone.tried)
        said = min(max(math.log(p / (1.0 - p)), -s.max_told), s.max_told)
        return last.value.log_odds_so_far + min(1.0, apart / INDEPENDENT_LOOK_RAD) * said

    def _choose_direction(self, robot: RobotModel, sketch: PlanSketch, pose: Pose2, tried: Sequence[float]) -> float:
        before = sketch.subgoals[sketch.at - 1] if sketch.at else None
        headings = self._find_untried(self._candidate_headings(robot.world, sketch, pose), tried)
        tolerance_m = before.tolerance_m if before else CHECK_TOLERANCE_M
        return choose_heading(robot, pose, headings, tolerance_m, _car(sketch, sketch.at), self._settings)

    def _candidate_headings(self, building: Building, sketch: PlanSketch, pose: Pose2) -> Iterator[float]:
        wanted = sketch.subgoals[sketch.at - 1].destination if sketch.at else None
        if wanted is not None and wanted.heading_rad is not None:
            yield wanted.in_world(building).heading_rad
        along = None if sketch.current is None else self._find_leg_heading(building, sketch.current, pose)
        if along is not None and abs(wrap_angle(along - pose.heading_rad)) > self._settings.plan.long_turn_rad:
            yield along  # few landmarks are followed through such a turn: it is done before the look
        yield pose.heading_rad
        if sketch.current is not None:
            end = sketch.current.destination.in_world(building)
            yield math.atan2(end.y_m - pose.y_m, end.x_m - pose.x_m)
        yield from self._turned_headings(pose)

    def _find_leg_heading(self, building: Building, subgoal: Subgoal, pose: Pose2) -> float | None:
        """Where the robot will face as it begins to drive [rad, world]; None where it has no way to drive."""
        end = subgoal.destination.in_world(building)
        if not subgoal.primitive or pose.distance_to(end) <= subgoal.tolerance_m:
            return None
        return math.atan2(end.y_m - pose.y_m, end.x_m - pose.x_m)

    def _turned_headings(self, pose: Pose2) -> Iterator[float]:
        """The headings that are tried for a better view [rad, world]."""
        return (wrap_angle(pose.heading_rad + turn) for turn in self._settings.plan.look_turns_rad)

    def _find_untried(self, headings: Iterable[float], tried: Sequence[float]) -> list[float]:
        """The headings whose views differ from those that were tried."""
        least = MIN_LOOK_DIFFERENCE_RAD
        return [h for h in headings if all(abs(wrap_angle(h - other)) > least for other in tried)]

    def _faces(self, view: View, belief: Hypothesis, milestone: Milestone) -> bool:
        error = wrap_angle(_find_heading(view, belief) - milestone.look_heading_rad)
        return abs(error) <= MAX_LOOK_ERROR_RAD


def _find_robot_and_pose(view: View, belief: Hypothesis) -> tuple[RobotModel, Pose2]:
    """The robot on its floor, and the believed pose in the world."""
    robot = find_robot_in(view, belief.locale)
    return robot, belief.world_from_robot(robot.world)


def _list_locales(robot: RobotModel, pose: Pose2, belief: Hypothesis, settings: Settings) -> set[str]:
    """The believed locale, and those of the landmarks that should be seen from a pose."""
    lines = predict_lines(robot, pose, settings.verification)
    marks = [lines.marks[int(i)] for i in np.unique(lines.landmark)]
    return {belief.locale, *(name for mark in marks for name in (mark.locale, mark.neighbour) if name)}


def _find_heading(view: View, belief: Hypothesis) -> float:
    """The believed heading [rad, world]."""
    return belief.world_from_robot(find_building(view)).heading_rad


def _awaited_milestone(view: View) -> Entry[Milestone] | None:
    """The milestone whose picture was asked for and is not judged."""
    waiting = open_milestone(view)
    return waiting if waiting is not None and waiting.value.status == "expected" else None


def _car_of(sketch: Entry[PlanSketch] | None, index: int) -> str:
    return "" if sketch is None else _car(sketch.value, index)


def _car(sketch: PlanSketch, index: int) -> str:
    """The elevator's car in which a ride before a milestone ends, or "": it looks the same on every floor."""
    before = sketch.subgoals[index - 1] if index > 0 else None
    return before.destination.locale if before is not None and before.is_ride else ""


def _tried_headings(view: View, is_same: Callable[[Entry[Milestone]], bool]) -> tuple[float, ...]:
    """The headings in which the last milestone, if it is the same one, was not testable."""
    last = view.latest(Milestone)
    if last is None or last.value.status != "not testable" or not is_same(last):
        return ()
    return (*last.value.tried, last.value.look_heading_rad)


def choose_heading(
    robot: RobotModel, pose: Pose2, headings: Iterable[float], tolerance_m: float, car: str = "",
    settings: Settings = DEFAULT,
) -> float:
    """The first heading whose view is good enough for a tolerance, else the best one [rad, world]."""
    rated: list[tuple[ViewQuality, float]] = []
    for heading in headings:
        quality = _compute_quality(robot, Pose2(pose.x_m, pose.y_m, heading), car, settings)
        if is_good_view(quality, tolerance_m):
            return heading
        rated.append((quality, heading))
    best = min(range(len(rated)), key=lambda i: (rated[i][0].lines < MIN_LINES, rated[i][0].sigma_m, i))
    return rated[best][1]


def is_good_view(quality: ViewQuality, tolerance_m: float) -> bool:
    """Whether a view tells place and heading well enough for a tolerance, by enough lines."""
    sharp = quality.sigma_m <= MAX_SIGMA_PART * tolerance_m and quality.sigma_rad <= MAX_SIGMA_RAD
    return sharp and quality.lines >= MIN_LINES


def predict_milestone(
    robot: RobotModel, pose: Pose2, milestone: Milestone, car: str = "", settings: Settings = DEFAULT
) -> Milestone:
    """The milestone with the lines and colours that should be seen from a pose, without those of ``car``."""
    lines = _predict_clear_lines(robot, pose, car, settings)
    marks = sorted({int(i) for i in lines.landmark})
    errors = find_errors(robot, lines)
    return replace(
        milestone,
        landmarks=tuple(lines.marks[i].name for i in marks),
        expected=_to_tuples(lines.lines_world),
        expected_px=_to_tuples(lines.segments_px),
        landmark_of=tuple(marks.index(int(i)) for i in lines.landmark),
        face_colors=predict_face_colors(robot, pose),
        displacement_modes=errors.displacement_modes,
        displacements=pack_errors(errors),
        status="expected",
    )


def _compute_quality(robot: RobotModel, pose: Pose2, car: str, settings: Settings) -> ViewQuality:
    lines = _predict_clear_lines(robot, pose, car, settings)
    return compute_view_quality(
        lines.lines_world, robot.camera, robot.mount.camera_from_robot, pose, settings.features.sigma_across_px)


def _predict_clear_lines(robot: RobotModel, pose: Pose2, car: str, settings: Settings) -> VisibleLines:
    """The clearest lines that should be seen from a pose, long ones with contrast, without those of ``car``."""
    lines = predict_lines(robot, pose, settings.verification)
    if car:
        marks = [lines.marks[int(i)] for i in lines.landmark]
        lines = lines[np.array([car not in (mark.locale, mark.neighbour) for mark in marks], bool)]
    s = settings.plan
    if len(lines) <= s.max_lines:
        return lines
    lengths = np.linalg.norm(lines.segments_px[:, 1] - lines.segments_px[:, 0], axis=1)
    clear = np.minimum(lengths, MAX_COUNTED_LENGTH_PX) * np.minimum(lines.contrast, MAX_COUNTED_CONTRAST)
    return lines[np.sort(np.argsort(-clear, kind="stable")[:s.max_lines])]


def _to_tuples(array: NDArray[np.float64]) -> tuple[tuple[tuple[float, ...], ...], ...]:
    return tuple(tuple(map(tuple, line)) for line in array.tolist())
