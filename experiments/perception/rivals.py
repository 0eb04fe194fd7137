"""Rivals of a pose: other poses within the whole prior that explain a picture comparably well.

Every two near-parallel model lines vote for the translations that take the one onto the other. What most vote for takes
much of the model onto itself, and a picture can hardly tell such poses apart; each is refined by the segments there.
Poses are compared by a log likelihood in which lines that coincide in the picture are one observation.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numba import njit

from knowledge_sources.methods.arrays import Floats, Indices
from knowledge_sources.methods.matching.pose_matching import refine_pose
from knowledge_sources.methods.matching.pose_pairs import PoseParameters
from knowledge_sources.methods.verification.line_check import (
    LINE_TOLERANCE_RAD,
    MAX_LINE_WEIGHT_PX,
    MIN_COVERED_FRACTION,
    compute_coverage,
)
from knowledge_sources.settings import DEFAULT
from world_models.camera import Camera
from world_models.frames import Pose

DETECTION_RATE = 0.85  # probability that a predicted line is found at the right pose
MIN_SCORE_CHANCE = 0.05  # lower bound of the probability of a line at a wrong pose
MAX_SCORE_CHANCE = 0.5  # upper bound of the probability of a line at a wrong pose: one that is found speaks for a pose
FULL_LINE_PX = 30.0  # length from which a line counts fully: shorter ones are covered by chance
LINE_INDEPENDENCE = 0.7  # weight of a line: lines of one thing are seen or missed together (tempered likelihood)
SAME_LINE_PX = 5.0  # distance up to which lines of the picture are one observation
SAME_LINE_RAD = 0.03  # angle up to which lines of the picture are one observation

CAMERA_MIN_LINE_LENGTH_PX = 8.0  # shortest projected model line that is matched
RIVAL_REACH_SIGMAS = 5.0  # distance from the prior, in its deviations, up to which a rival is looked for
RIVAL_MAX_VOTING_LINES = 150  # most model lines, the longest, that vote for motions onto one another
RIVAL_MAX_MOTIONS = 60  # most translations that are tried, those with most votes; each as a turn too
RIVAL_MAX_REFINED = 10  # most rivals that are refined, the likeliest
RIVAL_PARALLEL_RAD = 0.05  # largest angle of model lines that vote for a motion onto one another
RIVAL_VOTE_PX = 6.0  # cell of the votes, as seen at the lines' median distance
RIVAL_MIN_DEPTH_M = 0.3  # least median distance of lines that is counted with
RIVAL_SAME_PX = 6.0  # distance up to which a moved model line appears on another one
RIVAL_SAME_RAD = 0.08  # angle up to which a moved model line appears on another one
RIVAL_MIN_SELF_SIMILARITY = 0.3
"""Part of the model's length that a motion takes onto the model, from which the motion is tried."""
RIVAL_WIDTHS_PX = (12.0, 8.0, 5.0, 3.0, 2.0, 2.0)  # widths of the loss by which a rival is refined


@dataclass(frozen=True, slots=True, eq=False)
class PoseScore:
    """How much a picture speaks for a pose.

    Attributes:
        log_likelihood: against a picture of anything else; comparable between poses, given the same chance.
        coverage: (m,) covered part of each line; NaN where it is not in view.
        groups: (m,) number of the observation that each line belongs to; -1 where it is not in view.
    """

    log_likelihood: float
    coverage: Floats
    groups: Indices

    @property
    def count(self) -> int:
        """Number of observations."""
        return int(self.groups.max(initial=-1)) + 1


def compute_pose_score(lines_px: Floats, segments_px: Floats, chance: float) -> PoseScore:
    """Score lines (m, 2, 2) as a pose predicts them, NaN where not in view, by segments (k, 2, 2).

    ``chance`` is the probability that a line is found at a wrong pose.
    """
    s = DEFAULT.verification
    coverage = compute_coverage(lines_px, segments_px, s.line_tolerance_px, LINE_TOLERANCE_RAD)
    groups = group_lines(lines_px)
    seen = groups >= 0
    lengths = np.linalg.norm(lines_px[seen, 1] - lines_px[seen, 0], axis=1)
    whole = np.bincount(groups[seen], weights=lengths)
    part = np.bincount(groups[seen], weights=lengths * coverage[seen]) / np.maximum(whole, 1e-9)
    weights = np.minimum(whole / FULL_LINE_PX, 1.0)
    found, missed = compute_line_odds(chance)
    value = LINE_INDEPENDENCE * float(np.sum(weights * (part * found + (1.0 - part) * missed)))
    return PoseScore(value, coverage, groups)


def compute_line_odds(chance: float) -> tuple[float, float]:
    """The log likelihood ratios of a line that is found, and of one that is not, where the pose predicts it."""
    rate = DETECTION_RATE
    chance = min(max(chance, MIN_SCORE_CHANCE), MAX_SCORE_CHANCE)
    return math.log(rate / chance), math.log((1.0 - rate) / (1.0 - chance))


def group_lines(lines_px: Floats) -> Indices:
    """Number (m,) the observations that lines (m, 2, 2) belong to: of one line in the picture, each counts once.

    The longest line leads a group; -1 where a line is not in view.
    """
    lines = np.array(lines_px, float, order="C").reshape(-1, 2, 2)
    lengths = np.nan_to_num(np.linalg.norm(lines[:, 1] - lines[:, 0], axis=1))
    order = np.argsort(-lengths, kind="stable")
    groups: Indices = _group(lines, order, SAME_LINE_PX, math.sin(SAME_LINE_RAD))
    return groups


@njit(cache=True, error_model="numpy")
def _group(lines: Any, order: Any, tolerance_px: float, sine: float) -> Any:
    """(m,) group of each line: the first leader near whose infinite line both of its ends lie."""
    groups, leaders, count = np.full(len(lines), -1, np.intp), np.empty(len(lines), np.intp), 0
    for i in order:
        if not np.isfinite(lines[i, 0, 0] + lines[i, 1, 0] + lines[i, 0, 1] + lines[i, 1, 1]):
            continue
        for g in range(count):
            k = leaders[g]
            u0, v0 = lines[k, 0, 0], lines[k, 0, 1]
            u, v = lines[k, 1, 0] - u0, lines[k, 1, 1] - v0
            length = max(math.hypot(u, v), 1e-9)
            u, v = u / length, v / length
            x, y = lines[i, 1, 0] - lines[i, 0, 0], lines[i, 1, 1] - lines[i, 0, 1]
            if abs(u * y - v * x) > sine * max(math.hypot(x, y), 1e-9):
                continue
            first = abs((lines[i, 0, 0] - u0) * v - (lines[i, 0, 1] - v0) * u)
            second = abs((lines[i, 1, 0] - u0) * v - (lines[i, 1, 1] - v0) * u)
            if max(first, second) <= tolerance_px:
                groups[i] = g
                break
        if groups[i] < 0:
            leaders[count] = i
            groups[i] = count
            count += 1
    return groups


def find_self_motions(
    model_lines_world: Any, camera: Camera, pose: Pose, parameters: PoseParameters
) -> list[tuple[Pose, float]]:
    """Find the poses within the prior from which much of the model appears where it does from ``pose``.

    Args:
        model_lines_world: (m, 2, 3) [m], those that are visible about ``pose``.
        parameters: the prior; a candidate further off than ``RIVAL_REACH_SIGMAS`` is left out.

    Returns:
        Poses and the part (0..1) of the lines' length that appears on lines of the model, largest first.
    """
    lines = np.asarray(model_lines_world, float).reshape(-1, 2, 3)
    here, visible = camera.project_segments(lines, pose)
    lengths = np.linalg.norm(here[:, 1] - here[:, 0], axis=1)
    visible &= np.nan_to_num(lengths) >= CAMERA_MIN_LINE_LENGTH_PX
    if np.count_nonzero(visible) < 2:
        return []
    at_camera, lengths, here = pose.apply(lines[visible]), lengths[visible], here[visible]
    depth = max(float(np.median(at_camera[..., 2].mean(axis=1))), RIVAL_MIN_DEPTH_M)
    steps = _vote(at_camera, lengths, RIVAL_VOTE_PX * depth / camera.fx, parameters)
    poses = [pose.perturbed(np.zeros(3), step) for step in steps]
    poses += [pose.perturbed(np.array([-step[1], step[0], 0.0]) / depth, np.zeros(3)) for step in steps]
    found = []
    for other in poses:
        nearest = parameters.move(parameters.prior, parameters.compute_step(other))  # one that the unknowns allow
        if not is_within_prior(parameters, nearest, RIVAL_REACH_SIGMAS):
            continue
        there, seen = camera.project_segments(lines[visible], nearest)
        if not np.any(seen):
            continue
        covered = compute_coverage(there[seen], here, RIVAL_SAME_PX, RIVAL_SAME_RAD)
        weights = np.minimum(lengths[seen], MAX_LINE_WEIGHT_PX)
        found.append((nearest, float(np.sum(covered * weights) / np.sum(weights))))
    alike = [pair for pair in found if pair[1] >= RIVAL_MIN_SELF_SIMILARITY]
    return sorted(alike, key=lambda pair: -pair[1])


def is_within_prior(parameters: PoseParameters, pose: Pose, sigmas: float) -> bool:
    """Whether a pose is within so many deviations of the prior (Mahalanobis)."""
    step = parameters.compute_step(pose)
    return float(step @ parameters.information @ step) <= sigmas**2


def _vote(at_camera: Floats, lengths: Floats, cell_m: float, parameters: PoseParameters) -> list[Floats]:
    """Translations (3,) [m, camera] with the most votes, of near-parallel lines (m, 2, 3), weighted by length [px]."""
    longest = np.argsort(-lengths, kind="stable")[: RIVAL_MAX_VOTING_LINES]
    ends, weights = at_camera[longest], np.minimum(lengths[longest], MAX_LINE_WEIGHT_PX)
    spans = ends[:, 1] - ends[:, 0]
    directions = spans / np.maximum(np.linalg.norm(spans, axis=1), 1e-9)[:, None]
    i, j = np.nonzero(np.abs(directions @ directions.T) >= np.cos(RIVAL_PARALLEL_RAD))
    i, j = i[i != j], j[i != j]
    between = ends.mean(axis=1)[j] - ends.mean(axis=1)[i]
    across = between - np.sum(between * directions[i], axis=1)[:, None] * directions[i]
    steps, votes = np.concatenate([across, between]), np.tile(np.minimum(weights[i], weights[j]), 2)
    reach_m = 2.0 * RIVAL_REACH_SIGMAS * _compute_reach(parameters)
    size = np.linalg.norm(steps, axis=1)
    near = (size > cell_m) & (size <= reach_m)
    if not np.any(near):
        return []
    cells, inverse = np.unique(np.round(steps[near] / cell_m).astype(np.int64), axis=0, return_inverse=True)
    total = np.bincount(inverse.ravel(), weights=votes[near])
    sums = np.stack([np.bincount(inverse.ravel(), weights=votes[near] * steps[near][:, a]) for a in range(3)], axis=1)
    best = np.argsort(-total, kind="stable")[: RIVAL_MAX_MOTIONS]
    return [sums[k] / total[k] for k in best if len(cells)]


def _compute_reach(parameters: PoseParameters) -> float:
    """The largest deviation of the camera's position that the prior allows [m]."""
    moves = (parameters.compute_basis(parameters.prior) @ parameters.root)[3:]
    return float(np.sqrt(np.linalg.eigvalsh(moves @ moves.T)[-1]))


LinesAt = Callable[[Pose], Floats]
"""Gives the model lines (m, 2, 3) [m, world] that are visible from a pose."""


@dataclass(frozen=True, slots=True, eq=False)
class Rival:
    """Another pose that explains the picture.

    Attributes:
        camera_from_world: the pose.
        lead: log likelihood ratio of the pose in question to this one; negative where this one is better.
        shift_m, turn_rad: how far the camera is away, and turned.
        shared: number of lines that agree at both poses; own: at the pose in question only.
    """

    camera_from_world: Pose
    lead: float
    shift_m: float
    turn_rad: float
    shared: int
    own: int

    def sentence(self) -> str:
        """The rival in words."""
        away = f"{100.0 * self.shift_m:.0f} cm and {np.degrees(self.turn_rad):.1f} deg away"
        return f"a pose {away} explains {self.shared} of the same lines; {self.own} agree here only"


def find_rivals(
    lines_at: LinesAt, segments_px: Floats, camera: Camera, parameters: PoseParameters, pose: Pose, chance: float, *,
    same_m: float, same_rad: float,
) -> list[Rival]:
    """Find poses within the prior, distinct from ``pose``, to which a self-motion of the model leads; best first.

    Args:
        segments_px: (k, 2, 2) of the whole picture.
        parameters: the prior and its unknowns.
        chance: probability that a line is found at a wrong pose.
        same_m, same_rad: poses nearer than both are the same.
    """
    lines = lines_at(pose)
    motions = find_self_motions(lines, camera, pose, parameters)
    if not motions:
        return []
    own = _score(lines, segments_px, camera, pose, chance)
    scored = [(_score(lines_at(other), segments_px, camera, other, chance).log_likelihood, number, other)
              for number, (other, _) in enumerate(motions)]
    found: list[Rival] = []
    for _, _, other in sorted(scored, key=lambda s: (-s[0], s[1]))[: RIVAL_MAX_REFINED]:
        there = refine_near(lines_at(other), segments_px, camera, parameters, other)
        shift, turn = measure_apart(pose, there)
        is_same = shift <= same_m and turn <= same_rad
        if is_same or not is_within_prior(parameters, there, RIVAL_REACH_SIGMAS):
            continue
        score = _score(lines_at(there), segments_px, camera, there, chance)
        both, only = _compare(own, score, lines, lines_at(there))
        found.append(Rival(there, own.log_likelihood - score.log_likelihood, shift, turn, both, only))
    return sorted(found, key=lambda rival: rival.lead)


def refine_near(
    lines_world: Floats, segments_px: Floats, camera: Camera, parameters: PoseParameters, pose: Pose
) -> Pose:
    """The pose near ``pose`` at which lines (m, 2, 3) fit segments (k, 2, 2): reweighted least squares."""
    return refine_pose(lines_world, segments_px, camera, parameters, pose, RIVAL_WIDTHS_PX)


def measure_apart(pose: Pose, other: Pose) -> tuple[float, float]:
    """How far two cameras are apart [m], and turned [rad]."""
    shift = float(np.linalg.norm(pose.inverse().translation - other.inverse().translation))
    return shift, pose.angle_to(other)


def _score(lines: Floats, segments_px: Floats, camera: Camera, pose: Pose, chance: float) -> PoseScore:
    projected, visible = camera.project_segments(lines, pose)
    short = np.linalg.norm(projected[:, 1] - projected[:, 0], axis=1) < CAMERA_MIN_LINE_LENGTH_PX
    projected[~visible | short] = np.nan
    return compute_pose_score(projected, segments_px, chance)


def _compare(own: PoseScore, other: PoseScore, lines: Floats, there: Floats) -> tuple[int, int]:
    """Numbers of lines that agree at both poses, and at the first only."""
    least = MIN_COVERED_FRACTION
    at_own, at_other = _count_groups(own, least), _count_groups(other, least)
    if lines.shape == there.shape and np.array_equal(lines, there):
        agree = (np.nan_to_num(own.coverage) >= least, np.nan_to_num(other.coverage) >= least)
        both = len(np.unique(own.groups[agree[0] & agree[1]]))
        return both, at_own - both
    return min(at_own, at_other), max(at_own - at_other, 0)


def _count_groups(score: PoseScore, least: float) -> int:
    groups: Indices = score.groups[np.nan_to_num(score.coverage) >= least]
    return len(np.unique(groups))
