"""Recorded missions for the laws of frames."""

from __future__ import annotations

import pytest

from logs.run_directory import RunDirectory
from recorded_runs import Recorded


@pytest.fixture(scope="session")
def told_run(recorded: Recorded) -> RunDirectory:
    """On the way to one door the robot is told that it is shut."""
    return recorded("two doors")


@pytest.fixture(scope="session")
def lost_run(recorded: Recorded) -> RunDirectory:
    """Somebody bumps into the robot; lost, it asks for every room of the floor at once."""
    return recorded("hard bump")
