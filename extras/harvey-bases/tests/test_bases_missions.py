"""The simulated body behind a serial line: a mission over P2OS and the Open Interface, and a line that fails."""

from __future__ import annotations

import pytest

from serial_bench import check_a_failing_line_is_waited_for, drive_over
from sim.stage import Stage

KINDS = ("p2os", "create2")
WATCHDOG_S, BRAKES_S = 2.0, 1.5
"""Of a Pioneer, which brakes at 0.3 m/s^2 from 0.4 m/s; nothing but the line can stop a Create 2."""


@pytest.mark.parametrize("kind", KINDS)
def test_bases_that_count_in_whole_steps_reach_within_an_inch(short_stage: Stage, kind: str) -> None:
    result, _, _ = drive_over(short_stage, kind)
    assert (result.outcome, result.collisions) == ("reached", 0), result.reason
    assert result.final_error_m < 0.0254


@pytest.mark.parametrize(("kind", "lasts_s", "stands_after_s"), [
    ("p2os", 5.0, WATCHDOG_S + BRAKES_S), ("create2", 1.5, None)])
@pytest.mark.parametrize("fault_kind", ["link_lost", "nonsense"])
def test_a_line_that_fails_in_mid_move_is_told_and_waited_for_and_the_goal_is_reached(
    short_stage: Stage, kind: str, fault_kind: str, lasts_s: float, stands_after_s: float | None
) -> None:
    check_a_failing_line_is_waited_for(short_stage, kind, fault_kind, lasts_s, stands_after_s)
