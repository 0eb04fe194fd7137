"""Yaw calibrator (§3.2): learns how far the camera looks aside of where the robot drives."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from blackboard import Change, Effect, Level, Revise, Revised, View, Watch
from knowledge_sources.methods.calibration import LEAST_SIGMA_RAD, compute_camera_covariance, to_tuples
from knowledge_sources.priority import Priority
from knowledge_sources.reads import CAMERA, HELD, STANDING, WAY, Belief
from knowledge_sources.robot_knowledge_source import RobotKnowledgeSource
from world_models.camera import CAMERA_UNKNOWNS, YAW
from world_models.entries import CameraState, Drift, Hypothesis, Milestone, Travel, begin_travel, turn_about_camera
from world_models.frames import wrap_angle

MIN_TRAVEL_M = 1.0  # shortest way by which the yaw is learnt
MAX_TRAVEL_M = 15.0  # a longer way is not measured: what the wheels slip adds up
MIN_STRAIGHTNESS = 0.9  # part of the way's length that its ends are apart; of a more bent one nothing is learnt
HEADING_SIGMA_RAD = math.radians(0.33)
"""Standard deviation of the headings on a way of one metre; they average (three times how far yaws were off in 15
missions with nominal cameras, in four kinds of places, development seeds 7301 to 7306: a wall that stands elsewhere
bends a way too)."""
MAX_YAW_SIGMAS = 3.0  # a way that ends further aside than this tells nothing of the yaw
MIN_LEARNT = 0.05  # the yaw is revised when its variance shrinks by this part


class Measured(NamedTuple):
    """The yaw after a way: by how much it differs from what is believed, and its variance; None: it tells nothing."""

    step_rad: float = 0.0
    variance: float | None = None


class YawCalibrator(RobotKnowledgeSource):
    """Learns the camera's yaw on the robot from the direction in which the robot came from one milestone to another.

    No single picture can tell it from the robot's heading. Where the heading is wrong by the yaw, the robot reaches a
    place next to the one that the wheels and the headings say. With the yaw the believed heading turns, as the camera's
    own direction is what is known. A way on which something pushed or stopped the robot, or it was lost, tells nothing.
    """

    level, priority = Level.ACTION, Priority.ENTER
    on = (Watch(Hypothesis, (Revised,), lambda h: h.is_held and h.basis == "milestone"),)
    needs = (HELD, STANDING, CAMERA, WAY)
    writes = (CameraState, Hypothesis, Drift, Travel)

    def bind(self, view: View, trigger: Change) -> Measured | None:
        """What a way tells of the yaw: more than is known, or it is spent, so that another begins."""
        travel, camera, milestone = WAY.of(view), CAMERA.of(view), view.latest(Milestone)
        if milestone is not None and milestone.value.is_inexact:  # an inexact model bends the way
            return None
        measured = self._measure(camera.value, travel.value, HELD.of(view))
        known = compute_camera_covariance(camera.value)[YAW, YAW]
        is_measured = measured.variance is not None and measured.variance < (1.0 - MIN_LEARNT) * known
        return measured if is_measured or self._is_spent(travel.value) else None

    def act(self, view: View, case: Measured) -> Iterable[Effect]:
        travel, camera, held, (step_rad, told) = WAY.of(view), CAMERA.of(view), HELD.of(view), case
        belief, pose, way = held.entry, held.pose, travel.value
        if told is not None:
            covariance = compute_camera_covariance(camera.value)
            covariance[YAW, :] = covariance[:, YAW] = 0.0
            covariance[YAW, YAW] = max(told, LEAST_SIGMA_RAD**2)
            step = [0.0] * len(CAMERA_UNKNOWNS)
            step[YAW] = step_rad
            learnt = replace(camera.value.moved(step), covariance=to_tuples(covariance))
            yield Revise(camera, learnt, (travel, belief, camera))
            yield from _turn(view, held, camera.value, -step_rad)
            way = way.turned(-step_rad, camera.value.mount.forward_m)
        if self._is_spent(way):
            here = turn_about_camera(pose, -step_rad, camera.value.mount.forward_m)
            variance = float(compute_camera_covariance(camera.value)[YAW, YAW])
            way = begin_travel(here, held.covariance,
                               camera.value.mount.yaw_rad + step_rad,
                               variance if told is None else told)
        yield Revise(travel, way, (travel, belief))

    def _is_spent(self, travel: Travel) -> bool:
        """Whether a way is too long or too bent to measure more by it, or the robot was pushed or lost on it."""
        return travel.is_broken or travel.gone_m > MAX_TRAVEL_M or (
            travel.gone_m > MIN_TRAVEL_M and travel.net_m < MIN_STRAIGHTNESS * travel.gone_m)

    def _measure(self, camera: CameraState, travel: Travel, belief: Belief) -> Measured:
        """The yaw by the whole way, from what was known when it began; nothing where the way tells too little.

        Nor does a way tell anything that ends where no likely yaw leads: something else has moved the robot.
        """
        pose = belief.pose
        if travel.is_broken:
            return Measured()
        way = travel.seen(pose.heading_rad)
        came = pose.position - travel.began.position
        net_m = way.net_m
        if net_m < MIN_TRAVEL_M or net_m < MIN_STRAIGHTNESS * way.gone_m:
            return Measured()
        off_rad = wrap_angle(math.atan2(came[1], came[0]) - math.atan2(way.y_m, way.x_m))
        aside = np.array([-way.y_m, way.x_m]) / net_m
        ends = np.array(travel.covariance)[:2, :2] + belief.covariance[:2, :2]
        noise = (float(aside @ ends @ aside) + way.slip_m2) / net_m**2 + travel.covariance[2][2]
        noise += HEADING_SIGMA_RAD**2 / net_m
        gain = travel.yaw_variance / (travel.yaw_variance + noise)
        # The heading is too large by as much as the yaw is too small: the robot came to the right of it.
        believed = camera.mount.yaw_rad
        step_rad = believed - off_rad - travel.yaw_rad
        if step_rad**2 > MAX_YAW_SIGMAS**2 * (travel.yaw_variance + noise):
            return Measured()
        yaw = travel.yaw_rad + gain * step_rad
        return Measured(yaw - believed, (1.0 - gain) * travel.yaw_variance)


def _turn(view: View, belief: Belief, camera: CameraState, turn_rad: float) -> Iterable[Effect]:
    """Turn the believed heading, and the one that the drift is measured from."""
    here = turn_about_camera(belief.pose, turn_rad, camera.mount.forward_m)
    yield Revise(belief.entry, belief.moved_to(here, belief.covariance, belief.value.basis), (belief.entry,))
    drift = view.latest(Drift)
    if drift is not None:
        yield Revise(drift, replace(drift.value, heading_rad=drift.value.heading_rad + turn_rad), (drift,))
