"""Poses in space from which a correspondence is worth searching: a robust vote of the pairs."""

from __future__ import annotations

import numpy as np
from scipy.stats import norm, qmc

from knowledge_sources.methods.matching_space_pairs import Array, SpacePairs, SpaceScene, away, pairs_at
from world_models.frames import Pose

STARTS = 128
"""Starts spread over the prior, and the prior itself."""
FIRST_WIDTHS_PX = (16.0, 12.0, 8.0, 6.0)
LATER_WIDTHS_PX = (6.0, 4.0, 3.0, 2.0)
"""Widths of the loss: first to second, to first order round the prior; then exactly round each finalist."""
CLOSE_PX = 40.0
"""Pairs further than this from a place are left out when it is settled exactly."""
SHARE_PX = 20.0
"""A pair of this length weighs like one measurement."""
FINALISTS = 12
SEARCHED = 4


def settled_poses(scene: SpaceScene, wide: SpacePairs) -> list[Pose]:
    """Poses to search from: starts all over the prior, settled, the best settled again at their own places."""
    if not len(wide.model):
        return [scene.prior]
    steps, support = _settled(wide, _starts() @ scene.root.T, scene.information, np.zeros(6), FIRST_WIDTHS_PX)
    steps = steps[_distinct(steps, support, FINALISTS, scene)]
    exact = [_settled_exactly(scene, wide, _moved(scene.prior, step), LATER_WIDTHS_PX) for step in steps]
    reached = np.stack([away(scene, pose) for pose, _ in exact])
    best = _distinct(reached, np.array([score for _, score in exact]), SEARCHED, scene)
    return [_settled_exactly(scene, wide, exact[i][0], LATER_WIDTHS_PX[-2:])[0] for i in best]


def _starts() -> Array:
    """(s, 6) deviations: none, and an even spread of the normal law (Halton's sequence, the same at every call)."""
    spread = norm.ppf(qmc.Halton(6, scramble=False).random(STARTS + 1)[1:])
    return np.concatenate([np.zeros((1, 6)), spread])


def _moved(pose: Pose, step: Array) -> Pose:
    return pose.perturbed(step[:3], step[3:])


def _settled_exactly(
    scene: SpaceScene, wide: SpacePairs, pose: Pose, widths: tuple[float, ...]
) -> tuple[Pose, float]:
    """A pose settled with the pairs linearised there, width by width; its support."""
    support = 0.0
    for width in widths:
        pairs = pairs_at(scene, pose, wide.model, wide.data)
        pairs = pairs.take(np.abs(pairs.distances).max(axis=1) < CLOSE_PX)
        if not len(pairs.model):
            break
        more, found = _settled(pairs, np.zeros((1, 6)), scene.information, away(scene, pose), (width,))
        pose, support = _moved(pose, more[0]), float(found[0])
    return pose, support


def _distinct(steps: Array, scores: Array, count: int, scene: SpaceScene) -> list[int]:
    """The best ``count`` that differ by more than a twentieth of the prior's deviation."""
    whitened = steps @ np.linalg.inv(scene.root).T
    kept: list[int] = []
    for i in np.argsort(-scores, kind="stable"):
        if all(np.abs(whitened[i] - whitened[j]).max() > 0.05 for j in kept):
            kept.append(int(i))
        if len(kept) == count:
            break
    return kept


def _settled(
    pairs: SpacePairs, steps: Array, information: Array, offset: Array, widths: tuple[float, ...]
) -> tuple[Array, Array]:
    """Steps (s, 6) moved to where close pairs agree, to first order, and their support (s,) [px of model line]."""
    slopes = pairs.slopes.reshape(-1, 6)
    rests = pairs.distances.reshape(-1)
    squares = np.einsum("pea,peb->pab", pairs.slopes, pairs.slopes).reshape(-1, 36)
    pulls = np.einsum("pea,pe->pa", pairs.slopes, pairs.distances)
    for width in widths:
        closeness = _closeness(steps @ slopes.T + rests, width)
        weights = closeness**2 * (pairs.shares / SHARE_PX) / width**2
        hessian = (weights @ squares).reshape(-1, 6, 6) + information
        gradient = weights @ pulls + information @ offset
        steps = -np.linalg.solve(hessian, gradient[..., None])[..., 0]
    closeness = _closeness(steps @ slopes.T + rests, widths[-1])
    beside = (pairs.along.max(axis=1) < -20.0) | (pairs.along.min(axis=1) > pairs.lengths + 20.0)
    return steps, _support(pairs, np.where(beside, 0.0, closeness) * pairs.shares)


def _closeness(distances: Array, width: float) -> Array:
    """(s, p) from 1, on the model line, to 0; distances (s, 2 p)."""
    square = distances * distances
    return np.asarray(1.0 / (1.0 + (square[:, 0::2] + square[:, 1::2]) * (0.5 / width**2)))


def _support(pairs: SpacePairs, found: Array) -> Array:
    """(s,) model length that close data account for, each model line at most its own."""
    count = int(pairs.model.max(initial=0)) + 1
    belongs = np.zeros((len(pairs.model), count))
    belongs[np.arange(len(pairs.model)), pairs.model] = 1.0
    full = np.zeros(count)
    full[pairs.model] = pairs.lengths
    return np.asarray(np.minimum(found @ belongs, full).sum(axis=1))
