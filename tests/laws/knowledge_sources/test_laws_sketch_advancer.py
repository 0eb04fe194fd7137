"""Laws of the sketch advancer: what carried out the current subgoal takes its sketch on by one, once."""

from __future__ import annotations

from dataclasses import replace

import pytest

from generated_boards import Bench, all_reasons, effect_on
from harvey.testing import HALL, check_source
from knowledge_sources.sketcher.sketch_advancer import sketch_advancer
from world_models.entries import Place, PlanSketch, SketchStatus

SOURCE = sketch_advancer
WAY = tuple(Place(HALL, 1.0 + x, 2.0) for x in range(4))


@pytest.mark.parametrize("at", [0, 1, 2])
@pytest.mark.parametrize("of", [0, 1, 2])
def test_a_leg_takes_on_the_sketch_whose_current_subgoal_it_was(at: int, of: int) -> None:
    bench = Bench()
    sketch = bench.sketch(*WAY, at=at)
    leg = bench.revise(bench.leg(sketch, index=of), status="arrived")
    effects = bench.ask(SOURCE, leg)
    assert (effects is not None) == (at == of)
    if effects is not None:
        effect = effect_on(effects, PlanSketch)
        assert effect.entry is sketch and effect.value == replace(sketch.value, at=at + 1, verified=False)
        assert all_reasons(effects) == {leg.id}
        bench.apply(*effects)
        assert bench.ask(SOURCE, leg) is None


@pytest.mark.parametrize(("path", "takes_on"), [((0, 1), True), ((0, 0), False), ((0,), False), ((1, 1), False)])
def test_a_sketch_takes_on_the_one_that_it_refines(path: tuple[int, ...], takes_on: bool) -> None:
    bench = Bench()
    above = bench.sketch(*WAY, path=(0,), at=1)
    goal = bench.view[above.value.goal]
    other = bench.sketch(*WAY, path=(0,), at=1)  # of another goal
    done = bench.revise(bench.sketch(*WAY, goal=goal, path=path, at=3), status="done")
    effects = bench.ask(SOURCE, done)
    assert (effects is not None) == takes_on
    if effects is not None:
        effect = effect_on(effects, PlanSketch)
        assert effect.entry is above and effect.entry is not other
        assert effect.value == replace(above.value, at=2, verified=False) and all_reasons(effects) == {done.id}


@pytest.mark.parametrize("status", ["done", "halted", "superseded"])
def test_a_sketch_that_has_ended_is_taken_nowhere(status: SketchStatus) -> None:
    bench = Bench()
    sketch = bench.sketch(*WAY)
    leg = bench.revise(bench.leg(sketch), status="arrived")
    bench.revise(sketch, status=status)
    assert bench.ask(SOURCE, leg) is None


def test_it_keeps_the_laws_of_all_sources() -> None:
    bench = Bench()
    leg = bench.revise(bench.leg(bench.sketch(*WAY)), status="arrived")
    check_source(SOURCE, bench, leg, without=("PlanSketch-1",))
