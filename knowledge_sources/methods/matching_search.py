"""Local search over correspondences: every neighbour of a state judged in one batch (§6.1.1, §6.1.4)."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numba import njit
from numpy.typing import NDArray

from knowledge_sources.methods.matching_fit import Fits
from knowledge_sources.methods.matching_neighbours import flips, swaps
from knowledge_sources.methods.matching_objective import Terms

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]
Index = NDArray[np.intp]
Strategy = Literal["first", "steepest"]

GAIN = 1e-9
"""A move must lower the match error by more than this."""
STEPS_A_PAIR = 4
"""The search stops after so many moves for each possible pair (it ends long before)."""


@dataclass(frozen=True, slots=True, eq=False)
class PairSpace:
    """The restricted space: p possible pairs of a model line and a data line.

    Attributes:
        members: (p,) rows of the table of pairs. model, data: (p,) indices. forms: (p, d, d) shares of E_fit.
        masks: (p, c) cells of the model line that the data line covers.
        lines: number of model lines.
        anchor: (d, d) pull to the placement the space was formed at.
        fit: the best fits of k forms (k, d, d).
    """

    members: Index
    model: Index
    data: Index
    forms: Array
    masks: Mask
    lines: int
    anchor: Array
    fit: Callable[[Array], Fits]

    @property
    def arrays(self) -> tuple[Array | Mask | Index, ...]:
        """As the compiled loops take them."""
        return self.forms, self.masks, self.model, self.data, self.anchor


@dataclass(frozen=True, slots=True)
class TraceStep:
    """One state of the search: its pairs (model, data) and its match error, as a row of Figure 12(d)."""

    pairs: tuple[tuple[int, int], ...]
    evaluation: float


@dataclass(frozen=True, slots=True, eq=False)
class Found:
    """Where a search ended: (p,) chosen pairs, E_match, moves made, and the states if kept."""

    chosen: Mask
    error: float
    steps: int
    trace: tuple[TraceStep, ...]


def local_search(
    space: PairSpace,
    terms: Terms,
    start: Mask,
    *,
    strategy: Strategy,
    replace: bool,
    keep_trace: bool,
) -> Found:
    """Add or delete one pair at a time (k = 1) while the match error falls.

    A data line goes to one model line: adding a pair takes its data line from the pair that had it. With ``replace``
    a state that no single flip improves may also exchange one data line of a model line for another (§6.1.1 names
    the lack of that move as the cause of local minima).
    """
    if strategy not in ("first", "steepest"):
        raise ValueError(f'expected strategy "first" or "steepest", got {strategy!r}')
    chosen = start.copy()
    error = evaluate(space, terms, chosen)
    steps = [_step(space, chosen, error)] if keep_trace else []
    last, moves = -1, 0
    while moves < STEPS_A_PAIR * len(chosen):
        errors = flip_errors(space, terms, chosen)
        move = _pick(errors, error, strategy, last)
        if move >= 0:
            last, error = move, float(errors[move])
            chosen = flipped(space, chosen, move)
        else:
            swap = _best_swap(space, terms, chosen, error) if replace else None
            if swap is None:
                break
            out, move, error = swap
            chosen = flipped(space, chosen, move)
            chosen[out] = False
        moves += 1
        if keep_trace:
            steps.append(_step(space, chosen, error))
    return Found(chosen, error, moves, tuple(steps))


def evaluate(space: PairSpace, terms: Terms, chosen: Mask) -> float:
    """E_match of one state."""
    lines = np.arange(space.lines)
    return float(fit_of(space, chosen).errors[0] + terms.omission(1.0 - coverage(space, chosen), lines).sum())


def fit_of(space: PairSpace, chosen: Mask) -> Fits:
    """The best fit of one state."""
    return space.fit((space.anchor + space.forms[chosen].sum(axis=0))[None])


def coverage(space: PairSpace, chosen: Mask) -> Array:
    """(m,) share of each model line that the chosen data lines cover."""
    return np.asarray((_counts(space, chosen) > 0).mean(axis=1))


def nearest(data: Index, distances: Array, near: Mask) -> Mask:
    """(p,) a state to start from: for each data line the nearest (p,) ``distances`` of its ``near`` pairs."""
    order = np.lexsort((distances, data))
    order = order[near[order]]
    first = np.ones(len(order), bool)
    first[1:] = data[order[1:]] != data[order[:-1]]
    chosen = np.zeros(len(data), bool)
    chosen[order[first]] = True
    return chosen


def flipped(space: PairSpace, chosen: Mask, move: int) -> Mask:
    """The state after adding or deleting pair ``move``; an added pair takes its data line from another."""
    out = chosen.copy()
    if not chosen[move]:
        out[space.data == space.data[move]] = False
    out[move] = not chosen[move]
    return out


def flip_errors(space: PairSpace, terms: Terms, chosen: Mask) -> Array:
    """(p,) E_match of every neighbour, each one flip away."""
    forms, omission = flips(space.arrays, terms.arrays, chosen)
    return np.asarray(space.fit(forms).errors + omission)


def _best_swap(
    space: PairSpace, terms: Terms, chosen: Mask, error: float
) -> tuple[int, int, float] | None:
    """The best exchange (pair out, pair in, E_match) within a model line, if it lowers the match error."""
    moves, forms, omission = swaps(space.arrays, terms.arrays, chosen)
    if not len(moves):
        return None
    errors = space.fit(forms).errors + omission
    best = int(np.argmin(errors))
    out, into = moves[best].tolist()
    return (out, into, float(errors[best])) if errors[best] < error - GAIN else None


def _counts(space: PairSpace, chosen: Mask) -> Array:
    """(m, c) how many chosen data lines cover each cell."""
    counts: Array = _counted(space.masks, space.model, chosen, space.lines)
    return counts


@njit(cache=True, error_model="numpy")
def _counted(masks: Any, model: Any, chosen: Any, lines: int) -> Any:
    counts = np.zeros((lines, masks.shape[1]))
    for p in range(len(model)):
        if chosen[p]:
            for c in range(masks.shape[1]):
                counts[model[p], c] += masks[p, c]
    return counts


def _pick(errors: Array, error: float, strategy: Strategy, last: int) -> int:
    """The move to take, or -1: the best, or the first that improves in turn after the last one taken."""
    if strategy == "steepest":
        best = int(np.argmin(errors)) if len(errors) else -1
        return best if best >= 0 and errors[best] < error - GAIN else -1
    better = np.flatnonzero(errors < error - GAIN)
    if not len(better):
        return -1
    later = better[better > last]
    return int(later[0] if len(later) else better[0])


def _step(space: PairSpace, chosen: Mask, error: float) -> TraceStep:
    pairs = zip(space.model[chosen].tolist(), space.data[chosen].tolist(), strict=True)
    return TraceStep(tuple(sorted(pairs)), error)
