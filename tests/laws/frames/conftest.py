"""Recorded missions for the laws of frames."""

from __future__ import annotations

from pathlib import Path

import pytest

from experiments.generated.missions import OFFICE, fault
from harvey.simulation.simulated_run import run_mission
from logs.run_directory import RunDirectory
from sim.scenario import parse_scenario
from sim.stage import Stage, build_stage
from two_doors import two_doors

SEED = 3


@pytest.fixture(scope="session")
def told_stage(tmp_path_factory: pytest.TempPathFactory) -> Stage:
    """On the way to one door the robot is told that it is shut."""
    return two_doors(tmp_path_factory.mktemp("told"), ((3.0, "north-door", "shut"),))


@pytest.fixture(scope="session")
def told_run(told_stage: Stage, tmp_path_factory: pytest.TempPathFactory) -> RunDirectory:
    return _record(told_stage, tmp_path_factory.mktemp("runs") / "told")


@pytest.fixture(scope="session")
def lost_stage() -> Stage:
    """Somebody bumps into the robot; lost, it asks for every room of the floor at once."""
    bump = fault("bump", "allens-office", 3.0, left_m=0.3, turn_deg=40.0)
    return build_stage(parse_scenario(OFFICE + bump, "bump-in-allens-office"))


@pytest.fixture(scope="session")
def lost_run(lost_stage: Stage, tmp_path_factory: pytest.TempPathFactory) -> RunDirectory:
    return _record(lost_stage, tmp_path_factory.mktemp("runs") / "lost")


def _record(stage: Stage, to: Path) -> RunDirectory:
    assert run_mission(stage, SEED, out=to).outcome == "reached"
    return RunDirectory(to)
