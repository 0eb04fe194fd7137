"""The ``[truth]`` of a scenario: read, checked against the building, and built."""

from __future__ import annotations

import json
import math

import numpy as np
import pytest

from sim.ground_truth.table import NO_DIFFERENCES, TrueCamera
from sim.ground_truth.things import ROLLED_OVER, SHAPES
from sim.scenario import ScenarioError, load_scenario, parse_scenario, with_settings
from sim.stage import build_stage
from world_models.files.world_files import load_world
from world_models.frames import Pose2

SMALL = 'world = "research_center"\ngoal = "(ptrans (hallway (4,4,0)) (hallway (24,4,0)))"\n'
BOX = '[[truth.extra]]\nkind = "box"\nlocale = "hallway"\nx_ft = 14\ny_ft = 4\n'


def test_without_a_truth_table_all_is_as_believed() -> None:
    assert parse_scenario(SMALL).truth == NO_DIFFERENCES


def test_the_table_is_read_in_the_files_units() -> None:
    times = "at_s = 3\nuntil_s = 9\nheading_deg = 90\n"
    truth = parse_scenario(SMALL + BOX + times + "[truth.camera]\ntilt_deg = 1\n").truth
    (box,) = truth.extra
    assert (box.x_m, box.at_s, box.until_s) == pytest.approx((14 * 0.3048, 3.0, 9.0))
    assert box.heading_rad == pytest.approx(math.pi / 2) and truth.camera.tilt_rad == pytest.approx(math.radians(1))


@pytest.mark.parametrize(("text", "message"), [
    ("[truth]\ndoor = 3\n", r"m\.toml:4: truth\.door: expected one of doors"),
    ('[[truth.extra]]\nkind = "boks"\n', r"m\.toml:3: truth\.extra\.0: expected kind = one of box, got 'boks'"),
    (BOX + "at_s = 5\nuntil_s = 4\n", r"m\.toml:9: truth\.extra\.0\.until_s: expected a number above 5"),
    (BOX + "height_m = 2\n", r"m\.toml:8: truth\.extra\.0\.height_m: expected one of heading"),
    ('[[truth.doors]]\nname = "a"\nstate = "shutt"\n', r"m\.toml:3: truth\.doors\.0: expected state = one of shut"),
    ('[[truth.doors]]\nname = "a"\nopen_deg = 200\n', r"m\.toml:5: truth\.doors\.0\.open_deg: expected a number above"),
    ('[[truth.things]]\nthing = "a/b"\n', r"m\.toml:3: truth\.things\.0: expected either missing = true or .* neither"),
    ('[[truth.things]]\nthing = "a/b"\nmissing = true\nx_m = 1\n', r"truth\.things\.0: expected either .* got both"),
    ('[[truth.walls]]\nwall = "a/b"\n', r"m\.toml:3: truth\.walls\.0: expected either missing = true or .* neither"),
    ('[[truth.things]]\nthing = "a/b"\nmissing = true\nheading_deg = 9\n', r"truth\.things\.0: expected .* got both"),
    ("[truth.camera]\ntilt_deg = 80\n", r"m\.toml:4: truth\.camera\.tilt_deg: expected a number from -28"),
])
def test_a_malformed_table_is_pointed_at(text: str, message: str) -> None:
    with pytest.raises(ScenarioError, match=message):
        parse_scenario(SMALL + text, "m.toml")


@pytest.mark.parametrize(("text", "message"), [
    (BOX.replace("hallway", "halway"), r"m\.toml:5: truth\.extra\.0\.locale: expected a room, one of hallway"),
    (BOX.replace("y_ft = 4", "y_ft = 40"), r"m\.toml:3: truth\.extra\.0: expected the box to stand within hallway"),
    (BOX.replace("x_ft = 14", "x_ft = 4"), r"m\.toml:2: goal: expected 0\.35 m of room at the start"),
    ('[[truth.doors]]\nname = "libary-door"\n',
     r"m\.toml:4: truth\.doors\.0\.name: expected a door that is open in the model, one of library-door"),
    ('[[truth.doors]]\nname = "fire-exit"\nstate = "open"\n',
     r"m\.toml:4: truth\.doors\.0\.name: expected a closed door between two locales, one of .*'fire-exit'"),
    ('[[truth.doors]]\nname = "library-door"\ninto = "office"\n',
     r"m\.toml:5: truth\.doors\.0\.into: expected one of hallway, library"),
    ('[[truth.things]]\nthing = "hallway/chandelier"\nmissing = true\n',
     r"m\.toml:4: truth\.things\.0\.thing: expected a thing of the building"),
    ('[[truth.things]]\nthing = "hallway/notices-by-students"\nx_ft = 500\n',
     r"m\.toml:3: truth\.things\.0: expected hallway/notices-by-students to stand within hallway"),
    ('[[truth.walls]]\nwall = "hallway/nort-wall"\nmissing = true\n',
     r"m\.toml:4: truth\.walls\.0\.wall: expected a wall of the building, one of hallway/north-wall.*'hallway/nort-"),
    ('[[truth.walls]]\nwall = "hallway/floor"\nmissing = true\n', r"truth\.walls\.0\.wall: expected a wall of the"),
    ("[truth.camera]\nfocal_px = -1000\n", r"m\.toml:3: truth\.camera: expected a focal length above 0"),
    ("[truth.camera]\ndistortion = [0.1]\n", r"m\.toml:3: truth\.camera: expected 4.* distortion coefficients"),
    ("[truth.camera]\ndistortion = [-9, 0, 0, 0]\n", r"m\.toml:3: truth\.camera: expected a distortion that has one"),
])
def test_what_does_not_go_with_the_building_is_pointed_at(text: str, message: str) -> None:
    with pytest.raises(ScenarioError, match=message):
        build_stage(parse_scenario(SMALL + text, "m.toml"))


@pytest.mark.parametrize("kind", SHAPES)
def test_every_thing_stands_on_the_floor_and_is_solid_unless_it_is_rolled_over(kind: str) -> None:
    stage = build_stage(parse_scenario(SMALL + BOX.replace("box", kind)))
    assert min(face.polygon_world[:, 2].min() for face in stage.building.added) == pytest.approx(0.0, abs=0.011)
    there = stage.start_world @ Pose2(10 * 0.3048, 0.0, 0.0)
    free = build_stage(parse_scenario(SMALL)).building.obstacles
    assert (stage.building.obstacles.clearance_m(there) < 0.05) == (kind not in ROLLED_OVER)
    assert free.clearance_m(there) > 0.3


def test_a_missing_thing_is_gone_with_all_that_is_on_it() -> None:
    text = SMALL + '[[truth.things]]\nthing = "allens-office/desk"\nmissing = true\n'
    stage = build_stage(parse_scenario(text.replace("(hallway (4,4,0))", "(allens-office (7,4,0))")))
    assert stage.building.gone and not stage.building.added
    assert all(face.name.startswith("allens-office/desk") for face in stage.building.gone)


def test_a_thing_can_be_turned_where_it_stands() -> None:
    turned = '[[truth.things]]\nthing = "allens-office/file-cabinet-1"\nheading_deg = 90\nx_m = 0.5\ny_m = -0.5\n'
    text = SMALL + turned
    stage = build_stage(parse_scenario(text.replace("(hallway (4,4,0))", "(allens-office (7,4,0))")))
    before, after = (np.concatenate([face.polygon_world for face in faces])
                     for faces in (stage.building.gone, stage.building.added))
    low, high, new_low, new_high = before.min(axis=0), before.max(axis=0), after.min(axis=0), after.max(axis=0)
    np.testing.assert_allclose(new_high - new_low, (high - low)[[1, 0, 2]], atol=1e-9)
    np.testing.assert_allclose(new_high + new_low, high + low + (1.0, -1.0, 0.0), atol=1e-9)


def test_a_wall_can_be_missing_or_elsewhere() -> None:
    plain = build_stage(parse_scenario(SMALL)).building
    wall = '[[truth.walls]]\nwall = "hallway/south-wall"\n'
    shifted, gone = (build_stage(parse_scenario(f"{SMALL}{wall}{how}\n")).building
                     for how in ("y_m = 0.3", "missing = true"))
    assert not gone.added and {face.name for face in gone.gone} == {face.name for face in shifted.added}
    (own,) = [face for face in gone.gone if face.name == "hallway/south-wall"]
    assert all(face.name == own.name or face.parent == own.name for face in gone.gone)
    x, y = own.polygon_world[:, :2].mean(axis=0)
    there = Pose2(float(x) + 1.0, float(y) + 0.7, 0.0)
    clear = [building.obstacles.clearance_m(there) for building in (plain, shifted)]
    assert clear[0] - clear[1] == pytest.approx(0.3, abs=0.02)


def test_the_true_camera_can_be_set_from_the_command_line() -> None:
    scenario = parse_scenario(SMALL + "[truth.camera]\ntilt_deg = 1\nfocal_px = 3\n")
    changed = with_settings(scenario, {"truth.camera.tilt_rad": "0.01"})
    assert changed.truth.camera == TrueCamera(tilt_rad=0.01, focal_px=3.0)
    assert with_settings(parse_scenario(SMALL), {"truth.camera.tilt_deg": "1"}).truth.camera.tilt_rad == pytest.approx(
        math.radians(1.0))
    with pytest.raises(ScenarioError, match=r"--set truth\.camera\.tilt: expected one of truth\.camera\.tilt_"):
        with_settings(scenario, {"truth.camera.tilt": "1"})
    with pytest.raises(ScenarioError, match=r"truth\.camera\.tilt_deg.*: expected a number from -28"):
        with_settings(scenario, {"truth.camera.tilt_deg": "80"})


def test_a_closed_door_that_is_truly_open_can_be_driven_through() -> None:
    text = SMALL.replace("(4,4,0)", "(49,4,0)").replace("(24,4,0)", "(60,4,0)")
    door = '[[truth.doors]]\nname = "conference-side-door"\nstate = "open"\n'
    closed, opened = build_stage(parse_scenario(text)), build_stage(parse_scenario(text + door))
    world = load_world(opened.scenario.world, opened=("conference-side-door",))
    (doorway,) = [d for d in world.doorways if d.name == "conference-side-door"]
    there = Pose2(float(doorway.centre_world[0]), float(doorway.centre_world[1]), 0.0)
    assert closed.building.obstacles.clearance_m(there) < 0.0 < opened.building.obstacles.clearance_m(there)


def test_the_true_camera_differs_and_the_robot_believes_the_scenarios() -> None:
    stage = build_stage(parse_scenario(SMALL + "[truth.camera]\ntilt_deg = 1.0\nheight_m = 0.02\nfocal_px = 5\n"))
    plain = build_stage(parse_scenario(SMALL))
    assert stage.scenario.camera == plain.scenario.camera
    assert stage.body(0).picture() != plain.body(0).picture()
    believed, mount = stage.scenario.camera.camera, stage.scenario.camera.mount
    camera, true_mount = TrueCamera(tilt_rad=0.1, height_m=0.02, focal_px=5.0).mounted(believed, mount)
    assert (camera.fx - believed.fx, camera.cx - believed.cx) == (5.0, 0.0)
    assert true_mount.height_m == mount.height_m + 0.02 and true_mount.tilt_rad == mount.tilt_rad + 0.1


def test_the_true_lens_is_in_the_pictures_and_the_robot_believes_its_own() -> None:
    def seen(believed: str, true: str) -> bytes:
        lens = {"camera.distortion": believed} | ({"truth.camera.distortion": true} if true else {})
        stage = build_stage(with_settings(parse_scenario(SMALL), lens))
        assert list(stage.scenario.camera.distortion) == json.loads(believed)
        return stage.body(0).picture()
    bent = "[-0.1, 0.0, 0.0, 0.0]"
    assert seen("[-0.05, 0.0, 0.0, 0.0]", bent) == seen(bent, "") != seen("[-0.05, 0.0, 0.0, 0.0]", "")


@pytest.mark.parametrize(("name", "added"), [("box-in-the-way", "extra-0-box"), ("door-found-shut", "true-leaf")])
def test_the_shipped_scenarios_have_what_they_are_named_for(name: str, added: str) -> None:
    faces = build_stage(load_scenario(name)).building.added
    assert faces and all(added in face.name for face in faces)
