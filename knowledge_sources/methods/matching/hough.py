"""Where to start: a generalised Hough transform over turn and shift (§6.1.4)."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

Array = NDArray[np.float64]

TURN_STEP_RAD = 0.03
CELLS = 33
"""Shift cells along each axis of the accumulator."""


@dataclass(frozen=True, slots=True, eq=False)
class LineTable:
    """Segments as infinite lines, about a common centre.

    Attributes:
        ends: (n, 2, 2) [px]. middles: (n, 2). directions: (n, 2) unit. normals: (n, 2). offsets: (n,) n . p.
        lengths: (n,). angles: (n,) of the undirected line.
    """

    ends: Array
    middles: Array
    directions: Array
    normals: Array
    offsets: Array
    lengths: Array
    angles: Array


def build_line_table(segments_px: Array, centre: Array) -> LineTable:
    """Prepare segments (n, 2, 2), coordinates relative to ``centre``."""
    ends = segments_px - centre
    span = ends[:, 1] - ends[:, 0]
    lengths = np.linalg.norm(span, axis=1)
    directions = span / np.maximum(lengths, 1e-12)[:, None]
    normals = np.stack([-directions[:, 1], directions[:, 0]], axis=1)
    middles = ends.mean(axis=1)
    return LineTable(
        ends,
        middles,
        directions,
        normals,
        np.sum(normals * middles, axis=1),
        lengths,
        np.arctan2(directions[:, 1], directions[:, 0]),
    )


def undirected(angles_rad: Array) -> Array:
    """Angles between undirected lines, in [-pi/2, pi/2)."""
    return np.asarray(np.remainder(angles_rad + 0.5 * np.pi, np.pi) - 0.5 * np.pi)


@dataclass(frozen=True, slots=True)
class Peak:
    """A start: turn the model by ``turn_rad`` about the centre, then shift it."""

    turn_rad: float
    shift_px: tuple[float, float]
    votes: float


NO_MOTION = Peak(0.0, (0.0, 0.0), 0.0)


def hough_peaks(model: LineTable, data: LineTable, window_px: float, window_rad: float, count: int) -> list[Peak]:
    """The best ``count`` separate peaks, best first; no motion if nothing votes.

    A data line near (30 px, 0.3 rad) a model line votes, at each turn that makes them nearly parallel, for the shift
    across the model line that lays one on the other. A model line's votes at one offset count at most its own length:
    texture cannot outvote a contour. Gathering each line's votes at n . T gives the accumulator over T.
    """
    if not (len(model.ends) and len(data.ends)):
        return [NO_MOTION]
    turns = _turns(window_rad)
    step = 2.0 * window_px / (CELLS - 1)
    votes = _offset_votes(model, data, turns, window_px, window_rad, step)
    scores = _gathered(model, votes, turns, window_px, step)
    return _separate_peaks(scores, turns, window_px, step, count)


def _turns(window_rad: float) -> Array:
    half = int(np.ceil(window_rad / TURN_STEP_RAD))
    return np.linspace(-half * TURN_STEP_RAD, half * TURN_STEP_RAD, 2 * half + 1)


def _offset_votes(
    model: LineTable, data: LineTable, turns: Array, window_px: float, window_rad: float, step: float
) -> Array:
    """(t, m, bins): share of each model line found at each offset across it, at each turn."""
    bins = 2 * int(np.ceil(1.5 * window_px / step)) + 1
    rows, columns = pairs_within(model, data, np.full(len(model.ends), window_px), window_rad)
    votes: Array = _votes(
        turns, bins, rows, columns, undirected(data.angles[columns] - model.angles[rows]),
        model.normals, model.offsets, model.lengths, data.middles, data.lengths, step,
    )
    return votes


@njit(cache=True, error_model="numpy")
def _votes(
    turns: Any, bins: int, rows: Any, columns: Any, angles: Any, normals: Any, offsets: Any, model_lengths: Any,
    middles: Any, data_lengths: Any, step: float,
) -> Any:
    """Each near pair votes, at each turn that makes it nearly parallel, for the offset that lays one on the other; half
    as much for the offsets beside it."""
    votes, widest = np.zeros((len(turns), len(normals), bins)), 1.5 * TURN_STEP_RAD
    for t in range(len(turns)):
        c, s = math.cos(turns[t]), math.sin(turns[t])
        for p in range(len(rows)):
            i, k = rows[p], columns[p]
            miss = abs((angles[p] - turns[t] + 0.5 * math.pi) % math.pi - 0.5 * math.pi)
            if miss >= widest:
                continue
            u, v = middles[k, 0], middles[k, 1]
            across = normals[i, 0] * (c * u + s * v) + normals[i, 1] * (c * v - s * u) - offsets[i]
            cell = int(np.rint(across / step)) + bins // 2
            if 0 <= cell < bins:
                votes[t, i, cell] += min(data_lengths[k], model_lengths[i]) * (1.0 - miss / widest)
        for i in range(len(normals)):
            before = votes[t, i, 0]
            for cell in range(1, bins - 1):
                here = votes[t, i, cell]
                votes[t, i, cell] = here + 0.5 * (before + votes[t, i, cell + 1])
                before = here
            for cell in range(bins):
                votes[t, i, cell] = min(votes[t, i, cell], model_lengths[i])
    return votes


def pairs_within(
    model: LineTable, data: LineTable, window_px: Array, window_rad: float
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Model and data indices (p,) of every pair within the windows: (m,) pixels across the model line, its lever arm
    for such a turn added, and along it, and an angle."""
    found: NDArray[np.int64] = _pairs_within(
        np.ascontiguousarray(window_px), window_rad, model.middles, model.normals, model.directions, model.lengths,
        model.angles, data.middles, data.lengths, data.angles,
    )
    return found[0], found[1]


@njit(cache=True, error_model="numpy")
def _pairs_within(
    window_px: Any, window_rad: float, middles: Any, normals: Any, directions: Any, lengths: Any, angles: Any,
    data_middles: Any, data_lengths: Any, data_angles: Any,
) -> Any:
    found, count = np.empty((2, len(middles) * len(data_middles)), np.int64), 0
    for i in range(len(middles)):
        lever = 0.5 * window_rad * lengths[i]
        for k in range(len(data_middles)):
            u, v = data_middles[k, 0] - middles[i, 0], data_middles[k, 1] - middles[i, 1]
            across = abs(u * normals[i, 0] + v * normals[i, 1])
            gap = abs(u * directions[i, 0] + v * directions[i, 1]) - 0.5 * (lengths[i] + data_lengths[k])
            angle = abs((data_angles[k] - angles[i] + 0.5 * math.pi) % math.pi - 0.5 * math.pi)
            if across <= window_px[i] + lever and gap <= window_px[i] and angle <= window_rad:
                found[0, count], found[1, count] = i, k
                count += 1
    return found[:, :count]


def _gathered(model: LineTable, votes: Array, turns: Array, window_px: float, step: float) -> Array:
    """(t, CELLS, CELLS) accumulator over turn and shift."""
    axis = np.linspace(-window_px, window_px, CELLS)
    scores: Array = _gather(votes, turns, axis, model.normals, step)
    return scores


@njit(cache=True, error_model="numpy")
def _gather(votes: Any, turns: Any, axis: Any, normals: Any, step: float) -> Any:
    """At each turn and shift T the sum of what each model line has at its offset n . T."""
    bins, cells = votes.shape[2], len(axis)
    scores = np.zeros((len(turns), cells, cells))
    across = np.empty(cells)
    for t in range(len(turns)):
        c, s = math.cos(turns[t]), math.sin(turns[t])
        for i in range(len(normals)):
            if not votes[t, i].any():
                continue
            # In the model's own frame the shift appears turned back.
            by_u = (c * normals[i, 0] - s * normals[i, 1]) / step
            by_v = (s * normals[i, 0] + c * normals[i, 1]) / step
            for u in range(cells):
                across[u] = by_u * axis[u] + (bins // 2 + 0.5)  # so that cutting off the fraction rounds
            for v in range(cells):
                along = by_v * axis[v]
                for u in range(cells):
                    cell = int(across[u] + along)
                    scores[t, v, u] += votes[t, i, min(max(cell, 0), bins - 1)]
    return scores


def _separate_peaks(scores: Array, turns: Array, window_px: float, step: float, count: int) -> list[Peak]:
    """Highest cells first, each clearing its neighbourhood (2 turns, 2 cells); ties go to the smaller motion."""
    axis = np.linspace(-window_px, window_px, CELLS)
    cells = [cell for cell in _highest(scores, turns, axis, count).tolist() if scores[tuple(cell)] > 0.0]
    peaks = [Peak(float(turns[t]), (float(axis[u]), float(axis[v])), float(scores[t, v, u])) for t, v, u in cells]
    return peaks or [NO_MOTION]


@njit(cache=True, error_model="numpy")
def _highest(scores: Any, turns: Any, axis: Any, count: int) -> Any:
    """(n, 3) cells (turn, v, u), each the highest that those before it leave; a hair lower the larger its motion."""
    free = np.ones(scores.shape, np.bool_)
    tops, at = np.full(len(turns), -math.inf), np.zeros((len(turns), 3), np.int64)
    found = np.empty((count, 3), np.int64)
    first, last = 0, len(turns)
    for n in range(count):
        for t in range(first, last):  # of these turns the highest cell is not known, or taken
            tops[t] = -math.inf
            for v in range(len(axis)):
                for u in range(len(axis)):
                    if free[t, v, u] and scores[t, v, u] > tops[t]:
                        motion = abs(turns[t]) / 0.3 + math.hypot(axis[u], axis[v]) / 30.0
                        if scores[t, v, u] - 1e-6 * motion > tops[t]:
                            tops[t] = scores[t, v, u] - 1e-6 * motion
                            at[t, 0], at[t, 1], at[t, 2] = t, v, u
        best = np.argmax(tops)
        if tops[best] == -math.inf:
            return found[:n]
        found[n] = at[best]
        t, v, u = found[n]
        first, last = max(t - 2, 0), min(t + 3, len(turns))
        free[first:last, max(v - 2, 0) : v + 3, max(u - 2, 0) : u + 3] = False
    return found
