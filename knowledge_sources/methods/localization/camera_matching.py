"""Matching where the camera's own mounting and focal length are uncertain: more than a pose on the floor explains."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from knowledge_sources.methods.arrays import Floats
from knowledge_sources.methods.matching import Match, PoseMatch, match_in_space
from knowledge_sources.methods.pose import CameraEstimate, estimate_camera_and_pose
from knowledge_sources.methods.verification import LINE_TOLERANCE_RAD, MAX_LINE_WEIGHT_PX, compute_coverage
from world_models.camera import CAMERA_UNKNOWNS, Camera, CameraMount, move_camera
from world_models.frames import Pose, Pose2

FOCAL_STARTS = (-1.5, 0.0, 1.5)  # focal lengths that are tried beyond it, in deviations
CAMERA_PAIR_PX = 8.0  # largest distance of a data end from its model line then
CAMERA_MATCH_SIGMA_PX = 2.5  # standard deviation of a data end across its model line then
SHARP_PX = 1.0  # a line is covered sharply by segments within this distance
MIN_CAMERA_LINES = 10  # fewest lines by which the camera is learnt
CAMERA_LINE_SIGMA_PX = 0.5  # standard deviation of a line's end across it, with what model and picture have in common
STEP = 1e-5
"""Of the numeric derivatives [m, rad]."""
MOUNTING = 4
"""The first unknowns of a camera are those of its mounting."""
FOCAL = CAMERA_UNKNOWNS.index("focal")


@dataclass(frozen=True, slots=True, eq=False)
class CameraMatch:
    """Pairs, and what they are worth with the pose and the camera that fit them best.

    Attributes:
        match: the pairs.
        agreeing: how many of them agree; 0 with too few.
        sharp_part: of the model lines' length in view, what segments cover sharply; 0 with too few pairs.
        prior_chi2: squared distance of the camera from what was believed of it.
    """

    match: Match | PoseMatch
    agreeing: int
    sharp_part: float
    prior_chi2: float


def match_with_camera(
    model_lines_world: Any, data_px: Any, camera: Camera, mount: CameraMount, prior: Pose2, prior_covariance: Floats,
    camera_covariance: Floats,
) -> CameraMatch:
    """Match model lines to data lines within what the priors of pose and camera allow.

    The mounting and the pose on the floor move the camera in six unknowns; of several focal lengths the one is taken
    with which most pairs agree. How well lines are covered does not tell: from pairs of which some are wrong the same
    camera is found, and with it the same segments lie near.

    Args:
        model_lines_world: (m, 2, 3) [m]. data_px: (k, 2, 2), rectified. camera: without distortion.
        prior, prior_covariance: ``world_from_robot`` and (3, 3). camera_covariance: (7, 7).

    Raises:
        ValueError: no model line, or a wrong shape.
    """
    lines, data = np.asarray(model_lines_world, float), np.asarray(data_px, float)
    spread = compute_space_covariance(mount, prior, prior_covariance, camera_covariance)
    expected = mount.camera_from_robot @ prior.lifted().inverse()
    found: list[CameraMatch] = []
    for sigmas in FOCAL_STARTS:
        factor = 1.0 + sigmas * float(np.sqrt(camera_covariance[FOCAL, FOCAL]))
        zoomed = replace(camera, fx=factor * camera.fx, fy=factor * camera.fy)
        match = match_in_space(lines, data, zoomed, expected, spread,
                               pair_px=CAMERA_PAIR_PX, sigma_px=CAMERA_MATCH_SIGMA_PX)
        found.append(rate_match(
            match, lines, data, camera, mount, prior, prior_covariance, camera_covariance))
    return max(found, key=lambda tried: (tried.agreeing, tried.sharp_part))


def rate_match(
    match: Match | PoseMatch, lines_world: Floats, data_px: Floats, camera: Camera, mount: CameraMount, prior: Pose2,
    prior_covariance: Floats, camera_covariance: Floats,
) -> CameraMatch:
    """What a match is worth; arguments as for :func:`match_with_camera`."""
    pairs = np.asarray(match.pairs, np.intp).reshape(-1, 2)
    if len(pairs) < MIN_CAMERA_LINES:
        return CameraMatch(match, 0, 0.0, 0.0)
    estimate = estimate_camera_and_pose(
        lines_world[pairs[:, 0]], data_px[pairs[:, 1]], camera, mount, prior, prior_covariance, camera_covariance,
        sigma_px=CAMERA_LINE_SIGMA_PX)
    sharp = compute_sharp_part(lines_world, data_px, camera, mount, estimate)
    return CameraMatch(match, int(np.count_nonzero(estimate.inliers)), sharp, estimate.prior_chi2)


def compute_sharp_part(
    lines_world: Floats, data_px: Floats, camera: Camera, mount: CameraMount, estimate: CameraEstimate,
) -> float:
    """Which part of the length in view of model lines (m, 2, 3) segments (k, 2, 2) cover sharply, 0..1."""
    lens, mounted = move_camera(camera, mount, estimate.step)
    camera_from_world = mounted.camera_from_robot @ estimate.world_from_robot.lifted().inverse()
    seen, _ = lens.project_segments(lines_world, camera_from_world)
    covered = compute_coverage(seen, data_px, SHARP_PX, LINE_TOLERANCE_RAD)
    lengths = np.minimum(np.nan_to_num(np.linalg.norm(seen[:, 1] - seen[:, 0], axis=1)), MAX_LINE_WEIGHT_PX)
    total = float(lengths.sum())
    return float(np.sum(np.nan_to_num(covered) * lengths)) / total if total > 0.0 else 0.0


def compute_space_covariance(
    mount: CameraMount, pose: Pose2, pose_covariance: Floats, camera_covariance: Floats
) -> Floats:
    """(6, 6) of the left perturbation (rotation, translation) of ``camera_from_world`` by pose and mounting."""
    robot_from_world = pose.lifted().inverse()
    expected = mount.camera_from_robot @ robot_from_world

    def perturbation(moved: Pose) -> Floats:
        apart = moved @ expected.inverse()
        return np.concatenate([apart.rotation_vector, apart.translation]) / STEP

    by_pose = np.stack([
        perturbation(mount.camera_from_robot @ Pose2(pose.x_m + x, pose.y_m + y, pose.heading_rad + turn)
                     .lifted().inverse())
        for x, y, turn in STEP * np.eye(3)], axis=1)
    dummy = Camera(1.0, 1.0, 0.0, 0.0, 1, 1)
    by_mount = np.stack([
        perturbation(move_camera(dummy, mount, step)[1].camera_from_robot @ robot_from_world)
        for step in STEP * np.eye(len(CAMERA_UNKNOWNS))[:MOUNTING]], axis=1)
    mounting = camera_covariance[:MOUNTING, :MOUNTING]
    spread = by_pose @ pose_covariance @ by_pose.T + by_mount @ mounting @ by_mount.T
    return np.asarray(spread + 1e-10 * np.eye(6))
