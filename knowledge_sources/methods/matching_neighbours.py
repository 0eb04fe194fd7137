"""What every neighbour of a correspondence would cost, compiled: the inner loop of the local search (§6.1.1).

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


@compiled
def flips(space: Any, terms: Any, chosen: Any) -> tuple[Any, Any]:
    """Forms (p, d, d) and omission (p,) after adding or deleting each pair.

    An added pair takes its data line from the pair that has it.
    """
    forms, masks, model, data, _ = space
    counts, covered, now, base, holder = _state(space, terms, chosen)
    total = now.sum()
    out, omission = np.empty(forms.shape), np.empty(len(model))
    for p in range(len(model)):
        line = model[p]
        if chosen[p]:
            out[p] = base - forms[p]
            left = covered[line] - _share(masks[p], counts[line], 1)
        else:
            out[p] = base + forms[p]
            left = covered[line] + _share(masks[p], counts[line], 0)
        omission[p] = total + _omission(1.0 - left, line, terms) - now[line]
        rival = -1 if chosen[p] else holder[data[p]]
        if rival >= 0:
            out[p] -= forms[rival]
            omission[p] += _loss(rival, space, terms, counts, covered, now)
    return out, omission


@compiled
def swaps(space: Any, terms: Any, chosen: Any) -> tuple[Any, Any, Any]:
    """Each exchange of a chosen pair for another of its line: (out, in) (k, 2), forms (k, d, d), omission (k,)."""
    forms, masks, model, data, _ = space
    counts, covered, now, base, holder = _state(space, terms, chosen)
    total, count = now.sum(), 0
    for a in range(len(model)):
        for b in range(len(model)):
            count += chosen[a] and not chosen[b] and model[a] == model[b]
    moves = np.empty((count, 2), np.int64)
    out, omission = np.empty((count, *forms.shape[1:])), np.empty(count)
    k = 0
    for a in range(len(model)):
        for b in range(len(model)):
            if not chosen[a] or chosen[b] or model[a] != model[b]:
                continue
            line = model[a]
            held = 0
            for c in range(masks.shape[1]):
                held += counts[line, c] - masks[a, c] + masks[b, c] > 0
            moves[k, 0], moves[k, 1] = a, b
            out[k] = base + forms[b] - forms[a]
            omission[k] = total + _omission(1.0 - held / masks.shape[1], line, terms) - now[line]
            rival = holder[data[b]]
            if rival >= 0:
                out[k] -= forms[rival]
                omission[k] += _loss(rival, space, terms, counts, covered, now)
            k += 1
    return moves, out, omission


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
