"""Where is the robot on the floor, from points that were tracked in the image?"""

from __future__ import annotations

from typing import Any

import numpy as np

from knowledge_sources.methods.pose.estimate import BEHIND, Array, Mask, PlanarEstimate
from knowledge_sources.methods.pose.line_set import checked_sigma
from knowledge_sources.methods.pose.numerics import point_kernels
from knowledge_sources.methods.pose.numerics.levenberg_marquardt import Descent, Normal, invert_information
from knowledge_sources.methods.pose.planar import (
    FEW,
    PlanarPrior,
    build_planar_prior,
    mounted,
    pose2,
)
from world_models.camera import NEAR_PLANE_M, Camera
from world_models.frames import Pose, Pose2

HUBER = 1.5
"""Standard deviations beyond which a point pulls with a constant force."""
TOO_FAR = "too far from the predicted point"


def planar_from_points(
    points_world: Any,
    points_px: Any,
    camera: Camera,
    camera_from_robot: Pose,
    prior: Pose2,
    prior_covariance: Any = None,
    *,
    sigma_px: Any = 1.0,
    cutoff: float = 4.0,
) -> PlanarEstimate:
    """Robust Gauss-Newton: Huber's loss to get there, then least squares on the points within ``cutoff``.

    Args:
        points_world: (n, 3) [m]. points_px: (n, 2) observed, as the lens shows them.
        camera_from_robot: the mount. prior: ``world_from_robot``.
        prior_covariance: (3, 3) of (x, y, heading); ``None``: a weak one (1 m, 0.3 rad).
        sigma_px: standard deviation of u and of v, one number or (n,).
    """
    world, pixels = _checked(points_world, points_px)
    sigma = checked_sigma(sigma_px, len(world))
    belief = build_planar_prior(prior, prior_covariance)
    focal = np.array([camera.fx, camera.fy])
    observed = camera.undistort(pixels) - (camera.cx, camera.cy)
    problem = _Points(world, observed, sigma, focal, camera_from_robot, belief)
    state = problem.descend(belief.mean, np.ones(len(world), bool), HUBER).state
    near = problem.near(state, cutoff)
    for _ in range(6):
        state = problem.descend(state, near, HUBER).state
        again = problem.near(state, cutoff)
        if np.array_equal(again, near):
            break
        near = again
    return problem.estimate(state, near)


class _Points:
    """The measurements of one call; holds no changing state."""

    def __init__(
        self, world: Array, observed: Array, sigma: Array, focal: Array, mount: Pose, belief: PlanarPrior
    ) -> None:
        self.sigma, self.belief = sigma, belief
        self.measured = world, observed, sigma, focal, mounted(mount)

    def scaled(self, state: Array) -> tuple[Array, Array, Array]:
        """Depths (n,), residuals (n, 2) and derivatives (n, 2, 3) in standard deviations."""
        found: tuple[Array, Array, Array] = point_kernels.seen(*self.measured, np.array(state))
        return found

    def descend(self, state: Array, chosen: Mask, huber: float) -> Descent[Array]:
        at, hessian, cost = point_kernels.descend(
            *self.measured, *self.belief.arrays, NEAR_PLANE_M, np.array(state), chosen, huber, 20
        )
        return Descent(at, Normal(cost, hessian, np.zeros(3)), 0)

    def near(self, state: Array, cutoff: float) -> Mask:
        depth, residuals, _ = self.scaled(state)
        return np.asarray((depth > NEAR_PLANE_M) & (np.sum(residuals**2, axis=1) <= cutoff**2))

    def loss(self, state: Array, chosen: Mask) -> float:
        """Huber's, of the chosen points, and the prior's share."""
        found = point_kernels.descend(*self.measured, *self.belief.arrays, NEAR_PLANE_M, np.array(state), chosen,
                                      HUBER, 0)
        return float(found[2])

    def estimate(self, state: Array, near: Mask) -> PlanarEstimate:
        depth, residuals, jacobian = self.scaled(state)
        rejected = tuple(
            None if n else (BEHIND if d <= NEAR_PLANE_M else TOO_FAR) for n, d in zip(near, depth, strict=True)
        )
        j = jacobian[near].reshape(-1, 3)
        few = not self.belief.given and int(np.count_nonzero(near)) < 2
        return PlanarEstimate(
            world_from_robot=pose2(state),
            covariance=invert_information(j.T @ j + self.belief.information) * _excess(residuals[near]),
            inliers=near,
            residuals_px=residuals * self.sigma[:, None],
            rejected=rejected,
            cost=self.loss(state, near),
            reason=FEW if few else None,
        )


def _excess(residuals: Array) -> float:
    """By how much the inliers scatter more than sigma says (a variance ratio, never below 1)."""
    freedom = residuals.size - 3
    return max(1.0, float(np.sum(residuals**2)) / freedom) if freedom >= 6 else 1.0


def _checked(points_world: Any, points_px: Any) -> tuple[Array, Array]:
    world = np.array(points_world, float).reshape(-1, 3)
    pixels = np.array(points_px, float).reshape(-1, 2)
    if len(world) != len(pixels):
        raise ValueError(f"expected one pixel a point, got {len(world)} points and {len(pixels)} pixels")
    if not (np.all(np.isfinite(world)) and np.all(np.isfinite(pixels))):
        raise ValueError("expected finite points, got a value that is not")
    return world, pixels
