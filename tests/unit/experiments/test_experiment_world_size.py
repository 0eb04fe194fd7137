"""How the world-size experiment compares times: by what was measured in the same repetition."""

from collections.abc import Callable

import numpy as np
import pytest
from numpy.typing import NDArray

from experiments.scale.world_size import MIN_STEP_MS, _Times
from experiments.scale.worlds.lockstep import decide_in_turn


def times(factor: float, delays: NDArray[np.float64]) -> _Times:
    """40 repetitions of 6 decisions, each repetition delayed as a whole; some steps are too short to be timed."""
    steps = np.array([0.1 * MIN_STEP_MS, 1.0, 5.0, 9.0, 2.0, 30.0])
    whole = delays[:, None] * steps[None, :] * factor
    return _Times(whole, whole)


def test_what_delays_all_worlds_alike_is_not_told_as_a_difference() -> None:
    delays = 1.0 + np.random.default_rng(0).exponential(2.0, 40)
    small, same, slow = times(1.0, delays), times(1.0, delays), times(1.2, delays)
    assert same.first(small) == same.sketching(small) == same.worst(small) == 1.0
    assert slow.first(small) == pytest.approx(1.2) and slow.worst(small) == pytest.approx(1.2)


def test_one_slow_step_is_found_and_one_bad_moment_is_not() -> None:
    even = np.ones(40)
    small, moment, step = times(1.0, even), times(1.0, even), times(1.0, even)
    moment.steps_ms[3, 2] *= 50.0
    step.steps_ms[:, 2] *= 1.3
    assert moment.worst(small) == 1.0 and step.worst(small) == pytest.approx(1.3)
    step.steps_ms[:, 0] *= 9.0
    assert step.worst(small) == pytest.approx(1.3), "steps that cannot be timed are not compared"


def test_another_number_of_steps_is_no_likeness() -> None:
    small = times(1.0, np.ones(3))
    assert _Times(small.decisions_ms, small.steps_ms[:, :4]).worst(small) == float("inf")


def test_agents_decide_in_turn_until_each_is_done() -> None:
    told: list[int] = []

    def agent(number: int, decisions: int) -> Callable[[], bool]:
        left = [decisions]

        def step() -> bool:
            told.append(number)
            left[0] -= 1
            return left[0] > 0

        return step

    taken = decide_in_turn([agent(0, 2), agent(1, 3)], 0)
    assert [len(each) for each in taken] == [2, 3] and sorted(told) == [0, 0, 1, 1, 1]
    assert told[:2] != told[2:4], "each in turn is first"
