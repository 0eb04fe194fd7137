"""Possible pairs of model and data lines in the image, linear in the placement that lays the data on the model."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numba import njit

from knowledge_sources.methods.arrays import Floats, Indices, Mask
from knowledge_sources.methods.matching.fit import Similarity2, compute_best_fits
from knowledge_sources.methods.matching.hough import LineTable, Peak, find_pairs_within, wrap_undirected


@dataclass(frozen=True, slots=True, eq=False)
class PairTable:
    """p pairs. A placement is (cos, sin, T_u, T_v, s) of R p + T against s rho, §6.1.2.

    Attributes:
        model, data: (p,) indices. angles: (p,) data line's angle from the model line's [rad].
        across, along: (p, 2, 5) rows that give, times a placement, the data ends' distances across the model line
            and along it from its first end [px]. lengths: (p,) of the model line [px].
        shares: (p,) the shorter of both lengths [px].
        lines: number of model lines.
    """

    model: Indices
    data: Indices
    angles: Floats
    across: Floats
    along: Floats
    lengths: Floats
    shares: Floats
    lines: int


def build_pair_table(model: LineTable, data: LineTable, window_px: Floats, window_rad: float) -> PairTable:
    """Every pair within the windows: (m,) pixels across and along, and an angle; the turn's lever arm is added."""
    i, k = find_pairs_within(model, data, window_px, window_rad)
    starts = np.sum(model.directions * model.ends[:, 0], axis=1)
    return PairTable(
        model=i,
        data=k,
        angles=wrap_undirected(data.angles[k] - model.angles[i]),
        across=_build_rows(model.normals[i], model.offsets[i], data.ends[k]),
        along=_build_rows(model.directions[i], starts[i], data.ends[k]),
        lengths=model.lengths[i],
        shares=np.minimum(data.lengths[k], model.lengths[i]),
        lines=len(model.ends),
    )


def compute_placement(peak: Peak) -> Floats:
    """(5,) the placement of the data on the model: the inverse of the peak's motion of the model."""
    c, s = np.cos(peak.turn_rad), np.sin(peak.turn_rad)
    u, v = peak.shift_px
    return np.array([c, -s, -(c * u + s * v), -(-s * u + c * v), 1.0])


def compute_model_motion(placement: Floats, centre: Floats) -> Similarity2:
    """The motion of the model onto the data: the inverse of a placement (5,), about ``centre`` (2,) [px]."""
    c, s, u, v, scale = placement
    return Similarity2(
        float(np.arctan2(-s, c)),
        (float(-(c * u + s * v)), float(-(-s * u + c * v))),
        float(scale),
        (float(centre[0]), float(centre[1])),
    )


def find_gated(table: PairTable, placement: Floats, gates: Floats, window_rad: float) -> Mask:
    """(p,) pairs that, so placed, lie within (m,) ``gates`` [px] across, overlap along and are nearly parallel."""
    gate = gates[table.model]
    across = np.abs(table.across @ placement)
    along = table.along @ placement
    turn = np.arctan2(placement[1], placement[0])
    near = (np.maximum(across[:, 0], across[:, 1]) <= gate) & (np.abs(table.angles + turn) <= window_rad)
    low, high = np.minimum(along[:, 0], along[:, 1]), np.maximum(along[:, 0], along[:, 1])
    return np.asarray(near & (high >= -gate) & (low <= table.lengths + gate))


def refine_placements(table: PairTable, placements: Floats, widths_px: tuple[float, ...]) -> tuple[Floats, Floats]:
    """Placements (k, 5) moved to where close pairs agree, and their support (k,) [px of model line].

    Iteratively reweighted least squares on Geman and McClure's loss, weights 1 / (1 + (d / width)^2)^2, with a width
    that narrows from round to round (graduated non-convexity). It removes the coarseness of the accumulator.
    """
    forms = np.einsum("pea,peb->pab", table.across, table.across).reshape(len(table.model), 25)
    at = placements
    for width in widths_px:
        weights = _compute_closeness(table, at, width) ** 2 * table.shares
        total = weights.sum(axis=1)
        anchors = build_anchors(at, 1e-3 * total + 1e-9, 10.0 * total + 1e-9, total + 1e-9)
        at = compute_best_fits((weights @ forms).reshape(-1, 5, 5) + anchors, False, at).placements
    return at, _compute_support(table, at, widths_px[-1])


def build_anchors(placements: Floats, shift_weight: Floats, turn_weight: Floats, scale_weight: Floats) -> Floats:
    """(k, 5, 5) weak pulls to placements (k, 5), so that few or parallel pairs still have one best fit."""
    weights = [np.ascontiguousarray(w, float) for w in (shift_weight, turn_weight, scale_weight)]
    pulls: Floats = _build_pulls(np.ascontiguousarray(placements), *weights)
    return pulls


@njit(cache=True, error_model="numpy")
def _build_pulls(placements: Floats, shift_weight: Floats, turn_weight: Floats, scale_weight: Floats) -> Floats:
    out = np.zeros((len(placements), 5, 5))
    row = np.zeros((4, 5))
    for k in range(len(placements)):
        c, s, u, v = placements[k, 0], placements[k, 1], placements[k, 2], placements[k, 3]
        row[0, 2], row[0, 4], row[1, 3], row[1, 4] = 1.0, -u, 1.0, -v
        row[2, 0], row[2, 1], row[3, 0], row[3, 1], row[3, 4] = -s, c, -c, -s, 1.0
        weights = (shift_weight[k], shift_weight[k], turn_weight[k], scale_weight[k])
        for r in range(4):
            for a in range(5):
                for b in range(5):
                    out[k, a, b] += weights[r] * row[r, a] * row[r, b]
    return out


def _compute_support(table: PairTable, placements: Floats, width: float) -> Floats:
    """(k,) length of the model that close data lines cover, each model line at most its own."""
    closeness = _compute_closeness(table, placements, width) * table.shares
    covered = np.zeros((len(placements), table.lines))
    full = np.zeros(table.lines)
    full[table.model] = table.lengths
    for k, row in enumerate(closeness):
        covered[k] = np.bincount(table.model, row, table.lines)
    return np.asarray(np.minimum(covered, full).sum(axis=1))


def _compute_closeness(table: PairTable, placements: Floats, width: float) -> Floats:
    """(k, p) from 1, on the model line and overlapping it, to 0."""
    close: Floats = _compute_close(table.across, table.along, table.lengths, np.ascontiguousarray(placements), width)
    return close


@njit(cache=True, error_model="numpy")
def _compute_close(across: Floats, along: Floats, lengths: Floats, placements: Floats, width: float) -> Floats:
    out = np.zeros((len(placements), len(lengths)))
    for k in range(len(placements)):
        at = placements[k]
        for p in range(len(lengths)):
            low, high, square = math.inf, -math.inf, 0.0
            for e in range(2):
                off = beside = 0.0
                for a in range(5):
                    off += across[p, e, a] * at[a]
                    beside += along[p, e, a] * at[a]
                low, high, square = min(low, beside), max(high, beside), square + 0.5 * off * off
            if high >= 0.0 and low <= lengths[p]:
                out[k, p] = 1.0 / (1.0 + square / (width * width))
    return out


def _build_rows(unit: Floats, offset: Floats, ends: Floats) -> Floats:
    """(p, 2, 5) with unit . (R p + T) - s offset = row @ (cos, sin, T_u, T_v, s)."""
    rows = np.empty((len(ends), 2, 5))
    rows[..., 0] = np.sum(unit[:, None, :] * ends, axis=-1)
    rows[..., 1] = unit[:, None, 1] * ends[..., 0] - unit[:, None, 0] * ends[..., 1]
    rows[..., 2:4] = unit[:, None, :]
    rows[..., 4] = -offset[:, None]
    return rows
