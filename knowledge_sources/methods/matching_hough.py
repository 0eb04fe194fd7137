"""Where to start: a generalised Hough transform over turn and shift (§6.1.4)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
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


def line_table(segments_px: Array, centre: Array) -> LineTable:
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
    reach = int(np.ceil(1.5 * window_px / step))
    bins = 2 * reach + 1
    rows, columns = _near_pairs(model, data, window_px, window_rad)
    angle = undirected(data.angles[columns] - model.angles[rows])
    votes = np.zeros((len(turns), len(model.ends), bins))
    for t, turn in enumerate(turns):
        miss = np.abs(undirected(angle - turn))
        near = miss < 1.5 * TURN_STEP_RAD
        i, k = rows[near], columns[near]
        c, s = np.cos(turn), np.sin(turn)
        middle = data.middles[k]
        back = np.stack([c * middle[:, 0] + s * middle[:, 1], -s * middle[:, 0] + c * middle[:, 1]], axis=1)
        across = np.sum(model.normals[i] * back, axis=1) - model.offsets[i]
        cell = np.rint(across / step).astype(np.intp) + reach
        inside = (cell >= 0) & (cell < bins)
        share = np.minimum(data.lengths[k], model.lengths[i]) * (1.0 - miss[near] / (1.5 * TURN_STEP_RAD))
        np.add.at(votes[t], (i[inside], cell[inside]), share[inside])
    votes[..., 1:-1] += 0.5 * (votes[..., :-2] + votes[..., 2:])
    return np.minimum(votes, model.lengths[None, :, None])


def _near_pairs(
    model: LineTable, data: LineTable, window_px: float, window_rad: float
) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Model and data indices within the windows; along the line they may miss each other by the window."""
    apart = data.middles[None] - model.middles[:, None]
    across = np.abs(np.sum(apart * model.normals[:, None], axis=-1))
    along = np.abs(np.sum(apart * model.directions[:, None], axis=-1))
    gap = along - 0.5 * (model.lengths[:, None] + data.lengths[None])
    angle = np.abs(undirected(data.angles[None] - model.angles[:, None]))
    lever = 0.5 * window_rad * model.lengths[:, None]
    rows, columns = np.nonzero((across <= window_px + lever) & (gap <= window_px) & (angle <= window_rad))
    return rows, columns


def _gathered(model: LineTable, votes: Array, turns: Array, window_px: float, step: float) -> Array:
    """(t, CELLS, CELLS) accumulator over turn and shift."""
    axis = np.linspace(-window_px, window_px, CELLS)
    bins = votes.shape[2]
    scores = np.zeros((len(turns), CELLS, CELLS))
    for t, turn in enumerate(turns):
        c, s = np.cos(turn), np.sin(turn)
        # In the model's own frame the shift T appears turned back.
        u = c * axis[None, :] + s * axis[:, None]
        v = -s * axis[None, :] + c * axis[:, None]
        across = model.normals[:, 0, None, None] * u + model.normals[:, 1, None, None] * v
        cell = np.clip(np.rint(across / step).astype(np.intp) + bins // 2, 0, bins - 1)
        scores[t] = np.take_along_axis(votes[t], cell.reshape(len(cell), -1), axis=1).sum(axis=0).reshape(CELLS, -1)
    return scores


def _separate_peaks(scores: Array, turns: Array, window_px: float, step: float, count: int) -> list[Peak]:
    """Highest cells first, each clearing its neighbourhood (2 turns, 2 cells); ties go to the smaller motion."""
    axis = np.linspace(-window_px, window_px, CELLS)
    still = np.abs(turns)[:, None, None] / 0.3 + np.hypot(axis[None, :, None], axis[None, None, :]) / 30.0
    left = scores - 1e-6 * still
    peaks: list[Peak] = []
    while len(peaks) < count:
        t, v, u = np.unravel_index(int(np.argmax(left)), left.shape)
        if scores[t, v, u] <= 0.0 or not np.isfinite(left[t, v, u]):
            break
        peaks.append(Peak(float(turns[t]), (float(axis[u]), float(axis[v])), float(scores[t, v, u])))
        left[max(t - 2, 0) : t + 3, max(v - 2, 0) : v + 3, max(u - 2, 0) : u + 3] = -np.inf
    return peaks or [NO_MOTION]
