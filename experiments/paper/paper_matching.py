"""The paper's own 2D matching (§6.1): its match error, and a local search that takes the first improvement.

The space of pairs, the starts and the fit of a state are those of the matcher of missions, which has another objective
and descends most steeply. Here a search keeps its states, as Figure 12 shows them.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np

from knowledge_sources.methods.arrays import Floats, Indices, Mask
from knowledge_sources.methods.matching import (
    MAX_MOVES_PER_PAIR,
    MIN_GAIN,
    Match,
    PairSpace,
    SearchResult,
    Terms,
    count_cover,
    fit_state,
    match_lines,
)

OMISSION_ALPHA = 0.5  # weight of the omission error (§6.1.3, alpha)
OMISSION_BETA = 4.0  # exponent of the omission error (§6.1.3, beta)


class TraceStep(NamedTuple):
    """One state of a search: its pairs (model, data) and its match error, as a row of Figure 12(d)."""

    pairs: tuple[tuple[int, int], ...]
    evaluation: float


@dataclass(frozen=True, slots=True, eq=False)
class PaperTerms(Terms):
    """E_match = E_fit + alpha sum_L e^(beta P_L), P_L the part of model line L that is not covered. Source: §6.1.3."""

    def compute_omission(self, uncovered: Floats, lines: Indices) -> Floats:
        return np.asarray(self.omission_scale[lines] * np.exp(OMISSION_BETA * uncovered))


def build_paper_terms(model_lengths: Floats, data_lengths: Floats) -> PaperTerms:
    """The paper's objective of model and data lines of lengths (m,), (k,) [px].

    They count relative to the model's: E_fit is a mean squared distance [px^2], and a model line's omission weighs by
    its share of the model ("perhaps on the basis of model line length"). So weighted, the error spans the range of
    Figure 12(d).
    """
    total = max(float(np.sum(model_lengths)), 1.0)
    return PaperTerms(
        end_weights=0.5 * data_lengths / total,
        omission_scale=OMISSION_ALPHA * model_lengths / total,
        lengths=model_lengths,
        anchor_weights=(1e-6, 1e-2, 1e-2),
    )


@dataclass(slots=True)
class PaperSearch:
    """Local search: add or delete one pair at a time (k = 1) while the match error falls.

    Attributes:
        first: take the first improvement, after the pair that was flipped last; else the steepest.
        exchange: at a local minimum also exchange one data line of a model line for another, the steepest.
        trace: the states of the last search, first to last.
    """

    first: bool = True
    exchange: bool = False
    trace: tuple[TraceStep, ...] = field(default=(), init=False)

    def __call__(self, space: PairSpace, terms: Terms, start: Mask) -> SearchResult:
        """As :func:`knowledge_sources.methods.matching.search.search_pairs`."""
        chosen, last, steps = start.copy(), -1, []
        everyone = np.arange(len(start))
        state = _State(space, terms, chosen)
        errors = [float(fit_state(space, chosen).errors[0] + state.omissions.sum())]
        steps.append(_build_step(space, chosen, errors[0]))
        while len(errors) <= MAX_MOVES_PER_PAIR * len(start):
            below = errors[-1] - MIN_GAIN
            into, out = everyone, np.full(len(start), -1)
            found = state.evaluate(into, out)
            if self.exchange and not np.any(found < below):
                into, out = np.nonzero((space.model[:, None] == space.model) & ~chosen[:, None] & chosen)
                found = state.evaluate(into, out)
            better = np.flatnonzero(found < below)
            if not len(better):
                break
            if self.first and out[better[0]] < 0:
                move = better[np.argmin((better - last - 1) % len(start))]
                last = int(move)
            else:
                move = better[np.argmin(found[better])]
            errors.append(float(found[move]))
            chosen = _flip(space, chosen, int(into[move]), int(out[move]))
            steps.append(_build_step(space, chosen, errors[-1]))
            state = _State(space, terms, chosen)
        self.trace = tuple(steps)
        return SearchResult(chosen, np.array(errors))


class _State:
    """What the moves from a state need: how often each cell is covered (m, c), and the omission of each line (m,)."""

    def __init__(self, space: PairSpace, terms: Terms, chosen: Mask) -> None:
        self.space, self.terms, self.chosen = space, terms, chosen
        self.counts = count_cover(space.masks, space.model, chosen, space.lines)
        self.omissions = terms.compute_omission(1.0 - (self.counts > 0).mean(axis=1), np.arange(space.lines))
        self.form = space.anchor + space.forms[chosen].sum(axis=0)
        self.holder = np.full(int(space.data.max(initial=-1)) + 1, -1)
        self.holder[space.data[chosen]] = np.flatnonzero(chosen)

    def evaluate(self, into: Indices, out: Indices) -> Floats:
        """Match errors (n,) after each of n moves: flip pair ``into``, and take out pair ``out`` (-1: none)."""
        space = self.space
        if not len(into):
            return np.zeros(0)
        sign = np.where(self.chosen[into], -1.0, 1.0)
        losers = np.where(sign > 0.0, self.holder[space.data[into]], -1)  # who had the data line of an added pair
        given, lost = (out >= 0).astype(float), (losers >= 0).astype(float)
        masks, forms, model = space.masks.astype(float), space.forms, space.model
        covers = self.counts[model[into]] + sign[:, None] * masks[into] - given[:, None] * masks[out]
        error = self.omissions.sum() + self._grow(model[into], covers)
        error = error + lost * self._grow(model[losers], self.counts[model[losers]] - masks[losers])
        form = self.form + sign[:, None, None] * forms[into]
        form = form - given[:, None, None] * forms[out] - lost[:, None, None] * forms[losers]
        return np.asarray(error + space.fitting.fit(form).errors)

    def _grow(self, lines: Indices, covers: Floats) -> Floats:
        after = self.terms.compute_omission(1.0 - (covers > 0).mean(axis=1), lines)
        return np.asarray(after - self.omissions[lines])


def _flip(space: PairSpace, chosen: Mask, into: int, out: int) -> Mask:
    after = chosen.copy()
    if not chosen[into]:
        after[space.data == space.data[into]] = False
    after[into] = not chosen[into]
    if out >= 0:
        after[out] = False
    return after


def _build_step(space: PairSpace, chosen: Mask, error: float) -> TraceStep:
    pairs = zip(space.model[chosen].tolist(), space.data[chosen].tolist(), strict=True)
    return TraceStep(tuple(sorted(pairs)), error)


def match_as_paper(
    model_px: Any, data_px: Any, search: PaperSearch | None = None, *, max_starts: int = 1, pair_px: Any = 3.0,
    **given: Any,
) -> Match:
    """Match the projected model (m, 2, 2) to data lines (k, 2, 2) under the paper's match error.

    Args:
        search: by default the paper's own. max_starts, pair_px: as the paper has them [px].
        given: as for :func:`knowledge_sources.methods.matching.match_lines`.
    """
    model, data = (np.asarray(lines, float).reshape(-1, 2, 2) for lines in (model_px, data_px))
    lengths = [np.linalg.norm(lines[:, 1] - lines[:, 0], axis=1) for lines in (model, data)]
    return match_lines(
        model_px, data_px, max_starts=max_starts, pair_px=pair_px, terms=build_paper_terms(*lengths),
        search=search or PaperSearch(), **given)
