"""One floor down, on pixels: the robot is carried, and goes on only after a milestone holds where it is."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from harvey.runner.result import MissionResult
from harvey.simulation.simulated_run import run_mission
from sim.scenario import parse_scenario
from sim.stage import build_stage
from towers import tower

RIDE = """
description = "From the upper hall into the elevator, and out below."
world = "tower.toml"
goal = "(ptrans (hall-2 (6,4.3,0)) (hall-1 (6.5,4.3,0)))"

[start]
heading_deg = 180.0
put_down_sigma_m = 0.01
put_down_sigma_deg = 0.5

[limits]
max_cycles = 1200
"""
HELPER = "[[rides]]\ncomes_s = 3.0\ntakes_s = 9.0\n"


def driven(folder: Path, rides: str, floors: int = 2) -> tuple[MissionResult, list[dict[str, object]]]:
    """The result, and the decisions as they stand in the journal."""
    (folder / "tower.toml").write_text(tower(floors))
    result = run_mission(build_stage(parse_scenario(RIDE + rides, "ride", folder)), 1, out=folder / "run")
    return result, [json.loads(line) for line in (folder / "run" / "journal.jsonl").read_text().splitlines()]


def made(decisions: list[dict[str, object]], kind: str) -> list[tuple[int, dict[str, object]]]:
    """(cycle, value) of what was put on the board."""
    return [(d["cycle"], e["value"]) for d in decisions for e in (*d["made"], *d["observed"]) if e["type"] == kind]


@pytest.fixture(scope="module")
def helped(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, MissionResult, list[dict[str, object]]]:
    folder = tmp_path_factory.mktemp("helped")
    return folder, *driven(folder, HELPER)


def test_the_ride_is_believed_when_told_and_verified_before_going_on(
    helped: tuple[Path, MissionResult, list[dict[str, object]]],
) -> None:
    _, result, decisions = helped
    assert (result.outcome, result.collisions, result.milestones["false_accepts"]) == ("reached", 0, 0), result.reason
    assert result.final_error_m < 0.03
    (asked, ride), = made(decisions, "Ride")
    (told, _), = made(decisions, "RideReport")
    assert (ride["origin"], ride["destination"]) == ("car-2", "car-1") and asked < told
    carried = [cycle for cycle, h in made(decisions, "Hypothesis") if h["basis"] == "ride" and h["locale"] == "car-1"]
    verified = [cycle for cycle, c in made(decisions, "Certificate") if c["verdict"] == "verified" and cycle > told]
    moved = [cycle for cycle, command in made(decisions, "MotorCommand") if command["move_m"] > 0 and cycle > told]
    assert told <= carried[0] < verified[0] < moved[0]


def test_where_nobody_presses_the_button_the_mission_ends_with_that_reason(tmp_path: Path) -> None:
    result, decisions = driven(tmp_path, "")
    assert result.outcome == "blocked" and "elevator" in result.reason and "nobody comes by" in result.reason
    assert not made(decisions, "RideReport") and result.collisions == 0


def test_the_wrong_button_is_noticed_by_the_next_milestone(tmp_path: Path) -> None:
    result, decisions = driven(tmp_path, HELPER + 'presses = "car-3"\n', floors=3)
    (told, _), = made(decisions, "RideReport")
    after = [c["verdict"] for cycle, c in made(decisions, "Certificate") if cycle > told]
    assert after and "verified" not in after
    assert result.outcome != "reached" and result.collisions == 0
