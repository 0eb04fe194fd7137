"""The simulated body behind a serial line: a mission over P2OS and the Open Interface, and a line that fails."""

from __future__ import annotations

import os
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from blackboard.journal import Decision
from experiments.generated.missions import OFFICE
from harvey.runner.result import MissionResult
from harvey.simulation.simulated_run import run_mission
from sim.body.simulated_body import SimulatedBody
from sim.faults.fault_registry import find_fault_class
from sim.scenario import parse_scenario
from sim.stage import Stage, build_stage
from world_models.entries.body import BodyFault, MotorCommand, Recovery

INCH_M = 0.0254
KINDS = ("p2os", "create2")
WATCHDOG_S = {"p2os": 2.0}
BRAKES_S = 1.5
"""A Pioneer brakes at 0.3 m/s^2 from 0.4 m/s."""


@pytest.fixture(scope="session")
def short_stage() -> Stage:
    return build_stage(parse_scenario(OFFICE, "across-allens-office"))


def driven(stage: Stage, body: str) -> tuple[MissionResult, list[Any]]:
    """The result, and the values that were told of the body."""
    told: list[Any] = []

    def listen(decision: Decision) -> None:
        told.extend(c.entry.value for c in (*decision.observed, *decision.made))

    return run_mission(stage, 3, body=body, sinks=[listen]), told


@pytest.mark.parametrize("kind", KINDS)
def test_bases_that_count_in_whole_steps_reach_within_an_inch(short_stage: Stage, kind: str) -> None:
    result, _ = driven(short_stage, kind)
    assert (result.outcome, result.collisions) == ("reached", 0), result.reason
    assert result.final_error_m < INCH_M


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("fault_kind", ["link_lost", "nonsense"])
def test_a_line_that_fails_in_mid_move_is_told_and_waited_for_and_the_goal_is_reached(
    short_stage: Stage, kind: str, fault_kind: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    bodies: list[SimulatedBody] = []
    made = Stage.body
    monkeypatch.setattr(Stage, "body", lambda self, seed: bodies.append(made(self, seed)) or bodies[-1])
    lasts_s = 1.5 if kind == "create2" else 5.0  # nothing but the line can stop a Create 2
    fault = find_fault_class(fault_kind)(after_m=0.7, duration_s=lasts_s)
    result, told = driven(replace(short_stage, scenario=replace(short_stage.scenario, faults=(fault,))), kind)
    assert result.outcome == "reached" and result.final_error_m < INCH_M, result.reason
    faults = [v for v in told if isinstance(v, BodyFault)]
    assert faults[0].part == "base" and faults[0].what in {"link lost", "base answers nonsense"}
    assert faults[-1].status == "over"
    assert any(isinstance(v, Recovery) and v.status == "over" for v in told)
    _nobody_moves_at_fault(told)
    if kind in WATCHDOG_S:
        _stands(bodies[0], WATCHDOG_S[kind] + BRAKES_S, lasts_s)


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
