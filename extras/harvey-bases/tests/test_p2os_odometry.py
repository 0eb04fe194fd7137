"""A Pioneer's odometry from hand-made statuses: units, wraps, a count that begins anywhere, and jumps that are doubted.

The oracle adds up the steps as complex numbers: what the base counted, turned by the heading that its count began at.
"""

from __future__ import annotations

import cmath
import math
from typing import Any

import pytest
from hand_made_pioneer import HandMadePioneer, connect
from hypothesis import given, settings
from hypothesis import strategies as st

from harvey.hardware.drivers.base_driver import BaseFault
from harvey_bases.p2os import P2osBase

TURN = 4096
COUNTS = st.integers(0, 32767)
HEADINGS = st.integers(0, TURN - 1)
STEPS = st.lists(st.tuples(st.integers(-70, 70), st.integers(-70, 70), st.integers(-150, 150)), min_size=1, max_size=25)
TICK_S = 0.1


class Dictated(HandMadePioneer):
    """It tells the counts that the test dictates."""

    def __init__(self, x: int, y: int, heading: int, **more: Any) -> None:
        super().__init__(**more)
        self.counts = (x, y, heading)
        self.spoil = self._tell

    def step(self, dx: int, dy: int, dheading: int) -> None:
        self.counts = (self.counts[0] + dx, self.counts[1] + dy, self.counts[2] + dheading)

    def _tell(self, status: dict[str, Any]) -> dict[str, Any]:
        x, y, heading = self.counts
        return status | {"x": x % 32768, "y": y % 32768, "heading": heading % TURN, "moving": False}


def place(driver: P2osBase) -> tuple[complex, float]:
    there = driver.odometry()
    return complex(there.x_m, there.y_m), there.heading_rad


@settings(deadline=None, max_examples=60)
@given(COUNTS, COUNTS, HEADINGS, STEPS, st.sampled_from((("p3dx-sh", 0.001), ("p3dx", 0.000485), ("p2at-sh", 0.001))))
def test_the_way_is_the_sum_of_the_steps_in_the_frame_of_the_first_status(
    x: int, y: int, heading: int, steps: list[tuple[int, int, int]], kind: tuple[str, float]
) -> None:
    """Also over the wraps of all three counters; the subclass says the unit."""
    subclass, m_per_unit = kind
    base = Dictated(x, y, heading, names=("R", "Pioneer", subclass))
    driver = connect(base)
    expected, turned = 0j, 0.0
    for step in steps:
        base.step(*step)
        expected += m_per_unit * complex(step[0], step[1]) * cmath.exp(-2j * math.pi * heading / TURN)
        turned += 2.0 * math.pi * step[2] / TURN
        at, angle = place(driver)
        assert at == pytest.approx(expected, abs=1e-9)
        assert math.remainder(angle - turned, math.tau) == pytest.approx(0.0, abs=1e-9) and abs(angle) <= math.pi + 1e-9


@settings(deadline=None, max_examples=30)
@given(st.floats(0.1, 3.0), STEPS)
def test_a_unit_that_is_told_counts_before_the_one_that_is_known(mm: float, steps: list[tuple[int, int, int]]) -> None:
    base = Dictated(0, 0, 0, names=("R", "Pioneer", "p3dx"))
    driver = connect(base, mm_per_unit=mm)
    expected = 0j
    for step in steps:
        size = min(1.0, 30.0 / mm / 100.0)
        moved = round(step[0] * size), round(step[1] * size)
        base.step(*moved, 0)
        expected += mm / 1000.0 * complex(*moved)
        assert place(driver)[0] == pytest.approx(expected, abs=1e-9)


@settings(deadline=None, max_examples=30)
@given(HEADINGS, STEPS, COUNTS, COUNTS, HEADINGS, STEPS)
def test_a_base_that_counts_anew_goes_on_from_where_it_was(
    first: int, before: list[tuple[int, int, int]], x: int, y: int, heading: int, after: list[tuple[int, int, int]]
) -> None:
    """After it was off: its counters begin anywhere, and what it moves from then on is turned into the old frame."""
    base = Dictated(0, 0, first)
    driver = connect(base)
    expected, turned = 0j, 0.0
    for step in before:
        base.step(*step)
        expected += 0.001 * complex(step[0], step[1]) * cmath.exp(-2j * math.pi * first / TURN)
        turned += 2.0 * math.pi * step[2] / TURN
        place(driver)
    base.is_open, base.counts = False, (x, y, heading)
    with pytest.raises(BaseFault, match="nothing heard"):
        driver.odometry()
    assert place(driver)[0] == pytest.approx(expected, abs=1e-9)
    offset = turned - 2.0 * math.pi * heading / TURN
    for step in after:
        base.step(*step)
        expected += 0.001 * complex(step[0], step[1]) * cmath.exp(1j * offset)
        turned += 2.0 * math.pi * step[2] / TURN
        at, angle = place(driver)
        assert at == pytest.approx(expected, abs=1e-9)
        assert math.remainder(angle - turned, math.tau) == pytest.approx(0.0, abs=1e-9)


def heard_until_believed(base: HandMadePioneer, driver: P2osBase) -> int:
    """After how many statuses, 0.1 s apart, it tells where it is."""
    base.time_ms = (base.time_ms // 100) * 100
    began_s = base.now()
    driver.odometry()
    return round((base.now() - began_s) / TICK_S)


@pytest.mark.parametrize(
    ("step", "statuses"),
    [
        ((199, 0, 0), 1),
        ((0, -199, 0), 1),
        ((201, 0, 0), 2),
        ((0, 201, 0), 2),
        ((-299, 0, 0), 2),
        ((301, 0, 0), 3),
        ((-141, 141, 0), 1),
        ((142, 142, 0), 2),
        ((5000, 0, 0), 3),
        ((0, -5000, 0), 3),
        ((0, 0, 325), 1),
        ((0, 0, -325), 1),
        ((0, 0, 327), 2),
        ((0, 0, -455), 2),
        ((0, 0, 457), 3),
        ((0, 0, 2000), 3),
    ],
)
def test_a_jump_is_doubted_until_there_was_time_for_it_or_it_is_told_three_times(
    step: tuple[int, int, int], statuses: int
) -> None:
    """0.1 m and 1 m/s; 0.3 rad and 2 rad/s: in 0.1 s at most 0.2 m or 0.5 rad (326 units), in 0.2 s 0.3 m, 0.7 rad."""
    base = Dictated(500, 500, 0)
    driver = connect(base)
    base.step(*step)
    assert heard_until_believed(base, driver) == statuses
    at, angle = place(driver)
    assert at == pytest.approx(complex(step[0], step[1]) / 1000.0, abs=1e-9)
    assert angle == pytest.approx(2.0 * math.pi * step[2] / TURN, abs=1e-9)
    assert heard_until_believed(base, driver) == 1


@settings(deadline=None, max_examples=25)
@given(st.integers(301, 32768 - 301), st.integers(1, 2))
def test_a_wrong_status_or_two_move_nothing(jump: int, wrong: int) -> None:
    base = Dictated(0, 0, 0)
    driver = connect(base)
    told = 0

    def tell(status: dict[str, Any]) -> dict[str, Any]:
        nonlocal told
        told += 1
        return status | {"x": jump if told <= wrong else 0, "y": 0, "heading": 0, "moving": False}

    base.spoil = tell
    assert place(driver) == (0j, 0.0) and told == wrong + 1
