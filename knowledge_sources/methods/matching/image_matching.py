"""2D model matching in the image: which data lines show which model lines (§6.1)?"""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass
from typing import Any

import numpy as np

from knowledge_sources.methods.arrays import Floats, Indices, Mask
from knowledge_sources.methods.matching.image_pairs import (
    HOUGH_WINDOW_RAD,
    LineTable,
    PairTable,
    Peak,
    build_anchors,
    build_line_table,
    build_pair_table,
    compute_model_motion,
    compute_placement,
    find_gated,
    find_hough_peaks,
    refine_placements,
)
from knowledge_sources.methods.matching.search import (
    Fitting,
    PairSpace,
    SearchResult,
    Similarity2,
    Terms,
    TraceStep,
    build_likelihood_terms,
    build_masks,
    build_paper_terms,
    choose_nearest,
    compute_coverage,
    fit_state,
    list_pairs,
    search_pairs,
)
from knowledge_sources.settings import DEFAULT, MatchingSettings

COVERAGE_CELLS = 48  # cells along a model line by which its coverage is counted
MAX_PAIR_RAD = 0.3  # rad; largest angle between a data line and its model line (§6.1.4)
MIN_SIGMA_PX = 1.0  # px; smallest standard deviation of a data end, likelihood
MIN_START_ERROR_PX = 3.0  # px; smallest error of a start that the likelihood assumes
HOUGH_PEAKS_PER_START = 4  # peaks that are refined for each placement that is searched
START_WIDTHS_PX = (8.0, 6.0, 4.0, 3.0, 2.0, 1.5)  # px; widths of the loss by which a peak is refined

Pair = tuple[int, int]
"""Model index, data index."""


@dataclass(frozen=True, slots=True, eq=False)
class Match:
    """The best correspondence found.

    Attributes:
        pairs: (p, 2) model index, data index, sorted; many data lines may go to one model line.
        transform: moves the model onto the data, in the image.
        e_fit, e_omission: the two terms of the match error, the second with its weight.
        coverage: (m,) share of each model line that data lines cover.
        residuals_px: (p, 2) distances of the data ends to the moved model lines.
        objective: under which objective. steps: moves made from the start to this state.
        trace: the states of the search, first to last, if asked for.
    """

    pairs: Indices
    transform: Similarity2
    e_fit: float
    e_omission: float
    coverage: Floats
    residuals_px: Floats
    objective: str
    steps: int
    trace: tuple[TraceStep, ...] = ()

    @property
    def e_match(self) -> float:
        """The match error: smaller is better; only comparable under one objective and one model."""
        return self.e_fit + self.e_omission


def match_lines(
    model_px: Any,
    data_px: Any,
    settings: MatchingSettings = DEFAULT.matching,
    *,
    pair_px: Any = None,
    start: Peak | None = None,
    first_pairs: Collection[Pair] | None = None,
    trace: bool = False,
) -> Match:
    """Match the projected model to the data lines, the model moving as a rigid figure in the image.

    Source: §6.1: a generalised Hough transform over the data within a window of the model places the model; the pairs
    near that place form the space; local search finds the state of least match error. The paper's own way is
    ``replace(settings, objective="paper", strategy="first", exchange=False, max_starts=1)``.

    Args:
        model_px: (m, 2, 2) projected model lines. data_px: (k, 2, 2) data lines.
        pair_px: how far a data end may lie from its model line, in place of ``settings.max_pair_px``: one number, or
            (m,) when some model lines are predicted worse than others. Wider when perspective bends the prediction.
        start: this placement (about the mean of the model's ends) instead of Hough's.
        first_pairs: pairs of the first state; ``None``: each near data line to its nearest model line.
        trace: keep the states of the search, see :func:`format_trace`.

    Raises:
        ValueError: a wrong shape, a distance that is not > 0, an unknown objective or strategy.
    """
    model, data = _check_lines(model_px, "model_px"), _check_lines(data_px, "data_px")
    centre = model.reshape(-1, 2).mean(axis=0) if len(model) else np.zeros(2)
    still, scene = build_line_table(model, centre), build_line_table(data, centre)
    gates = _check_gates(settings.max_pair_px if pair_px is None else pair_px, len(model))
    terms = _build_terms(still, scene, gates, settings)
    window_px = settings.hough_window_px + np.maximum(gates, START_WIDTHS_PX[0])
    table = build_pair_table(still, scene, window_px, HOUGH_WINDOW_RAD + MAX_PAIR_RAD)
    placements = [compute_placement(start)] if start else _find_starts(still, scene, table, settings)
    tries = []
    for placement in placements:
        space, first = _build_space(table, placement, gates, terms, settings)
        if first_pairs is not None:
            first = np.array([pair in first_pairs for pair in zip(space.model, space.data, strict=True)], bool)
        result = search_pairs(
            space, terms, first, settings, strategy=settings.strategy, exchange=settings.exchange, keep_trace=trace
        )
        tries.append((space, result))
    space, result = min(tries, key=lambda tried: tried[1].error)
    return _build_match(space, result, table, centre, terms, settings.objective)


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


def _build_terms(model: LineTable, data: LineTable, gates: Floats, settings: MatchingSettings) -> Terms:
    """The objective, its noise taken from the median distance (m,) within which pairs are looked for [px]."""
    if settings.objective == "paper":
        return build_paper_terms(model.lengths, data.lengths)
    if settings.objective != "likelihood":
        raise ValueError(f'expected objective "paper" or "likelihood", got {settings.objective!r}')
    width = float(np.median(gates)) if len(gates) else settings.max_pair_px
    sigma_px = max(MIN_SIGMA_PX, width / settings.pair_sigmas)
    start_px = max(width, MIN_START_ERROR_PX)
    return build_likelihood_terms(model.lengths, len(data.ends), sigma_px, start_px, settings)


def _find_starts(still: LineTable, scene: LineTable, table: PairTable, settings: MatchingSettings) -> Floats:
    """Placements (k, 5) to search from: Hough's peaks, refined, the best supported that differ.

    They differ by 1 px of shift, or 0.01 of turn or scale.
    """
    peaks = find_hough_peaks(still, scene, HOUGH_PEAKS_PER_START * settings.max_starts, settings)
    coarse = np.stack([compute_placement(peak) for peak in peaks])
    placements, support = refine_placements(table, coarse, START_WIDTHS_PX)
    kept: list[int] = []
    for i in np.argsort(-support, kind="stable"):
        apart = [np.abs((placements[i] - placements[j]) * (100.0, 100.0, 1.0, 1.0, 100.0)).max() for j in kept]
        if all(a > 1.0 for a in apart):
            kept.append(int(i))
    return placements[kept[: settings.max_starts]]


def _build_space(
    table: PairTable, placement: Floats, gates: Floats, terms: Terms, settings: MatchingSettings
) -> tuple[PairSpace, Mask]:
    """The restricted space at a placement, and the state to start from: each near data line to its nearest line."""
    members = np.flatnonzero(find_gated(table, placement, gates, MAX_PAIR_RAD))
    model, data = table.model[members], table.data[members]
    rows = table.across[members]
    weights = terms.end_weights[data]
    shift, turn, scale = (np.array([w]) for w in terms.anchor_weights)
    space = PairSpace(
        members=members,
        model=model,
        data=data,
        forms=np.swapaxes(rows * weights[:, None, None], 1, 2) @ rows,
        masks=build_masks(table.along[members] @ placement, table.lengths[members], COVERAGE_CELLS),
        lines=table.lines,
        anchor=build_anchors(placement[None], shift, turn, scale)[0],
        fitting=Fitting.in_image(settings.with_scale, placement),
    )
    distances = np.sqrt(np.mean((rows @ placement) ** 2, axis=1))
    return space, choose_nearest(data, distances, distances <= 0.5 * gates[model])


def _build_match(
    space: PairSpace, result: SearchResult, table: PairTable, centre: Floats, terms: Terms, objective: str
) -> Match:
    fit = fit_state(space, result.chosen)
    covered = compute_coverage(space, result.chosen)
    rows, pairs = list_pairs(space, result.chosen)
    return Match(
        pairs=pairs,
        transform=compute_model_motion(fit.placements[0], centre),
        e_fit=float(fit.errors[0]),
        e_omission=float(terms.compute_omission(1.0 - covered, np.arange(space.lines)).sum()),
        coverage=covered,
        residuals_px=np.asarray(table.across[space.members[rows]] @ fit.placements[0]),
        objective=objective,
        steps=result.steps,
        trace=result.trace,
    )


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
