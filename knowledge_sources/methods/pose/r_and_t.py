"""R and T: rotation and translation at once (§6.2.2)."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Literal

import numpy as np

from knowledge_sources.methods.pose.estimate import Array, PoseEstimate
from knowledge_sources.methods.pose.line_set import TINY, LandmarkIds, LineSet, build_line_set, check_landmarks
from knowledge_sources.methods.pose.numerics import line_kernels as kernels
from knowledge_sources.methods.pose.numerics.finish import FEW_LINES, all_kept, estimate_at, guarded, prior_estimate
from knowledge_sources.methods.pose.numerics.levenberg_marquardt import (
    Descent,
    Normal,
    descend,
    normal_equations,
    rotations,
)
from knowledge_sources.methods.pose.numerics.line_kernels import PLANES
from knowledge_sources.methods.pose.numerics.plane_error import (
    Weighting,
    compute_camera_ends,
    compute_plane_distances,
    compute_plane_jacobian,
    line_weights,
    propagated_covariance,
)
from world_models.camera import Camera
from world_models.frames import Pose

PoseState = tuple[Array, Array]

NOTHING = np.zeros((6, 6))
"""The information of a prior that says nothing."""
NOTHING.setflags(write=False)


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
) -> PoseEstimate:
    """Least squares of the model ends' distances to the observed projection planes.

    Source: §6.2.2, E1 = sum_i sigma_i (n_i . (R p_i + T))^2, and E2, each term over |R p_i + T|^2. E1 is quadratic
    in T, which is eliminated: the basin does not depend on the prior's translation.

    Args:
        model_lines_world: (n, 2, 3) [m].
        segments_px: (n, 2, 2) observed, as the lens shows them.
        prior: guess of ``camera_from_world``.
        landmark_ids: checked, not used: every line counts.
        sigma_px: of the segment ends across the line, one number or (n,); scales the covariance.
        objective: "E1", or "E2" (ends weigh alike whatever their depth), started from E1.
        weighting: the paper's sigma_i: "unit" or by segment "length".
    """
    if objective not in ("E1", "E2"):
        raise ValueError(f'expected objective "E1" or "E2", got {objective!r}')
    lines = build_line_set(model_lines_world, segments_px, camera, sigma_px)
    check_landmarks(landmark_ids, len(lines))
    if len(lines) < 3:
        return prior_estimate(lines, prior, FEW_LINES)
    weights = line_weights(lines, weighting)
    end = solve_e1(lines, prior, weights)
    steps = end.iterations
    if objective == "E2":
        end = descend(end.state, _e2_normal(lines, weights), moved)
        steps += end.iterations
    rotation, translation = end.state
    scale = np.ones((len(lines), 2))
    if objective == "E2":
        scale = 1.0 / np.maximum(np.sum(compute_camera_ends(lines, rotation, translation) ** 2, axis=-1), TINY)
    covariance = propagated_covariance(lines, rotation, translation, weights[:, None] * scale)
    kept = all_kept(lines, rotation, translation)
    return guarded(
        lines, prior, estimate_at(lines, rotation, translation, covariance, kept, end.normal.cost, steps, None)
    )


def solve_e1(lines: LineSet, start: Pose, weights: Array) -> Descent[PoseState]:
    """Minimise E1 over R with T eliminated exactly at every step."""
    return compiled_descent(PLANES, lines, weights, (start.rotation, start.translation))


def compiled_descent(
    kind: int, lines: LineSet, weights: Array, start: PoseState, prior: Pose | None = None,
    information: Array | None = None, iterations: int = 30,
) -> Descent[PoseState]:
    """:func:`kernels.descend`, with the prior's pull if its information (6, 6) is given.

    Arrays are copied where they are read-only: the loops are compiled anew for each kind of argument.
    """
    begin = np.array(start[0]), np.array(start[1])
    towards = begin if prior is None else (np.array(prior.rotation), np.array(prior.translation))
    pull = NOTHING.copy() if information is None or prior is None else np.array(information)
    rotation, translation, hessian, cost, steps = kernels.descend(
        kind, lines.arrays, weights, begin, towards, pull, iterations
    )
    return Descent((rotation, translation), Normal(cost, hessian, np.zeros(6)), steps)


def moved(state: PoseState, step: Array) -> PoseState:
    """The left perturbation of a pose by (rotation, translation) (6,)."""
    turn = rotations(step[:3])
    return turn @ state[0], turn @ state[1] + step[3:]


def _e2_normal(lines: LineSet, weights: Array) -> Callable[[PoseState], Normal]:
    def linearise(state: PoseState) -> Normal:
        ends = compute_camera_ends(lines, *state)
        reach = np.maximum(np.linalg.norm(ends, axis=-1), TINY)
        sines = compute_plane_distances(lines, ends) / reach
        jacobian = compute_plane_jacobian(lines, ends) / reach[..., None]
        jacobian[..., 3:] -= (sines / reach**2)[..., None] * ends
        root = np.sqrt(weights)[:, None]
        return normal_equations(sines * root, jacobian * root[..., None])

    return linearise
