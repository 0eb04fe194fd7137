"""Something between agent and body fails in mid-mission: it is an entry, nobody moves, and it ends declared."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import pytest

from blackboard import Decision
from harvey.runner.result import MissionResult
from harvey.simulation.simulated_run import run_mission
from sim.faults.built_in_faults import CameraUnplugged, LinkLost, Stall
from sim.faults.fault import DeviceFault
from sim.faults.fault_registry import BUILT_IN
from sim.stage import Stage
from world_models.entries import BodyFault, Milestone, MotionReport, MotorCommand, Recovery

MID_MOVE_M = 0.7
"""The second increment has just begun."""


class Watched:
    """What was told of the body, in order, and what moved meanwhile."""

    def __init__(self) -> None:
        self.told: list[Any] = []
        self.moved_at_fault: list[str] = []
        self._open: set[str] = set()

    def __call__(self, decision: Decision) -> None:
        for change in (*decision.observed, *decision.made):
            value = change.entry.value
            if isinstance(value, BodyFault):
                (self._open.add if value.is_open else self._open.discard)(change.entry.id)
            if isinstance(value, MotorCommand) and self._open:
                self.moved_at_fault.append(str(change.entry.ref))
            self.told.append(value)

    def of(self, kind: type[Any]) -> list[Any]:
        return [value for value in self.told if isinstance(value, kind)]


DEVICE_FAULTS = [kind for kind in BUILT_IN if issubclass(kind, DeviceFault)]


def driven(stage: Stage, kind: type[DeviceFault], duration_s: float) -> tuple[MissionResult, Watched]:
    fault = kind(after_m=MID_MOVE_M, duration_s=duration_s)
    watched = Watched()
    faulty = replace(stage, scenario=replace(stage.scenario, faults=(fault,)))
    return run_mission(faulty, 3, sinks=[watched]), watched


@pytest.mark.parametrize("kind", DEVICE_FAULTS)
def test_what_passes_is_told_waited_for_and_the_goal_is_reached(short_stage: Stage, kind: type[DeviceFault]) -> None:
    result, watched = driven(short_stage, kind, 10.0)
    assert result.outcome == "reached", result.reason
    assert result.final_error_m < 0.0254 and result.collisions == 0
    assert [(f.part, f.what, f.status) for f in watched.of(BodyFault)] == [
        (kind.part, kind.what, "open"), (kind.part, kind.what, "over")]
    assert [r.status for r in watched.of(Recovery)].count("still failing") >= 1
    assert watched.of(Recovery)[-1].status == "over"
    assert watched.moved_at_fault == []


def test_a_motion_that_was_broken_off_is_claimed_and_a_milestone_has_to_hold_before_the_next(
    short_stage: Stage,
) -> None:
    _, watched = driven(short_stage, LinkLost, 4.0)
    over = watched.told.index(next(r for r in watched.told if isinstance(r, Recovery) and r.status == "over"))
    after = watched.told[over:]
    report = next(v for v in after if isinstance(v, MotionReport))
    assert 0.0 < report.move_m < 0.5
    next_move = after.index(next(v for v in after if isinstance(v, MotorCommand)))
    assert any(isinstance(v, Milestone) and v.status == "verified" for v in after[:next_move])


@pytest.mark.parametrize("kind", [LinkLost, CameraUnplugged])
def test_what_does_not_pass_ends_the_mission_with_the_robot_standing(
    short_stage: Stage, kind: type[DeviceFault]
) -> None:
    result, watched = driven(short_stage, kind, 500.0)
    assert result.outcome == "failed" and kind.what in result.reason
    assert 30.0 <= watched.of(Recovery)[-1].waited_s < 40.0
    assert watched.moved_at_fault == [] and result.path_length_m < 2.0


def test_a_wheel_that_always_stalls_is_given_up(short_stage: Stage) -> None:
    """The base answers each time, but no motion is ever whole: that ends, too."""
    faults = tuple(Stall(after_s=1.0 + 0.4 * k, duration_s=0.3) for k in range(400))
    watched = Watched()
    faulty = replace(short_stage, scenario=replace(short_stage.scenario, faults=faults))
    result = run_mission(faulty, 3, sinks=[watched])
    assert result.outcome in {"failed", "blocked", "lost"} and watched.moved_at_fault == []
