"""A mission in a building that differs from its model: the recording shows how, from when to when."""

from __future__ import annotations

from pathlib import Path

from rerun.chunk import RrdReader

from experiments.generated.missions import OFFICE
from harvey.simulation.simulated_run import run_mission
from recorded_runs import Recorded
from sim.scenario import parse_scenario
from sim.stage import build_stage

CHAIR = """
[[truth.extra]]
kind = "chair"
locale = "allens-office"
x_ft = 4.0
y_ft = 9.0
at_s = 2.0
until_s = 14.0
"""


def test_the_recording_shows_what_is_there_while_it_is(tmp_path: Path) -> None:
    stage = build_stage(parse_scenario(OFFICE + CHAIR))
    assert run_mission(stage, 3, out=tmp_path).outcome == "reached"
    assert count_rows(tmp_path / "recording.rrd", "/world/truth/added") == 2  # it comes, and it goes


def test_where_nothing_differs_nothing_is_drawn(recorded: Recorded) -> None:
    assert count_rows(recorded("office").recording, "/world/truth/added") == 0


def count_rows(recording: Path, path: str) -> int:
    chunks = RrdReader(recording).stream()
    return sum(chunk.num_rows for chunk in chunks if str(chunk.entity_path) == path)
