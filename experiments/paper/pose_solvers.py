"""Camera poses that no mission uses: R then T (§6.2.1), R and T by E1 and E2 (§6.2.2), and a truncated loss.

They take and return what the solvers of :mod:`knowledge_sources.methods.pose` do, and stand on them: E1 and the
likelihood are minimised there, and the subsets are those of Med R and T.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Literal, NamedTuple

import numpy as np

from knowledge_sources.methods.arrays import Floats, Mask
from knowledge_sources.methods.pose import (
    FEW_LINES,
    IMAGE,
    MAX_BESIDE_PX,
    MAX_ITERATIONS,
    MIN_LINES,
    OUTLIER_SIGMAS,
    PLANES,
    SHARED_PX,
    SUBSET_SIZE,
    TINY,
    LandmarkIds,
    LineSet,
    Minimum,
    PoseEstimate,
    RigidMotion,
    add_concentrated,
    build_estimate,
    build_line_set,
    build_prior_estimate,
    check_landmarks,
    compute_covariance,
    compute_squared_distances,
    compute_weak_information,
    cross,
    keep_possible,
    knows_more,
    measure_lines,
    minimise,
    reject_behind,
    solve_from_subsets,
)
from world_models.camera import Camera
from world_models.frames import Pose

Weighting = Literal["unit", "length"]
Normal = tuple[float, Floats, Floats]
"""The cost, J'J (d, d) and J'r (d,) of least squares at a pose."""

TRUNC_DRAWN_OUTLIER_PART = 0.7  # share of wrong lines for which enough subsets are drawn (experiment table3)
TRUNC_CANDIDATES = 24  # candidates of least loss that are solved again
TRUNC_INLIER_PART = 0.35  # share of the lines that they are solved again on
TRUNC_FINALISTS = 5  # candidates that are refined before one is chosen
TRUNC_ROUNDS = 6  # rounds of inliers and pose in that refinement


def r_and_t(
    model_lines_world: Any,
    segments_px: Any,
    camera: Camera,
    prior: Pose,
    *,
    landmark_ids: LandmarkIds = None,
    sigma_px: Any = 1.0,
    objective: Literal["E1", "E2"] = "E1",
    weighting: Weighting = "unit",
    shared_px: float = SHARED_PX,
) -> PoseEstimate:
    """Camera pose of least squared distances of the model ends to the observed projection planes.

    Source: §6.2.2, E1 = sum_i sigma_i (n_i . (R p_i + T))^2, and E2, each term over |R p_i + T|^2. E1 is quadratic
    in T, which is eliminated: the basin does not depend on the prior's translation. Every line counts: use
    ``med_r_and_t`` where some may be matched wrongly.

    Args:
        model_lines_world: (n, 2, 3) [m].
        segments_px: (n, 2, 2) observed, as the lens shows them.
        prior: guess of ``camera_from_world``.
        landmark_ids: checked, not used, as every line counts.
        sigma_px: of the segment ends across the line, one number or (n,); scales the covariance.
        objective: "E1", or "E2" (ends weigh alike whatever their depth), started from E1.
        weighting: the paper's sigma_i: "unit" or by segment "length".

    Raises:
        ValueError: as :func:`build_line_set`; ids that are not one a line; an unknown objective or weighting.
    """
    if objective not in ("E1", "E2"):
        raise ValueError(f'expected objective "E1" or "E2", got {objective!r}')
    lines = build_line_set(model_lines_world, segments_px, camera, sigma_px)

    def solve(weights: Floats) -> Minimum:
        e1 = minimise(PLANES, lines, (prior.rotation, prior.translation), weights=weights)
        return _minimise_e2(lines, weights, e1) if objective == "E2" else e1

    return _solve(lines, prior, landmark_ids, weighting, solve, objective, shared_px)


def r_then_t(
    model_lines_world: Any,
    segments_px: Any,
    camera: Camera,
    prior: Pose,
    *,
    landmark_ids: LandmarkIds = None,
    sigma_px: Any = 1.0,
    weighting: Weighting = "unit",
    shared_px: float = SHARED_PX,
) -> PoseEstimate:
    """Camera pose in two least-squares problems: n_i . R d_i = 0 for R, then n_i . (R p_i + T) = 0 for T.

    Source: §6.2.1 (Liu et al. [27]). Rotation increments are axis-angle vectors, not Liu's Euler angles: the minimum is
    the same, the way to it safer. Arguments and errors as in :func:`r_and_t`, which is more accurate.
    """
    lines = build_line_set(model_lines_world, segments_px, camera, sigma_px)

    def solve(weights: Floats) -> Minimum:
        return _minimise_turn(lines, weights, prior)

    return _solve(lines, prior, landmark_ids, weighting, solve, "turn", shared_px)


def _solve(
    lines: LineSet, prior: Pose, landmark_ids: LandmarkIds, weighting: Weighting, solve: Callable[[Floats], Minimum],
    objective: str, shared_px: float,
) -> PoseEstimate:
    check_landmarks(landmark_ids, len(lines))
    if len(lines) < MIN_LINES:
        return build_prior_estimate(lines, prior, FEW_LINES)
    weights = _compute_line_weights(lines, weighting)
    end = solve(weights)
    kept = reject_behind(lines, end.state)
    covariance = compute_covariance(lines, end.state, kept, _compute_gain(lines, end, weights, objective), shared_px)
    return build_estimate(lines, end, covariance, kept, prior)


def _compute_line_weights(lines: LineSet, weighting: Weighting) -> Floats:
    """The paper's weights sigma_i (n,): all one, or the segment's length over the mean length."""
    if weighting == "unit":
        return np.ones(len(lines))
    if weighting == "length":
        return np.asarray(lines.lengths_px / max(float(np.mean(lines.lengths_px)), TINY))
    raise ValueError(f'expected weighting "unit" or "length", got {weighting!r}')


def _minimise_e2(lines: LineSet, weights: Floats, start: Minimum) -> Minimum:
    def linearise(pose: Pose) -> Normal:
        q, normals = pose.apply(lines.points), lines.normals[:, None]
        reach = np.maximum(np.linalg.norm(q, axis=-1, keepdims=True), TINY)
        misses = np.sum(q * normals, axis=-1, keepdims=True) / reach
        slopes = (normals - misses * q / reach) / reach
        rows = np.concatenate([cross(q, slopes), slopes], axis=-1).reshape(-1, 6)
        return _form_normal(misses.reshape(-1), rows, np.repeat(weights, 2))

    at = Pose(start.rotation, start.translation)
    return _descend(linearise, lambda pose, step: pose.perturbed(step[:3], step[3:]), at, start.iterations)


def _minimise_turn(lines: LineSet, weights: Floats, prior: Pose) -> Minimum:
    def linearise(pose: Pose) -> Normal:
        turned = lines.directions @ pose.rotation.T
        return _form_normal(np.sum(turned * lines.normals, axis=1), cross(turned, lines.normals), weights)

    end = _descend(linearise, lambda pose, step: pose.perturbed(step, np.zeros(3)), prior, 0)
    root = np.repeat(np.sqrt(weights), 2)
    rows = root[:, None] * np.repeat(lines.normals, 2, axis=0)
    turned = lines.points.reshape(-1, 3) @ end.rotation.T
    misses = np.sum(rows * (turned + prior.translation), axis=1)
    return end._replace(translation=prior.translation - np.linalg.lstsq(rows, misses, rcond=1e-5)[0])


def _form_normal(misses: Floats, rows: Floats, weights: Floats) -> Normal:
    weighted = rows * weights[:, None]
    return float(weights @ misses**2), rows.T @ weighted, weighted.T @ misses


def _descend(
    linearise: Callable[[Pose], Normal], move: Callable[[Pose, Floats], Pose], at: Pose, before: int
) -> Minimum:
    """Levenberg-Marquardt, as `kernels` has it; ``before``: the steps that were taken so far."""
    cost, hessian, gradient = linearise(at)
    damping, done = 1e-9, 0
    while done < MAX_ITERATIONS and damping <= 1e7:
        diagonal = np.diag(hessian)
        damped = hessian + np.diag(damping * diagonal + 1e-12 * max(diagonal.max(), 1e-30))
        step = np.asarray(-np.linalg.solve(damped, gradient), float)
        trial = move(at, step)
        after = linearise(trial)
        gain, done = cost - after[0], done + 1
        if not gain >= 0.0:
            damping = max(30.0 * damping, 1e-4)
            continue
        at, (cost, hessian, gradient), damping = trial, after, max(0.1 * damping, 1e-12)
        if np.abs(step).max() < 1e-8 or gain <= 1e-12 * cost:
            break
    return Minimum(at.rotation, at.translation, hessian, cost, before + done)


def _compute_gain(lines: LineSet, end: Minimum, weights: Floats, objective: str) -> tuple[Floats, Floats]:
    """How the pose of one of the paper's minima moves with the observed ends, see :func:`compute_gain`.

    None of them is a likelihood, so the inverse Hessian is not the covariance. At a minimum the gradient is zero, and
    stays so: its derivative by the pose, times the pose's move, is minus its derivative by the ends.
    """
    q = lines.points @ end.rotation.T + end.translation
    weigh = np.repeat(weights[:, None], 2, axis=1)
    if objective == "E2":
        weigh = weigh / np.maximum(np.sum(q**2, axis=-1), TINY)
    normals = np.broadcast_to(lines.normals[:, None], q.shape)
    slopes = np.concatenate([cross(q, normals), normals], axis=-1)
    first, second = lines.rays[:, 0], lines.rays[:, 1]
    along = (second - first)[:, :2] * lines.focal_px
    across = np.stack([-along[:, 1], along[:, 0]], axis=1) / np.maximum(lines.lengths_px, TINY)[:, None]
    shift = np.concatenate([across / lines.focal_px, np.zeros((len(lines), 1))], axis=1)
    size = np.maximum(np.linalg.norm(cross(first, second), axis=1), TINY)[:, None, None]
    moved = np.stack([cross(shift, second), cross(first, shift)], axis=1) / size  # normals, for each end by one px
    hessian = np.einsum("ik,ika,ikb->ab", weigh, slopes, slopes)
    spread = np.einsum("ik,ika,ikc,iec->aie", weigh, slopes, q, moved)
    if objective == "turn":  # the rotation has conditions of its own
        turned = lines.directions @ end.rotation.T
        about = cross(turned, lines.normals)
        hessian[:3] = np.concatenate([np.einsum("i,ia,ib->ab", weights, about, about), np.zeros((3, 3))], axis=1)
        spread[:3] = np.einsum("i,ia,ic,iec->aie", weights, about, turned, moved)
    least = max(float(np.trace(hessian)) * 1e-15, TINY) * np.eye(6)
    gain = -np.linalg.solve(hessian + least, spread.reshape(6, -1)).reshape(6, len(lines), 2)
    return np.ascontiguousarray(np.moveaxis(gain, 0, 2)), across


def trunc_r_and_t(
    model_lines_world: Any,
    segments_px: Any,
    camera: Camera,
    prior: Pose,
    *,
    landmark_ids: LandmarkIds = None,
    sigma_px: Any = 1.0,
    probability: float | None = None,
    rng: np.random.Generator | None = None,
    prior_covariance: Any = None,
    shared_px: float = SHARED_PX,
) -> PoseEstimate:
    """Camera pose of least truncated loss (MSAC): holds beyond 50 % of wrong lines, if ``sigma_px`` is true.

    The loss is the sum of squared errors over their variance, each line's at most ``2 outlier_sigmas^2``. Candidates
    and arguments are those of ``med_r_and_t``; the prior's share is part of the loss if its covariance is given.
    The best candidates are refined on their own inliers, and a line that matches only beside its model line's ends, or
    behind the camera, counts as an outlier.

    Raises:
        ValueError: as ``med_r_and_t``.
    """
    bound = 2.0 * OUTLIER_SIGMAS**2

    def choose(lines: LineSet, rotations: Floats, translations: Floats) -> tuple[RigidMotion, Mask, float]:
        def rank(errors: Floats) -> Floats:
            return np.asarray(np.minimum(errors, bound).sum(axis=1))

        few = max(SUBSET_SIZE + 1, int(len(lines) * TRUNC_INLIER_PART))
        rotations, translations = add_concentrated(lines, rotations, translations, rank, TRUNC_CANDIDATES, few)
        rotations, translations = keep_possible(lines, prior, prior_covariance, rotations, translations)
        costs = rank(compute_squared_distances(lines, rotations, translations))
        order = np.argsort(costs, kind="stable")[:TRUNC_FINALISTS].tolist()
        information = None
        if prior_covariance is not None:
            information, order = np.linalg.inv(prior_covariance), [*order, len(rotations) - 1]
        loss = TruncatedLoss(lines, prior, information, bound, MAX_BESIDE_PX)
        ends = [loss.refine((rotations[i], translations[i])) for i in order]
        state, _ = min(ends, key=lambda end: end[1])
        return state, loss.measure(state, bound) < bound, bound

    return solve_from_subsets(model_lines_world, segments_px, camera, prior, landmark_ids, sigma_px, probability,
                              TRUNC_DRAWN_OUTLIER_PART, rng, prior_covariance, shared_px, choose)


class TruncatedLoss(NamedTuple):
    """The truncated loss of lines, and the prior's share.

    Attributes:
        information: (6, 6) of the prior, which counts as one more measurement; ``None``: it does not.
        bound: of a line's squared distance over its variance.
    """

    lines: LineSet
    prior: Pose
    information: Floats | None
    bound: float
    max_beside_px: float

    def measure(self, state: RigidMotion, bound: float) -> Floats:
        """(n,) squared distances over their variance, at most ``bound``.

        Lines behind the camera cost ``bound``, and so do segments beside their model line's ends.
        """
        distances, front, over = measure_lines(self.lines, *state, self.max_beside_px)
        squares = np.sum(distances**2, axis=1) / self.lines.sigma_px**2
        return np.asarray(np.where(front & over, np.minimum(squares, bound), bound))

    def compute(self, costs: Floats, state: RigidMotion) -> float:
        """The loss of lines that cost so much (n,), and the prior's share at a pose."""
        if self.information is None:
            return float(costs.sum())
        apart = Pose(*state) @ self.prior.inverse()
        away = np.concatenate([apart.rotation_vector, apart.translation])
        return float(costs.sum() + away @ self.information @ away)

    def refine(self, state: RigidMotion) -> tuple[RigidMotion, float]:
        """Alternate inliers and least squares until they agree; the pose of least loss on the way, and that loss.

        The first round admits lines up to twice as far. A weak prior helps where the inliers leave a direction open.
        """
        best, least = state, self.compute(self.measure(state, self.bound), state)
        near = self.measure(state, 4.0 * self.bound) < 4.0 * self.bound
        here, weak = (self.prior.rotation, self.prior.translation), compute_weak_information()
        for _ in range(TRUNC_ROUNDS):
            if np.count_nonzero(near) < SUBSET_SIZE:
                break
            weights = near.astype(float)
            end = minimise(IMAGE, self.lines, state, self.prior, self.information, weights)
            if not knows_more(end.hessian, weak):
                end = minimise(IMAGE, self.lines, here, self.prior, weak, weights)
            state = end.state
            costs = self.measure(state, self.bound)
            if (loss := self.compute(costs, state)) < least:
                best, least = state, loss
            again = costs < self.bound
            if np.array_equal(again, near):
                break
            near = again
        return best, least
