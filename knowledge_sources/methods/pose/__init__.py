"""Where is the camera, given model lines and the image segments matched to them (§6.2)?

Which solver to use:

==========================  =========================================================================
:func:`r_and_t_ml`          all matches are right: maximum likelihood, the smallest error
:func:`med_r_and_t`         up to about 45 % of the matches may be wrong (least median of squares)
:func:`trunc_r_and_t`       more than half may be wrong, and the noise is known (truncated loss)
:func:`planar_from_lines`   a robot on the floor whose camera mounting is known; matches may be wrong
:func:`planar_from_points`  the same from tracked points (Huber's loss)
:func:`r_and_t`             the paper's own objectives E1 and E2: the widest basin, a larger error
:func:`r_then_t`            the paper's baseline (Liu et al.): rotation first, then translation
==========================  =========================================================================

The paper's other ones, which only its tables use, are in :mod:`experiments.paper.pose_solvers`.

The solvers of a camera's six unknowns take ``(model_lines_world (n, 2, 3) [m], segments_px (n, 2, 2), camera, prior)``,
``prior`` being a guess of ``camera_from_world``, and return a :class:`PoseEstimate`. Those on the floor take the
mounting ``camera_from_robot`` and a prior ``world_from_robot``, and return a :class:`PlanarEstimate`. All of them say
which lines they rejected and why, and state a covariance.

>>> import numpy as np
>>> from knowledge_sources.methods.pose import med_r_and_t
>>> from world_models.camera import Camera
>>> from world_models.frames import Pose

Eight lines of a door and a window, seen by a camera at the world's origin; one of them is matched wrongly:

>>> x, y = [-1.0, 0.0, 1.0, 2.0], [-1.0, 1.0, 0.5]
>>> upright = [[[x[i], y[0], 4.0 + i], [x[i], y[1], 4.0 + i]] for i in range(4)]
>>> level = [[[x[0], y[i], 4.0 + i], [x[3], y[i], 5.0 + i]] for i in range(3)] + [[[x[0], 0.2, 6.0], [x[2], 0.2, 4.5]]]
>>> lines = np.array(upright + level)
>>> camera = Camera.from_field_of_view(np.radians(65.0))
>>> segments, visible = camera.project_segments(lines, Pose.identity())
>>> segments[2] += 30.0

Three lines of code:

>>> prior = Pose.from_rotation_vector([0.02, -0.03, 0.01], [0.2, -0.1, 0.15])
>>> found = med_r_and_t(lines, segments, camera, prior, sigma_px=0.5)
>>> bool(np.abs(found.camera_from_world.translation).max() < 0.01)
True

>>> found.ok, found.rejected[2]
(True, 'too far from the model line')
"""

from knowledge_sources.methods.pose.estimate import (
    FEW_LINES, MAX_CHI2_SIGMAS, MAX_ITERATIONS, MAX_RESIDUAL_SIGMAS, MIN_LINES, Minimum, PlanarEstimate,
    PoseEstimate, SHARED_PX, build_estimate, build_prior_estimate, compute_covariance, compute_weak_information,
    knows_more, minimise, reject_behind,
)
from knowledge_sources.methods.pose.kernels import IMAGE, PLANES, RigidMotion, TINY
from knowledge_sources.methods.pose.line_set import (
    LandmarkIds, LineSet, MAX_BESIDE_PX, OUTLIER_SIGMAS, build_line_set, check_landmarks, compute_image_jacobian,
    compute_squared_distances, cross, invert_information, measure_lines,
)
from knowledge_sources.methods.pose.planar import (
    MARGINAL_SPREAD, POINT_OUTLIER_SIGMAS, compute_camera_poses, compute_point_jacobian, compute_sigmas_px,
    planar_from_points, to_pose2,
)
from knowledge_sources.methods.pose.planar_from_lines import planar_from_lines
from knowledge_sources.methods.pose.r_and_t import (
    MIN_NOISE_PART, SUBSET_SIZE, add_concentrated, keep_possible, med_r_and_t, r_and_t_ml, solve_from_subsets,
)
from knowledge_sources.methods.pose.solution_separation import Rests, compute_protection, tell_unavailable
from knowledge_sources.methods.pose.standing_beside import find_beside, find_width, weigh_places
from knowledge_sources.methods.pose.with_camera import CameraEstimate, compute_pose_slopes, estimate_camera_and_pose

__all__ = [
    "FEW_LINES", "IMAGE", "MARGINAL_SPREAD", "MAX_BESIDE_PX", "MAX_CHI2_SIGMAS", "MAX_ITERATIONS",
    "MAX_RESIDUAL_SIGMAS", "MIN_LINES", "MIN_NOISE_PART", "OUTLIER_SIGMAS", "PLANES", "POINT_OUTLIER_SIGMAS",
    "SHARED_PX", "SUBSET_SIZE", "TINY", "CameraEstimate", "LandmarkIds", "LineSet", "Minimum",
    "PlanarEstimate", "PoseEstimate", "Rests", "RigidMotion", "add_concentrated", "build_estimate", "build_line_set",
    "build_prior_estimate", "check_landmarks", "compute_camera_poses", "compute_covariance", "compute_image_jacobian",
    "compute_point_jacobian", "compute_pose_slopes", "compute_protection", "compute_sigmas_px",
    "compute_squared_distances", "compute_weak_information", "cross", "estimate_camera_and_pose", "find_beside",
    "find_width", "invert_information", "keep_possible", "knows_more", "measure_lines", "med_r_and_t", "minimise",
    "planar_from_lines", "planar_from_points", "r_and_t_ml", "reject_behind", "solve_from_subsets", "tell_unavailable",
    "to_pose2", "weigh_places",
]
