"""Figure 12: a simple 2D matching problem, and the trace of the local search that solves it.

The figure's drawing is not legible to the digit; this is a problem of its kind: a model of four lines A to D, fifteen
data lines numbered as in 12(d), of which the figure's final state names those that belong to the model. The search
starts, as there, from C-8 and D-7 alone, both wrong in the end.
"""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import numpy as np
import pytest

from experiments.paper.figure12 import format_trace
from experiments.paper.paper_matching import PaperSearch, TraceStep, match_as_paper
from knowledge_sources.methods.matching import Match, Peak, image_matching, match_lines

MODEL = np.array(
    [
        [[100.0, 100.0], [100.0, 220.0]],  # A: left side
        [[100.0, 100.0], [220.0, 100.0]],  # B: top
        [[220.0, 100.0], [220.0, 220.0]],  # C: right side
        [[100.0, 220.0], [220.0, 220.0]],  # D: bottom
    ]
)
A, B, C, D = range(4)
DATA = {
    1: [[101.0, 103.0], [100.0, 165.0]],
    2: [[100.5, 172.0], [99.5, 214.0]],
    3: [[103.0, 101.0], [216.0, 99.5]],
    4: [[219.0, 104.0], [220.5, 216.0]],
    5: [[104.0, 220.5], [150.0, 219.5]],
    6: [[158.0, 219.5], [214.0, 220.5]],
    7: [[150.0, 227.0], [190.0, 225.0]],
    8: [[226.0, 130.0], [225.0, 180.0]],
    9: [[94.0, 150.0], [93.0, 190.0]],
    10: [[130.0, 93.0], [170.0, 92.0]],
    11: [[140.0, 108.0], [200.0, 110.0]],
    12: [[213.0, 110.0], [212.0, 150.0]],
    13: [[110.0, 212.0], [140.0, 213.0]],
    14: [[228.0, 190.0], [229.0, 215.0]],
    15: [[107.0, 105.0], [109.0, 150.0]],
}
NUMBERS = list(DATA)
BELONGS = {(A, 1), (A, 2), (B, 3), (C, 4), (D, 5), (D, 6)}


SEGMENTS = np.array([DATA[n] for n in NUMBERS])
NEAR: dict[str, Any] = {"pair_px": 10.0, "start": Peak(0.0, (0.0, 0.0), 0.0)}


def solve() -> tuple[Match, tuple[TraceStep, ...]]:
    start, search = {(C, NUMBERS.index(8)), (D, NUMBERS.index(7))}, PaperSearch()
    return match_as_paper(MODEL, SEGMENTS, search=search, first_pairs=start, **NEAR), search.trace


def number_pairs(match: Match) -> set[tuple[int, int]]:
    return {(int(m), NUMBERS[d]) for m, d in match.pairs}


def test_the_evaluation_falls_at_each_step() -> None:
    evaluations = [step.evaluation for step in solve()[1]]
    assert len(evaluations) >= 6
    assert all(after < before for before, after in pairwise(evaluations))


def test_each_step_adds_or_deletes_one_pair() -> None:
    states = [set(step.pairs) for step in solve()[1]]
    assert states[0] == {(C, NUMBERS.index(8)), (D, NUMBERS.index(7))}
    assert all(len(before ^ after) == 1 for before, after in pairwise(states))


def test_the_search_leaves_the_false_start_and_finds_the_model() -> None:
    match, _ = solve()
    assert number_pairs(match) == BELONGS
    assert np.all(match.coverage > 0.8)


def test_the_evaluations_span_the_figure_s() -> None:
    """17.44 at the start, 1.61 at the end: omission weighted by relative model length, alpha .5, beta 4."""
    _, trace = solve()
    assert trace[0].evaluation == pytest.approx(17.44, rel=0.35)
    assert trace[-1].evaluation == pytest.approx(1.61, abs=0.9)


def test_the_likelihood_agrees_from_the_nearest_pairs(monkeypatch: pytest.MonkeyPatch) -> None:
    """Its evidence grows with the logarithm of length: from the false start the exchange would come too late."""
    monkeypatch.setattr(image_matching, "PAIR_SIGMAS", 10.0)
    assert number_pairs(match_lines(MODEL, SEGMENTS, **NEAR)) == BELONGS


def test_the_trace_prints_as_a_table() -> None:
    match, trace = solve()
    lines = format_trace(trace).splitlines()
    assert len(lines) == len(trace) + 1
    assert lines[1].split()[0] == "initial" and lines[-1].split()[0] == "final"
    assert lines[-1].split()[1:-1].count("x") == len(match.pairs)
    assert float(lines[-1].split()[-1]) == pytest.approx(match.e_match, abs=0.01)
