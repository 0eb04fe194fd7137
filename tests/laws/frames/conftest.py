"""A recorded mission for the laws of frames: half-way to one door the robot is told that it is shut."""

from __future__ import annotations

import pytest

from harvey.run_files.run_directory import RunDirectory
from harvey.simulation.run import run_mission
from two_doors import two_doors


@pytest.fixture(scope="session")
def told_run(tmp_path_factory: pytest.TempPathFactory) -> RunDirectory:
    folder = tmp_path_factory.mktemp("told")
    run = RunDirectory(folder / "run")
    assert run_mission(two_doors(folder, ((3.0, "north-door", "shut"),)), 3, out=run.path).outcome == "reached"
    return run
