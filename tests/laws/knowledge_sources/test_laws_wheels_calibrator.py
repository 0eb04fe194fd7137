"""Laws of the wheels calibrator: it learns how far wheels go that surely err, and changes none that are right."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from blackboard import Entry
from generated_boards import Bench, made, reasons
from harvey.testing import check_source, plain_robot
from knowledge_sources.methods.belief import weigh_rivals
from knowledge_sources.senses.wheels_calibrator import wheels_calibrator
from world_models.actuator import ActuatorModel
from world_models.entries import Difference, Evidence, Explanation, RivalKind, Wheels

TOLD = ActuatorModel()
reaches = st.floats(0.5, 1.3)


def tell(reach: float, sigma: float, when_s: float, ratio: float = 3.9, kind: RivalKind = "wheels") -> Evidence:
    """A stretch of the way by which the wheels go so far a metre."""
    told = Explanation("chance", "chance", 0.0), Explanation(kind, f"{kind} that err", ratio, reach, sigma)
    return Evidence("motion", "", told, 0.0, 0.0, 0.0, 0.0, 0.0, when_s)


def ask(told: Sequence[Evidence]) -> tuple[Bench, Entry[Difference], list[Wheels]]:
    bench = Bench(plain_robot(actuator=TOLD))
    found = bench.put(weigh_rivals("motion", told))
    return bench, found, made(bench.ask(wheels_calibrator, found), Wheels)


@given(reaches, st.lists(st.floats(-2.0, 2.0), min_size=3, max_size=8), st.permutations(range(3)))
def test_it_takes_over_what_all_stretches_tell(reach: float, errors: list[float], order: list[int]) -> None:
    told = [tell(reach + 0.06 * error, 0.06, float(k)) for k, error in enumerate(errors)]
    bench, found, learnt = ask([*(told[k] for k in order), *told[3:]])
    if not learnt:
        assert abs(reach - TOLD.reach) < 0.25
        return
    (wheels,) = learnt
    assert wheels.actuator.reach == pytest.approx(reach + 0.06 * np.mean(errors))
    sigma = 0.06 / len(told) ** 0.5 * max(1.0, float(np.std(errors, ddof=1)))
    assert wheels.actuator.reach_sigma == pytest.approx(max(TOLD.reach_sigma, sigma))
    (effect,) = bench.ask(wheels_calibrator, found) or ()
    assert reasons(effect) == {found.id, "Wheels-1"}
    bench.apply(effect)
    assert not list(bench.ask(wheels_calibrator, found) or ())  # the same is not learnt twice


def test_a_way_that_tells_nothing_changes_nothing_and_it_keeps_the_laws_of_all_sources() -> None:
    assert not ask([tell(0.0, 0.0, float(k)) for k in range(4)])[2]
    bench, found, _ = ask([tell(0.7, 0.02, float(k)) for k in range(4)])
    check_source(wheels_calibrator, bench, found)
