"""The knowledge sources of a robot that somebody else drives, beside those of Harvey that read pictures and search.

They sit only at a board whose run names them: no other run has them.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import replace
from typing import Any

import numpy as np

from blackboard import Change, Effect, Entry, Level, Post, Posted, Revise, Revised, View, Watch
from knowledge_sources.methods.calibration import compute_camera_covariance
from knowledge_sources.methods.verification import list_seen_locales, predict_milestone
from knowledge_sources.priority import Priority
from knowledge_sources.reads import (
    HELD,
    LOST,
    NO_MILESTONE,
    NOT_LOST,
    PLACED_BY,
    find_camera,
    find_frames,
    find_panorama,
)
from knowledge_sources.robot_knowledge_source import RobotKnowledgeSource
from world_models.camera import YAW
from world_models.entries import (
    CameraPicture,
    Certificate,
    Discrepancy,
    Hypothesis,
    Milestone,
    MotionReport,
    Obstruction,
    PlaceSearch,
    Travel,
    begin_travel,
)

CONTRADICTED = 2
"""So many pictures one after the other that contradict the believed place, and it is lost."""
MIN_P_WRONG, MIN_EXPECTED = 0.95, 8
"""A picture contradicts a place from this probability of a wrong one, where at least so many lines should be seen."""
MOST_SIGMA_M, MOST_SIGMA_RAD = 0.8, 0.3
"""A belief that is less sure is none."""
MOST_GLIMPSES = 8
"""After so many looks that did not tell the place, the search begins again: the robot has gone on meanwhile."""


UNCOUNTED_M_PER_S, UNCOUNTED_RAD_PER_S = 0.5, 0.8
"""How fast a robot is taken to move, one standard deviation, that tells nothing of its wheels."""


def is_uncounted(report: MotionReport) -> bool:
    """Whether a report says only that time passed: it stands for the odometry of a robot that has none."""
    return report.turn_rad == report.move_m == 0.0


def contradicts(verdict: Certificate) -> bool:
    """Whether a picture in which much should be seen speaks against the place, be the camera well known or not."""
    return verdict.verdict == "refuted" or (verdict.p_wrong >= MIN_P_WRONG and verdict.expected >= MIN_EXPECTED)


class ClaimReckoner(RobotKnowledgeSource):
    """Moves the belief by what the wheels of a robot report that somebody else drives, and keeps the way it came.

    The heading is the camera's less a yaw that is not exactly known: by that, too, the robot may have come aside.
    """

    level, priority = Level.ACTION, Priority.ENTER
    on = (Watch(MotionReport, (Posted,)),)
    needs = (HELD,)
    writes = (Hypothesis, Travel)

    def act(self, view: View, case: Change) -> Iterable[Effect]:
        told, held = case.entry, HELD.of(view)
        report, world = told.value, held.robot.world
        pose, covariance = held.robot.actuator.propagate_move(
            held.pose, held.covariance, report.turn_rad, report.move_m)
        if is_uncounted(report):
            gone = report.duration_s * np.array([UNCOUNTED_M_PER_S, UNCOUNTED_M_PER_S, UNCOUNTED_RAD_PER_S])
            covariance = covariance + np.diag(gone**2)
        there = world.locale_at([*pose.position, world.floor_m(held.locale)])
        locale = there if there and world.is_room(there) else held.locale
        camera, travel = find_camera(view), view.latest(Travel)
        yaw_variance = float(compute_camera_covariance(camera)[YAW, YAW])
        aside = np.array([held.pose.y_m - pose.y_m, pose.x_m - held.pose.x_m, 0.0])
        covariance = covariance + np.outer(aside, aside) * yaw_variance
        moved = held.moved_to(pose, covariance, "odometry", locale=str(locale), motion=told.id)
        yield Revise(held.entry, moved, (told, held.entry))
        if is_uncounted(report):
            return
        way = (begin_travel(held.pose, held.covariance, camera.mount.yaw_rad, yaw_variance)
               if travel is None or held.value.basis in PLACED_BY else travel.value)
        slip_m = held.robot.actuator.skitter_m * min(1.0, abs(report.turn_rad) / (math.pi / 2.0))
        way = way.after_motion(held.pose, pose, slip_m)
        yield Post(way, (told,)) if travel is None else Revise(travel, way, (told, travel))


class ViewExpecter(RobotKnowledgeSource):
    """Says, before a picture is read, what it should show of the place where the robot is believed to be."""

    level, priority = Level.PLAN, Priority.ENTER
    on = (Watch(CameraPicture, (Posted,), lambda picture: picture.purpose == "milestone"),)
    needs = (HELD, NOT_LOST, NO_MILESTONE)
    writes = (Milestone,)

    def act(self, view: View, case: Change) -> Iterable[Effect]:
        belief, hidden = HELD.of(view), view.all(Obstruction)[-1:]
        robot, pose = belief.seeing, belief.pose
        here = Milestone("", 0, "the place where it believes to be", pose.heading_rad)
        expected = predict_milestone(robot, pose, here, "")
        frames = find_frames(view, list_seen_locales(robot, pose, belief.locale))
        yield Post(expected, (case.entry, belief.entry, *hidden, *frames))


class LossDeclarer(RobotKnowledgeSource):
    """Declares a robot lost that somebody else drives: contradicted twice, or hardly known any more where it is.

    One picture that contradicts the place may be of somebody who walks by: what it leaves open at the plan level ends
    with the next one. Where a search has not told the place in so many looks, it begins again: after one where nothing
    is known of the way from one look to the next.
    """

    level, priority = Level.PLAN, Priority.ENTER
    on = (
        Watch(Certificate, (Posted,), contradicts),
        Watch(Discrepancy, (Posted, Revised), lambda doubt: doubt.exceeds and doubt.level is Level.PLAN),
        Watch(Hypothesis, (Posted, Revised), lambda h: h.is_held and (
            h.sigma_m > MOST_SIGMA_M or h.sigma_rad > MOST_SIGMA_RAD)),
        Watch(PlaceSearch, (Posted,), lambda search: search.status != "found"),
    )
    writes = (Discrepancy,)

    def bind(self, view: View, trigger: Change) -> Entry[Any] | None:
        value, doubt = trigger.entry.value, LOST.find(view)
        if isinstance(value, PlaceSearch):
            panorama, report = None if doubt is None else find_panorama(view, doubt), view.latest(MotionReport)
            most = 1 if report is not None and is_uncounted(report.value) else MOST_GLIMPSES
            return None if panorama is None or len(panorama.value.glimpses) < most else trigger.entry
        if isinstance(value, Certificate):
            last = view.all(Certificate)[-CONTRADICTED:]
            if len(last) < CONTRADICTED or not all(contradicts(one.value) for one in last):
                return None
        return trigger.entry if doubt is None or isinstance(value, Discrepancy) else None

    def act(self, view: View, case: Entry[Any]) -> Iterable[Effect]:
        value, bound_px = case.value, self._settings.plan.max_deviation_px
        if isinstance(value, Discrepancy):
            yield Revise(case, value.corrected(), (case,))
        elif isinstance(value, PlaceSearch):
            doubt = LOST.of(view)
            yield Revise(doubt, replace(doubt.value, times=doubt.value.times + 1), (doubt, case))
        else:
            last = view.all(Certificate)[-CONTRADICTED:] if isinstance(value, Certificate) else (case,)
            what = (f"{len(last)} pictures contradict the place where it believes to be"
                    if isinstance(value, Certificate) else f"its place is known to {value.sigma_m:.1f} m only")
            yield Post(Discrepancy(Level.GOAL, what, None, (0.0, bound_px), "px"), last)


class PlaceConfirmer(RobotKnowledgeSource):
    """Ends the doubt of a lost robot whose place a search has found: its looks are the evidence."""

    level = closes = Level.GOAL
    priority = Priority.CORRECT
    on = (Watch(Hypothesis, (Revised,), lambda h: h.is_held and h.basis == "relocalization"),)
    needs = (LOST,)
    writes = (Discrepancy,)

    def bind(self, view: View, trigger: Change) -> tuple[Entry[Hypothesis], Entry[Discrepancy]]:
        return trigger.entry, LOST.of(view)

    def act(self, view: View, case: tuple[Entry[Hypothesis], Entry[Discrepancy]]) -> Iterable[Effect]:
        place, doubt = case
        yield Revise(doubt, doubt.value.corrected(), (place, doubt))
