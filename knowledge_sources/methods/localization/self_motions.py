"""Motions of a camera under which a model looks like itself: one stair up, one window along, one shelf down.

Every two near-parallel model lines vote for the translations that take the one onto the other. A translation that many
vote for takes much of the model onto itself, and a picture can hardly tell the two poses apart (voting as in the
generalized Hough transform: Ballard, Pattern Recognition 13 (2), 1981).
"""

from __future__ import annotations

from typing import Any

import numpy as np

from knowledge_sources.methods.arrays import Floats
from knowledge_sources.methods.matching.pose_parameters import PoseParameters
from knowledge_sources.methods.verification.agreement import compute_coverage
from knowledge_sources.settings import DEFAULT, Settings
from world_models.camera import Camera
from world_models.frames import Pose


def find_self_motions(
    model_lines_world: Any, camera: Camera, pose: Pose, parameters: PoseParameters, settings: Settings = DEFAULT
) -> list[tuple[Pose, float]]:
    """Find the poses within the prior from which much of the model appears where it does from ``pose``.

    Args:
        model_lines_world: (m, 2, 3) [m], those that are visible about ``pose``.
        parameters: the prior; a candidate further off than ``rival_reach_sigmas`` is left out.

    Returns:
        Poses and the part (0..1) of the lines' length that appears on lines of the model, largest first.
    """
    tuning = settings.localization
    lines = np.asarray(model_lines_world, float).reshape(-1, 2, 3)
    here, visible = camera.project_segments(lines, pose)
    lengths = np.linalg.norm(here[:, 1] - here[:, 0], axis=1)
    visible &= np.nan_to_num(lengths) >= tuning.camera_min_line_length_px
    if np.count_nonzero(visible) < 2:
        return []
    at_camera, lengths, here = pose.apply(lines[visible]), lengths[visible], here[visible]
    depth = max(float(np.median(at_camera[..., 2].mean(axis=1))), tuning.rival_min_depth_m)
    steps = _vote(at_camera, lengths, tuning.rival_vote_px * depth / camera.fx, parameters, settings)
    poses = [pose.perturbed(np.zeros(3), step) for step in steps]
    poses += [pose.perturbed(np.array([-step[1], step[0], 0.0]) / depth, np.zeros(3)) for step in steps]
    found = []
    for other in poses:
        nearest = parameters.move(parameters.prior, parameters.compute_step(other))  # one that the unknowns allow
        if not is_within_prior(parameters, nearest, tuning.rival_reach_sigmas):
            continue
        there, seen = camera.project_segments(lines[visible], nearest)
        if not np.any(seen):
            continue
        covered = compute_coverage(
            there[seen], here, tuning.rival_same_px, tuning.rival_same_rad, settings.verification)
        weights = np.minimum(lengths[seen], settings.verification.max_line_weight_px)
        found.append((nearest, float(np.sum(covered * weights) / np.sum(weights))))
    alike = [pair for pair in found if pair[1] >= tuning.rival_min_self_similarity]
    return sorted(alike, key=lambda pair: -pair[1])


def is_within_prior(parameters: PoseParameters, pose: Pose, sigmas: float) -> bool:
    """Whether a pose is within so many deviations of the prior (Mahalanobis)."""
    step = parameters.compute_step(pose)
    return float(step @ parameters.information @ step) <= sigmas**2


def _vote(
    at_camera: Floats, lengths: Floats, cell_m: float, parameters: PoseParameters, settings: Settings
) -> list[Floats]:
    """Translations (3,) [m, camera] with the most votes, of near-parallel lines (m, 2, 3), weighted by length [px]."""
    tuning = settings.localization
    longest = np.argsort(-lengths, kind="stable")[: tuning.rival_max_voting_lines]
    ends, weights = at_camera[longest], np.minimum(lengths[longest], settings.verification.max_line_weight_px)
    spans = ends[:, 1] - ends[:, 0]
    directions = spans / np.maximum(np.linalg.norm(spans, axis=1), 1e-9)[:, None]
    i, j = np.nonzero(np.abs(directions @ directions.T) >= np.cos(tuning.rival_parallel_rad))
    i, j = i[i != j], j[i != j]
    between = ends.mean(axis=1)[j] - ends.mean(axis=1)[i]
    across = between - np.sum(between * directions[i], axis=1)[:, None] * directions[i]
    steps, votes = np.concatenate([across, between]), np.tile(np.minimum(weights[i], weights[j]), 2)
    reach_m = 2.0 * tuning.rival_reach_sigmas * _compute_reach(parameters)
    size = np.linalg.norm(steps, axis=1)
    near = (size > cell_m) & (size <= reach_m)
    if not np.any(near):
        return []
    cells, inverse = np.unique(np.round(steps[near] / cell_m).astype(np.int64), axis=0, return_inverse=True)
    total = np.bincount(inverse.ravel(), weights=votes[near])
    sums = np.stack([np.bincount(inverse.ravel(), weights=votes[near] * steps[near][:, a]) for a in range(3)], axis=1)
    best = np.argsort(-total, kind="stable")[: tuning.rival_max_motions]
    return [sums[k] / total[k] for k in best if len(cells)]


def _compute_reach(parameters: PoseParameters) -> float:
    """The largest deviation of the camera's position that the prior allows [m]."""
    moves = (parameters.compute_basis(parameters.prior) @ parameters.root)[3:]
    return float(np.sqrt(np.linalg.eigvalsh(moves @ moves.T)[-1]))
