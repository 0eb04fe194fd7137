"""What holds for every mission, seen on a short one: it reaches, and twice the same is the same, byte for byte."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from harvey.runner.result import MissionResult
from harvey.simulation.simulated_run import run_mission
from recorded_runs import Recorded
from sim.stage import Stage

INCH_M = 0.0254
KEYS = {
    "scenario", "seed", "outcome", "goal", "final_error_m", "final_heading_error_rad", "path_length_m", "sim_time_s",
    "wall_time_s", "frames", "decisions", "milestones", "replans", "relocalizations", "collisions", "max_cross_track_m",
}


@pytest.fixture(scope="module")
def runs(
    recorded: Recorded, short_stage: Stage, tmp_path_factory: pytest.TempPathFactory
) -> list[tuple[Path, MissionResult]]:
    """One driven now, and that of the library, with the same result."""
    out = tmp_path_factory.mktemp("run")
    result = run_mission(short_stage, 3, out=out)
    return [(out, result), (recorded("office").path, result)]


def test_reaches_within_an_inch(runs: list[tuple[Path, MissionResult]]) -> None:
    _, result = runs[0]
    assert (result.outcome, result.collisions, result.milestones["false_accepts"]) == ("reached", 0, 0), result.reason
    assert result.final_error_m < INCH_M
    assert result.milestones["verified"] >= 2


def test_the_same_seed_gives_the_same_journal(runs: list[tuple[Path, MissionResult]]) -> None:
    first, second = ((path / "journal.jsonl").read_bytes() for path, _ in runs)
    assert first == second
    assert len(first.splitlines()) == runs[0][1].decisions


def test_the_result_file_has_what_is_promised(runs: list[tuple[Path, MissionResult]]) -> None:
    path, result = runs[0]
    record = json.loads((path / "result.json").read_text())
    assert set(record) >= KEYS
    assert set(record["milestones"]) == {"verified", "refuted", "not_testable", "false_accepts"}
    assert record["outcome"] == result.outcome
    assert (path / "recording.rrd").stat().st_size > 0


def test_every_decision_rests_on_a_command_or_an_observation(runs: list[tuple[Path, MissionResult]]) -> None:
    """Walking ``because`` from any entry ends at the user's command, or at what the robot was told of itself."""
    because: dict[str, list[str]] = {}
    authors: dict[str, str] = {}
    for line in (runs[0][0] / "journal.jsonl").read_text().splitlines():
        record = json.loads(line)
        for entry in (*record["observed"], *record["made"]):
            because[entry["entry"]], authors[entry["entry"]] = entry["because"], entry["author"]
    roots = {ref for ref, reasons in because.items() if not reasons}
    assert {authors[ref] for ref in roots} <= {"user", "scheduler", "robot"}
    assert {ref.partition("-")[0] for ref in roots if authors[ref] == "robot"} == {"CameraState", "Wheels", "Footprint"}
    assert all(reason in because for reasons in because.values() for reason in reasons)
