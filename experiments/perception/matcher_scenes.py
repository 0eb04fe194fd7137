"""Synthetic 2D matching problems: a moved model in skewed fragments among distractors and clutter."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from knowledge_sources.methods.matching import Similarity2

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
        float(rng.uniform(-TURN_RAD, TURN_RAD)), (float(shift[0]), float(shift[1])), 1.0,
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
