"""The inner loops of matching, compiled by numba: the best fit of a state, and the local search over states (§6.1).

Compiled functions call only functions of their own file: numba's cache does not notice a change in another one.
A state is the chosen pairs, a mask (p,).
"""

from __future__ import annotations

import math

import numpy as np

from knowledge_sources.methods.arrays import Floats, Indices, Ints, Mask
from world_models.compiled import compiled

SpaceArrays = tuple[Floats, Mask, Indices, Indices, Floats]
"""Forms (p, d, d), masks (p, c), model and data indices (p,), anchor (d, d) of a :class:`PairSpace`."""
TermArrays = tuple[Floats, Floats]
"""Scale (m,) and lengths (m,) of the omission, see :class:`Terms`."""
StateArrays = tuple[Ints, Floats, Floats, Floats, Ints]
Scratch = tuple[Floats, Floats, Floats]

RIGID, STEP = 0, 1
"""What is fitted: a turn and a shift in the image; or a step of a pose, to first order."""
NEWTON_STEPS = 4
"""Newton's method doubles the digits at each step: from a start near the turn so many reach rounding."""


@compiled
def search_locally(
    space: SpaceArrays, terms: TermArrays, kind: int, turn: float, start: Mask, most: int, gain: float,
) -> tuple[Mask, Floats]:
    """Add or delete one pair at a time, or exchange two of a model line, while the match error falls by ``gain``.

    Args:
        kind, turn: see :func:`compute_fits`. most: moves.

    Returns:
        The last state (p,), and the match errors (k + 1,) of all states on the way.
    """
    chosen, count, errors = start.copy(), 0, np.empty(most + 1)
    scratch = np.empty(space[0].shape[1:]), np.empty((8, 8)), np.empty(8)
    state = _summarise(space, terms, chosen)
    errors[0] = _fit_form(state[3], kind, turn, scratch[1], scratch[2]) + state[2].sum()
    while count < most:
        below = errors[count] - gain
        move, out, error = _find_best_flip(space, terms, kind, turn, chosen, state, below, scratch)
        if move < 0:
            move, out, error = _find_best_exchange(space, terms, kind, turn, chosen, state, below, scratch)
        if move < 0:
            break
        _apply_move(space[3], chosen, move, out)
        count += 1
        errors[count] = error
        state = _summarise(space, terms, chosen)
    return chosen, errors[: count + 1]


@compiled
def _apply_move(data: Indices, chosen: Mask, move: int, out: int) -> None:
    """Change a state: flip pair ``move``, or exchange pair ``out`` for it; ``out`` is -1 if there is none.

    A pair that is added takes its data line from the pair that has it.
    """
    is_in = chosen[move]
    for p in range(len(data)):
        if not is_in and data[p] == data[move]:
            chosen[p] = False
    chosen[move] = not is_in
    if out >= 0:
        chosen[out] = False


@compiled
def _find_best_flip(
    space: SpaceArrays, terms: TermArrays, kind: int, turn: float, chosen: Mask, state: StateArrays, below: float,
    scratch: Scratch,
) -> tuple[int, int, float]:
    """The pair whose flip lowers the match error most, -1, and the match error then; pair -1 if none gets ``below``.

    A pair that cannot get there by its omission alone is not fitted, as more pairs never fit better.
    """
    forms, masks, model, data, _ = space
    counts, covered, now, base, holder = state
    form = scratch[0]
    total, here = now.sum(), _fit_form(base, kind, turn, scratch[1], scratch[2])
    best, move = below, -1
    for p in range(len(model)):
        line, holder_pair, bound = model[p], -1, 0.0
        if chosen[p]:
            left = covered[line] - _compute_share(masks[p], counts[line], 1)
        else:
            left = covered[line] + _compute_share(masks[p], counts[line], 0)
            holder_pair = holder[data[p]]
            bound = 0.0 if holder_pair >= 0 else here
        omission = total + _compute_omission(1.0 - left, line, terms) - now[line]
        if holder_pair >= 0:
            omission += _compute_growth(holder_pair, space, terms, counts, covered, now)
        if omission + bound >= best:
            continue
        _add_scaled(form, base, forms[p], -1.0 if chosen[p] else 1.0)
        if holder_pair >= 0:
            _add_scaled(form, form, forms[holder_pair], -1.0)
        error = _fit_form(form, kind, turn, scratch[1], scratch[2]) + omission
        if error < best:
            best, move = error, p
    return move, -1, best


@compiled
def _find_best_exchange(
    space: SpaceArrays, terms: TermArrays, kind: int, turn: float, chosen: Mask, state: StateArrays, below: float,
    scratch: Scratch,
) -> tuple[int, int, float]:
    """The best exchange (pair in, pair out, match error) of a chosen pair for another of its line, or -1, -1."""
    forms, masks, model, data, _ = space
    counts, covered, now, base, holder = state
    form, cells, total = scratch[0], masks.shape[1], now.sum()
    best, into, out = below, -1, -1
    for a in range(len(model)):
        if not chosen[a]:
            continue
        line = model[a]
        for b in range(len(model)):
            if chosen[b] or model[b] != line:
                continue
            held = 0
            for c in range(cells):
                held += counts[line, c] - masks[a, c] + masks[b, c] > 0
            omission = total + _compute_omission(1.0 - held / cells, line, terms) - now[line]
            holder_pair = holder[data[b]]
            if holder_pair >= 0:
                omission += _compute_growth(holder_pair, space, terms, counts, covered, now)
            if omission >= best:
                continue
            _add_scaled(form, base, forms[b], 1.0)
            _add_scaled(form, form, forms[a], -1.0)
            if holder_pair >= 0:
                _add_scaled(form, form, forms[holder_pair], -1.0)
            error = _fit_form(form, kind, turn, scratch[1], scratch[2]) + omission
            if error < best:
                best, into, out = error, b, a
    return into, out, best


@compiled
def _add_scaled(out: Floats, one: Floats, other: Floats, times: float) -> None:
    """Fill out = one + times other."""
    for i in range(out.shape[0]):
        for j in range(out.shape[1]):
            out[i, j] = one[i, j] + times * other[i, j]


@compiled
def _summarise(space: SpaceArrays, terms: TermArrays, chosen: Mask) -> StateArrays:
    """What the moves from a state need.

    Returns:
        how many data lines cover each cell (m, c); the share covered (m,) and the omission (m,) of each model line;
        the form (d, d); the chosen pair (k,) that holds each data line, or -1.
    """
    forms, masks, model, data, anchor = space
    lines, cells = len(terms[0]), masks.shape[1]
    counts, covered, now = np.zeros((lines, cells), np.int64), np.zeros(lines), np.empty(lines)
    base, last = anchor.copy(), -1
    for p in range(len(model)):
        last = max(last, data[p])
    holder = np.full(last + 1, -1)
    for p in range(len(model)):
        if chosen[p]:
            base += forms[p]
            holder[data[p]] = p
            for c in range(cells):
                counts[model[p], c] += masks[p, c]
    for line in range(lines):
        for c in range(cells):
            covered[line] += counts[line, c] > 0
        covered[line] /= cells
        now[line] = _compute_omission(1.0 - covered[line], line, terms)
    return counts, covered, now, base, holder


@compiled
def _compute_growth(
    pair: int, space: SpaceArrays, terms: TermArrays, counts: Ints, covered: Floats, now: Floats
) -> float:
    """By how much the omission of a chosen pair's model line grows without the pair."""
    line = space[2][pair]
    left = covered[line] - _compute_share(space[1][pair], counts[line], 1)
    return float(_compute_omission(1.0 - left, line, terms) - now[line])


@compiled
def _compute_share(mask: Mask, counts: Ints, count: int) -> float:
    """Share of the cells (c,) that a data line covers and that ``count`` of the chosen ones cover."""
    found = 0
    for c in range(len(mask)):
        found += mask[c] and counts[c] == count
    return found / len(mask)


@compiled
def _compute_omission(uncovered: float, line: int, terms: TermArrays) -> float:
    """As :meth:`Terms.compute_omission`."""
    scale, lengths = terms
    size = lengths[line]
    return float(scale[line] * math.log((1.0 + size) / (1.0 + size * (1.0 - uncovered))))


@compiled
def compute_fits(forms: Floats, kind: int, turns: Floats) -> tuple[Floats, Floats]:
    """Errors (k,) and placements of the best fits of quadratic forms (k, d, d).

    ``kind`` is RIGID or STEP; a rigid fit starts from ``turns`` (k,) [rad].
    """
    errors, work = np.empty(len(forms)), np.empty((8, 8))
    placements = np.empty((len(forms), forms.shape[1] - 1 if kind == STEP else 5))
    for k in range(len(forms)):
        errors[k] = _fit_form(forms[k], kind, turns[k], work, placements[k])
    return errors, placements


@compiled
def _fit_form(form: Floats, kind: int, turn: float, work: Floats, placement: Floats) -> float:
    """The error of the best fit of a form (d, d); fills its ``placement``; ``work`` (8, 8) is scratch."""
    if kind == STEP:
        return _fit_step(form, work, placement)
    back, q = work[:2], work[2:5]
    _eliminate_shift(form, back, q)
    c, s = _fit_turn(q, turn)
    rest = (c, s, 1.0)
    error = 0.0
    for a in range(3):
        for b in range(3):
            error += rest[a] * q[a, b] * rest[b]
    placement[0], placement[1], placement[4] = c, s, 1.0
    for t in range(2):
        placement[2 + t] = -(back[t, 0] * c + back[t, 1] * s + back[t, 2])
    return max(error, 0.0)


@compiled
def _fit_step(form: Floats, factor: Floats, step: Floats) -> float:
    """By Cholesky's factor L: the error is the rest of the last pivot, the step solves L' step = -(last row)."""
    unknowns = form.shape[0] - 1
    for a in range(unknowns + 1):
        for b in range(a + 1):
            rest = form[a, b]
            for c in range(b):
                rest -= factor[a, c] * factor[b, c]
            if b < a:
                factor[a, b] = rest / factor[b, b]
            else:
                factor[a, b] = math.sqrt(rest) if a < unknowns else rest
    for a in range(unknowns - 1, -1, -1):
        rest = -factor[unknowns, a]
        for c in range(a + 1, unknowns):
            rest -= factor[c, a] * step[c]
        step[a] = rest / factor[a, a]
    return float(max(factor[unknowns, unknowns], 0.0))


@compiled
def _eliminate_shift(form: Floats, back: Floats, reduced: Floats) -> None:
    """Eliminate T: ``reduced`` (3, 3) in (cos, sin, s) and ``back`` (2, 3) with T = -back @ (cos, sin, s)."""
    a, b, d = form[2, 2], form[2, 3], form[3, 3]
    determinant = a * d - b * b
    kept = (0, 1, 4)
    for j in range(3):
        u, v = form[2, kept[j]], form[3, kept[j]]
        back[0, j], back[1, j] = (d * u - b * v) / determinant, (a * v - b * u) / determinant
    for i in range(3):
        for j in range(3):
            across = form[2, kept[i]] * back[0, j] + form[3, kept[i]] * back[1, j]
            reduced[i, j] = form[kept[i], kept[j]] - across


@compiled
def _fit_turn(q: Floats, turn: float) -> tuple[float, float]:
    """Newton's method on the turn for x'Ax + 2 b'x, x = (cos, sin), with s = 1."""
    a, b, d, e, f = q[0, 0], q[0, 1], q[1, 1], q[0, 2], q[1, 2]
    for _ in range(NEWTON_STEPS):
        c, s = math.cos(turn), math.sin(turn)
        slope = (d - a) * s * c + b * (c * c - s * s) - e * s + f * c
        bend = (d - a) * (c * c - s * s) - 4.0 * b * s * c - e * c - f * s
        if bend > 1e-12:
            turn -= min(max(slope / bend, -0.5), 0.5)
    return math.cos(turn), math.sin(turn)


@compiled
def count_cover(masks: Mask, model: Indices, chosen: Mask, lines: int) -> Floats:
    """(m, c) how many chosen data lines cover each cell."""
    counts = np.zeros((lines, masks.shape[1]))
    for p in range(len(model)):
        if chosen[p]:
            for c in range(masks.shape[1]):
                counts[model[p], c] += masks[p, c]
    return counts
