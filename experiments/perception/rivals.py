"""Rivals of a pose: where a model repeats itself, other poses explain a picture comparably well.

Every two near-parallel model lines vote for the translation that takes the one onto the other. What most vote for takes
much of the model onto itself, however far that is: the model's own repetition decides how far is looked, not the prior.
Poses are compared by a log likelihood in which lines that coincide in the picture are one observation.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from knowledge_sources.methods.arrays import Floats, Indices
from knowledge_sources.methods.verification import (
    LINE_TOLERANCE_PX,
    LINE_TOLERANCE_RAD,
    MAX_LINE_WEIGHT_PX,
    compute_coverage,
)
from world_models.camera import Camera
from world_models.frames import Pose

DETECTION_RATE = 0.75  # probability that a predicted line is found at the right pose
SCORE_CHANCES = 0.05, 0.5  # bounds of the probability that it is found at a wrong one
FULL_LINE_PX = 30.0  # length from which a line counts fully: shorter ones are covered by chance
SAME_LINE_PX = 5.0  # distance up to which lines of the picture are one observation
SAME_LINE_RAD = 0.03  # angle up to which lines of the picture are one observation

MIN_LINE_LENGTH_PX = 8.0  # shortest projected model line that counts
MAX_VOTING_LINES = 150  # most model lines, the longest, that vote for motions onto one another
MAX_MOTIONS = 60  # most translations that are tried, those with most votes; each as a turn too
PARALLEL_RAD = 0.05  # largest angle of model lines that vote for a motion onto one another
VOTE_PX = 6.0  # cell of the votes, as seen at the lines' median distance
MIN_DEPTH_M = 0.3  # least median distance of lines that is counted with
ALIKE_PX, ALIKE_RAD = 6.0, 0.08  # distance and angle up to which a moved model line appears on another one
MIN_SELF_SIMILARITY = 0.3  # part of the model's length that a motion takes onto the model, from which it is tried


@dataclass(frozen=True, slots=True)
class PoseScore:
    """How much a picture supports a pose.

    Attributes:
        log_likelihood: against a picture of anything else; comparable between poses, given the same chance.
        count: number of observations.
    """

    log_likelihood: float
    count: float


def project_leaders(lines_world: Floats, camera: Camera, pose: Pose) -> Floats:
    """(m, 2, 2) lines (m, 2, 3) as seen from a pose [px], NaN but for the longest of those that coincide.

    A line that is nearly on the longer one's extension is the same observation: a copy, a piece, the next door's top.
    """
    lines, _ = camera.project_segments(lines_world, pose)
    spans = lines[:, 1] - lines[:, 0]
    lengths = np.nan_to_num(np.linalg.norm(spans, axis=1))
    order = np.argsort(-lengths, kind="stable")
    order = order[lengths[order] >= MIN_LINE_LENGTH_PX]
    ends, along = lines[order], spans[order] / lengths[order, None]
    across = np.stack([-along[:, 1], along[:, 0]], axis=1)
    apart = np.abs(np.einsum("kij,lj->kli", ends, across) - np.sum(ends[:, 0] * across, axis=1)[None, :, None])
    same = (apart.max(axis=2) <= SAME_LINE_PX) & (np.abs(along @ across.T) <= math.sin(SAME_LINE_RAD))
    leads = np.zeros(len(order), bool)
    for k in range(len(order)):
        leads[k] = not np.any(same[k] & leads)
    shown = np.full_like(lines, np.nan)
    shown[order[leads]] = ends[leads]
    return shown


def compute_pose_score(leaders_px: Floats, segments_px: Floats, chance: float) -> PoseScore:
    """Score lines (m, 2, 2) as a pose predicts them, NaN where not in view, by segments (k, 2, 2).

    ``chance`` is the probability that a line is found at a wrong pose. One that is not found speaks against the pose.
    """
    seen = leaders_px[~np.isnan(leaders_px[:, 0, 0])]
    covered = compute_coverage(seen, segments_px, LINE_TOLERANCE_PX, LINE_TOLERANCE_RAD)
    weights = np.minimum(np.linalg.norm(seen[:, 1] - seen[:, 0], axis=1) / FULL_LINE_PX, 1.0)
    rate, p = DETECTION_RATE, min(max(chance, SCORE_CHANCES[0]), SCORE_CHANCES[1])
    found, missed = math.log(rate / p), math.log((1.0 - rate) / (1.0 - p))
    return PoseScore(float(np.sum(weights * (covered * found + (1.0 - covered) * missed))), float(np.sum(weights)))


def find_self_motions(model_lines_world: Any, camera: Camera, pose: Pose) -> tuple[list[Pose], Floats]:
    """Find the poses from which much of the model (m, 2, 3) [m] appears where it does from ``pose``, most first.

    Returns:
        The poses, and the covariance (6, 6) of their left perturbations.
    """
    lines = np.asarray(model_lines_world, float).reshape(-1, 2, 3)
    here, visible = camera.project_segments(lines, pose)
    lengths = np.nan_to_num(np.linalg.norm(here[:, 1] - here[:, 0], axis=1))
    visible &= lengths >= MIN_LINE_LENGTH_PX
    if np.count_nonzero(visible) < 2:
        return [], np.eye(6)
    at_camera = pose.apply(lines)
    depth = max(float(np.median(at_camera[visible, :, 2].mean(axis=1))), MIN_DEPTH_M)
    spread_rad = VOTE_PX / camera.fx
    sizes = np.linalg.norm(at_camera[:, 1] - at_camera[:, 0], axis=1) * camera.fx / depth
    steps = _vote(at_camera, sizes, spread_rad * depth, depth)  # what is not in view may repeat what is
    here = here[visible]
    poses = [pose.perturbed(np.zeros(3), step) for step in steps]
    poses += [pose.perturbed(np.array([-step[1], step[0], 0.0]) / depth, np.zeros(3)) for step in steps]
    found = []
    for other in poses:
        there, seen = camera.project_segments(lines, other)
        if np.any(seen):
            covered = compute_coverage(there[seen], here, ALIKE_PX, ALIKE_RAD)
            length = np.linalg.norm(there[seen, 1] - there[seen, 0], axis=1)
            found.append((float(np.average(covered, weights=np.clip(length, 1e-9, MAX_LINE_WEIGHT_PX))), other))
    alike = [pair for pair in found if pair[0] >= MIN_SELF_SIMILARITY]
    spread = np.diag(np.repeat([spread_rad, spread_rad * depth], 3) ** 2)
    return [other for _, other in sorted(alike, key=lambda pair: -pair[0])], spread


def _vote(at_camera: Floats, lengths: Floats, cell_m: float, reach_m: float) -> list[Floats]:
    """Translations (3,) [m, camera] with the most votes, of near-parallel lines (m, 2, 3), weighted by length [px]."""
    longest: Indices = np.argsort(-lengths, kind="stable")[:MAX_VOTING_LINES]
    ends, weights = at_camera[longest], np.minimum(lengths[longest], MAX_LINE_WEIGHT_PX)
    spans = ends[:, 1] - ends[:, 0]
    directions = spans / np.maximum(np.linalg.norm(spans, axis=1), 1e-9)[:, None]
    i, j = np.nonzero(np.abs(directions @ directions.T) >= np.cos(PARALLEL_RAD))
    i, j = i[i != j], j[i != j]
    between = ends.mean(axis=1)[j] - ends.mean(axis=1)[i]
    across = between - np.sum(between * directions[i], axis=1)[:, None] * directions[i]
    steps, votes = np.concatenate([across, between]), np.tile(np.minimum(weights[i], weights[j]), 2)
    size = np.linalg.norm(steps, axis=1)
    near = (size > cell_m) & (size <= reach_m)
    if not np.any(near):
        return []
    _, cells = np.unique(np.round(steps[near] / cell_m).astype(np.int64), axis=0, return_inverse=True)
    total = np.bincount(cells.ravel(), weights=votes[near])
    sums = np.stack([np.bincount(cells.ravel(), weights=votes[near] * steps[near][:, a]) for a in range(3)], axis=1)
    return [sums[k] / total[k] for k in np.argsort(-total, kind="stable")[:MAX_MOTIONS]]
