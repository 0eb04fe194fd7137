"""Missions that are drawn and written: the same again for the same seed, and such that they can be staged."""

from __future__ import annotations

import tomllib
from collections.abc import Callable
from pathlib import Path

import pytest

from experiments.differences import obstacles
from experiments.differences.light import write_light_mission
from experiments.drives import Trial
from experiments.generated.door_missions import write_door_mission
from experiments.generated.floors import generated_floor
from experiments.generated.light import HALL_FT, LIGHT_KINDS, draw_light, write_soak_mission
from experiments.generated.missions import (
    CAMERA_CASES,
    MAX_TURN_RAD,
    write_camera_mission,
    write_inexact_mission,
    write_twin_mission,
)
from sim.ground_truth.inexact import TrueInexact
from sim.render.lighting import Lighting
from sim.scenario import Scenario, load_scenario
from sim.stage import Stage, build_stage

INEXACT = TrueInexact(sigma_m=0.05, missing=0.3, extra=0.1)


def write_twice(folder: Path, write: Callable[[Path], Path]) -> tuple[Scenario, Stage]:
    """What is written by a writer that writes the same again."""
    text = write(folder).read_text("utf-8")
    path = write(folder)
    assert path.read_text("utf-8") == text
    scenario = load_scenario(path)
    return scenario, build_stage(scenario)


@pytest.mark.parametrize("case", ["another way", "no way", "stands open", "loose leaf"])
def test_a_door_is_otherwise(tmp_path: Path, case: str) -> None:
    scenario, _ = write_twice(tmp_path, lambda folder: write_door_mission(folder, 3, case).path)
    door = write_door_mission(tmp_path, 3, case).door
    assert [d.name for d in scenario.truth.doors] == ([door] if door else [])


def test_an_inexact_model_states_how_well_things_are_known(tmp_path: Path) -> None:
    scenario, _ = write_twice(tmp_path, lambda folder: write_inexact_mission(folder, 3, INEXACT, stated_m=0.05))
    assert scenario.truth.inexact.sigma_m == 0.05 and scenario.truth.inexact.seed == 3
    assert scenario.world.read_text("utf-8").startswith("sigma_cm = 5\n")


@pytest.mark.parametrize("case", CAMERA_CASES)
def test_a_camera_is_mounted_otherwise_or_knocked(tmp_path: Path, case: str) -> None:
    scenario, _ = write_twice(tmp_path, lambda folder: write_camera_mission(folder, 3, case))
    camera = scenario.truth.camera
    assert bool(scenario.faults) == (case == "knocked") and bool(camera.tilt_rad) == (case == "miscalibrated")
    assert max(abs(camera.tilt_rad), abs(camera.roll_rad), abs(camera.yaw_rad)) <= MAX_TURN_RAD


@pytest.mark.parametrize("kind", LIGHT_KINDS)
def test_every_kind_of_light_is_read_as_it_was_drawn(tmp_path: Path, kind: str) -> None:
    found, values = load_scenario(write_light_mission(tmp_path, Trial(kind, 4))).light, draw_light(kind, 4)
    if values is None:
        assert kind == "flat" and found is None
    else:
        assert found == Lighting(**{key: tuple(v) if isinstance(v, list) else v for key, v in values.items()})


@pytest.mark.parametrize("is_told_right", [True, False])
def test_a_robot_is_put_down_in_a_twin_of_the_told_room(tmp_path: Path, is_told_right: bool) -> None:
    def write(folder: Path) -> Path:
        return write_twin_mission(folder, 3, is_told_right=is_told_right, rooms=6).path

    _, stage = write_twice(tmp_path, write)
    one = write_twin_mission(tmp_path, 3, is_told_right=is_told_right, rooms=6)
    assert (stage.put_down_world == stage.start_world) == is_told_right == (one.told == one.true)
    assert stage.world.locale_at([*stage.put_down_world.position, 0.0]) == one.true


def test_rooms_are_identical_but_for_a_turn() -> None:
    floor = generated_floor(5, 8, open_share=1.0, identical=True)
    rooms = [tomllib.loads(floor.text)["locales"][name] for name in floor.rooms]
    assert all(room["size"] == rooms[0]["size"] for room in rooms)
    parts = [sorted(thing["part"] for thing in room["things"]) for room in rooms]
    assert parts[0] and all(names == parts[0] for names in parts)
    north = [room for name, room in zip(floor.rooms, rooms, strict=True) if "north" in name]
    assert all(room["things"] == north[0]["things"] for room in north)


def test_an_empty_floor_is_the_cluttered_one_without_its_things(tmp_path: Path) -> None:
    cluttered, empty = (load_scenario(obstacles.write_mission(Trial(row, 5), tmp_path))
                        for row in (obstacles.CAMERA, obstacles.EMPTY))
    assert cluttered.truth.extra and not empty.truth.extra
    assert (cluttered.goal, cluttered.start, cluttered.details) == (empty.goal, empty.start, empty.details)


def test_each_tenth_mission_has_no_way_and_each_second_is_camouflaged(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    asked: list[bool] = []
    camouflaged: list[bool] = []

    def write(folder: Path, seed: int, *, leaves_way: bool, is_camouflaged: bool) -> Path:
        asked.append(leaves_way)
        camouflaged.append(is_camouflaged)
        return folder

    monkeypatch.setattr(obstacles, "write_cluttered_mission", write)
    for trial in obstacles.make_trials(obstacles.ROWS[obstacles.CAMERA], 1_000_000, 20):
        obstacles.write_mission(trial, tmp_path)
    assert asked.count(False) == 2 and asked.count(True) == 18
    assert camouflaged == [False, True] * 10


@pytest.mark.parametrize(("day", "seed"), [(0, 1), (10, 2), (40, 3)])  # days of flat light, which needs no extra
def test_errands_are_told_one_after_another(tmp_path: Path, day: int, seed: int) -> None:
    _, stage = write_twice(tmp_path, lambda folder: write_soak_mission(folder, day, seed))
    assert stage.start_world.distance_to(stage.goal_world) > 0.3048 * (HALL_FT[1] - HALL_FT[0]) / 2.0 - 0.01
    told = [told.at_s for told in stage.scenario.told]
    assert len(told) >= 3 and told == sorted(told)
