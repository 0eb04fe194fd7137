"""Laws of the 2D matcher (§6.1), with brute force and scipy's minimiser as oracles."""

from __future__ import annotations

from itertools import pairwise, product
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy.optimize import minimize

from experiments.paper.paper_matching import PaperSearch, match_as_paper
from knowledge_sources.methods.matching import Match, Peak, Similarity2, compute_best_fits, match_lines

Array = NDArray[np.float64]

seeds = st.integers(0, 2**32 - 1)
objectives = st.sampled_from(["paper", "likelihood"])
quick = settings(max_examples=12, deadline=None, derandomize=True)


def match(objective: str, model: Array, data: Array, search: PaperSearch | None = None, **more: Any) -> Match:
    """Three starts within 3 px, and steepest descent with exchanges, under the likelihood or the paper's objective."""
    more = {"max_starts": 3, "pair_px": 3.0, **more}
    if objective == "paper":
        return match_as_paper(model, data, search or PaperSearch(first=False, exchange=True), **more)
    return match_lines(model, data, **({"search": search} if search else {}), **more)


def draw_model(rng: np.random.Generator, count: int) -> Array:
    """Lines of all directions, spread over the image (m, 2, 2)."""
    middles = rng.uniform(120.0, 390.0, (count, 2))
    angles = np.linspace(0.0, np.pi, count, endpoint=False) + rng.uniform(-0.1, 0.1, count)
    half = 0.5 * rng.uniform(60.0, 160.0, count)[:, None] * np.stack([np.cos(angles), np.sin(angles)], axis=1)
    return np.stack([middles - half, middles + half], axis=1)


def draw_data(model: Array, move: Similarity2, rng: np.random.Generator, clutter: int, noise_px: float = 0.3) -> Array:
    """The moved model in two fragments a line, and clutter, shuffled (k, 2, 2)."""
    moved = move.apply(model)
    cuts = rng.uniform(0.45, 0.55, len(model))[:, None]
    span = moved[:, 1] - moved[:, 0]
    parts = [
        np.stack([moved[:, 0], moved[:, 0] + (cuts - 0.05) * span], axis=1),
        np.stack([moved[:, 0] + (cuts + 0.05) * span, moved[:, 1]], axis=1),
    ]
    start, angle = rng.uniform(0.0, 511.0, (clutter, 2)), rng.uniform(0.0, np.pi, clutter)
    length = rng.uniform(10.0, 60.0, (clutter, 1))
    parts.append(np.stack([start, start + length * np.stack([np.cos(angle), np.sin(angle)], axis=1)], axis=1))
    data = np.concatenate(parts)
    return rng.permutation(data + rng.normal(0.0, noise_px, data.shape))


def draw_motion(rng: np.random.Generator, model: Array, shift_px: float = 20.0, turn_rad: float = 0.15) -> Similarity2:
    centre = model.reshape(-1, 2).mean(axis=0)
    shift = rng.uniform(-shift_px, shift_px, 2)
    return Similarity2(rng.uniform(-turn_rad, turn_rad), (shift[0], shift[1]), (centre[0], centre[1]))


def scene(seed: int, lines: int = 10, clutter: int = 40) -> tuple[Array, Array, Similarity2, np.random.Generator]:
    rng = np.random.default_rng(seed)
    model = draw_model(rng, lines)
    move = draw_motion(rng, model)
    return model, draw_data(model, move, rng, clutter), move, rng


def measure_error_px(found: Match, move: Similarity2, model: Array) -> float:
    return float(np.abs(found.transform.apply(model) - move.apply(model)).max())


@given(seed=seeds, objective=objectives)
@quick
def test_a_moved_model_is_found(seed: int, objective: Any) -> None:
    model, data, move, _ = scene(seed)
    found = match(objective, model, data)
    assert measure_error_px(found, move, model) < 2.0
    assert found.coverage.mean() > 0.8


@given(seed=seeds, objective=objectives, first=st.booleans(), exchange=st.booleans())
@quick
def test_the_match_error_falls_at_every_step(seed: int, objective: Any, first: bool, exchange: bool) -> None:
    model, data, _, _ = scene(seed, lines=6, clutter=80)
    search = PaperSearch(first, exchange)
    found = match(objective, model, data, search, pair_px=8.0, start=Peak(0.0, (0.0, 0.0), 1.0))
    errors = [step.evaluation for step in search.trace]
    assert all(after < before for before, after in pairwise(errors))
    assert len(errors) == found.steps + 1
    assert found.e_match == pytest.approx(errors[-1])
    most = 3 if exchange else 2
    for before, after in pairwise(search.trace):
        assert 1 <= len(set(before.pairs) ^ set(after.pairs)) <= most


@given(seed=seeds, objective=objectives)
@quick
def test_each_data_line_goes_to_one_model_line(seed: int, objective: Any) -> None:
    model, data, _, _ = scene(seed, clutter=100)
    pairs = match(objective, model, data, pair_px=8.0).pairs
    assert len(np.unique(pairs[:, 1])) == len(pairs)
    assert [tuple(p) for p in pairs] == sorted(tuple(p) for p in pairs)


@given(seed=seeds, objective=objectives)
@quick
def test_the_order_of_lines_does_not_matter(seed: int, objective: Any) -> None:
    model, data, _, rng = scene(seed)
    rows, columns = rng.permutation(len(model)), rng.permutation(len(data))
    first = match(objective, model, data)
    second = match(objective, model[rows], data[columns])
    back = {(int(rows[m]), int(columns[d])) for m, d in second.pairs}
    assert back == {(int(m), int(d)) for m, d in first.pairs}
    assert second.e_match == pytest.approx(first.e_match, abs=1e-6)


@given(seed=seeds, objective=objectives)
@quick
def test_which_end_comes_first_does_not_matter(seed: int, objective: Any) -> None:
    model, data, _, rng = scene(seed)
    a, b = rng.random(len(model)) < 0.5, rng.random(len(data)) < 0.5
    turned, flipped = model.copy(), data.copy()
    turned[a], flipped[b] = model[a][:, ::-1], data[b][:, ::-1]
    first = match(objective, model, data)
    second = match(objective, turned, flipped)
    assert np.array_equal(first.pairs, second.pairs)
    assert second.e_match == pytest.approx(first.e_match, abs=1e-6)


@given(seed=seeds, objective=objectives, angle=st.floats(-3.0, 3.0))
@quick
def test_moving_model_and_data_together_changes_nothing(seed: int, objective: Any, angle: float) -> None:
    """From one placement: the accumulator's axes are the image's, so it alone may prefer another peak."""
    model, data, move, rng = scene(seed)
    still = Peak(0.0, (0.0, 0.0), 1.0)
    data = draw_data(model, Similarity2(0.0, (0.0, 0.0), move.centre_px), rng, 40)
    common = Similarity2(angle, (37.0, -80.0), (256.0, 256.0))
    first = match(objective, model, data, start=still)
    second = match(objective, common.apply(model), common.apply(data), start=still)
    assert np.array_equal(first.pairs, second.pairs)
    assert second.e_match == pytest.approx(first.e_match, rel=1e-6)


@pytest.mark.parametrize("objective", ["paper", "likelihood"])
def test_an_exchange_leaves_a_local_minimum(objective: str) -> None:
    """One side of a square starts with a line 3 px beside the right one: no single flip improves that, §6.1.1."""
    square = 100.0 * np.array([[[1, 1], [1, 2]], [[1, 1], [2, 1]], [[2, 1], [2, 2]], [[1, 2], [2, 2]]])
    data = np.concatenate([square, square[:1] + np.array([3.0, 0.0])])
    wrong, right = [(0, 4), (1, 1), (2, 2), (3, 3)], [(0, 0), (1, 1), (2, 2), (3, 3)]
    for exchange, pairs in ((False, wrong), (True, right)):
        search = PaperSearch(first=False, exchange=False) if not exchange else None
        found = match(objective, square, data, search, pair_px=4.0, start=Peak(0.0, (0.0, 0.0), 0.0), first_pairs=wrong)
        assert [(int(m), int(d)) for m, d in found.pairs] == pairs


@given(seed=seeds, objective=objectives)
@settings(max_examples=5, deadline=None)
def test_a_small_problem_ends_at_a_local_minimum_of_all_its_states(seed: int, objective: Any) -> None:
    """Brute force over every state of a small space: the search ends at a local minimum, never below the best."""
    rng = np.random.default_rng(seed)
    model = draw_model(rng, 2)
    data = draw_data(model, Similarity2(0.0, (1.0, -0.5), (256.0, 256.0)), rng, 0)
    data = np.concatenate([data, data[:1] + 2.0, data[-1:] - 2.0])
    arguments: dict[str, Any] = {"start": Peak(0.0, (0.0, 0.0), 1.0), "pair_px": 4.0}
    found = match(objective, model, data, **arguments)
    errors: dict[frozenset[tuple[int, int]], float] = {}
    nearest = [int(np.argmin([_measure_distance(line, segment) for line in model])) for segment in data]
    for take in product([False, True], repeat=len(data)):
        pairs = frozenset((nearest[k], k) for k in range(len(data)) if take[k])
        search = PaperSearch(first=False, exchange=False)
        match(objective, model, data, search, first_pairs=pairs, **arguments)
        errors[pairs] = search.trace[0].evaluation
    state = frozenset((int(m), int(d)) for m, d in found.pairs)
    assert found.e_match >= min(errors.values()) - 1e-9
    assert found.e_match == pytest.approx(errors[state])
    assert all(errors[other] >= found.e_match - 1e-9 for other in errors if len(other ^ state) == 1)


def _measure_distance(line: Array, segment: Array) -> float:
    unit = (line[1] - line[0]) / np.linalg.norm(line[1] - line[0])
    across = (segment - line[0]) @ np.array([-unit[1], unit[0]])
    beyond = (segment - line[0]) @ unit
    gap = max(0.0, -float(beyond.max()), float(beyond.min()) - float(np.linalg.norm(line[1] - line[0])))
    return float(np.abs(across).max()) + gap


@given(seed=seeds)
@settings(max_examples=25, deadline=None)
def test_the_closed_fit_is_scipy_s_minimum(seed: int) -> None:
    """E_fit of random pairs over turn and shift, near no motion."""
    rng = np.random.default_rng(seed)
    angles = rng.uniform(0.0, np.pi, 8)
    normals = np.stack([-np.sin(angles), np.cos(angles)], axis=1)
    ends = rng.uniform(-200.0, 200.0, (8, 2, 2))
    offsets = np.sum(normals * ends.mean(axis=1), axis=1)
    ends += -np.sum(normals[:, None] * (ends - ends.mean(axis=1, keepdims=True)), axis=-1)[..., None] * normals[:, None]
    ends += rng.normal(0.0, 3.0, ends.shape)
    weights = rng.uniform(0.1, 2.0, 8)
    rows = np.empty((8, 2, 5))
    rows[..., 0] = np.sum(normals[:, None] * ends, axis=-1)
    rows[..., 1] = normals[:, None, 1] * ends[..., 0] - normals[:, None, 0] * ends[..., 1]
    rows[..., 2:4], rows[..., 4] = normals[:, None], -offsets[:, None]
    form = np.einsum("p,pea,peb->ab", weights, rows, rows)
    still = np.array([1.0, 0.0, 0.0, 0.0, 1.0])
    found = compute_best_fits(form[None], still)

    def error(x: Any) -> float:
        c, s = np.cos(x[0] / 100.0), np.sin(x[0] / 100.0)
        moved = ends @ np.array([[c, s], [-s, c]]) + (x[1], x[2])
        return float(np.sum(weights[:, None] * (np.sum(normals[:, None] * moved, -1) - offsets[:, None]) ** 2))

    oracle = minimize(error, np.zeros(3), method="BFGS", options={"gtol": 1e-8})
    assert found.errors[0] == pytest.approx(oracle.fun, rel=1e-4, abs=1e-6)
    c, s, u, v, _ = found.placements[0]
    assert error((100.0 * np.arctan2(s, c), u, v)) == pytest.approx(found.errors[0], abs=1e-6)


@pytest.mark.parametrize("objective", ["paper", "likelihood"])
def test_without_lines_there_are_no_pairs(objective: Any) -> None:
    empty, line = np.zeros((0, 2, 2)), np.array([[[10.0, 10.0], [10.0, 90.0]]])
    for model, data in ((line, empty), (empty, line), (empty, empty)):
        found = match(objective, model, data)
        assert found.pairs.shape == (0, 2) and not found.coverage.any()


@pytest.mark.parametrize("more", [{"pair_px": 0.0}, {"pair_px": [1.0, 2.0, 3.0]}])
def test_wrong_distances_are_named(more: dict[str, Any]) -> None:
    line = np.array([[[10.0, 10.0], [10.0, 90.0]]])
    with pytest.raises(ValueError, match="expected"):
        match("likelihood", line, line, **more)
