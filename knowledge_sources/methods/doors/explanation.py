"""Does a shut door explain a picture that is not as expected? The pose beside it, and how likely that is wrong."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from knowledge_sources.methods.arrays import Floats
from knowledge_sources.methods.features.picture import read_picture
from knowledge_sources.methods.matching import match_on_floor
from knowledge_sources.methods.pose import planar_from_lines
from knowledge_sources.methods.verification.color_check import check_colors
from knowledge_sources.methods.verification.line_check import check_lines, predict_lines
from knowledge_sources.methods.verification.pose_confidence import POSE_CONFIDENCE, compute_evidence
from knowledge_sources.methods.verification.predicted_colors import predict_face_colors
from knowledge_sources.settings import DEFAULT, Settings
from world_models.frames import Pose2
from world_models.robot import RobotModel


@dataclass(frozen=True, slots=True, eq=False)
class Explanation:
    """A picture as seen from a pose.

    Attributes:
        pose, covariance: as solved for, world; (3, 3) over (x, y, heading).
        p_false: probability that the pose is wrong, by lines and colors.
        matched, expected: number of lines.
        is_solved: whether the pose was solved for; else there were too few lines, and it is the believed one.
    """

    pose: Pose2
    covariance: Floats
    p_false: float
    matched: int
    expected: int
    is_solved: bool = True


def explain_picture(
    robot: RobotModel, belief: Pose2, covariance: Floats, segments_px: Floats, jpeg: bytes, settings: Settings = DEFAULT
) -> Explanation | None:
    """Find the pose near a belief from which a picture was taken; None where no line is expected.

    Args:
        robot: in the building as it would be.
        covariance: (3, 3) of the belief.
        segments_px: (k, 2, 2) found in the picture.
    """
    s = settings.verification
    lines = predict_lines(robot, belief, s)
    if not len(lines) or not len(segments_px):
        return None
    mount = robot.mount.camera_from_robot
    found = match_on_floor(lines.lines_world, segments_px, robot.camera, mount, belief, covariance, settings.matching)
    pairs = np.asarray(found.pairs, np.int64).reshape(-1, 2)
    if len(np.unique(pairs[:, 0])) < s.min_matched_lines:
        agreed = check_lines(robot, lines.lines_world, segments_px, belief, s)
        return Explanation(belief, covariance, 1.0, agreed.agreement.matched, len(lines), is_solved=False)
    fix = planar_from_lines(
        lines.lines_world[pairs[:, 0]], segments_px[pairs[:, 1]], robot.camera, mount, belief,
        prior_covariance=covariance, landmark_ids=[int(lines.landmark[i]) for i in pairs[:, 0]],
        sigma_px=settings.features.sigma_across_px, settings=settings.pose)
    pose = fix.world_from_robot
    agreed = check_lines(robot, lines.lines_world, segments_px, pose, s)
    faces = check_colors(robot, pose, read_picture(jpeg).quarter, predict_face_colors(robot, pose), settings)
    weight = compute_evidence(robot, lines.lines_world, segments_px, pose, fix.covariance, belief, covariance, agreed,
                              faces)
    return Explanation(pose, fix.covariance, POSE_CONFIDENCE.p_false(weight), agreed.agreement.matched, len(lines))
