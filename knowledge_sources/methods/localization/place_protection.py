"""The protection level of a place that a search has found: by all lines that agree, in all looks.

Nothing was believed before of a robot that is lost: where a line is left out, and no other tells, its place is known
no better than candidates are apart. The motions between the looks are taken as they were refined with the place.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from knowledge_sources.methods.arrays import Floats
from knowledge_sources.methods.localization.pose_candidates import DISTINCT
from knowledge_sources.methods.localization.refinement import list_pairs, refine_view_motions
from knowledge_sources.methods.localization.views import CameraView, align_headings
from knowledge_sources.methods.pose import Rests, compute_protection
from world_models.entries import Protection, count_sigmas
from world_models.frames import Pose2
from world_models.robot import RobotModel


def protect_place(
    robot: RobotModel, looks: Sequence[CameraView], pose: Pose2, covariance: Floats, camera_covariance: Floats,
    model_m: float = 0.0,
) -> Protection:
    """The protection level of a place (world) with its covariance (3, 3), by the looks from which it was found.

    ``camera_covariance``: (7, 7) of what is believed of the camera. ``model_m``: deviation of the model.
    """
    views = refine_view_motions(robot, align_headings(looks, robot.camera, robot.mount.camera_from_robot), pose,
                                covariance)
    lines, segments, names, seen_from = list[Floats](), list[Floats](), list[str](), list[Pose2]()
    for view in views:
        found = list_pairs(robot, view, view.pose_then(pose))
        lines.append(found.lines_world)
        segments.append(found.segments_px)
        names += found.names
        seen_from += [view.pose_then(pose)] * len(found.names)
    (apart_m, apart_rad), sigmas = DISTINCT, 2.0 * count_sigmas(1)  # where something is false, twice is taken
    nothing = np.diag(np.square(np.array([apart_m, apart_m, apart_rad]) / sigmas))
    return compute_protection(pose, covariance, Rests(
        np.concatenate(lines), np.concatenate(segments), names, robot.camera, robot.mount,
        np.zeros(len(camera_covariance)), pose, nothing, nothing, camera_covariance, seen_from, model_m))
