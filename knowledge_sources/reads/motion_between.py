"""The motion between two pictures: by what is believed of both places, or by the wheels if they tell it better (§3.2).

Two beliefs of which each is off by half a degree tell the motion between them to 0.7 degrees only, as nobody knows how
much of that they have in common. On a straight way the wheels tell it to 0.2.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from itertools import islice
from statistics import NormalDist

import numpy as np

from blackboard import Entry, View
from knowledge_sources.methods.arrays import Floats
from knowledge_sources.methods.features import compute_mean_and_deviation, is_dark, measure_moved, read_picture
from knowledge_sources.methods.floor import TYPICAL_M, MotionBetween
from knowledge_sources.reads.conditions import Belief
from knowledge_sources.reads.questions import rolling_course
from world_models.actuator import ActuatorModel
from world_models.entries import (
    RISK,
    BodyFault,
    CameraPicture,
    Difference,
    Drift,
    FloorView,
    MotionReport,
    MotorCommand,
)
from world_models.frames import Pose2, wrap_angle

MOTION = "motion"
"""What differs where pictures and wheels do not agree on the way."""
WHEELS_PART = 0.25
"""Wheels that are wrong go by such a part more or less than they count, one standard deviation."""
SHARED_SIGMA_RAD = 0.0014
"""What a model, a camera and a matcher share of the heading (as ``SHARED_SIGMA_M`` of the place)."""
MIN_MOVED, MAX_STOOD_S = 0.04, 1.0
"""Part of the edges, in both halves of a picture, that move as the robot goes by a centimetre; and so long after the
wheels have stopped pictures tell whether they are late."""
MAX_APART_SIGMAS = 3.0
"""Wheels that say otherwise than what is believed by more than this slipped, or the robot was pushed."""


def find_motion_between(
    view: View, then: FloorView, now: Belief
) -> tuple[MotionBetween, tuple[Entry[MotionReport] | Entry[Drift], ...]]:
    """The motion from where a picture was kept to where the robot is believed to be now, and what told of it beside the
    belief.
    """
    believed = _compare_beliefs(then, now)
    reports = list_reports(view, then.motion, now.value.motion)
    drift = view.latest(Drift)
    if drift is None or not reports or any(is_broken(view, report) for report in reports):
        return believed, ()
    rolled = add_reports(now.robot.actuator, drift.value, [report.value for report in reports])
    off = believed.moved.position - rolled.moved.position
    turned = wrap_angle(believed.moved.heading_rad - rolled.moved.heading_rad)
    is_apart = (abs(turned) > MAX_APART_SIGMAS * math.hypot(believed.sigma_rad, rolled.sigma_rad)
                or math.hypot(*off) > MAX_APART_SIGMAS * math.hypot(believed.sigma_m, rolled.sigma_m))
    return believed if is_apart else min(believed, rolled, key=_measure_unsure_m), (drift, *reports)


def add_reports(actuator: ActuatorModel, drift: Drift, reports: list[MotionReport]) -> MotionBetween:
    """The motion that wheels report, the oldest part first; their errors are taken as one and the same."""
    moved = Pose2(0.0, 0.0, 0.0)
    for report in reports:
        moved = moved @ actuator.predict_motion(report.turn_rad, report.move_m, drift.curvature_per_m)
    bent = math.hypot(drift.sigma_per_m, actuator.bend_sigma_per_m)
    known = replace(actuator, curvature_sigma_per_m=bent)
    return MotionBetween(moved, *_spread(known.motion_covariance(
        math.fsum(abs(report.turn_rad) for report in reports), math.fsum(report.move_m for report in reports))))


def has_moved_standing(view: View) -> bool | None:
    """Whether all moves between the last two pictures, though the wheels stood; None where it is not known."""
    pictures, report = [entry.value for entry in islice(view.newest_first(CameraPicture), 2)], view.latest(MotionReport)
    if len(pictures) < 2 or report is None or rolling_course(view) is not None:
        return None
    if not all(picture.jpeg for picture in pictures):  # a recorded run is asked without its pictures
        return None
    last_s, first_s = (picture.sim_time_s - report.value.sim_time_s for picture in pictures)
    if not 0.0 <= first_s < last_s <= MAX_STOOD_S:
        return None
    now, before = (read_picture(picture.jpeg).half[..., 1] for picture in pictures)
    return None if is_dark(*compute_mean_and_deviation(now)) else measure_moved(before, now) >= MIN_MOVED


def bound_wheels_m(view: View, actuator: ActuatorModel, way_m: float) -> tuple[float, tuple[Entry[Difference], ...]]:
    """How much further off a belief may be after a way, at its risk, where the wheels are only suspected to go another
    part of it, and what says so; not where they are known to go so.
    """
    known = view.latest(Difference, lambda difference: difference.about == MOTION)
    wheels = None if known is None else known.value.find("wheels")
    if known is None or wheels is None or wheels.p <= RISK:
        return 0.0, ()
    if abs(wheels.off - actuator.reach) <= MAX_APART_SIGMAS * math.hypot(wheels.sigma, actuator.reach_sigma):
        return 0.0, ()
    return WHEELS_PART * abs(way_m) * NormalDist().inv_cdf(1.0 - 0.5 * RISK / wheels.p), (known,)


def list_asked(view: View, reports: Sequence[Entry[MotionReport]]) -> list[MotionReport]:
    """The reports as they would be if each motion were the one that was asked for; of a course nothing was asked, nor
    of a recording.
    """
    asked = [view.get(report.because[0].id) if report.because else None for report in reports]
    return [replace(report.value, turn_rad=of.value.turn_rad, move_m=of.value.move_m)
            if of is not None and isinstance(of.value, MotorCommand) else report.value
            for report, of in zip(reports, asked, strict=True)]


def _measure_unsure_m(motion: MotionBetween) -> float:
    """How unsure it leaves where floor is seen that is so far away."""
    return motion.sigma_m + TYPICAL_M * motion.sigma_rad


def _compare_beliefs(then: FloorView, now: Belief) -> MotionBetween:
    sigma_m, sigma_rad = _spread(now.covariance)
    moved = Pose2(then.x_m, then.y_m, then.heading_rad).inverse() @ now.pose
    return MotionBetween(moved, math.hypot(then.sigma_m, sigma_m), math.hypot(then.sigma_rad, sigma_rad))


def _spread(covariance: Floats) -> tuple[float, float]:
    """Standard deviations [m, rad] of a pose with covariance (3, 3)."""
    return math.sqrt(max(float(np.trace(covariance[:2, :2])) / 2.0, 0.0)), math.sqrt(max(float(covariance[2, 2]), 0.0))


def list_reports(view: View, since: str, until: str) -> list[Entry[MotionReport]]:
    """The reports after one up to another, the oldest first; none where not all of them are on the board any more."""
    between: list[Entry[MotionReport]] = []
    for report in view.newest_first(MotionReport):
        if report.id == since:
            return between[::-1]
        if between or report.id == until:
            between.append(report)
    return []


def is_broken(view: View, report: Entry[MotionReport]) -> bool:
    """Whether the motion was broken off: the wheels do not tell all of it."""
    asked = report.because[0].id
    return view.latest(BodyFault, lambda fault: fault.request == asked) is not None
