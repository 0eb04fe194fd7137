"""The simulated body behind a serial line: the same mission over its protocol, and a line that fails."""

from __future__ import annotations

import os
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from blackboard.journal import Decision, decision_line
from harvey.runner.result import MissionResult
from harvey.simulation.simulated_run import run_mission
from sim.body.simulated_body import SimulatedBody
from sim.faults.fault_registry import find_fault_class
from sim.stage import Stage
from world_models.entries.body import BodyFault, MotorCommand, Recovery

INCH_M = 0.0254
WATCHDOG_S = 0.5


def driven(stage: Stage, body: str) -> tuple[MissionResult, list[str], list[Any]]:
    """The result, the journal, and the values that were told of the body."""
    lines: list[str] = []
    told: list[Any] = []

    def listen(decision: Decision) -> None:
        lines.append(decision_line(decision))
        told.extend(c.entry.value for c in (*decision.observed, *decision.made))

    return run_mission(stage, 3, body=body, sinks=[listen]), lines, told


def test_over_the_lock_step_protocol_every_decision_is_the_same_to_the_byte(short_stage: Stage) -> None:
    (here, journal, _), (there, over_the_line, _) = driven(short_stage, "simulated"), driven(short_stage, "denning")
    assert over_the_line == journal
    assert replace(there, wall_time_s=0.0) == replace(here, wall_time_s=0.0)


@pytest.mark.parametrize("fault_kind", ["link_lost", "nonsense"])
def test_a_line_that_fails_in_mid_move_is_told_and_waited_for_and_the_goal_is_reached(
    short_stage: Stage, fault_kind: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    bodies: list[SimulatedBody] = []
    made = Stage.body
    monkeypatch.setattr(Stage, "body", lambda self, seed: bodies.append(made(self, seed)) or bodies[-1])
    lasts_s = 5.0
    fault = find_fault_class(fault_kind)(after_m=0.7, duration_s=lasts_s)
    result, _, told = driven(replace(short_stage, scenario=replace(short_stage.scenario, faults=(fault,))), "denning")
    assert result.outcome == "reached" and result.final_error_m < INCH_M, result.reason
    faults = [v for v in told if isinstance(v, BodyFault)]
    assert faults[0].part == "base" and faults[0].what in {"link lost", "base answers nonsense"}
    assert faults[-1].status == "over"
    assert any(isinstance(v, Recovery) and v.status == "over" for v in told)
    _nobody_moves_at_fault(told)
    _stands(bodies[0], WATCHDOG_S, lasts_s)


def _nobody_moves_at_fault(told: list[Any]) -> None:
    at_fault = False
    for value in told:
        at_fault = value.is_open if isinstance(value, BodyFault) else at_fault
        assert not (at_fault and isinstance(value, MotorCommand))


def _stands(body: SimulatedBody, after_s: float, lasts_s: float) -> None:
    """From ``after_s`` after the line failed until it is back the robot truly stands."""
    began_s = next(t.time_s for t in body.track if t.path_m >= 0.7)
    still = [t.world_from_robot for t in body.track if began_s + after_s < t.time_s < began_s + lasts_s]
    assert still and all(pose == still[0] for pose in still)


def test_the_lines_are_let_go(short_stage: Stage) -> None:
    stage = replace(short_stage, scenario=replace(short_stage.scenario, limits=replace(
        short_stage.scenario.limits, max_cycles=12)))
    driven(stage, "denning")
    before = len(list(Path("/proc/self/fd").iterdir()))
    driven(stage, "denning")
    assert len(list(Path("/proc/self/fd").iterdir())) == before, os.listdir("/proc/self/fd")
