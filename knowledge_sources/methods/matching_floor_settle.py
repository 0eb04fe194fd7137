"""Places on the floor from which a correspondence is worth searching: a robust vote of the pairs."""

from __future__ import annotations

import numpy as np

from knowledge_sources.methods.matching_floor_pairs import Array, FloorPairs, FloorScene, pairs_at

GRID = (-2.0, -1.0, 0.0, 1.0, 2.0)
"""Starts along each axis of the prior, in its deviations."""
FIRST_WIDTHS_PX = (16.0, 12.0, 8.0)
LATER_WIDTHS_PX = (6.0, 4.0, 3.0, 2.0)
"""Widths of the loss: first to second, to first order round the prior; then exactly round each finalist."""
CLOSE_PX = 40.0
"""Pairs further than this from a place are left out when it is settled exactly."""
SHARE_PX = 20.0
"""A pair of this length weighs like one measurement."""
FINALISTS = 12
SEARCHED = 4


def settled_places(scene: FloorScene, wide: FloorPairs) -> list[Array]:
    """States to search from: a grid over the prior, settled, the best settled again at their own places."""
    axes = np.stack(np.meshgrid(GRID, GRID, GRID, indexing="ij"), axis=-1).reshape(-1, 3)
    if not len(wide.model):
        return [scene.mean]
    steps, support = _settled(wide, axes @ scene.root.T, scene.information, np.zeros(3), FIRST_WIDTHS_PX)
    steps = steps[_distinct(steps, support, FINALISTS, scene)]
    exact = [_settled_exactly(scene, wide, scene.mean + step, step, LATER_WIDTHS_PX) for step in steps]
    states = np.stack([state for state, _ in exact])
    best = _distinct(states, np.array([score for _, score in exact]), SEARCHED, scene)
    return [
        _settled_exactly(scene, wide, states[i], states[i] - scene.mean, LATER_WIDTHS_PX[-2:])[0] for i in best
    ]


def _settled_exactly(
    scene: FloorScene, wide: FloorPairs, state: Array, step: Array, widths: tuple[float, ...]
) -> tuple[Array, float]:
    """A state settled with the pairs linearised there (those that ``step`` puts close, to first order); its support."""
    close = np.abs(wide.distances + wide.slopes @ step).max(axis=1) < CLOSE_PX
    pairs = pairs_at(scene, state, wide.model[close], wide.data[close])
    more, support = _settled(pairs, np.zeros((1, 3)), scene.information, state - scene.mean, widths)
    return state + more[0], float(support[0])


def _distinct(states: Array, scores: Array, count: int, scene: FloorScene) -> list[int]:
    """The best ``count`` that differ by more than a twentieth of the prior's deviation."""
    whitened = states @ np.linalg.inv(scene.root).T
    kept: list[int] = []
    for i in np.argsort(-scores, kind="stable"):
        if all(np.abs(whitened[i] - whitened[j]).max() > 0.05 for j in kept):
            kept.append(int(i))
        if len(kept) == count:
            break
    return kept


def _settled(
    pairs: FloorPairs, steps: Array, information: Array, offset: Array, widths: tuple[float, ...]
) -> tuple[Array, Array]:
    """Steps (s, 3) moved to where close pairs agree, to first order, and their support (s,) [px of model line]."""
    slopes = pairs.slopes.reshape(-1, 3)
    rests = pairs.distances.reshape(-1)
    squares = np.einsum("pea,peb->pab", pairs.slopes, pairs.slopes).reshape(-1, 9)
    pulls = np.einsum("pea,pe->pa", pairs.slopes, pairs.distances)
    for width in widths:
        closeness = _closeness(steps @ slopes.T + rests, width)
        weights = closeness**2 * (pairs.shares / SHARE_PX) / width**2
        hessian = (weights @ squares).reshape(-1, 3, 3) + information
        gradient = weights @ pulls + information @ offset
        steps = -np.linalg.solve(hessian, gradient[..., None])[..., 0]
    closeness = _closeness(steps @ slopes.T + rests, widths[-1])
    beside = (pairs.along.max(axis=1) < -20.0) | (pairs.along.min(axis=1) > pairs.lengths + 20.0)
    return steps, _support(pairs, np.where(beside, 0.0, closeness) * pairs.shares)


def _closeness(distances: Array, width: float) -> Array:
    """(s, p) from 1, on the model line, to 0; distances (s, 2 p)."""
    square = distances * distances
    return np.asarray(1.0 / (1.0 + (square[:, 0::2] + square[:, 1::2]) * (0.5 / width**2)))


def _support(pairs: FloorPairs, found: Array) -> Array:
    """(s,) model length that close data account for, each model line at most its own."""
    count = int(pairs.model.max(initial=0)) + 1
    belongs = np.zeros((len(pairs.model), count))
    belongs[np.arange(len(pairs.model)), pairs.model] = 1.0
    full = np.zeros(count)
    full[pairs.model] = pairs.lengths
    return np.asarray(np.minimum(found @ belongs, full).sum(axis=1))
