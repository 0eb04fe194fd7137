"""R and T: rotation and translation at once (§6.2.2)."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Literal

import numpy as np

from knowledge_sources.methods.arrays import Floats
from knowledge_sources.methods.pose.estimate import PoseEstimate
from knowledge_sources.methods.pose.line_set import LandmarkIds, LineSet, build_line_set, check_landmarks
from knowledge_sources.methods.pose.numerics import kernels
from knowledge_sources.methods.pose.numerics.finish import (
    FEW_LINES,
    build_estimate,
    build_prior_estimate,
    check_in_front,
    compute_covariance,
    reject_behind,
)
from knowledge_sources.methods.pose.numerics.kernels import PLANES, TINY
from knowledge_sources.methods.pose.numerics.levenberg_marquardt import (
    Minimum,
    NormalEquations,
    build_normal_equations,
    compute_rotations,
    minimise,
)
from knowledge_sources.methods.pose.numerics.plane_error import (
    Weighting,
    compute_camera_ends,
    compute_gain,
    compute_line_weights,
    compute_plane_distances,
    compute_plane_jacobian,
)
from knowledge_sources.settings import DEFAULT
from knowledge_sources.settings.pose import PoseSettings
from world_models.camera import Camera
from world_models.frames import Pose

PoseState = tuple[Floats, Floats]
"""Rotation (3, 3) and translation (3,) [m] of ``camera_from_world``."""

MIN_LINES = 3
"""Three lines decide six unknowns."""
NO_INFORMATION = np.zeros((6, 6))
"""Of a prior that does not count."""
NO_INFORMATION.setflags(write=False)


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
    settings: PoseSettings = DEFAULT.pose,
) -> PoseEstimate:
    """Camera pose of least squared distances of the model ends to the observed projection planes.

    Source: §6.2.2, E1 = sum_i sigma_i (n_i . (R p_i + T))^2, and E2, each term over |R p_i + T|^2. E1 is quadratic
    in T, which is eliminated: the basin does not depend on the prior's translation. Every line counts: use
    :func:`med_r_and_t` where some may be matched wrongly.

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
    check_landmarks(landmark_ids, len(lines))
    if len(lines) < MIN_LINES:
        return build_prior_estimate(lines, prior, FEW_LINES, settings)
    weights = compute_line_weights(lines, weighting)
    end = minimise_e1(lines, prior, weights, settings)
    steps = end.iterations
    if objective == "E2":
        end = minimise(end.state, _build_e2(lines, weights), _perturb, settings.max_iterations)
        steps += end.iterations
    rotation, translation = end.state
    scale = np.ones((len(lines), 2))
    if objective == "E2":
        scale = 1.0 / np.maximum(np.sum(compute_camera_ends(lines, rotation, translation) ** 2, axis=-1), TINY)
    gain = compute_gain(lines, rotation, translation, weights[:, None] * scale)
    kept = reject_behind(lines, rotation, translation)
    covariance = compute_covariance(lines, rotation, translation, kept, gain, settings)
    estimate = build_estimate(lines, rotation, translation, covariance, kept, end.normal.cost, steps, None, settings)
    return check_in_front(lines, prior, estimate, settings)


def minimise_e1(lines: LineSet, start: Pose, weights: Floats, settings: PoseSettings) -> Minimum[PoseState]:
    """Minimise E1 over R, with T eliminated exactly at every step."""
    return minimise_compiled(PLANES, lines, weights, (start.rotation, start.translation), settings.max_iterations)


def minimise_compiled(
    kind: int, lines: LineSet, weights: Floats, start: PoseState, iterations: int, prior: Pose | None = None,
    information: Floats | None = None,
) -> Minimum[PoseState]:
    """:func:`kernels.minimise_pose`; the prior counts if its information (6, 6) is given.

    Arrays that may be read-only are copied: numba compiles a function anew for each kind of argument.
    """
    begin = np.array(start[0]), np.array(start[1])
    towards = begin if prior is None else (np.array(prior.rotation), np.array(prior.translation))
    known = NO_INFORMATION.copy() if information is None or prior is None else np.array(information)
    rotation, translation, hessian, cost, steps = kernels.minimise_pose(
        kind, lines.arrays, weights, begin, towards, known, iterations
    )
    return Minimum((rotation, translation), NormalEquations(cost, hessian, np.zeros(6)), steps)


def _perturb(state: PoseState, step: Floats) -> PoseState:
    """The left perturbation of a pose by (rotation, translation) (6,)."""
    turn = compute_rotations(step[:3])
    return turn @ state[0], turn @ state[1] + step[3:]


def _build_e2(lines: LineSet, weights: Floats) -> Callable[[PoseState], NormalEquations]:
    def linearise(state: PoseState) -> NormalEquations:
        ends = compute_camera_ends(lines, *state)
        reach = np.maximum(np.linalg.norm(ends, axis=-1), TINY)
        sines = compute_plane_distances(lines, ends) / reach
        jacobian = compute_plane_jacobian(lines, ends) / reach[..., None]
        jacobian[..., 3:] -= (sines / reach**2)[..., None] * ends
        root = np.sqrt(weights)[:, None]
        return build_normal_equations(sines * root, jacobian * root[..., None])

    return linearise
