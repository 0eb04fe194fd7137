"""The simulated body behind a serial line: the same mission over its protocol, and a line that fails."""

from __future__ import annotations

import json

import pytest

from blackboard import decision_line
from recorded_runs import Recorded
from serial_bench import check_a_failing_line_is_waited_for, drive_over
from sim.stage import Stage


def test_over_the_lock_step_protocol_every_decision_is_the_same_to_the_byte(
    recorded: Recorded, short_stage: Stage
) -> None:
    result, decisions, _ = drive_over(short_stage, "denning")
    here, there = recorded("office"), json.loads(json.dumps(result.record()))
    assert [decision_line(decision) for decision in decisions] == here.journal.read_text("utf-8").splitlines()
    assert {**there, "wall_time_s": 0.0} == {**here.read_result(), "wall_time_s": 0.0}


@pytest.mark.parametrize("fault_kind", ["link_lost", "nonsense"])
def test_a_line_that_fails_in_mid_move_is_told_and_waited_for_and_the_goal_is_reached(
    short_stage: Stage, fault_kind: str
) -> None:
    check_a_failing_line_is_waited_for(short_stage, "denning", fault_kind, lasts_s=5.0, stands_after_s=0.5)
