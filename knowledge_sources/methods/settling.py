"""From about the right pose to the exact one: what is seen is paired with the nearest model lines, look by look."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

from knowledge_sources.methods.glances import Glance
from knowledge_sources.methods.lines import SIGMA_ACROSS_PX
from knowledge_sources.methods.pose import planar_from_lines
from world_models.frames import Pose2
from world_models.robot import RobotModel
from world_models.visibility import VisibleLines, visible_lines

Floats = NDArray[np.float64]

ROUGH = np.diag([0.15**2, 0.15**2, math.radians(1.5) ** 2])
ROUGH.setflags(write=False)
"""(3, 3) How far off a proposal may be."""
GATES_PX = (16.0, 4.0)
"""Round by round, how far a segment may be from its model line."""
GATE_RAD = 0.12
LEAST_PAIRS = 3


def expected_lines(robot: RobotModel, world_from_robot: Pose2) -> VisibleLines:
    """The model lines that are worth looking for from there."""
    return visible_lines(robot.world, robot.camera, robot.camera_from_world(world_from_robot), min_length_px=12.0,
                         min_contrast=0.05, max_distance_m=15.0)


def settled(robot: RobotModel, glances: Sequence[Glance], pose: Pose2) -> tuple[Pose2, Floats]:
    """The pose now, with its covariance (3, 3), that the glances show together near a rough one.

    The glance of which the model has most comes first: what another shows of things that the model lacks misleads
    nobody any more when the pose is known from it.
    """
    covariance = np.array(ROUGH)
    rich = [len(expected_lines(robot, glance.then(pose))) for glance in glances]
    for _, glance in sorted(zip(rich, glances, strict=True), key=lambda pair: -pair[0]):
        pose, covariance = _with(robot, glance, pose, covariance)
    return pose, covariance


def _with(robot: RobotModel, glance: Glance, pose: Pose2, covariance: Floats) -> tuple[Pose2, Floats]:
    """What is known after one more glance."""
    then, lever = glance.then(pose), _lever(pose, glance.now_from_then)
    prior = lever @ covariance @ lever.T + glance.spread
    solved = then
    spread = None
    for gate_px in GATES_PX:
        lines = expected_lines(robot, solved)
        pairs = _pairs(lines.segments_px, glance.segments_px, gate_px, math.sin(GATE_RAD))
        if len(pairs) < LEAST_PAIRS:
            break
        model, data = pairs[:, 0], pairs[:, 1]
        fix = planar_from_lines(
            lines.lines_world[model], glance.segments_px[data], robot.camera, robot.mount.camera_from_robot, then,
            prior_covariance=prior, landmark_ids=lines.landmark[model].tolist(), sigma_px=SIGMA_ACROSS_PX,
        )
        solved, spread = fix.world_from_robot, np.asarray(fix.covariance)
    if spread is None:
        return pose, covariance
    now = solved @ glance.now_from_then.inverse()
    back = np.linalg.inv(_lever(now, glance.now_from_then))
    return now, np.asarray(back @ spread @ back.T)


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
