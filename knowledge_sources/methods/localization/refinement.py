"""Refine a rough pose with several views: iterated closest lines, and one Kalman update for each view."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numba import njit

from knowledge_sources.methods.arrays import Floats, Ints
from knowledge_sources.methods.localization.views import CameraView
from knowledge_sources.methods.pose import planar_from_lines
from knowledge_sources.methods.verification.predicted_lines import predict_lines
from knowledge_sources.settings import DEFAULT, Settings
from knowledge_sources.settings.localization import LocalizationSettings
from world_models.frames import Pose2, wrap_angle
from world_models.robot import RobotModel


def refine_pose(
    robot: RobotModel, views: Sequence[CameraView], pose: Pose2, settings: Settings = DEFAULT
) -> tuple[Pose2, Floats]:
    """Refine a rough pose of the robot now, by all views together; returns the pose and its covariance (3, 3).

    Views with a known turn come first, and of these the view in which most model lines are visible: once the pose is
    known from it, clutter in the others, or a wrong turn, does no harm.
    """
    tuning = settings.localization
    sigma_m, sigma_rad = tuning.candidate_sigma_m, tuning.candidate_sigma_rad
    covariance = np.diag([sigma_m**2, sigma_m**2, sigma_rad**2])
    visible = [len(predict_lines(robot, view.pose_then(pose), settings.verification)) for view in views]
    order = sorted(zip(visible, views, strict=True), key=lambda pair: (_is_turn_uncertain(pair[1], tuning), -pair[0]))
    for _, view in order:
        pose, covariance = _update(robot, view, pose, covariance, settings)
    return pose, covariance


def refine_view_motions(
    robot: RobotModel, views: Sequence[CameraView], pose: Pose2, covariance: Floats, settings: Settings = DEFAULT
) -> tuple[CameraView, ...]:
    """Refine where the robot was at each view, given its pose now and the covariance (3, 3).

    Only of views whose turn level lines have not measured: a turn known to a few degrees would count against the pose.
    """
    out = []
    for view in views:
        if _is_turn_uncertain(view, settings.localization):
            prior, _ = _predict_covariance(pose, covariance, view)
            start = _search_turn(robot, view, pose, settings)
            then, _ = _solve(robot, view, view.pose_then(pose), prior, start, settings)
            view = replace(view, now_from_then=pose.inverse() @ then)
        out.append(view)
    return tuple(out)


def _is_turn_uncertain(view: CameraView, settings: LocalizationSettings) -> bool:
    return bool(view.covariance[2, 2] > settings.known_turn_rad**2)


def _search_turn(robot: RobotModel, view: CameraView, pose: Pose2, settings: Settings) -> Pose2:
    """Of the headings that a view may have had, the one with most pairs of segment and line, then the nearest."""
    tuning, step = settings.localization, settings.localization.turn_step_rad
    most = int(tuning.turn_search_sigmas * math.sqrt(float(view.covariance[2, 2])) / step)
    turns = sorted((k * step for k in range(-most, most + 1)), key=abs)
    tried = [view.pose_then(pose) @ Pose2(0.0, 0.0, turn) for turn in turns]
    predicted = [predict_lines(robot, then, settings.verification).segments_px for then in tried]
    pairs = [_pair(lines, view.segments_px, tuning.coarse_gate_px, tuning) for lines in predicted]
    return tried[int(np.argmax([len(p) for p in pairs]))]


def _update(
    robot: RobotModel, view: CameraView, pose: Pose2, covariance: Floats, settings: Settings
) -> tuple[Pose2, Floats]:
    """Kalman update of the pose now by one view.

    The covariance of the motion since then keeps its share of the correction (Schmidt-Kalman).
    """
    then = view.pose_then(pose)
    prior, lever = _predict_covariance(pose, covariance, view)
    uncertain = _is_turn_uncertain(view, settings.localization)
    start = _search_turn(robot, view, pose, settings) if uncertain else then
    solved, posterior = _solve(robot, view, then, prior, start, settings)
    gain = np.linalg.solve(prior, lever @ covariance).T
    off = gain @ (solved.x_m - then.x_m, solved.y_m - then.y_m, wrap_angle(solved.heading_rad - then.heading_rad))
    now = Pose2(pose.x_m + float(off[0]), pose.y_m + float(off[1]), wrap_angle(pose.heading_rad + float(off[2])))
    return now, np.asarray(covariance - gain @ (prior - posterior) @ gain.T)


def _predict_covariance(pose: Pose2, covariance: Floats, view: CameraView) -> tuple[Floats, Floats]:
    """(3, 3) covariance of the robot's pose at a view, world, and its Jacobian (3, 3) by the pose now."""
    then, lever, turn = view.pose_then(pose), np.eye(3), np.eye(3)
    lever[0, 2], lever[1, 2] = -(then.y_m - pose.y_m), then.x_m - pose.x_m
    c, s = math.cos(pose.heading_rad), math.sin(pose.heading_rad)
    turn[:2, :2] = ((c, -s), (s, c))
    return lever @ covariance @ lever.T + turn @ view.covariance @ turn.T, lever


def _solve(
    robot: RobotModel, view: CameraView, then: Pose2, prior: Floats, start: Pose2, settings: Settings
) -> tuple[Pose2, Floats]:
    """The pose at a view, and its covariance: pair and solve, with a coarse and a fine gate.

    Both are those of the prior where there are too few pairs.
    """
    tuning, solved, posterior = settings.localization, start, prior
    for gate_px in (tuning.coarse_gate_px, tuning.fine_gate_px):
        lines = predict_lines(robot, solved, settings.verification)
        pairs = _pair(lines.segments_px, view.segments_px, gate_px, tuning)
        if len(pairs) < tuning.min_pairs:
            break
        model, data = pairs[:, 0], pairs[:, 1]
        fix = planar_from_lines(
            lines.lines_world[model], view.segments_px[data], robot.camera, robot.mount.camera_from_robot, then,
            prior_covariance=prior, landmark_ids=lines.landmark[model].tolist(),
            sigma_px=settings.features.sigma_across_px, settings=settings.pose,
        )
        solved, posterior = fix.world_from_robot, np.asarray(fix.covariance)
    return (then if posterior is prior else solved), posterior


def _pair(lines_px: Floats, segments_px: Floats, gate_px: float, settings: LocalizationSettings) -> Ints:
    """(p, 2) indices of lines (m, 2, 2) and segments (k, 2, 2): each segment along a line, with the nearest one."""
    nearest = _find_nearest(
        np.array(lines_px, float, order="C"), np.array(segments_px, float, order="C"), gate_px,
        math.sin(settings.gate_rad), settings.min_pair_overlap)
    data = np.flatnonzero(nearest >= 0)
    return np.column_stack([nearest[data], data])


@njit(cache=True, error_model="numpy")
def _find_nearest(lines: Any, segments: Any, gate_px: float, sine: float, min_overlap: float) -> Any:
    """(k,) index of the nearest line of about the direction of each segment, -1 where there is none."""
    out = np.full(len(segments), -1, np.int64)
    for k in range(len(segments)):
        best = gate_px
        du, dv = segments[k, 1, 0] - segments[k, 0, 0], segments[k, 1, 1] - segments[k, 0, 1]
        size = max(math.hypot(du, dv), 1e-9)
        for i in range(len(lines)):
            u, v = lines[i, 1, 0] - lines[i, 0, 0], lines[i, 1, 1] - lines[i, 0, 1]
            length = max(math.hypot(u, v), 1e-9)
            u, v = u / length, v / length
            if abs(u * dv - v * du) > sine * size:
                continue
            low, high, off = math.inf, -math.inf, 0.0
            for e in range(2):
                x, y = segments[k, e, 0] - lines[i, 0, 0], segments[k, e, 1] - lines[i, 0, 1]
                off = max(off, abs(x * v - y * u))
                low, high = min(low, x * u + y * v), max(high, x * u + y * v)
            shared = min(high, length) - max(low, 0.0)
            if off < best and shared > min_overlap * (high - low):
                out[k], best = i, off
    return out
