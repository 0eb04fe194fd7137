"""Laws of the goal closer: a goal is reached by the sketch that leads to it, and by no other."""

from __future__ import annotations

from dataclasses import replace
from typing import get_args

import pytest

from generated_boards import Bench, all_reasons, effect_on
from harvey.testing import check_source
from knowledge_sources.goal.goal_closer import goal_closer
from world_models.entries import Goal
from world_models.entries.task import GoalStatus

SOURCE = goal_closer


@pytest.mark.parametrize("status", get_args(GoalStatus))
def test_it_closes_the_goal_of_the_sketch_once(status: GoalStatus) -> None:
    bench = Bench()
    goal, other = bench.pursue(), bench.pursue()
    sketch = bench.revise(bench.sketch(goal=goal), status="done")
    goal = bench.revise(goal, status=status)
    effects = bench.ask(SOURCE, sketch)
    assert (effects is not None) == (status == "active")
    if effects is not None:
        effect = effect_on(effects, Goal)
        assert effect.entry is goal and effect.value == replace(goal.value, status="reached")
        assert all_reasons(effects) == {sketch.id} and effect.entry.id != other.id
        bench.apply(*effects)
        assert bench.ask(SOURCE, sketch) is None


def test_it_keeps_the_laws_of_all_sources() -> None:
    bench = Bench()
    goal = bench.pursue()
    sketch = bench.revise(bench.sketch(goal=goal), status="done")
    check_source(SOURCE, bench, sketch, without=(goal.id,))
