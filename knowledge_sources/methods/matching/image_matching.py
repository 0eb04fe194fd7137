"""2D model matching: which data lines show which model lines (§6.1)?"""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from knowledge_sources.methods.matching.fit import Fits, Fitting, Similarity2
from knowledge_sources.methods.matching.hough import LineTable, Peak, build_line_table, hough_peaks
from knowledge_sources.methods.matching.objective import Objective, Terms, likelihood_terms, paper_terms
from knowledge_sources.methods.matching.pairs import (
    SETTLE_PX,
    PairTable,
    build_pair_table,
    compute_model_motion,
    gated,
    placement_of,
    settled,
    start_anchor,
)
from knowledge_sources.methods.matching.search import (
    Found,
    PairSpace,
    Strategy,
    TraceStep,
    coverage,
    fit_of,
    local_search,
    nearest,
)

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

COVER_CELLS = 48
"""Cells along a model line by which its coverage is counted."""
SETTLED_A_PEAK = 4
"""So many Hough peaks are settled for each that the search may start from."""

__all__ = ["Match", "Peak", "Similarity2", "TraceStep", "format_trace", "match_lines"]


@dataclass(frozen=True, slots=True, eq=False)
class Match:
    """The best correspondence found.

    Attributes:
        pairs: (p, 2) model index, data index; many data lines may go to one model line, sorted.
        transform: moves the model onto the data, in the image.
        e_fit, e_omission: the two terms of the match error, the second with its weight.
        coverage: (m,) share of each model line accounted for.
        residuals_px: (p, 2) distances of the data ends to the moved model lines.
        objective: under which objective. steps: moves made from the start to this state.
        trace: the states of the search, first to last, if asked for.
    """

    pairs: NDArray[np.intp]
    transform: Similarity2
    e_fit: float
    e_omission: float
    coverage: Array
    residuals_px: Array
    objective: Objective
    steps: int
    trace: tuple[TraceStep, ...] = ()

    @property
    def e_match(self) -> float:
        """The match error: smaller is better; only comparable under one objective and one model."""
        return self.e_fit + self.e_omission


def match_lines(
    model_px: Any,
    data_px: Any,
    *,
    hough_px: float = 30.0,
    hough_rad: float = 0.3,
    pair_px: Any = 3.0,
    pair_rad: float = 0.3,
    alpha: float = 0.5,
    beta: float = 4.0,
    objective: Objective = "paper",
    sigma_px: float | None = None,
    chance_exponent: float = 3.0,
    chance_px: float = 10.0,
    with_scale: bool = False,
    strategy: Strategy = "steepest",
    replace: bool = True,
    peaks: int = 3,
    start: Peak | None = None,
    first_pairs: Collection[tuple[int, int]] | None = None,
    trace: bool = False,
) -> Match:
    """Match the projected model to the data lines.

    Source: §6.1: a generalised Hough transform over data within (``hough_px``, ``hough_rad``) of the model places
    the model; pairs within (``pair_px``, ``pair_rad``) of that place form the space; local search finds the state of
    least match error. The paper's own way is ``strategy="first", replace=False, peaks=1``.

    Args:
        model_px: (m, 2, 2) projected model lines. data_px: (k, 2, 2) data lines.
        pair_px: how far a data end may lie from its model line; one number, or (m,) when some model lines are
            predicted worse than others. Wider than 3 px when perspective bends the prediction (large pose error).
        alpha, beta: of the objective "paper".
        sigma_px: of a data end about its model line, for "likelihood"; ``None``: a third of ``pair_px``, at least 1.
        chance_exponent, chance_px: of "likelihood", see :func:`likelihood_terms`.
        with_scale: fit a scale too.
        strategy: "steepest", or the paper's "first" improvement. replace: allow exchanges at local minima.
        peaks: placements tried. start: this placement (about the mean of the model's ends) instead of Hough's.
        first_pairs: (model, data) pairs of the first state; ``None``: each near data line to its nearest model line.
        trace: keep the states of the search.
    """
    model, data = _checked(model_px, "model_px"), _checked(data_px, "data_px")
    centre = model.reshape(-1, 2).mean(axis=0) if len(model) else np.zeros(2)
    still, scene = build_line_table(model, centre), build_line_table(data, centre)
    gates = _gates(pair_px, len(model))
    width = float(np.median(gates)) if len(gates) else 3.0
    if objective == "paper":
        terms = paper_terms(still.lengths, scene.lengths, alpha, beta)
    elif objective == "likelihood":
        sigma = max(1.0, width / 3.0) if sigma_px is None else sigma_px
        start_px = max(width, 3.0)
        terms = likelihood_terms(still.lengths, len(data), sigma, chance_exponent, chance_px, start_px)
    else:
        raise ValueError(f'expected objective "paper" or "likelihood", got {objective!r}')
    table = build_pair_table(still, scene, hough_px + np.maximum(gates, SETTLE_PX[0]), hough_rad + pair_rad)
    placements = [placement_of(start)] if start else _starts(still, scene, table, hough_px, hough_rad, peaks)
    tries = []
    for placement in placements:
        space, first = _pair_space(table, placement, gates, pair_rad, terms, with_scale)
        if first_pairs is not None:
            first = np.array([pair in first_pairs for pair in zip(space.model, space.data, strict=True)], bool)
        found = local_search(space, terms, first, strategy=strategy, replace=replace, keep_trace=trace)
        tries.append((space, found))
    space, found = min(tries, key=lambda tried: tried[1].error)
    return _match(space, found, table, fit_of(space, found.chosen), centre, terms, objective)


def format_trace(match: Match) -> str:
    """The states of the search as a table like Figure 12(d): one row a state, its pairs and its evaluation."""
    columns = sorted({pair for step in match.trace for pair in step.pairs})
    head = " ".join(f"{m}-{d}" for m, d in columns)
    rows = [f"{'step':>7}  {head}  evaluation"]
    last = len(match.trace) - 1
    for i, step in enumerate(match.trace):
        name = "initial" if i == 0 else "final" if i == last else str(i)
        have = set(step.pairs)
        marks = " ".join(f"{'x' if c in have else '.':>{len(f'{c[0]}-{c[1]}')}}" for c in columns)
        rows.append(f"{name:>7}  {marks}  {step.evaluation:10.2f}")
    return "\n".join(rows)


def _starts(
    still: LineTable, scene: LineTable, table: PairTable, hough_px: float, hough_rad: float, count: int
) -> Array:
    """Placements (k, 5) to search from: Hough's peaks, settled, the best supported that differ."""
    found = hough_peaks(still, scene, hough_px, hough_rad, SETTLED_A_PEAK * count)
    placements, support = settled(table, np.stack([placement_of(peak) for peak in found]))
    kept: list[int] = []
    for i in np.argsort(-support, kind="stable"):
        apart = [np.abs((placements[i] - placements[j]) * (100.0, 100.0, 1.0, 1.0, 100.0)).max() for j in kept]
        if all(a > 1.0 for a in apart):
            kept.append(int(i))
    return placements[kept[:count]]


def _pair_space(
    table: PairTable, placement: Array, gates: Array, pair_rad: float, terms: Terms, with_scale: bool
) -> tuple[PairSpace, Mask]:
    """The restricted space at a placement, and the state to start from: each near data line to its nearest line."""
    members = np.flatnonzero(gated(table, placement, gates, pair_rad))
    model, data = table.model[members], table.data[members]
    rows = table.across[members]
    weights = terms.end_weights[data]
    along = table.along[members] @ placement
    cells = (np.arange(COVER_CELLS) + 0.5) / COVER_CELLS * table.lengths[members][:, None]
    masks = (cells >= along.min(axis=1)[:, None]) & (cells <= along.max(axis=1)[:, None])
    forms = np.swapaxes(rows * weights[:, None, None], 1, 2) @ rows
    shift, turn, scale = (np.array([w]) for w in terms.anchor_weights)
    anchor = start_anchor(placement[None], shift, turn, scale)[0]
    fitting = Fitting.of_figure(with_scale, placement)
    space = PairSpace(members, model, data, forms, masks, table.lines, anchor, fitting)
    distances = np.sqrt(np.mean((rows @ placement) ** 2, axis=1))
    return space, nearest(data, distances, distances <= 0.5 * gates[model])


def _match(
    space: PairSpace, found: Found, table: PairTable, fit: Fits, centre: Array, terms: Terms, objective: Objective
) -> Match:
    covered = coverage(space, found.chosen)
    chosen = np.flatnonzero(found.chosen)
    chosen = chosen[np.lexsort((space.data[chosen], space.model[chosen]))]
    return Match(
        pairs=np.stack([space.model[chosen], space.data[chosen]], axis=1),
        transform=compute_model_motion(fit.placements[0], centre),
        e_fit=float(fit.errors[0]),
        e_omission=float(terms.omission(1.0 - covered, np.arange(space.lines)).sum()),
        coverage=covered,
        residuals_px=np.asarray(table.across[space.members[chosen]] @ fit.placements[0]),
        objective=objective,
        steps=found.steps,
        trace=found.trace,
    )


def _gates(pair_px: Any, count: int) -> Array:
    gates = np.asarray(pair_px, float)
    if gates.shape not in ((), (count,)) or np.any(~(gates > 0)):
        raise ValueError(f"expected pair_px > 0, one number or {count}, got {pair_px!r}")
    return np.broadcast_to(gates, (count,))


def _checked(values: Any, name: str) -> Array:
    array = np.asarray(values, float)
    if array.size == 0:
        return np.zeros((0, 2, 2))
    if array.ndim != 3 or array.shape[1:] != (2, 2) or not np.all(np.isfinite(array)):
        raise ValueError(f"expected finite {name} of shape (n, 2, 2), got {array.shape}")
    return array
