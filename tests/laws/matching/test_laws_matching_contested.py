"""Laws of the local search where data lines are contested: plain numpy and brute force over every move (§6.1.1).

Near-parallel model lines a few pixels apart want the same data lines. Each goes to one of them; what its rival loses by
that is part of the match error.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from experiments.paper.paper_matching import PaperSearch, PaperTerms, build_paper_terms
from knowledge_sources.methods.matching import MIN_GAIN, PairSpace, Peak, Terms, match_lines
from knowledge_sources.methods.matching.matching_kernels import RIGID
from knowledge_sources.methods.matching.search import (
    POSE_STEP,
    Fitting,
    build_likelihood_terms,
    evaluate_state,
    search_pairs,
)

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]
LINES, DATA, CELLS = 4, 6, 12
seeds = st.integers(0, 2**32 - 1)
quick = settings(max_examples=25, deadline=None, derandomize=True)


def draw_space(seed: int, fitting: Fitting, *, as_paper: bool) -> tuple[PairSpace, Terms, np.random.Generator]:
    """Most data lines may go to several model lines, with different residuals and covering different parts."""
    rng = np.random.default_rng(seed)
    allowed = rng.random((LINES, DATA)) < 0.7
    allowed[rng.integers(LINES, size=DATA), np.arange(DATA)] = True
    model, data = np.nonzero(allowed)
    unknowns = 4 if fitting.kind == POSE_STEP.kind else 5
    rows = rng.normal(0.0, 1.0, (len(model), 2, unknowns))
    if unknowns == 5:  # the placement is near no motion: cos 1, sin 0, no shift, scale 1
        rows[..., 4] = -rows[..., 0] + rng.normal(0.0, 0.3, rows.shape[:2])
    else:
        rows[..., -1] *= 0.5
    forms = np.einsum("pea,peb->pab", rows, rows)
    low = rng.uniform(0.0, 0.7, len(model))
    at = (np.arange(CELLS) + 0.5) / CELLS
    masks = (at >= low[:, None]) & (at <= (low + rng.uniform(0.1, 0.6, len(model)))[:, None])
    anchor = 0.1 * np.eye(unknowns)
    if unknowns == 5:
        anchor[0, 4] = anchor[4, 0] = -0.1
    lengths = rng.uniform(20.0, 120.0, LINES)
    terms = (build_paper_terms(lengths, rng.uniform(10.0, 80.0, DATA)) if as_paper
             else build_likelihood_terms(lengths, DATA, 1.0, 5.0))
    return PairSpace(model, data, forms, masks, LINES, anchor, fitting), terms, rng


def fit_by_hand(form: Array, fitting: Fitting) -> float:
    """The least value of a quadratic form: by solving, or over a fine grid of turns with the rest solved."""
    if fitting.kind == POSE_STEP.kind:
        step = np.linalg.solve(form[:-1, :-1], -form[:-1, -1])
        return float(np.append(step, 1.0) @ form @ np.append(step, 1.0))
    best = np.inf
    turns, width = np.linspace(-np.pi, np.pi, 721), 2.0 * np.pi / 720
    for _ in range(4):
        values = []
        for turn in turns:
            fixed = np.array([np.cos(turn), np.sin(turn)])
            free, known, rest = [2, 3], [0, 1, 4], np.append(fixed, 1.0)
            x = np.zeros(5)
            x[known] = rest
            x[free] = -np.linalg.solve(form[np.ix_(free, free)], form[np.ix_(free, known)] @ rest)
            values.append(x @ form @ x)
        near = turns[int(np.argmin(values))]
        best, turns, width = min(values), np.linspace(near - width, near + width, 41), width / 20.0
    return float(best)


def evaluate_by_hand(space: PairSpace, terms: Terms, chosen: Mask) -> float:
    """E_match from the definition: the fit of the chosen pairs, and the omission of each model line (§6.1.3)."""
    total = fit_by_hand(space.anchor + space.forms[chosen].sum(axis=0), space.fitting)
    for line in range(LINES):
        covered = space.masks[chosen & (space.model == line)].any(axis=0).mean()
        size = terms.lengths[line]
        if isinstance(terms, PaperTerms):
            total += terms.omission_scale[line] * np.exp(4.0 * (1.0 - covered))
        else:
            total += terms.omission_scale[line] * np.log((1.0 + size) / (1.0 + size * covered))
    return total


def list_moves(space: PairSpace, chosen: Mask, exchange: bool) -> list[Mask]:
    """Every state one move away: a pair taken out, or put in, which takes its data line from the pair that has it."""
    states = []
    for p in range(len(chosen)):
        after = chosen.copy()
        if not chosen[p]:
            after[space.data == space.data[p]] = False
        after[p] = not chosen[p]
        states.append(after)
        for out in np.flatnonzero(chosen & (space.model == space.model[p])) if exchange and not chosen[p] else ():
            swapped = after.copy()
            swapped[out] = False
            states.append(swapped)
    return states


def draw_start(space: PairSpace, rng: np.random.Generator) -> Mask:
    chosen = np.zeros(len(space.data), bool)
    for data in range(DATA):
        rows = np.flatnonzero(space.data == data)
        if rng.random() < 0.5:
            chosen[rng.choice(rows)] = True
    return chosen


@pytest.mark.parametrize("kind", [POSE_STEP, Fitting(RIGID, 0.0)], ids=["step", "rigid"])
@pytest.mark.parametrize(("first", "exchange", "as_paper"), [
    (False, False, True), (False, True, False), (False, True, True), (True, True, True), (True, False, False)])
@given(seed=seeds)
@settings(max_examples=12, deadline=None, derandomize=True)
def test_a_search_is_what_brute_force_finds(
    first: bool, exchange: bool, as_paper: bool, kind: Fitting, seed: int
) -> None:
    """Each state's error is the definition's, no data line is used twice, and at the end no move is better."""
    space, terms, rng = draw_space(seed, kind, as_paper=as_paper)
    start, search = draw_start(space, rng), PaperSearch(first, exchange)
    found, error = search(space, terms, start), search.trace[-1].evaluation
    if exchange and not (first or as_paper):  # the compiled search takes the same way
        compiled = search_pairs(space, terms, start)
        np.testing.assert_array_equal(compiled.chosen, found.chosen)
        np.testing.assert_allclose(compiled.errors, found.errors, rtol=1e-9, atol=1e-9)
    for step in search.trace:
        assert len({data for _, data in step.pairs}) == len(step.pairs), "a data line is kept by two model lines"
    if kind.kind == RIGID:  # Newton's method may end in another valley of the turn; its own fit is tested elsewhere
        def evaluate(chosen: Mask) -> float:
            return evaluate_state(space, terms, chosen)
    else:
        def evaluate(chosen: Mask) -> float:
            return evaluate_by_hand(space, terms, chosen)
    for step in search.trace if kind.kind == POSE_STEP.kind else (search.trace[0], search.trace[-1]):
        chosen = np.array([pair in step.pairs for pair in zip(space.model, space.data, strict=True)])
        assert step.evaluation == pytest.approx(evaluate(chosen), rel=1e-5, abs=1e-6)
    assert error == pytest.approx(evaluate(found.chosen), rel=1e-5, abs=1e-6)
    around = list_moves(space, found.chosen, exchange)
    assert all(evaluate(state) >= error - MIN_GAIN - 1e-6 for state in around)
    if not first and len(search.trace) > 1 and kind.kind == POSE_STEP.kind:
        best = min(evaluate(state) for state in list_moves(space, start, False))
        if best < search.trace[0].evaluation - MIN_GAIN:
            assert search.trace[1].evaluation == pytest.approx(best, rel=1e-5, abs=1e-6)


def draw_parallel(rng: np.random.Generator) -> tuple[Array, Array]:
    """Three near-parallel pairs of lines 3 to 6 px apart; their data lie between them, with noise."""
    model = []
    for k in range(3):
        angle, middle = k * 1.0 + rng.uniform(-0.2, 0.2), rng.uniform(150.0, 350.0, 2)
        for side in (0.0, rng.uniform(3.0, 6.0)):
            tilt = angle + rng.uniform(-0.02, 0.02)
            along = 0.5 * rng.uniform(80.0, 140.0) * np.array([np.cos(tilt), np.sin(tilt)])
            across = side * np.array([-np.sin(angle), np.cos(angle)])
            model.append([middle + across - along, middle + across + along])
    lines = np.array(model)
    parts = []
    for line in lines:
        for _ in range(2):
            a, b = np.sort(rng.uniform(0.0, 1.0, 2))
            parts.append(line[0] + np.array([[a], [b]]) * (line[1] - line[0]))
    return lines, np.array(parts) + rng.normal(0.0, 1.5, (len(parts), 2, 2))


@given(seed=seeds)
@quick
def test_near_parallel_lines_share_no_data_line(seed: int) -> None:
    """In the image: contested data go to one model line each, and the error is that of the state from again."""
    model, data = draw_parallel(np.random.default_rng(seed))
    given_: dict[str, Any] = {"start": Peak(0.0, (0.0, 0.0), 1.0), "pair_px": 9.0}
    found = match_lines(model, data, **given_)
    assert len(np.unique(found.pairs[:, 1])) == len(found.pairs)
    pairs = [(int(m), int(d)) for m, d in found.pairs]
    search = PaperSearch(first=False, exchange=True)
    match_lines(model, data, first_pairs=frozenset(pairs), search=search, **given_)
    again = search.trace[0]
    assert again.pairs == tuple(sorted(pairs)) and again.evaluation == pytest.approx(found.e_match, rel=1e-9)


def test_near_parallel_data_are_contested() -> None:
    """The scenes above are no plain ones: most of their data lines could go to either line of a pair."""
    contested = 0
    for seed in range(10):
        model, data = draw_parallel(np.random.default_rng(seed))
        along = model[:, 1] - model[:, 0]
        normals = np.stack([-along[:, 1], along[:, 0]], axis=1) / np.linalg.norm(along, axis=1)[:, None]
        for segment in data:
            near = np.abs(np.einsum("mj,mej->me", normals, segment - model[:, :1])).max(axis=1) < 9.0
            contested += int(np.count_nonzero(near) > 1)
    assert contested > 0.6 * 10 * len(data)
