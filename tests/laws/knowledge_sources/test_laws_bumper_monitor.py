"""Laws of the bumper monitor: what ends a motion was touched; what is felt where nothing can be is no touch."""

from __future__ import annotations

import math
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from blackboard import Post
from generated_boards import Bench, effect_on
from harvey.testing import check_source, plain_robot
from knowledge_sources.model.rival_weigher import rival_weigher
from knowledge_sources.reads.questions import BUMPER, list_touches
from knowledge_sources.senses.bumper_monitor import LAST_PART_M, MIN_TURNED_RAD, bumper_monitor
from world_models.entries import RISK, Contact, Difference, Evidence, MotionReport, MotorCommand
from world_models.frames import Pose2

SIDES = st.floats(-3.0, 3.0)


class Bumped(Bench):
    """A board of a robot whose motions may touch something."""

    def __init__(self) -> None:
        super().__init__(plain_robot())
        self.believe(Pose2(2.0, 2.0, 0.0))

    def go(self, turn_rad: float, asked_m: float, done_m: float, side_rad: float | None = None) -> Any:
        """A motion in which something is felt on a side, or nothing; what is told of it."""
        command = self.put(MotorCommand(turn_rad, asked_m))
        report = MotionReport(turn_rad, done_m, 1.0, float(self.cycle))
        felt = [] if side_rad is None else [Contact("bumper", side_rad, 0.15, float(self.cycle))]
        changes = self.apply(*(Post(value, (command,)) for value in (*felt, report)))
        told = self.ask(bumper_monitor, changes[0].entry)
        for effect in told or ():
            (posted,) = self.apply(effect)
            self.apply(*self.ask(rival_weigher, posted.entry) or ())
        return changes[0].entry, told

    @property
    def p(self) -> float:
        """How probably the bumper stays pressed."""
        known = self.view.latest(Difference, lambda d: d.about == BUMPER)
        stuck = None if known is None else known.value.find("bumper")
        return 0.0 if stuck is None else stuck.p


@given(st.lists(st.tuples(st.floats(-1.5, 1.5), st.floats(0.1, 0.8), st.floats(0.0, 0.9), SIDES), max_size=6))
def test_what_ends_motions_on_a_way_is_touched_wherever_it_is(way: list[tuple[float, float, float, float]]) -> None:
    bench = Bumped()
    for turn_rad, asked_m, part, side_rad in way:
        bench.go(0.0, 0.4, 0.4)
        assert not bench.go(turn_rad, asked_m, part * (asked_m - LAST_PART_M), side_rad)[1]
    assert bench.p == 0.0 and len(list_touches(bench.view)) == len(way)


@given(SIDES, st.floats(0.1, 0.8))
def test_wheels_that_go_on_tell_of_a_bumper_that_stays_pressed_and_touches_tell_nothing_then(
    side_rad: float, asked_m: float
) -> None:
    bench, p = Bumped(), []
    for _ in range(5):
        bench.go(0.0, asked_m, asked_m, side_rad)
        p.append(bench.p)
        assert not list_touches(bench.view)
    assert p == sorted(p) and p[0] < 0.1 and p[1] < 0.95 and 1.0 - p[4] < RISK


@pytest.mark.parametrize(("turned", "gone_m", "side", "is_told"), [
    (2.0, 0.0, 0.0, True), (-2.0, 0.02, 0.0, True), (2.0, 0.2, 0.0, False), (0.9, 0.0, 0.0, False),
    (2.0, 0.0, -2.0, False), (math.tau / MIN_TURNED_RAD, 0.0, 0.0, False)])
def test_the_same_side_after_a_turn_is_told_where_a_thing_would_be_on_another(
    turned: float, gone_m: float, side: float, is_told: bool
) -> None:
    bench = Bumped()
    bench.go(0.0, 0.4, 0.2, 0.0)
    assert bool(bench.go(turned * MIN_TURNED_RAD, 0.4, gone_m, side * MIN_TURNED_RAD)[1]) == is_told


def test_motions_in_which_nothing_is_felt_acquit_it_and_it_keeps_the_laws_of_all_sources() -> None:
    bench = Bumped()
    assert not bench.go(0.0, 0.4, 0.4)[1]  # nobody has accused it
    felt, _ = bench.go(0.0, 0.4, 0.4, 1.0)
    accused = bench.p
    for _ in range(3):
        bench.go(0.0, 0.4, 0.4)
    assert bench.p < 0.5 * accused and len(list_touches(bench.view)) == 1
    again, _ = bench.go(0.0, 0.4, 0.4, 1.0)
    effects = check_source(bumper_monitor, bench, again)
    assert effect_on(effects, Evidence).value.shows.startswith("it felt something")
    assert felt.id not in {reason.id for reason in effect_on(effects, Evidence).because}
