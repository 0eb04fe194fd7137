"""Poses from which a correspondence is worth searching: starts all over the prior, refined by a robust loss."""

from __future__ import annotations

from typing import Any

import numpy as np
from numba import njit

from knowledge_sources.methods.arrays import Floats, Indices
from knowledge_sources.methods.matching.pose_pairs import (
    LineScene,
    PosePairs,
    build_scene,
    find_pairs_near,
    linearise_pairs,
)
from knowledge_sources.methods.matching.pose_parameters import PoseParameters, Widths
from knowledge_sources.settings.matching import MatchingSettings
from world_models.camera import Camera
from world_models.frames import Pose

compiled = njit(cache=True, error_model="numpy")


def find_start_poses(scene: LineScene, wide: PosePairs, settings: MatchingSettings) -> list[Pose]:
    """Poses to search from, best supported first.

    Starts all over the prior are refined to first order, by iteratively reweighted least squares on Geman and
    McClure's loss with a narrowing width (graduated non-convexity); the best, linearised at their own poses, again.

    Args:
        wide: the pairs that the prior allows, linearised at the prior.
    """
    parameters = scene.parameters
    if not len(wide.model):
        return [parameters.prior]
    reach_px = np.median(np.sqrt(np.mean((wide.slopes @ parameters.root) ** 2, axis=1)), axis=0)
    starts = parameters.list_starts(reach_px, settings) @ parameters.root.T
    steps, support = _refine_steps(
        wide, starts, parameters.information, np.zeros(starts.shape[1]), parameters.get_widths(settings), settings
    )
    poses = [
        parameters.move(parameters.prior, steps[i])
        for i in _select_distinct(steps, support, settings.pose_finalists, scene, settings)
    ]
    widths, size = settings.last_widths_px, parameters.widths_per_linearisation
    groups = [widths[i : i + size] for i in range(0, len(widths), size)]
    exact = [_refine_pose(scene, wide, pose, groups, settings) for pose in poses]
    reached = np.stack([parameters.compute_step(pose) for pose, _ in exact])
    scores = np.array([score for _, score in exact])
    best = _select_distinct(reached, scores, settings.max_pose_starts, scene, settings)
    return [_refine_pose(scene, wide, exact[i][0], [groups[-1][-2:]], settings)[0] for i in best]


def refine_pose(
    model_lines_world: Any, segments_px: Any, camera: Camera, parameters: PoseParameters, pose: Pose, widths: Widths,
    settings: MatchingSettings,
) -> Pose:
    """The pose near ``pose`` at which model lines (m, 2, 3) [m] fit data lines (k, 2, 2) [px], the prior as one term.

    Args:
        parameters: the prior and its unknowns.
        widths: of the loss, narrowing; data further than the first [px] from their lines are left out.
    """
    scene = build_scene(model_lines_world, segments_px, camera, parameters)
    for width in widths:
        pairs = find_pairs_near(scene, pose, width, settings.max_pose_pair_rad)
        if not len(pairs.model):
            break
        still, offset = np.zeros((1, len(parameters.root))), parameters.compute_step(pose)
        steps, _ = _refine_steps(pairs, still, parameters.information, offset, (width, width), settings)
        pose = parameters.move(pose, steps[0])
    return pose


def _refine_pose(
    scene: LineScene, wide: PosePairs, pose: Pose, groups: list[Widths], settings: MatchingSettings
) -> tuple[Pose, float]:
    """A pose refined with the pairs linearised there, anew for each group of widths; and its support."""
    parameters, support = scene.parameters, 0.0
    for group in groups:
        pairs = linearise_pairs(scene, pose, wide.model, wide.data)
        pairs = pairs.take(np.abs(pairs.distances).max(axis=1) < settings.max_refined_pair_px)
        if not len(pairs.model):
            break
        still = np.zeros((1, len(parameters.root)))
        offset = parameters.compute_step(pose)
        steps, supports = _refine_steps(pairs, still, parameters.information, offset, group, settings)
        pose, support = parameters.move(pose, steps[0]), float(supports[0])
    return pose, support


def _select_distinct(
    steps: Floats, scores: Floats, count: int, scene: LineScene, settings: MatchingSettings
) -> list[int]:
    """The best ``count`` of the steps (s, d) that differ, in the prior's deviations (non-maximum suppression)."""
    whitened = steps @ np.linalg.inv(scene.parameters.root).T
    free = np.ones(len(steps), np.bool_)
    kept: list[int] = []
    for i in np.argsort(-scores, kind="stable"):
        if free[i]:
            kept.append(int(i))
            free &= np.abs(whitened - whitened[i]).max(axis=1) > settings.min_pose_difference_sigmas
        if len(kept) == count:
            break
    return kept


def _refine_steps(
    pairs: PosePairs, steps: Floats, information: Floats, offset: Floats, widths: Widths, settings: MatchingSettings
) -> tuple[Floats, Floats]:
    """Steps (s, d) moved to where close pairs agree, to first order, and their support (s,) [px of model line].

    ``information`` (d, d) is the prior's, ``offset`` (d,) the step from the prior to where the pairs are linearised.
    """
    max_square = settings.max_width_ratio**2
    moved: Floats = _reweight(
        pairs.distances, pairs.slopes, pairs.shares, np.array(steps), information, offset, np.array(widths),
        settings.unit_length_px, max_square,
    )
    support: Floats = _compute_support(
        pairs.model, pairs.distances, pairs.slopes, pairs.along, pairs.lengths, pairs.shares, moved, widths[-1],
        settings.max_beside_px, max_square,
    )
    return moved, support


@compiled
def _reweight(
    distances: Floats, slopes: Floats, shares: Floats, steps: Floats, information: Floats, offset: Floats,
    widths: Floats, unit_length_px: float, max_square: float,
) -> Floats:
    """Steps (s, d), each reweighted and solved once a width: weights 1 / (1 + (distance / width)^2)^2."""
    pairs, _, unknowns = slopes.shape
    squares, pulls = np.zeros((pairs, unknowns * (unknowns + 1) // 2)), np.zeros((pairs, unknowns))
    for p in range(pairs):
        at = 0
        for a in range(unknowns):
            pulls[p, a] = slopes[p, 0, a] * distances[p, 0] + slopes[p, 1, a] * distances[p, 1]
            for b in range(a + 1):
                squares[p, at] = slopes[p, 0, a] * slopes[p, 0, b] + slopes[p, 1, a] * slopes[p, 1, b]
                at += 1
    totals, gradient, hessian = np.empty(squares.shape[1]), np.empty(unknowns), np.empty((unknowns, unknowns))
    for s in range(len(steps)):
        for width in widths:
            totals[:], gradient[:] = 0.0, information @ offset
            for p in range(pairs):
                close = _compute_closeness(distances, slopes, p, steps[s], width, max_square)
                if close == 0.0:
                    continue
                weight = close * close * shares[p] / (unit_length_px * width * width)
                for c in range(len(totals)):
                    totals[c] += weight * squares[p, c]
                for a in range(unknowns):
                    gradient[a] += weight * pulls[p, a]
            at = 0
            for a in range(unknowns):
                for b in range(a + 1):
                    hessian[a, b] = hessian[b, a] = totals[at] + information[a, b]
                    at += 1
            steps[s] = -np.linalg.solve(hessian, gradient)
    return steps


@compiled
def _compute_support(
    model: Indices, distances: Floats, slopes: Floats, along: Floats, lengths: Floats, shares: Floats, steps: Floats,
    width: float, max_beside_px: float, max_square: float,
) -> Floats:
    """(s,) model length that close data lines cover, each model line at most its own."""
    support, covered, full = np.zeros(len(steps)), np.zeros(model.max() + 1), np.zeros(model.max() + 1)
    for p in range(len(model)):
        full[model[p]] = lengths[p]
    for s in range(len(steps)):
        covered[:] = 0.0
        for p in range(len(model)):
            low, high = min(along[p, 0], along[p, 1]), max(along[p, 0], along[p, 1])
            if high >= -max_beside_px and low <= lengths[p] + max_beside_px:
                covered[model[p]] += _compute_closeness(distances, slopes, p, steps[s], width, max_square) * shares[p]
        for m in range(len(covered)):
            support[s] += min(covered[m], full[m])
    return support


@compiled
def _compute_closeness(
    distances: Floats, slopes: Floats, p: int, step: Floats, width: float, max_square: float
) -> float:
    """From 1, on the model line, down; 0 where the mean square distance exceeds ``max_square`` squared widths."""
    first, second = distances[p, 0], distances[p, 1]
    for a in range(len(step)):
        first, second = first + slopes[p, 0, a] * step[a], second + slopes[p, 1, a] * step[a]
    square = (first * first + second * second) * (0.5 / (width * width))
    return 1.0 / (1.0 + square) if square < max_square else 0.0
