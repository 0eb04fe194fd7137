"""Synthetic 2D matching problems, small and large, and the baseline that they are given to: RANSAC, then ICP."""

from __future__ import annotations

import time
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from knowledge_sources.methods.matching import (
    PairTable,
    Similarity2,
    build_line_table,
    build_pair_table,
    compute_best_fits,
    compute_model_motion,
    match_in_space,
)
from world_models.camera import Camera
from world_models.frames import Pose

Array = NDArray[np.float64]
Index = NDArray[np.intp]

SIDE_PX = 512.0
MAIN_RAD = (0.0, 1.3, 2.0)
"""Half of the lines are near one of these directions, as in a building; the others have any."""
MODEL_LENGTH_PX = (40.0, 180.0)
SHIFT_PX, TURN_RAD = 15.0, 0.1
OMITTED = 0.15
FRAGMENTS = 3
GAP_SHARE = 0.2
"""Largest missing share of a fragment's length at each end."""
SKEW_RAD = 0.015
OFFSET_PX = 0.5
DISTRACTED = 0.5
BESIDE_PX = (4.0, 12.0)
CLUTTER_LENGTH_PX = 25.0


@dataclass(frozen=True, slots=True, eq=False)
class MatchScene:
    """A problem and its solution.

    Attributes:
        model_px: (m, 2, 2) as projected from a wrong pose. data_px: (k, 2, 2).
        owner: (k,) the model line that a data line is a fragment of, -1 for none.
        move: the true move of the model.
    """

    model_px: Array
    data_px: Array
    owner: Index
    move: Similarity2


def generate_match_scene(lines: int, data: int, rng: np.random.Generator) -> MatchScene:
    """Generate ``lines`` model lines and ``data`` data lines: fragments, then distractors, then clutter."""
    model = _model(lines, rng)
    shift, centre = rng.uniform(-SHIFT_PX, SHIFT_PX, 2), model.reshape(-1, 2).mean(axis=0)
    move = Similarity2(
        float(rng.uniform(-TURN_RAD, TURN_RAD)), (float(shift[0]), float(shift[1])),
        (float(centre[0]), float(centre[1])),
    )
    moved = move.apply(model)
    seen = np.flatnonzero(rng.random(lines) >= OMITTED)
    pieces = [(piece, int(i)) for i in seen for piece in _fragments(moved[i], rng)]
    beside = np.flatnonzero(rng.random(lines) < DISTRACTED)
    pieces += [(piece, -1) for i in beside for piece in _fragments(_shift_aside(moved[i], rng), rng)]
    pieces = pieces[:data]
    clutter = _clutter(data - len(pieces), rng)
    segments = np.concatenate([np.array([piece for piece, _ in pieces]).reshape(-1, 2, 2), clutter])
    owner = np.array([i for _, i in pieces] + [-1] * len(clutter), dtype=np.intp)
    order = rng.permutation(len(segments))
    return MatchScene(model, segments[order], owner[order], move)


def _model(count: int, rng: np.random.Generator) -> Array:
    angle = rng.choice(MAIN_RAD, count) + rng.normal(0.0, 0.05, count)
    angle = np.where(rng.random(count) < 0.5, angle, rng.uniform(0.0, np.pi, count))
    half = 0.5 * rng.uniform(*MODEL_LENGTH_PX, count)[:, None] * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    middle = rng.uniform(0.2 * SIDE_PX, 0.8 * SIDE_PX, (count, 2))
    return np.stack([middle - half, middle + half], axis=1)


def _fragments(line: Array, rng: np.random.Generator) -> list[Array]:
    """Cut a line into 1 to 3 pieces (2, 2) with gaps, each turned and moved a little."""
    edges = np.linspace(0.0, 1.0, int(rng.integers(1, FRAGMENTS + 1)) + 1)
    parts = []
    for low, high in pairwise(edges):
        room = GAP_SHARE * (high - low)
        start, end = low + rng.uniform(0.0, room), high - rng.uniform(0.0, room)
        parts.append(_skew(line[0] + np.outer([start, end], line[1] - line[0]), rng))
    return parts


def _skew(piece: Array, rng: np.random.Generator) -> Array:
    span = piece[1] - piece[0]
    across = np.array([-span[1], span[0]])
    slope = rng.normal(0.0, SKEW_RAD) * 0.5 * across
    offset = rng.normal(0.0, OFFSET_PX) * across / np.linalg.norm(across)
    return np.asarray(piece + offset + np.stack([-slope, slope]))


def _shift_aside(line: Array, rng: np.random.Generator) -> Array:
    """Shift a line sideways by 4 to 12 px, as a frame or shadow."""
    span = line[1] - line[0]
    across = np.array([-span[1], span[0]]) / np.linalg.norm(span)
    return np.asarray(line + rng.choice([-1.0, 1.0]) * rng.uniform(*BESIDE_PX) * across)


def _clutter(count: int, rng: np.random.Generator) -> Array:
    start, angle = rng.uniform(0.0, SIDE_PX, (count, 2)), rng.uniform(0.0, np.pi, count)
    length = 8.0 + rng.exponential(CLUTTER_LENGTH_PX, (count, 1))
    return np.stack([start, start + length * np.stack([np.cos(angle), np.sin(angle)], axis=1)], axis=1)


MODEL, DATA = 300, 4500
CAMERA = Camera.from_field_of_view(np.radians(65.0))
NOISE_PX = 0.4
PRIORS = ((0.15, 0.02), (0.3, 0.05), (1.0, 0.1))
"""Standard deviations of the prior [m] and [rad] on each axis."""
MAX_S = 2.0


def measure_large(seed: int) -> list[tuple[str, int, float]]:
    """For each prior what it is, how many pairs are matched, and the processor time of the match [s]."""
    rng = np.random.default_rng([seed, MODEL, DATA])
    lines, data = generate_large(rng)
    out = []
    for spread_m, spread_rad in PRIORS:
        covariance = np.diag([spread_rad**2] * 3 + [spread_m**2] * 3)
        prior = Pose.from_rotation_vector(*(rng.uniform(-s, s, 3) for s in (spread_rad, spread_m)))
        match_in_space(lines[:5], data[:20], CAMERA, prior, covariance)  # compiles
        before = time.process_time()
        match = match_in_space(lines, data, CAMERA, prior, covariance)
        out.append((f"prior of {spread_m:g} m and {spread_rad:g} rad", len(match.pairs), time.process_time() - before))
    return out


def generate_large(rng: np.random.Generator) -> tuple[Array, Array]:
    """Model lines (300, 2, 3) [m] along three axes, and the segments (4500, 2, 2) [px] of those in view and clutter."""
    start = rng.uniform([-4.0, -3.0, 4.0], [4.0, 3.0, 14.0], (MODEL, 3))
    along = np.eye(3)[rng.integers(0, 3, MODEL)] * rng.uniform(0.3, 2.0, (MODEL, 1))
    lines = np.stack([start, start + along], axis=1)
    px, visible = CAMERA.project_segments(lines, Pose.identity())
    seen = px[visible] + rng.normal(0.0, NOISE_PX, px[visible].shape)
    count = DATA - len(seen)
    middle = rng.uniform(0.0, 511.0, (count, 2))
    angle = rng.choice([0.0, 0.5 * np.pi, 0.3, -0.3, 1.0], count) + rng.normal(0.0, 0.05, count)
    half = 0.5 * rng.uniform(10.0, 60.0, (count, 1)) * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    return lines, np.concatenate([seen, np.stack([middle - half, middle + half], axis=1)])


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
    return np.asarray(compute_best_fits(form[None], placement).placements[0])
