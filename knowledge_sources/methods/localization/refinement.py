"""From about the right pose to the exact one: what is seen is paired with the nearest model lines, look by look."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

from knowledge_sources.methods.features.lines import SIGMA_ACROSS_PX
from knowledge_sources.methods.localization.views import CameraView
from knowledge_sources.methods.pose import planar_from_lines
from knowledge_sources.methods.verification.predicted_lines import predict_lines
from world_models.frames import Pose2, wrap_angle
from world_models.robot import RobotModel

Floats = NDArray[np.float64]

ROUGH = np.diag([0.15**2, 0.15**2, math.radians(1.5) ** 2])
ROUGH.setflags(write=False)
"""(3, 3) How far off a proposal may be."""
GATES_PX = (16.0, 4.0)
"""Round by round, how far a segment may be from its model line."""
GATE_RAD = 0.12
LEAST_PAIRS = 3
MOST_KNOWN_RAD = math.radians(0.5)
"""Turns that are known better than this are not asked about again."""
TURN_RAD, TURNS_SIGMA = math.radians(1.5), 2.5
"""Turns that are known less well are tried in such steps, as far as so many of their standard deviations."""


def refine_pose(robot: RobotModel, glances: Sequence[CameraView], pose: Pose2) -> tuple[Pose2, Floats]:
    """The pose now, with its covariance (3, 3), that the glances show together near a rough one.

    The glance of which the model has most comes first, of those whose turn is known: what another shows of things that
    the model lacks, or aside of where it is looked for, misleads nobody any more when the pose is known from it.
    """
    covariance = np.array(ROUGH)
    rich = [len(predict_lines(robot, glance.then(pose))) for glance in glances]
    for _, glance in sorted(zip(rich, glances, strict=True), key=lambda pair: (_is_unsure(pair[1]), -pair[0])):
        pose, covariance = _with(robot, glance, pose, covariance)
    return pose, covariance


def refine_view_motions(
    robot: RobotModel, glances: Sequence[CameraView], pose: Pose2, covariance: Floats
) -> tuple[CameraView, ...]:
    """The glances with the motions between them as they must have been if the robot is at a pose (covariance (3, 3)).

    Only of motions whose turn level lines have not told: a turn that is known but to a few degrees would else count
    against the pose.
    """
    out = []
    for glance in glances:
        if _is_unsure(glance):
            prior, _ = _prior(pose, covariance, glance)
            then, _ = _fix(robot, glance, glance.then(pose), prior, _best_turn(robot, glance, pose))
            glance = replace(glance, now_from_then=pose.inverse() @ then)
        out.append(glance)
    return tuple(out)


def _is_unsure(glance: CameraView) -> bool:
    return bool(glance.covariance[2, 2] > MOST_KNOWN_RAD**2)


def _best_turn(robot: RobotModel, glance: CameraView, pose: Pose2) -> Pose2:
    """Of the headings a glance may have had, the one at which most of what it shows lies on lines; then the nearest."""
    most = int(TURNS_SIGMA * math.sqrt(float(glance.covariance[2, 2])) / TURN_RAD)
    turns = sorted((k * TURN_RAD for k in range(-most, most + 1)), key=abs)
    tried = [glance.then(pose) @ Pose2(0.0, 0.0, turn) for turn in turns]
    pairs = [_pairs(predict_lines(robot, then).segments_px, glance.segments_px, GATES_PX[0], math.sin(GATE_RAD))
             for then in tried]
    return tried[int(np.argmax([len(p) for p in pairs]))]


def _with(robot: RobotModel, glance: CameraView, pose: Pose2, covariance: Floats) -> tuple[Pose2, Floats]:
    """What is known after one more glance: of what it corrects, the motion since then has its part, as it is unsure."""
    then = glance.then(pose)
    prior, lever = _prior(pose, covariance, glance)
    solved, spread = _fix(robot, glance, then, prior, _best_turn(robot, glance, pose) if _is_unsure(glance) else then)
    gain = np.linalg.solve(prior, lever @ covariance).T
    off = gain @ (solved.x_m - then.x_m, solved.y_m - then.y_m, wrap_angle(solved.heading_rad - then.heading_rad))
    now = Pose2(pose.x_m + float(off[0]), pose.y_m + float(off[1]), wrap_angle(pose.heading_rad + float(off[2])))
    return now, np.asarray(covariance - gain @ (prior - spread) @ gain.T)


def _prior(pose: Pose2, covariance: Floats, glance: CameraView) -> tuple[Floats, Floats]:
    """(3, 3) covariance of where a glance was taken, world, and the lever from the pose now to it."""
    lever, turn = _lever(pose, glance.now_from_then), np.eye(3)
    c, s = math.cos(pose.heading_rad), math.sin(pose.heading_rad)
    turn[:2, :2] = ((c, -s), (s, c))
    return lever @ covariance @ lever.T + turn @ glance.covariance @ turn.T, lever


def _fix(robot: RobotModel, glance: CameraView, then: Pose2, prior: Floats, start: Pose2) -> tuple[Pose2, Floats]:
    """Where a glance was taken, from about where it starts, with the covariance; as before where too little is seen."""
    solved, spread = start, prior
    for gate_px in GATES_PX:
        lines = predict_lines(robot, solved)
        pairs = _pairs(lines.segments_px, glance.segments_px, gate_px, math.sin(GATE_RAD))
        if len(pairs) < LEAST_PAIRS:
            break
        model, data = pairs[:, 0], pairs[:, 1]
        fix = planar_from_lines(
            lines.lines_world[model], glance.segments_px[data], robot.camera, robot.mount.camera_from_robot, then,
            prior_covariance=prior, landmark_ids=lines.landmark[model].tolist(), sigma_px=SIGMA_ACROSS_PX,
        )
        solved, spread = fix.world_from_robot, np.asarray(fix.covariance)
    return (then if spread is prior else solved), spread


def _lever(pose: Pose2, step: Pose2) -> Floats:
    """(3, 3) how the pose after a step moves with the one before it."""
    after, lever = pose @ step, np.eye(3)
    lever[0, 2], lever[1, 2] = -(after.y_m - pose.y_m), after.x_m - pose.x_m
    return lever


def _pairs(lines_px: Floats, segments_px: Floats, gate_px: float, sine: float) -> NDArray[np.int64]:
    """(p, 2) for each segment that lies along a model line, the nearest one: its number, the segment's number."""
    nearest = _nearest(np.array(lines_px, float, order="C"), np.array(segments_px, float, order="C"), gate_px, sine)
    data = np.flatnonzero(nearest >= 0)
    return np.column_stack([nearest[data], data])


@njit(cache=True, error_model="numpy")
def _nearest(lines: Any, segments: Any, gate_px: float, sine: float) -> Any:
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
            if off < best and shared > 0.5 * (high - low):
                out[k], best = i, off
    return out
