"""Robot pose on the floor from points that were tracked in the image."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from knowledge_sources.methods.arrays import Floats, Mask
from knowledge_sources.methods.pose.estimate import BEHIND, PlanarEstimate
from knowledge_sources.methods.pose.line_set import check_sigma
from knowledge_sources.methods.pose.numerics import kernels
from knowledge_sources.methods.pose.numerics.kernels import PointArrays
from knowledge_sources.methods.pose.numerics.levenberg_marquardt import invert_information
from knowledge_sources.methods.pose.planar import (
    FEW,
    PlanarPrior,
    build_planar_prior,
    compute_scatter,
    to_pose2,
    to_rigid_motion,
)
from knowledge_sources.settings import DEFAULT
from knowledge_sources.settings.pose import PoseSettings
from world_models.camera import NEAR_PLANE_M, Camera
from world_models.frames import Pose, Pose2

TOO_FAR = "too far from the predicted point"
MIN_POINTS = 2
"""Two points decide three unknowns."""


def planar_from_points(
    points_world: Any,
    points_px: Any,
    camera: Camera,
    camera_from_robot: Pose,
    prior: Pose2,
    prior_covariance: Any = None,
    *,
    sigma_px: Any = 1.0,
    settings: PoseSettings = DEFAULT.pose,
) -> PlanarEstimate:
    """Robot pose on the floor by Levenberg-Marquardt on Huber's loss, on the points that agree with it.

    First on all points; then points beyond ``settings.point_outlier_sigmas`` are left out, until they stay the same.

    Args:
        points_world: (n, 3) [m]. points_px: (n, 2) observed, as the lens shows them.
        camera_from_robot: the mount. prior: ``world_from_robot``.
        prior_covariance: (3, 3) of (x, y, heading); ``None``: a weak one.
        sigma_px: standard deviation of u and of v, one number or (n,).

    Raises:
        ValueError: shapes that do not match, a value that is not finite, a sigma that is not > 0.
    """
    world, pixels = _check_points(points_world, points_px)
    sigma = check_sigma(sigma_px, len(world))
    belief = build_planar_prior(prior, prior_covariance, settings)
    focal = np.array([camera.fx, camera.fy])
    observed = camera.undistort(pixels) - (camera.cx, camera.cy)
    mount = to_rigid_motion(camera_from_robot)
    problem = _Problem((world, observed, sigma, focal, belief.mean, belief.information, mount), belief, settings)
    state, _ = problem.minimise(belief.mean, np.ones(len(world), bool), settings.max_floor_iterations)
    near = problem.find_near(state)
    for _ in range(settings.max_point_rounds):
        state, _ = problem.minimise(state, near, settings.max_floor_iterations)
        again = problem.find_near(state)
        if np.array_equal(again, near):
            break
        near = again
    return _build_estimate(problem, state, near)


@dataclass(frozen=True, slots=True, eq=False)
class _Problem:
    """The data of one call."""

    points: PointArrays
    prior: PlanarPrior
    settings: PoseSettings

    def minimise(self, state: Floats, chosen: Mask, iterations: int) -> tuple[Floats, float]:
        """The state (3,) of least loss over the chosen points (n,), with the prior's share; and that loss."""
        end, _, loss, _ = kernels.minimise_points(
            self.points, np.array(state), chosen, self.settings.huber_sigmas, NEAR_PLANE_M, iterations
        )
        return end, float(loss)

    def project(self, state: Floats) -> tuple[Floats, Floats, Floats]:
        """See :func:`kernels.project_points`."""
        projected: tuple[Floats, Floats, Floats] = kernels.project_points(self.points, np.array(state))
        return projected

    def find_near(self, state: Floats) -> Mask:
        """(n,) the points in front of the camera that are no outliers."""
        depth, residuals, _ = self.project(state)
        bound = self.settings.point_outlier_sigmas**2
        return np.asarray((depth > NEAR_PLANE_M) & (np.sum(residuals**2, axis=1) <= bound))


def _build_estimate(problem: _Problem, state: Floats, near: Mask) -> PlanarEstimate:
    depth, residuals, jacobian = problem.project(state)
    rejected = tuple(
        None if n else (BEHIND if d <= NEAR_PLANE_M else TOO_FAR) for n, d in zip(near, depth, strict=True)
    )
    j = jacobian[near].reshape(-1, 3)
    few = not problem.prior.given and int(np.count_nonzero(near)) < MIN_POINTS
    bound = problem.settings.point_outlier_sigmas**2
    scatter = compute_scatter(float(np.sum(residuals[near] ** 2)), residuals[near].size, problem.settings, bound)
    sigma = problem.points[2]
    return PlanarEstimate(
        world_from_robot=to_pose2(state),
        covariance=invert_information(j.T @ j + problem.prior.information) * scatter,
        inliers=near,
        residuals_px=residuals * sigma[:, None],
        rejected=rejected,
        cost=problem.minimise(state, near, 0)[1],
        reason=FEW if few else None,
    )


def _check_points(points_world: Any, points_px: Any) -> tuple[Floats, Floats]:
    world = np.array(points_world, float).reshape(-1, 3)
    pixels = np.array(points_px, float).reshape(-1, 2)
    if len(world) != len(pixels):
        raise ValueError(f"expected one pixel a point, got {len(world)} points and {len(pixels)} pixels")
    if not (np.all(np.isfinite(world)) and np.all(np.isfinite(pixels))):
        raise ValueError("expected finite points, got a value that is not")
    return world, pixels
