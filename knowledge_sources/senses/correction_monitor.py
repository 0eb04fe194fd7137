"""Correction monitor (§3.2): how pictures say that the robot moved, against what the wheels counted."""

from __future__ import annotations

import math
from collections.abc import Iterable

import numpy as np

from blackboard import Change, Effect, Level, Post, Posted, View, Watch, rule
from knowledge_sources.methods.arrays import Floats
from knowledge_sources.methods.belief import hedge
from knowledge_sources.priority import Priority
from knowledge_sources.reads import HELD, add_reports, is_worth_telling
from knowledge_sources.reads.motion_between import MOTION, SHARED_SIGMA_RAD, WHEELS_PART, has_moved_standing, list_asked
from knowledge_sources.reads.place_believed import MAX_P_RIVAL
from world_models.actuator import ActuatorModel
from world_models.building.locale_frame import FrameRequest
from world_models.entries import (
    LAST_REPORTS,
    SHARED_SIGMA_M,
    Certificate,
    Drift,
    Evidence,
    Explanation,
    MotionReport,
    PoseFix,
    RivalKind,
)
from world_models.frames import Pose2

BEND_RAD_PER_M, ASIDE_M_PER_RAD = 0.1, 0.05
"""Wheels that turn wrongly bend so much, and slip so far aside, one standard deviation."""
MIN_REACH_M = 0.2
"""A shorter way does not tell how far the wheels go."""
ELSEWHERE = 1.0, 1.0, 1.0
"""How far off a robot is that was pushed or carried, or takes one place for another [m, m, rad]."""
P_MOVED, P_STOOD = 0.001, 0.3
"""Part of the pairs of pictures, while the wheels stand, in which all moves by chance, as by a push just then; and in
which nothing moves though they are late: it had stood for long enough."""


def tells_place(certificate: Certificate) -> bool:
    """Whether a picture tells a place, be it held back as a sense may lie: else nothing could acquit that sense."""
    return certificate.verdict != "refuted" and certificate.p_false <= MAX_P_RIVAL


def find_otherwise(view: View, trigger: Change) -> Post | None:
    """What is not as expected of the way since the certificate before; None where all is, or not all is known.

    A picture that never changes says that the robot stands, and one that changes while the wheels stand is late. Wheels
    may go another part of the way than they count, or turn otherwise than is stated: that is told apart, as a turn says
    nothing of the first, nor a straight way of the second. If they went as they were asked, and counted something else,
    the count is wrong.
    """
    before = view.latest(Certificate, lambda c: c is not trigger.entry.value)
    if before is None or not tells_place(before.value):
        return None
    began, ended = view.get(before.value.fix), view.get(trigger.entry.value.fix)
    reports = view.since(MotionReport, before.cycle)
    if began is None or ended is None or not 0 < len(reports) < LAST_REPORTS:
        return None
    seen, here = began.value.world_from_robot.inverse() @ ended.value.world_from_robot, ended.value.world_from_robot
    actuator, drift, is_late = HELD.of(view).robot.actuator, view.latest(Drift), has_moved_standing(view)
    known = Drift.unknown(actuator, here.heading_rad) if drift is None else drift.value
    explained = _explain(seen, _spread(began.value, ended.value), actuator, known, [one.value for one in reports],
                         list_asked(view, reports), is_late)
    if not is_worth_telling(view, MOTION, explained):
        return None
    shows = "all moves in pictures while the wheels stand" if is_late else (
        f"by pictures it moved {seen.x_m:+.2f} m ahead and {math.degrees(seen.heading_rad):+.0f} degrees")
    told = Evidence(MOTION, shows, explained, here.x_m, here.y_m, here.heading_rad, 0.0, 0.0,
                    reports[-1].value.sim_time_s)
    return Post(told, (trigger.entry, began, ended, *reports))


def _spread(began: PoseFix, ended: PoseFix) -> Floats:
    """(3, 3) covariance of the motion by two pictures, in the robot's frame at its begin."""
    c, s = math.cos(began.world_from_robot.heading_rad), math.sin(began.world_from_robot.heading_rad)
    turn = np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]])
    moved = began.world_from_robot.inverse() @ ended.world_from_robot
    arm = np.array([[1.0, 0.0, -moved.y_m], [0.0, 1.0, moved.x_m], [0.0, 0.0, 1.0]])  # a heading moves the far end
    shared = np.diag(np.square([SHARED_SIGMA_M, SHARED_SIGMA_M, SHARED_SIGMA_RAD]))
    return np.asarray(arm @ turn @ began.covariance @ turn.T @ arm.T + turn @ ended.covariance @ turn.T + 2.0 * shared)


def _explain(
    seen: Pose2, spread: Floats, actuator: ActuatorModel, drift: Drift, reports: list[MotionReport],
    asked: list[MotionReport], is_late: bool | None,
) -> tuple[Explanation, ...]:
    """What each rival makes of a motion by pictures, with its covariance, of what the wheels report of it, and of what
    was asked of them.
    """
    rolled = add_reports(actuator, drift, reports)
    moved, off = rolled.moved, seen.minus(rolled.moved)
    usual = spread + np.diag(np.square([rolled.sigma_m, rolled.sigma_m, rolled.sigma_rad]))
    stated = add_reports(actuator, Drift.unknown(actuator, 0.0), reports)  # how they turn was learnt, be it wrong
    as_stated = spread + np.diag(np.square([stated.sigma_m, stated.sigma_m, stated.sigma_rad]))
    bend = seen.minus(stated.moved)
    gone_m, turned_rad = (math.fsum(abs(part) for part in parts) for parts in (
        (one.move_m for one in reports), (one.turn_rad for one in reports)))
    aside_m = ASIDE_M_PER_RAD * turned_rad + BEND_RAD_PER_M * gone_m**2 / 2.0
    along = np.array([*moved.position, 0.0])
    bent = np.diag(np.square([aside_m, aside_m, WHEELS_PART * turned_rad + BEND_RAD_PER_M * gone_m]))
    plain = _log_density(off, usual)
    told = add_reports(actuator, drift, asked).moved
    ratios: dict[RivalKind, float] = {
        "wheels": _log_density(off, usual + WHEELS_PART**2 * np.outer(along, along)) - plain,
        "turns": _log_density(bend, as_stated + bent) - _log_density(bend, as_stated),
        "still camera": _log_density(seen.minus(Pose2(0.0, 0.0, 0.0)), spread) - plain,
        "odometry": _log_density(seen.minus(told), usual) - plain,
        "elsewhere": _log_density(off, usual + np.diag(np.square(ELSEWHERE))) - plain}
    if is_late is not None:  # pictures that are late tell nothing else of the way
        ratios = {"late pictures": -math.log(P_MOVED)} if is_late else ratios | {"late pictures": math.log(P_STOOD)}
    reach, sigma = _measure_reach(seen, moved, usual, actuator.reach)
    what = {"wheels": f"wheels that go {reach:.2f} m a metre" if sigma else "wheels that go another part of the way",
            "turns": f"wheels that turned by {math.degrees(bend[2]):+.1f} degrees more than they count",
            "late pictures": "pictures that show where the robot was before",
            "still camera": "a camera whose picture does not change",
            "odometry": f"wheels that counted {moved.x_m - told.x_m:+.2f} m more than they went",
            "elsewhere": "a robot that was moved, or is elsewhere"}
    return (Explanation("chance", "chance", 0.0), *(
        Explanation(kind, what[kind], left, *((reach, sigma) if kind == "wheels" else ()))
        for kind, left in hedge(ratios).items()))


def _measure_reach(seen: Pose2, moved: Pose2, spread: Floats, reach: float) -> tuple[float, float]:
    """How far the wheels go a metre commanded, by pictures, and its deviation; 0 where the way is too short to tell."""
    way_m = math.hypot(moved.x_m, moved.y_m)
    if way_m < MIN_REACH_M:
        return 0.0, 0.0
    along = moved.position / way_m
    sigma_m = math.sqrt(float(along @ spread[:2, :2] @ along))
    return reach * float(along @ seen.position) / way_m, reach * sigma_m / way_m


def _log_density(off: Floats, covariance: Floats) -> float:
    """Of a Gaussian (3,) about zero, but for what all have in common."""
    return -0.5 * float(off @ np.linalg.solve(covariance, off) + np.linalg.slogdet(covariance)[1])


@rule(on=Watch(Certificate, (Posted,), tells_place), writes=(Evidence, FrameRequest), needs=(HELD,),
      bind=find_otherwise, priority=Priority.ENTER, level=Level.PLAN)
def correction_monitor(_view: View, case: Post) -> Iterable[Effect]:
    """Says where the motion from one picture to the next is not the one that the wheels counted."""
    yield case
