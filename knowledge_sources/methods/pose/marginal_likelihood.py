"""Robot pose from lines of a model that is inexact: errors that lines share do not average out.

With r the distances of the segments' ends from their model lines, r = J dx + A a + noise. The modes' amplitudes a ~
N(0, I) are not solved for but integrated out: the residuals have the covariance S = sigma^2 I + A A', and the pose of
greatest marginal likelihood is that of generalised least squares, with the covariance (J' S^-1 J + prior)^-1. It is
what a Schmidt-Kalman filter states whose considered states are the modes. Source: S. F. Schmidt, Application of
state-space methods to navigation problems, Advances in Control Systems 3, 1966.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from knowledge_sources.methods.arrays import Floats, Mask
from knowledge_sources.methods.pose.displacements import compute_displaced_jacobian
from knowledge_sources.methods.pose.line_set import LineSet
from knowledge_sources.methods.pose.planar import PlanarPrior, compute_scatter
from knowledge_sources.settings.pose import PoseSettings
from world_models.frames import Pose, wrap_angle


@dataclass(frozen=True, slots=True, eq=False)
class MarginalFit:
    """A pose of greatest marginal likelihood.

    Attributes:
        state: (3,) x [m], y [m], heading [rad].
        covariance: (3, 3).
        near: (n,) the lines that agree with it.
        residuals_px: (n, 2) what of the distances the model's errors do not explain.
        cost: squared distances over their covariance, plus the prior's share.
    """

    state: Floats
    covariance: Floats
    near: Mask
    residuals_px: Floats
    cost: float


def maximise_marginal(
    lines: LineSet, shifts: Floats, sigma_px: float, mount: Pose, prior: PlanarPrior, state: Floats, near: Mask,
    settings: PoseSettings,
) -> MarginalFit:
    """The pose of greatest marginal likelihood from lines of which some are wrong.

    Lines whose remaining residual is beyond ``settings.outlier_sigmas`` are left out, the worst first.

    Args:
        shifts: (k, n, 3) displacement of each line by one standard deviation of each mode [m, world].
        sigma_px: of a segment's end across its line.
        state, near: where to start, and the lines (n,) that are used at first.
    """
    bound, near = 2.0 * settings.outlier_sigmas**2, near.copy()
    prior = _loosen(prior, lines.take(near), shifts[:, near], sigma_px, mount, state, settings)
    for _ in range(settings.max_marginal_rounds):
        state = _minimise(lines.take(near), shifts[:, near], sigma_px, mount, prior, state, settings)
        squares = np.where(near, np.sum(_explain(lines, shifts, sigma_px, mount, state, near) ** 2, axis=1), 0.0)
        worst = float(squares.max(initial=0.0))
        if worst <= bound * sigma_px**2 or np.count_nonzero(near) <= settings.max_few_lines:
            break
        near = near & (squares < 0.5 * worst)
    r, slopes, weights = _linearise(lines.take(near), shifts[:, near], sigma_px, mount, state)
    away = _subtract(state, prior.mean)
    chi2 = float(r @ weights @ r)
    scatter = settings.marginal_spread**2 * compute_scatter(chi2, len(r), settings, bound)
    return MarginalFit(
        state, np.asarray(np.linalg.inv(slopes.T @ weights @ slopes + prior.information) * scatter, float), near,
        _explain(lines, shifts, sigma_px, mount, state, near), chi2 + float(away @ prior.information @ away))


def _loosen(
    prior: PlanarPrior, lines: LineSet, shifts: Floats, sigma_px: float, mount: Pose, state: Floats,
    settings: PoseSettings,
) -> PlanarPrior:
    """The prior without what it may share with these lines: it came of the same model, with the same errors.

    The share is the part of the covariance that the model's errors make. Where the lines tell nothing it is none.
    """
    if not prior.given or not np.any(prior.information):
        return prior
    _, slopes, weights = _linearise(lines, shifts, sigma_px, mount, state)
    exact = slopes.T @ slopes / sigma_px**2 + prior.information
    share = np.linalg.inv(slopes.T @ weights @ slopes + prior.information) - np.linalg.inv(exact)
    loose = np.linalg.inv(prior.information) + settings.shared_prior_factor * share
    return PlanarPrior(prior.mean, np.asarray(np.linalg.inv(loose), float), True)


def _minimise(
    lines: LineSet, shifts: Floats, sigma_px: float, mount: Pose, prior: PlanarPrior, state: Floats,
    settings: PoseSettings,
) -> Floats:
    """Gauss-Newton on generalised least squares."""
    for _ in range(settings.max_marginal_steps):
        r, slopes, weights = _linearise(lines, shifts, sigma_px, mount, state)
        hessian = slopes.T @ weights @ slopes + prior.information
        step = np.linalg.solve(hessian, slopes.T @ weights @ r + prior.information @ _subtract(state, prior.mean))
        state = state - step
        if np.abs(step).max() < settings.min_marginal_step:
            break
    return state


def _linearise(
    lines: LineSet, shifts: Floats, sigma_px: float, mount: Pose, state: Floats
) -> tuple[Floats, Floats, Floats]:
    """Distances (2n,), their derivatives (2n, 3) by the state, and the inverse of their covariance (2n, 2n)."""
    distances, by_pose, by_mode = compute_displaced_jacobian(lines, shifts, state, mount)
    modes = by_mode.reshape(2 * len(lines), -1)
    weights = np.linalg.inv(sigma_px**2 * np.eye(len(modes)) + modes @ modes.T)
    return distances.reshape(-1), by_pose.reshape(-1, 3), np.asarray(weights, float)


def _explain(lines: LineSet, shifts: Floats, sigma_px: float, mount: Pose, state: Floats, near: Mask) -> Floats:
    """(n, 2) what the modes, as the lines ``near`` tell them, leave of each line's distances [px]."""
    distances, _, by_mode = compute_displaced_jacobian(lines, shifts, state, mount)
    modes = by_mode[near].reshape(-1, by_mode.shape[2])
    information = modes.T @ modes / sigma_px**2 + np.eye(by_mode.shape[2])
    amplitudes = np.linalg.solve(information, modes.T @ distances[near].reshape(-1)) / sigma_px**2
    return np.asarray(distances - by_mode @ amplitudes)


def _subtract(state: Floats, mean: Floats) -> Floats:
    return np.array([state[0] - mean[0], state[1] - mean[1], wrap_angle(float(state[2] - mean[2]))])
