"""2D model matching in the image: which data lines show which model lines (§6.1)?

A generalised Hough transform over turn and shift says where to start (§6.1.2); the pairs round that place are linear in
the placement that lays the data on the model (§6.1.4).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Collection
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from knowledge_sources.methods.arrays import Floats, Indices, Ints, Mask
from knowledge_sources.methods.matching.matching_kernels import RIGID
from knowledge_sources.methods.matching.search import (
    Correspondence,
    Fitting,
    PairSpace,
    SearchResult,
    Similarity2,
    Terms,
    build_likelihood_terms,
    build_masks,
    choose_nearest,
    compute_best_fits,
    compute_coverage,
    fit_state,
    list_pairs,
    search_pairs,
)
from world_models.compiled import compiled

MAX_PAIR_PX = 4.0
"""Largest distance of a data end from its model line in the image (§6.1.4 says 3 px; wider for perspective)."""
PAIR_SIGMAS = 3.0  # standard deviations of a data end in that largest distance
MAX_STARTS = 3  # placements that are searched (paper: 1) (§6.1.4, experiment matcher)
HOUGH_WINDOW_PX = 30.0  # largest shift of the model (§6.1.4)
HOUGH_STEP_RAD = 0.03  # turn between two planes of the accumulator
HOUGH_CELLS = 33  # cells along each of the accumulator's two axes of shift
HOUGH_WINDOW_RAD = 0.3  # rad; largest turn of the model (§6.1.4)
COVERAGE_CELLS = 48  # cells along a model line by which its coverage is counted
MAX_PAIR_RAD = 0.3  # rad; largest angle between a data line and its model line (§6.1.4)
MIN_SIGMA_PX = 1.0  # px; smallest standard deviation of a data end, likelihood
MIN_START_ERROR_PX = 3.0  # px; smallest error of a start that the likelihood assumes
HOUGH_PEAKS_PER_START = 4  # peaks that are refined for each placement that is searched
START_WIDTHS_PX = (8.0, 6.0, 4.0, 3.0, 2.0, 1.5)  # px; widths of the loss by which a peak is refined
MIN_LENGTH_PX = 1e-12  # keeps the direction of a segment without length finite

Pair = tuple[int, int]
"""Model index, data index."""
Search = Callable[[PairSpace, Terms, Mask], SearchResult]
"""As :func:`search_pairs`."""


@dataclass(frozen=True, slots=True, eq=False)
class Match(Correspondence):
    """A correspondence in the image.

    Attributes:
        transform: moves the model onto the data.
        steps: moves made from the start to this state.
    """

    transform: Similarity2
    steps: int


def match_lines(
    model_px: Any,
    data_px: Any,
    *,
    pair_px: Any = MAX_PAIR_PX,
    max_starts: int = MAX_STARTS,
    start: Peak | None = None,
    first_pairs: Collection[Pair] | None = None,
    terms: Terms | None = None,
    search: Search = search_pairs,
) -> Match:
    """Match the projected model to the data lines, the model moving as a rigid figure in the image.

    Source: §6.1: a generalised Hough transform over the data within a window of the model places the model; the pairs
    near that place form the space; local search finds the state of least match error. The paper's own objective and
    search are in :mod:`experiments.paper.paper_matching`.

    Args:
        model_px: (m, 2, 2) projected model lines. data_px: (k, 2, 2) data lines.
        pair_px: how far a data end may lie from its model line: one number, or (m,) when some model lines are
            predicted worse than others. Wider when perspective bends the prediction.
        max_starts: placements that are searched.
        start: this placement (about the mean of the model's ends) instead of Hough's.
        first_pairs: pairs of the first state; ``None``: each near data line to its nearest model line.
        terms, search: another objective than the likelihood, and another local search.

    Raises:
        ValueError: a wrong shape, a distance that is not > 0.
    """
    model, data = _check_lines(model_px, "model_px"), _check_lines(data_px, "data_px")
    centre = model.reshape(-1, 2).mean(axis=0) if len(model) else np.zeros(2)
    still, scene = build_line_table(model, centre), build_line_table(data, centre)
    gates = _check_gates(pair_px, len(model))
    terms = terms or _build_terms(still, scene, gates)
    window_px = HOUGH_WINDOW_PX + np.maximum(gates, START_WIDTHS_PX[0])
    table = build_pair_table(still, scene, window_px, HOUGH_WINDOW_RAD + MAX_PAIR_RAD)
    placements = [compute_placement(start)] if start else _find_starts(still, scene, table, max_starts)
    tries = []
    for placement in placements:
        space, first, rows = _build_space(table, placement, gates, terms)
        if first_pairs is not None:
            first = np.array([pair in first_pairs for pair in zip(space.model, space.data, strict=True)], bool)
        tries.append((space, rows, search(space, terms, first)))
    space, rows, result = min(tries, key=lambda tried: float(tried[2].errors[-1]))
    chosen, pairs = list_pairs(space, result.chosen)
    fit, covered = fit_state(space, result.chosen), compute_coverage(space, result.chosen)
    return Match(
        pairs=pairs,
        e_fit=float(fit.errors[0]),
        e_omission=float(terms.compute_omission(1.0 - covered, np.arange(space.lines)).sum()),
        coverage=covered,
        residuals_px=np.asarray(rows[chosen] @ fit.placements[0]),
        transform=compute_model_motion(fit.placements[0], centre),
        steps=len(result.errors) - 1,
    )


def _build_terms(model: LineTable, data: LineTable, gates: Floats) -> Terms:
    """The objective, its noise taken from the median distance (m,) within which pairs are looked for [px]."""
    width = float(np.median(gates)) if len(gates) else MAX_PAIR_PX
    sigma_px = max(MIN_SIGMA_PX, width / PAIR_SIGMAS)
    start_px = max(width, MIN_START_ERROR_PX)
    return build_likelihood_terms(model.lengths, len(data.ends), sigma_px, start_px)


def _find_starts(still: LineTable, scene: LineTable, table: PairTable, max_starts: int) -> Floats:
    """Placements (k, 5) to search from: Hough's peaks, refined, the best supported that differ.

    They differ by 1 px of shift, or 0.01 of turn or scale.
    """
    peaks = find_hough_peaks(still, scene, HOUGH_PEAKS_PER_START * max_starts)
    coarse = np.stack([compute_placement(peak) for peak in peaks])
    placements, support = refine_placements(table, coarse, START_WIDTHS_PX)
    kept: list[int] = []
    for i in np.argsort(-support, kind="stable"):
        apart = [np.abs((placements[i] - placements[j]) * (100.0, 100.0, 1.0, 1.0, 100.0)).max() for j in kept]
        if all(a > 1.0 for a in apart):
            kept.append(int(i))
    return placements[kept[:max_starts]]


def _build_space(
    table: PairTable, placement: Floats, gates: Floats, terms: Terms
) -> tuple[PairSpace, Mask, Floats]:
    """The restricted space at a placement; the state to start from, each near data line to its nearest line; and the
    rows ``across`` of its pairs.
    """
    members = np.flatnonzero(find_gated(table, placement, gates, MAX_PAIR_RAD))
    model, data = table.model[members], table.data[members]
    rows = table.across[members]
    weights = terms.end_weights[data]
    shift, turn, scale = (np.array([w]) for w in terms.anchor_weights)
    space = PairSpace(
        model=model,
        data=data,
        forms=np.swapaxes(rows * weights[:, None, None], 1, 2) @ rows,
        masks=build_masks(table.along[members] @ placement, table.lengths[members], COVERAGE_CELLS),
        lines=table.lines,
        anchor=build_anchors(placement[None], shift, turn, scale)[0],
        fitting=Fitting(RIGID, math.atan2(placement[1], placement[0])),
    )
    distances = np.sqrt(np.mean((rows @ placement) ** 2, axis=1))
    return space, choose_nearest(data, distances, distances <= 0.5 * gates[model]), rows


def _check_gates(pair_px: Any, count: int) -> Floats:
    gates = np.asarray(pair_px, float)
    if gates.shape not in ((), (count,)) or np.any(~(gates > 0)):
        raise ValueError(f"expected pair_px > 0, one number or {count}, got {pair_px!r}")
    return np.broadcast_to(gates, (count,))


def _check_lines(values: Any, name: str) -> Floats:
    array = np.asarray(values, float)
    if array.size == 0:
        return np.zeros((0, 2, 2))
    if array.ndim != 3 or array.shape[1:] != (2, 2) or not np.all(np.isfinite(array)):
        raise ValueError(f"expected finite {name} of shape (n, 2, 2), got {array.shape}")
    return array


class LineTable(NamedTuple):
    """n segments as infinite lines, relative to a common centre.

    Attributes:
        ends: (n, 2, 2) [px]. middles: (n, 2). directions: (n, 2) unit. normals: (n, 2). offsets: (n,) n . p.
        lengths: (n,). angles: (n,) of the undirected line [rad].
    """

    ends: Floats
    middles: Floats
    directions: Floats
    normals: Floats
    offsets: Floats
    lengths: Floats
    angles: Floats


def build_line_table(segments_px: Floats, centre: Floats) -> LineTable:
    """Prepare segments (n, 2, 2), coordinates relative to ``centre`` (2,)."""
    ends = segments_px - centre
    span = ends[:, 1] - ends[:, 0]
    lengths = np.linalg.norm(span, axis=1)
    directions = span / np.maximum(lengths, MIN_LENGTH_PX)[:, None]
    normals = np.stack([-directions[:, 1], directions[:, 0]], axis=1)
    middles = ends.mean(axis=1)
    angles = np.arctan2(directions[:, 1], directions[:, 0])
    return LineTable(ends, middles, directions, normals, np.sum(normals * middles, axis=1), lengths, angles)


def wrap_undirected(angles_rad: Floats) -> Floats:
    """Angles between undirected lines, in [-pi/2, pi/2)."""
    return np.asarray(np.remainder(angles_rad + 0.5 * np.pi, np.pi) - 0.5 * np.pi)


@dataclass(frozen=True, slots=True)
class Peak:
    """A start: turn the model by ``turn_rad`` about the centre, then shift it."""

    turn_rad: float
    shift_px: tuple[float, float]
    votes: float


NO_MOTION = Peak(0.0, (0.0, 0.0), 0.0)


def find_hough_peaks(model: LineTable, data: LineTable, count: int) -> list[Peak]:
    """The best ``count`` separate peaks, best first; no motion if nothing votes.

    A data line in the window of a model line votes, at each turn that makes them nearly parallel, for the shift across
    the model line that lays one on the other. A model line's votes at one offset count at most its own length: texture
    cannot outvote a contour. The sum of each line's votes at n . T is the accumulator over T.
    """
    if not (len(model.ends) and len(data.ends)):
        return [NO_MOTION]
    window_px, window_rad = HOUGH_WINDOW_PX, HOUGH_WINDOW_RAD
    half = int(np.ceil(window_rad / HOUGH_STEP_RAD))
    turns = np.linspace(-half * HOUGH_STEP_RAD, half * HOUGH_STEP_RAD, 2 * half + 1)
    axis = np.linspace(-window_px, window_px, HOUGH_CELLS)
    step = 2.0 * window_px / (HOUGH_CELLS - 1)
    rows, columns = find_pairs_within(model, data, np.full(len(model.ends), window_px), window_rad)
    votes = _vote(
        turns, 2 * int(np.ceil(1.5 * window_px / step)) + 1, rows, columns,
        wrap_undirected(data.angles[columns] - model.angles[rows]), model.normals, model.offsets, model.lengths,
        data.middles, data.lengths, step, HOUGH_STEP_RAD,
    )
    scores = _gather(votes, turns, axis, model.normals, step)
    cells = _suppress_non_maxima(scores, turns, axis, count, window_px, window_rad).tolist()
    peaks = [
        Peak(float(turns[t]), (float(axis[u]), float(axis[v])), float(scores[t, v, u]))
        for t, v, u in cells if scores[t, v, u] > 0.0
    ]
    return peaks or [NO_MOTION]


def find_pairs_within(
    model: LineTable, data: LineTable, window_px: Floats, window_rad: float
) -> tuple[Ints, Ints]:
    """Model and data indices (p,) of every pair within the windows.

    Args:
        window_px: (m,) across the model line, its lever arm for such a turn added, and along it.
        window_rad: between the directions.
    """
    pairs: Ints = _find_pairs_within(
        np.ascontiguousarray(window_px), window_rad, model.middles, model.normals, model.directions, model.lengths,
        model.angles, data.middles, data.lengths, data.angles,
    )
    return pairs[0], pairs[1]


@compiled
def _vote(
    turns: Floats, bins: int, rows: Ints, columns: Ints, angles: Floats, normals: Floats, offsets: Floats,
    model_lengths: Floats, middles: Floats, data_lengths: Floats, step: float, turn_step: float,
) -> Floats:
    """Each near pair votes, at each turn that makes it nearly parallel, for the offset that lays one on the other.

    The offsets next to it get half as much.
    """
    votes, widest = np.zeros((len(turns), len(normals), bins)), 1.5 * turn_step
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


@compiled
def _find_pairs_within(
    window_px: Floats, window_rad: float, middles: Floats, normals: Floats, directions: Floats, lengths: Floats,
    angles: Floats, data_middles: Floats, data_lengths: Floats, data_angles: Floats,
) -> Ints:
    pairs, count = np.empty((2, len(middles) * len(data_middles)), np.int64), 0
    for i in range(len(middles)):
        lever = 0.5 * window_rad * lengths[i]
        for k in range(len(data_middles)):
            u, v = data_middles[k, 0] - middles[i, 0], data_middles[k, 1] - middles[i, 1]
            across = abs(u * normals[i, 0] + v * normals[i, 1])
            gap = abs(u * directions[i, 0] + v * directions[i, 1]) - 0.5 * (lengths[i] + data_lengths[k])
            angle = abs((data_angles[k] - angles[i] + 0.5 * math.pi) % math.pi - 0.5 * math.pi)
            if across <= window_px[i] + lever and gap <= window_px[i] and angle <= window_rad:
                pairs[0, count], pairs[1, count] = i, k
                count += 1
    return pairs[:, :count]


@compiled
def _gather(votes: Floats, turns: Floats, axis: Floats, normals: Floats, step: float) -> Floats:
    """(t, cells, cells) accumulator: at each turn and shift T the sum of each model line's votes at its n . T."""
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


@compiled
def _suppress_non_maxima(
    scores: Floats, turns: Floats, axis: Floats, count: int, window_px: float, window_rad: float
) -> Ints:
    """(n, 3) cells (turn, v, u), highest first; each suppresses those within 2 turns and 2 cells.

    Ties go to the smaller motion.
    """
    free = np.ones(scores.shape, np.bool_)
    tops, at = np.full(len(turns), -math.inf), np.zeros((len(turns), 3), np.int64)
    cells = np.empty((count, 3), np.int64)
    first, last = 0, len(turns)
    for n in range(count):
        for t in range(first, last):  # the turns whose highest free cell is not known
            tops[t] = -math.inf
            for v in range(len(axis)):
                for u in range(len(axis)):
                    if free[t, v, u] and scores[t, v, u] > tops[t]:
                        motion = abs(turns[t]) / window_rad + math.hypot(axis[u], axis[v]) / window_px
                        if scores[t, v, u] - 1e-6 * motion > tops[t]:
                            tops[t] = scores[t, v, u] - 1e-6 * motion
                            at[t, 0], at[t, 1], at[t, 2] = t, v, u
        best = np.argmax(tops)
        if tops[best] == -math.inf:
            return cells[:n]
        cells[n] = at[best]
        t, v, u = cells[n]
        first, last = max(t - 2, 0), min(t + 3, len(turns))
        free[first:last, max(v - 2, 0) : v + 3, max(u - 2, 0) : u + 3] = False
    return cells


class PairTable(NamedTuple):
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
    c, s, u, v, _ = placement
    return Similarity2(
        float(np.arctan2(-s, c)),
        (float(-(c * u + s * v)), float(-(-s * u + c * v))),
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
        at = compute_best_fits((weights @ forms).reshape(-1, 5, 5) + anchors, at).placements
    return at, _compute_support(table, at, widths_px[-1])


def build_anchors(placements: Floats, shift_weight: Floats, turn_weight: Floats, scale_weight: Floats) -> Floats:
    """(k, 5, 5) weak pulls to placements (k, 5), so that few or parallel pairs still have one best fit."""
    weights = [np.ascontiguousarray(w, float) for w in (shift_weight, turn_weight, scale_weight)]
    pulls: Floats = _build_pulls(np.ascontiguousarray(placements), *weights)
    return pulls


@compiled
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


@compiled
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
