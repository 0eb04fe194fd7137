"""Dead reckoner (§3.2): the belief follows the odometry, with the covariance of the actuator model."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from blackboard import Change, Effect, Entry, Level, Post, Posted, Revise, View, Watch
from knowledge_sources.methods.calibration import compute_camera_covariance
from knowledge_sources.priority import Priority
from knowledge_sources.reads import HELD, PLACED_BY, bound_wheels_m, find_camera, find_contact
from knowledge_sources.robot_knowledge_source import RobotKnowledgeSource
from world_models.actuator import ActuatorModel
from world_models.camera import YAW
from world_models.entries import (
    BodyFault,
    Course,
    Discrepancy,
    Drift,
    Hypothesis,
    MotionReport,
    MotorCommand,
    PictureRequest,
    Travel,
    begin_travel,
)
from world_models.frames import Pose2

MAX_COUNTED_BESIDE_M = 0.02  # a base stops, and counts, as near as this to what was asked of it
MIN_CLAIMED_PART = 0.7  # if the wheels claim less than this part of a move, something stopped the robot


class DeadReckoner(RobotKnowledgeSource):
    """Moves the belief by the odometry's report, corrected for drift, and asks for a picture to check it.

    Of a motion that was broken off, the unreported rest may have been driven in part or whole: it is added to the
    covariance. So is the error of the heading that comes from the camera's own unknown yaw.
    """

    level, priority = Level.ACTION, Priority.ENTER
    on = (Watch(MotionReport, (Posted,)),)
    needs = (HELD,)
    writes = (Hypothesis, Drift, Travel, PictureRequest, Discrepancy)

    def bind(self, view: View, trigger: Change) -> Entry[MotionReport] | None:
        """A report that the belief does not include yet."""
        return None if HELD.of(view).value.motion == trigger.entry.id else trigger.entry

    def act(self, view: View, case: Entry[MotionReport]) -> Iterable[Effect]:
        reported, held = case, HELD.of(view)
        belief, report = held.entry, reported.value
        robot, before = held.robot, held.pose
        world, actuator = robot.world, robot.actuator
        known = view.latest(Drift)
        drift = Drift.unknown(actuator, before.heading_rad) if known is None else known.value
        request = view.get(reported.because[0].id)
        on_the_move = request is not None and isinstance(request.value, Course)
        pose, covariance = (actuator.propagate_course if on_the_move else actuator.propagate_move)(
            before, held.covariance, report.turn_rad, report.move_m, drift.curvature_per_m
        )
        camera = find_camera(view)
        yaw_variance = float(compute_camera_covariance(camera)[YAW, YAW])
        covariance = covariance + _compute_aside_covariance(before, pose, yaw_variance)
        there = world.locale_at([*pose.position, world.floor_m(belief.value.locale)])
        locale = there if there and world.is_room(there) else belief.value.locale  # in a doorway: still the old room
        fault = None if request is None else view.latest(BodyFault, lambda f: f.request == request.id)
        if request is not None and fault is not None:
            missing = _compute_missing_motion(request.value, report, actuator)
            covariance = covariance + _compute_partial_covariance(pose, *missing)
        moved = held.moved_to(pose, covariance, "odometry", locale=str(locale), motion=reported.id)
        more_m, suspected = bound_wheels_m(view, actuator, report.move_m)
        contact = None if request is None else find_contact(view, request.id)
        beside_m = 0.0 if request is None or on_the_move else abs(report.move_m - request.value.move_m)
        if beside_m > MAX_COUNTED_BESIDE_M and fault is None and contact is None:  # one of both is wrong
            more_m += beside_m
        moved = replace(moved, excess_m=moved.excess_m + more_m)
        step = Revise(belief, moved, (reported, belief, *suspected, *(() if fault is None else (fault,))))
        yield step
        rolled = drift.after_motion(actuator, report.turn_rad, report.move_m, on_the_spot=not on_the_move)
        yield Post(rolled, (reported,)) if known is None else Revise(known, rolled, (reported, known))
        travel = view.latest(Travel)
        if travel is None or belief.value.basis in PLACED_BY:
            way = begin_travel(before, held.covariance, camera.mount.yaw_rad, yaw_variance)
        else:
            way = travel.value
        slip_m = actuator.skitter_m * min(1.0, abs(report.turn_rad) / (math.pi / 2.0))
        way = way.after_motion(before, pose, slip_m)
        yield Post(way, (reported,)) if travel is None else Revise(travel, way, (reported, travel))
        if not on_the_move or fault is not None:  # on the move a picture was taken
            yield Post(PictureRequest("track"), (step,))
        if request is None or fault is not None:
            return
        what = "something was touched on the move" if on_the_move else (
            f"something stopped the robot: the wheels report {report.move_m:.2f} m of {request.value.move_m:.2f} m")
        is_short = not on_the_move and report.move_m < MIN_CLAIMED_PART * request.value.move_m
        if contact is not None or is_short:
            bound_px = self._settings.plan.max_deviation_px
            stopped = Discrepancy(Level.ACTION, what, math.inf, (bound_px, bound_px), "px")
            yield Post(stopped, (reported,) if contact is None else (reported, contact))


def _compute_aside_covariance(before: Pose2, after: Pose2, yaw_variance: float) -> NDArray[np.float64]:
    """(3, 3) of where the robot came to, as its heading is the camera's less a yaw that is not exactly known."""
    ahead = after.position - before.position
    aside = np.array([-ahead[1], ahead[0], 0.0])
    return np.asarray(np.outer(aside, aside) * yaw_variance)


def _compute_missing_motion(
    request: MotorCommand | Course, report: MotionReport, actuator: ActuatorModel
) -> tuple[float, float]:
    """What may have been driven beyond the report: (turn [rad], move [m])."""
    if isinstance(request, Course):
        return 0.0, actuator.stopping_distance_m()
    return request.turn_rad - report.turn_rad, request.move_m - report.move_m


def _compute_partial_covariance(pose: Pose2, turn_rad: float, move_m: float) -> NDArray[np.float64]:
    """(3, 3) second moment, world frame, of a TURN and a MOVE of which any part may have been driven.

    A part that is uniform in 0..d has the second moment d^2 / 3.
    """
    ahead = np.array([math.cos(pose.heading_rad), math.sin(pose.heading_rad), 0.0]) * move_m
    turned = np.array([0.0, 0.0, turn_rad])
    return np.asarray((np.outer(ahead, ahead) + np.outer(turned, turned)) / 3.0)
