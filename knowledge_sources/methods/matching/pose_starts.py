"""Poses from which a correspondence is worth searching: a robust vote of the pairs."""

from __future__ import annotations

from typing import Any

import numpy as np
from numba import njit

from knowledge_sources.methods.matching.pose_pairs import LineScene, PosePairs, linearise_pairs
from knowledge_sources.methods.matching.pose_parameters import Array, Widths
from world_models.frames import Pose

compiled = njit(cache=True, error_model="numpy")

CLOSE_PX = 40.0
"""Pairs further than this from a place are left out when it is settled exactly."""
SHARE_PX = 20.0
"""A pair of this length weighs like one measurement."""
BESIDE_PX = 20.0
"""A data line that lies further than this past a model line's end supports nothing."""
FARTHEST = 25.0
"""Pairs whose mean square distance is more than so many squared widths do not pull at all."""
FINALISTS = 8
SEARCHED = 4


def settled_poses(scene: LineScene, wide: PosePairs) -> list[Pose]:
    """Poses to search from: starts all over the prior, settled, the best settled again at their own places."""
    freedom = scene.freedom
    if not len(wide.model):
        return [freedom.prior]
    reach_px = np.median(np.sqrt(np.mean((wide.slopes @ freedom.root) ** 2, axis=1)), axis=0)
    starts = freedom.starts(reach_px) @ freedom.root.T
    steps, support = _settled(wide, starts, freedom.information, np.zeros(starts.shape[1]), freedom.first_widths)
    poses = [freedom.moved(freedom.prior, steps[i]) for i in _distinct(steps, support, FINALISTS, scene)]
    exact = [_settled_exactly(scene, wide, pose, freedom.later_widths) for pose in poses]
    reached = np.stack([freedom.away(pose) for pose, _ in exact])
    best = _distinct(reached, np.array([score for _, score in exact]), SEARCHED, scene)
    last = (freedom.later_widths[-1][-2:],)
    return [_settled_exactly(scene, wide, exact[i][0], last)[0] for i in best]


def _settled_exactly(
    scene: LineScene, wide: PosePairs, pose: Pose, widths: tuple[Widths, ...]
) -> tuple[Pose, float]:
    """A pose settled with the pairs linearised there, group of widths by group; its support."""
    freedom, support = scene.freedom, 0.0
    for group in widths:
        pairs = linearise_pairs(scene, pose, wide.model, wide.data)
        pairs = pairs.take(np.abs(pairs.distances).max(axis=1) < CLOSE_PX)
        if not len(pairs.model):
            break
        still = np.zeros((1, len(freedom.root)))
        more, found = _settled(pairs, still, freedom.information, freedom.away(pose), group)
        pose, support = freedom.moved(pose, more[0]), float(found[0])
    return pose, support


def _distinct(steps: Array, scores: Array, count: int, scene: LineScene) -> list[int]:
    """The best ``count`` that differ by more than a twentieth of the prior's deviation."""
    whitened = steps @ np.linalg.inv(scene.freedom.root).T
    free = np.ones(len(steps), np.bool_)
    kept: list[int] = []
    for i in np.argsort(-scores, kind="stable"):
        if free[i]:
            kept.append(int(i))
            free &= np.abs(whitened - whitened[i]).max(axis=1) > 0.05
        if len(kept) == count:
            break
    return kept


def _settled(
    pairs: PosePairs, steps: Array, information: Array, offset: Array, widths: Widths
) -> tuple[Array, Array]:
    """Steps (s, d) moved to where close pairs agree, to first order, and their support (s,) [px of model line]."""
    moved: Array = _descended(
        pairs.distances, pairs.slopes, pairs.shares, np.array(steps), information, offset, np.array(widths)
    )
    support: Array = _supported(
        pairs.model, pairs.distances, pairs.slopes, pairs.along, pairs.lengths, pairs.shares, moved, widths[-1]
    )
    return moved, support


@compiled
def _descended(
    distances: Any, slopes: Any, shares: Any, steps: Any, information: Any, offset: Any, widths: Any
) -> Any:
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
                close = _closeness(distances, slopes, p, steps[s], width)
                if close == 0.0:
                    continue
                weight = close * close * shares[p] / (SHARE_PX * width * width)
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
def _supported(
    model: Any, distances: Any, slopes: Any, along: Any, lengths: Any, shares: Any, steps: Any, width: float
) -> Any:
    """(s,) model length that close data account for, each model line at most its own."""
    support, found, full = np.zeros(len(steps)), np.zeros(model.max() + 1), np.zeros(model.max() + 1)
    for p in range(len(model)):
        full[model[p]] = lengths[p]
    for s in range(len(steps)):
        found[:] = 0.0
        for p in range(len(model)):
            low, high = min(along[p, 0], along[p, 1]), max(along[p, 0], along[p, 1])
            if high >= -BESIDE_PX and low <= lengths[p] + BESIDE_PX:
                found[model[p]] += _closeness(distances, slopes, p, steps[s], width) * shares[p]
        for m in range(len(found)):
            support[s] += min(found[m], full[m])
    return support


@compiled
def _closeness(distances: Any, slopes: Any, p: int, step: Any, width: float) -> float:
    """From 1, on the model line, to 1 / 26 at 5 widths, root mean square; 0 beyond."""
    first, second = distances[p, 0], distances[p, 1]
    for a in range(len(step)):
        first, second = first + slopes[p, 0, a] * step[a], second + slopes[p, 1, a] * step[a]
    square = (first * first + second * second) * (0.5 / (width * width))
    return 1.0 / (1.0 + square) if square < FARTHEST else 0.0
