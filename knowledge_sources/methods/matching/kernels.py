"""The inner loops of matching, compiled: the best fit of a state, and the descent from state to state (§6.1).

Jitted functions of this file call only one another, because numba's cache does not follow calls into other files.

``space`` is (forms (p, d, d), masks (p, c), model (p,), data (p,), anchor (d, d)) of a :class:`PairSpace`, ``terms``
(scale (m,), lengths (m,), rate) of :class:`Terms`' omission; ``chosen`` (p,) is the state.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numba import njit

compiled = njit(cache=True, error_model="numpy")

RIGID, SCALED, STEP = 0, 1, 2
"""What is fitted: a turn and a shift in the image; a scale too; or a step of a pose, to first order."""
NEWTON_STEPS = 4


@compiled
def descend(
    space: Any, terms: Any, kind: int, turn: float, start: Any, first: bool, replace: bool, most: int, gain: float
) -> tuple[Any, Any, Any]:
    """Add or delete one pair at a time, or exchange two of a model line, while the match error falls by ``gain``.

    Returns:
        The last state (p,); the moves (k, 2), each (pair flipped, -1) or (pair put in, pair taken out); and the match
        errors (k + 1,) of all states on the way.
    """
    data = space[3]
    chosen, last, count = start.copy(), -1, 0
    moves, errors = np.empty((most, 2), np.int64), np.empty(most + 1)
    scratch = np.empty(space[0].shape[1:]), np.empty((8, 8)), np.empty(8)
    state = _state(space, terms, chosen)
    errors[0] = _fit(state[3], kind, turn, scratch[1], scratch[2]) + state[2].sum()
    while count < most:
        below = errors[count] - gain
        move, out, error = _best_flip(space, terms, kind, turn, chosen, state, first, last, below, scratch)
        if move < 0 and replace:
            move, out, error = _best_swap(space, terms, kind, turn, chosen, state, below, scratch)
        if move < 0:
            break
        if out < 0:
            last = move
        carry_out(data, chosen, move, out)
        moves[count, 0], moves[count, 1] = move, out
        count += 1
        errors[count] = error
        state = _state(space, terms, chosen)
    return chosen, moves[:count], errors[: count + 1]


@compiled
def carry_out(data: Any, chosen: Any, move: int, out: int) -> None:
    """Change a state (p,): flip pair ``move``, or put it in for ``out``.

    What is put in takes its data line from the pair that has it.
    """
    is_in = chosen[move]
    for p in range(len(data)):
        if not is_in and data[p] == data[move]:
            chosen[p] = False
    chosen[move] = not is_in
    if out >= 0:
        chosen[out] = False


@compiled
def _best_flip(
    space: Any, terms: Any, kind: int, turn: float, chosen: Any, state: Any, first: bool, last: int, below: float,
    scratch: Any,
) -> tuple[int, int, float]:
    """The pair (or -1) by which to get furthest ``below``, -1, and the match error then; or the first in turn that
    does. What cannot get there by its omission alone is not fitted: pairs more never fit better."""
    forms, masks, model, data, _ = space
    counts, covered, now, base, holder = state
    form = scratch[0]
    total, here = now.sum(), _fit(base, kind, turn, scratch[1], scratch[2])
    best, move = below, -1
    for i in range(len(model)):
        p = (last + 1 + i) % len(model) if first else i
        line, rival, bound = model[p], -1, 0.0
        if chosen[p]:
            left = covered[line] - _share(masks[p], counts[line], 1)
        else:
            left = covered[line] + _share(masks[p], counts[line], 0)
            rival = holder[data[p]]
            bound = 0.0 if rival >= 0 else here
        omission = total + _omission(1.0 - left, line, terms) - now[line]
        if rival >= 0:
            omission += _loss(rival, space, terms, counts, covered, now)
        if omission + bound >= best:
            continue
        _sum(form, base, forms[p], -1.0 if chosen[p] else 1.0)
        if rival >= 0:
            _sum(form, form, forms[rival], -1.0)
        error = _fit(form, kind, turn, scratch[1], scratch[2]) + omission
        if error < best:
            best, move = error, p
            if first:
                break
    return move, -1, best


@compiled
def _best_swap(
    space: Any, terms: Any, kind: int, turn: float, chosen: Any, state: Any, below: float, scratch: Any
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
            omission = total + _omission(1.0 - held / cells, line, terms) - now[line]
            rival = holder[data[b]]
            if rival >= 0:
                omission += _loss(rival, space, terms, counts, covered, now)
            if omission >= best:
                continue
            _sum(form, base, forms[b], 1.0)
            _sum(form, form, forms[a], -1.0)
            if rival >= 0:
                _sum(form, form, forms[rival], -1.0)
            error = _fit(form, kind, turn, scratch[1], scratch[2]) + omission
            if error < best:
                best, into, out = error, b, a
    return into, out, best


@compiled
def _sum(out: Any, one: Any, other: Any, times: float) -> None:
    for i in range(out.shape[0]):
        for j in range(out.shape[1]):
            out[i, j] = one[i, j] + times * other[i, j]


@compiled
def _state(space: Any, terms: Any, chosen: Any) -> tuple[Any, Any, Any, Any, Any]:
    """Of a state: how many data lines cover each cell (m, c), the share covered (m,), the omission (m,) of each model
    line, the form (d, d), and which chosen pair holds each data line, or -1."""
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
        now[line] = _omission(1.0 - covered[line], line, terms)
    return counts, covered, now, base, holder


@compiled
def _loss(pair: int, space: Any, terms: Any, counts: Any, covered: Any, now: Any) -> Any:
    """By how much the omission of a chosen pair's model line grows without it."""
    line = space[2][pair]
    left = covered[line] - _share(space[1][pair], counts[line], 1)
    return _omission(1.0 - left, line, terms) - now[line]


@compiled
def _share(mask: Any, counts: Any, count: int) -> float:
    """Share of the cells that a data line covers, and that so many of the chosen ones do."""
    found = 0
    for c in range(len(mask)):
        found += mask[c] and counts[c] == count
    return found / len(mask)


@compiled
def _omission(uncovered: float, line: int, terms: Any) -> Any:
    """As :meth:`Terms.omission`."""
    scale, lengths, rate = terms
    if rate == 0.0:
        size = lengths[line]
        return scale[line] * math.log((1.0 + size) / (1.0 + size * (1.0 - uncovered)))
    return scale[line] * math.exp(rate * uncovered)


@compiled
def fits(forms: Any, kind: int, turns: Any) -> tuple[Any, Any]:
    """Errors (k,) and placements of the best fits of forms (k, d, d)."""
    errors, work = np.empty(len(forms)), np.empty((8, 8))
    placements = np.empty((len(forms), forms.shape[1] - 1 if kind == STEP else 5))
    for k in range(len(forms)):
        errors[k] = _fit(forms[k], kind, turns[k], work, placements[k])
    return errors, placements


@compiled
def _fit(form: Any, kind: int, turn: float, work: Any, placement: Any) -> Any:
    """The error of the best fit of a form (d, d); its ``placement`` is filled in, ``work`` (8, 8) is scratch."""
    if kind == STEP:
        return _step(form, work, placement)
    back, q = work[:2], work[2:5]
    _without_shift(form, back, q)
    scale = 1.0
    if kind == SCALED:
        c, s, scale = _circle_with_scale(q)
    else:
        c, s = _circle(q, turn)
    rest = (c, s, scale)
    error = 0.0
    for a in range(3):
        for b in range(3):
            error += rest[a] * q[a, b] * rest[b]
    placement[0], placement[1], placement[4] = c, s, scale
    for t in range(2):
        placement[2 + t] = -(back[t, 0] * c + back[t, 1] * s + back[t, 2] * scale)
    return max(error, 0.0)


@compiled
def _step(form: Any, factor: Any, step: Any) -> Any:
    """By Cholesky's factors L: the error is what is left of the last pivot, the step solves L' step = -(last row)."""
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
    return max(factor[unknowns, unknowns], 0.0)


@compiled
def _without_shift(form: Any, back: Any, reduced: Any) -> None:
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
def _circle_with_scale(q: Any) -> tuple[float, float, float]:
    """Eliminate s from (3, 3), then the smaller root of the second-order equation."""
    pull = (q[0, 2] / q[2, 2], q[1, 2] / q[2, 2])
    xx, xy, yy = q[0, 0] - q[0, 2] * pull[0], q[0, 1] - q[0, 2] * pull[1], q[1, 1] - q[1, 2] * pull[1]
    turn = 0.5 * math.atan2(2.0 * xy, xx - yy) + 0.5 * math.pi
    c, s = math.cos(turn), math.sin(turn)
    if c < 0.0:
        c, s = -c, -s
    return c, s, -(pull[0] * c + pull[1] * s)


@compiled
def _circle(q: Any, turn: float) -> tuple[float, float]:
    """Newton on the turn for x'Ax + 2 b'x, x = (cos, sin), with s = 1."""
    a, b, d, e, f = q[0, 0], q[0, 1], q[1, 1], q[0, 2], q[1, 2]
    for _ in range(NEWTON_STEPS):
        c, s = math.cos(turn), math.sin(turn)
        slope = (d - a) * s * c + b * (c * c - s * s) - e * s + f * c
        bend = (d - a) * (c * c - s * s) - 4.0 * b * s * c - e * c - f * s
        if bend > 1e-12:
            turn -= min(max(slope / bend, -0.5), 0.5)
    return math.cos(turn), math.sin(turn)
