"""Local search over correspondences (§6.1.1, §6.1.4)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numba import njit

from knowledge_sources.methods.arrays import Floats, Indices, Mask
from knowledge_sources.methods.matching.fit import Fits, Fitting
from knowledge_sources.methods.matching.kernels import SpaceArrays, apply_move, search_locally
from knowledge_sources.methods.matching.objective import Terms
from knowledge_sources.settings.matching import MatchingSettings

STRATEGIES = ("first", "steepest")


@dataclass(frozen=True, slots=True, eq=False)
class PairSpace:
    """The restricted space: p possible pairs of a model line and a data line. A state is a mask (p,) of chosen pairs.

    Attributes:
        members: (p,) rows of the table of pairs. model, data: (p,) indices. forms: (p, d, d) shares of E_fit.
        masks: (p, c) cells of the model line that the data line covers.
        lines: number of model lines.
        anchor: (d, d) pull to the placement at which the space was formed.
        fitting: how a state is fitted.
    """

    members: Indices
    model: Indices
    data: Indices
    forms: Floats
    masks: Mask
    lines: int
    anchor: Floats
    fitting: Fitting

    @property
    def arrays(self) -> SpaceArrays:
        """As the compiled functions take them."""
        return self.forms, self.masks, self.model, self.data, self.anchor


@dataclass(frozen=True, slots=True)
class TraceStep:
    """One state of the search: its pairs (model, data) and its match error, as a row of Figure 12(d)."""

    pairs: tuple[tuple[int, int], ...]
    evaluation: float


@dataclass(frozen=True, slots=True, eq=False)
class SearchResult:
    """Where a search ended: (p,) chosen pairs, E_match, moves made, and the states if kept."""

    chosen: Mask
    error: float
    steps: int
    trace: tuple[TraceStep, ...]


def search_pairs(
    space: PairSpace,
    terms: Terms,
    start: Mask,
    settings: MatchingSettings,
    *,
    strategy: str,
    exchange: bool,
    keep_trace: bool,
) -> SearchResult:
    """Local search: add or delete one pair at a time (k = 1) while the match error falls.

    A data line goes to one model line: adding a pair takes its data line from the pair that had it. With ``exchange``
    a state that no single flip improves may also exchange one data line of a model line for another (§6.1.1 names
    the lack of that move as the cause of local minima).

    Raises:
        ValueError: an unknown strategy.
    """
    if strategy not in STRATEGIES:
        raise ValueError(f'expected strategy "first" or "steepest", got {strategy!r}')
    most = settings.max_moves_per_pair * len(start)
    chosen, moves, errors = search_locally(
        space.arrays, terms.arrays, *space.fitting, start, strategy == "first", exchange, most, settings.min_gain
    )
    steps = _list_states(space, start, moves.tolist(), errors.tolist()) if keep_trace else ()
    return SearchResult(chosen, float(errors[-1]), len(moves), steps)


def evaluate_state(space: PairSpace, terms: Terms, chosen: Mask) -> float:
    """E_match of one state."""
    omission = terms.compute_omission(1.0 - compute_coverage(space, chosen), np.arange(space.lines))
    return float(fit_state(space, chosen).errors[0] + omission.sum())


def fit_state(space: PairSpace, chosen: Mask) -> Fits:
    """The best fit of one state."""
    return space.fitting.fit((space.anchor + space.forms[chosen].sum(axis=0))[None])


def compute_coverage(space: PairSpace, chosen: Mask) -> Floats:
    """(m,) share of each model line that the chosen data lines cover."""
    return np.asarray((_count_cover(space.masks, space.model, chosen, space.lines) > 0).mean(axis=1))


def build_masks(along: Floats, lengths: Floats, cells: int) -> Mask:
    """(p, cells) which cells of a model line, ``lengths`` (p,) [px], its data line, ``along`` (p, 2) [px], covers."""
    middles = (np.arange(cells) + 0.5) / cells * lengths[:, None]
    return np.asarray((middles >= along.min(axis=1)[:, None]) & (middles <= along.max(axis=1)[:, None]))


def choose_nearest(data: Indices, distances: Floats, near: Mask) -> Mask:
    """(p,) a state to start from: for each data line the nearest (p,) ``distances`` of its ``near`` pairs."""
    order = np.lexsort((distances, data))
    order = order[near[order]]
    first = np.ones(len(order), bool)
    first[1:] = data[order[1:]] != data[order[:-1]]
    chosen = np.zeros(len(data), bool)
    chosen[order[first]] = True
    return chosen


def list_pairs(space: PairSpace, chosen: Mask) -> tuple[Indices, Indices]:
    """The chosen pairs, sorted: rows (n,) of the space, and (n, 2) model and data indices."""
    rows = np.flatnonzero(chosen)
    rows = rows[np.lexsort((space.data[rows], space.model[rows]))]
    return rows, np.stack([space.model[rows], space.data[rows]], axis=1)


@njit(cache=True, error_model="numpy")
def _count_cover(masks: Mask, model: Indices, chosen: Mask, lines: int) -> Floats:
    """(m, c) how many chosen data lines cover each cell."""
    counts = np.zeros((lines, masks.shape[1]))
    for p in range(len(model)):
        if chosen[p]:
            for c in range(masks.shape[1]):
                counts[model[p], c] += masks[p, c]
    return counts


def _list_states(
    space: PairSpace, start: Mask, moves: list[tuple[int, int]], errors: list[float]
) -> tuple[TraceStep, ...]:
    """The states of a search: each move flips a pair, or exchanges one for another."""
    chosen = start.copy()
    steps = [_build_step(space, chosen, errors[0])]
    for (move, out), error in zip(moves, errors[1:], strict=True):
        apply_move(space.data, chosen, move, out)
        steps.append(_build_step(space, chosen, error))
    return tuple(steps)


def _build_step(space: PairSpace, chosen: Mask, error: float) -> TraceStep:
    pairs = zip(space.model[chosen].tolist(), space.data[chosen].tolist(), strict=True)
    return TraceStep(tuple(sorted(pairs)), error)
