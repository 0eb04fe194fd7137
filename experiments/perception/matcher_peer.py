"""Baseline of the matcher: RANSAC over two pairs of lines, then ICP."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from knowledge_sources.methods.matching import Similarity2
from knowledge_sources.methods.matching.image_pairs import (
    PairTable,
    build_line_table,
    build_pair_table,
    compute_model_motion,
)
from knowledge_sources.methods.matching.search import compute_best_fits

Array = NDArray[np.float64]

DRAWS = 500
MAX_DISTANCE_PX, MAX_TURN_RAD = 3.0, 0.1
ROUNDS = 8
WINDOW_PX, WINDOW_RAD = 30.0, 0.3
STILL = (1.0, 0.0, 0.0, 0.0, 1.0)


def ransac_icp(model_px: Array, data_px: Array, rng: np.random.Generator) -> Similarity2:
    """Find the motion of the model: the best of 500 draws of two pairs, refined by ICP."""
    centre = model_px.reshape(-1, 2).mean(axis=0)
    model, data = build_line_table(model_px, centre), build_line_table(data_px, centre)
    table = build_pair_table(model, data, np.full(len(model_px), WINDOW_PX), WINDOW_RAD)
    placements = np.concatenate([np.array([STILL]), _draw_placements(table, rng)])
    best = placements[int(np.argmax([_score(table, placement) for placement in placements]))]
    for _ in range(ROUNDS):
        best = _refit(table, best)
    return compute_model_motion(best, centre)


def _draw_placements(table: PairTable, rng: np.random.Generator) -> Array:
    """Draw (d, 5) placements of the data that align two data lines with two model lines."""
    if len(table.model) < 2:
        return np.zeros((0, 5))
    i, k = rng.integers(0, len(table.model), (2, DRAWS))
    turn = -0.5 * (table.angles[i] + table.angles[k])
    rows = np.stack([table.across[i].mean(axis=1), table.across[k].mean(axis=1)], axis=1)
    still = np.stack([np.cos(turn), np.sin(turn), np.zeros(DRAWS), np.zeros(DRAWS), np.ones(DRAWS)], axis=1)
    apart = np.einsum("dea,da->de", rows, still)
    crossing = np.abs(np.linalg.det(rows[:, :, 2:4])) > 0.3
    alike = np.abs(table.angles[i] - table.angles[k]) < MAX_TURN_RAD
    kept = crossing & alike
    still[kept, 2:4] = -np.linalg.solve(rows[kept][:, :, 2:4], apart[kept][..., None])[..., 0]
    return np.asarray(still[kept & (np.abs(still[:, 2:4]).max(axis=1) <= WINDOW_PX)])


def _find_inliers(table: PairTable, placement: Array) -> tuple[NDArray[np.bool_], Array]:
    distance = np.abs(table.across @ placement).max(axis=1)
    along = table.along @ placement
    beside = (along.max(axis=1) < 0.0) | (along.min(axis=1) > table.lengths)
    turned = np.abs(table.angles + np.arctan2(placement[1], placement[0]))
    return (distance <= MAX_DISTANCE_PX) & (turned <= MAX_TURN_RAD) & ~beside, distance


def _score(table: PairTable, placement: Array) -> float:
    """Length of the model that inlier data lines cover."""
    near, _ = _find_inliers(table, placement)
    found = np.bincount(table.model[near], table.shares[near], table.lines)
    full = np.zeros(table.lines)
    full[table.model] = table.lengths
    return float(np.minimum(found, full).sum())


def _refit(table: PairTable, placement: Array) -> Array:
    """Assign each inlier data line to its nearest model line, then fit in closed form."""
    near, distance = _find_inliers(table, placement)
    order = np.lexsort((distance, table.data))
    order = order[near[order]]
    first = np.ones(len(order), bool)
    first[1:] = table.data[order[1:]] != table.data[order[:-1]]
    chosen = order[first]
    return _fit(table, chosen, placement)


def fit_true_pairs(model_px: Array, data_px: Array, owner: NDArray[np.intp]) -> Similarity2:
    """Fit to the true pairs, given by ``owner`` (k,): a bound for any search for pairs."""
    centre = model_px.reshape(-1, 2).mean(axis=0)
    model, data = build_line_table(model_px, centre), build_line_table(data_px, centre)
    table = build_pair_table(model, data, np.full(len(model_px), 3.0 * WINDOW_PX), 2.0 * WINDOW_RAD)
    right = np.flatnonzero(owner[table.data] == table.model)
    return compute_model_motion(_fit(table, right, np.array(STILL)), centre)


def _fit(table: PairTable, chosen: NDArray[np.intp], placement: Array) -> Array:
    """Fit pairs in closed form, weighted by length; ``placement`` if there are fewer than two."""
    if len(chosen) < 2:
        return placement
    rows = table.across[chosen] * np.sqrt(table.shares[chosen])[:, None, None]
    form = np.einsum("pea,peb->ab", rows, rows) + 1e-6 * np.diag([0.0, 0.0, 1.0, 1.0, 0.0])
    return np.asarray(compute_best_fits(form[None], False, placement).placements[0])
