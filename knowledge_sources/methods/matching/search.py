"""Local search over correspondences: every neighbour of a state judged in one batch (§6.1.1, §6.1.4)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numba import njit
from numpy.typing import NDArray

from knowledge_sources.methods.matching.fit import Fits, Fitting
from knowledge_sources.methods.matching.kernels import carry_out, descend
from knowledge_sources.methods.matching.objective import Terms

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
        fitting: how a state is fitted.
    """

    members: Index
    model: Index
    data: Index
    forms: Array
    masks: Mask
    lines: int
    anchor: Array
    fitting: Fitting

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
    most = STEPS_A_PAIR * len(start)
    chosen, moves, errors = descend(
        space.arrays, terms.arrays, *space.fitting, start, strategy == "first", replace, most, GAIN)
    steps = _states(space, start, moves.tolist(), errors.tolist()) if keep_trace else ()
    return Found(chosen, float(errors[-1]), len(moves), steps)


def evaluate(space: PairSpace, terms: Terms, chosen: Mask) -> float:
    """E_match of one state."""
    lines = np.arange(space.lines)
    return float(fit_of(space, chosen).errors[0] + terms.omission(1.0 - coverage(space, chosen), lines).sum())


def fit_of(space: PairSpace, chosen: Mask) -> Fits:
    """The best fit of one state."""
    return space.fitting.of((space.anchor + space.forms[chosen].sum(axis=0))[None])


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


def _states(
    space: PairSpace, start: Mask, moves: list[tuple[int, int]], errors: list[float]
) -> tuple[TraceStep, ...]:
    """The states on the way: each move flips a pair, or puts one in for another."""
    chosen = start.copy()
    steps = [_step(space, chosen, errors[0])]
    for (move, out), error in zip(moves, errors[1:], strict=True):
        carry_out(space.data, chosen, move, out)
        steps.append(_step(space, chosen, error))
    return tuple(steps)


def _step(space: PairSpace, chosen: Mask, error: float) -> TraceStep:
    pairs = zip(space.model[chosen].tolist(), space.data[chosen].tolist(), strict=True)
    return TraceStep(tuple(sorted(pairs)), error)
