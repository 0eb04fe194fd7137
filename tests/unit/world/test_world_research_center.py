"""The shipped floor keeps the promises that the mission of Figure 17 rests on."""

import math

import numpy as np
import pytest

from world_models.building.plan_view import LEGEND, build_drawing, plan_svg
from world_models.building.world import World
from world_models.camera import Camera, CameraMount
from world_models.files.world_files import WORLDS, load_world
from world_models.frames import Pose2
from world_models.visibility.lines_and_points import visible_lines, visible_points

FT = 0.3048
CAMERA = Camera.from_field_of_view(math.radians(65.0))
MOUNT = CameraMount(1.0, 0.1)


@pytest.fixture(scope="module")
def world() -> World:
    return load_world(WORLDS / "research_center.toml")


def test_there_are_enough_rooms_in_the_hierarchy(world: World) -> None:
    assert len(world.rooms) >= 7
    assert world.path_of("allens-office") == ("research-center", "second-floor", "allens-office")
    assert world.walk("robot-laboratory", "allens-office") == ["robot-laboratory", "hallway", "allens-office"]


def test_the_two_doors_are_wide(world: World) -> None:
    widths = {d.name: d.width_m for d in world.doorways}
    assert math.isclose(widths["laboratory-door"], 3.3 * FT) and math.isclose(widths["allens-door"], 3.3 * FT)


@pytest.mark.parametrize(
    ("locale", "x_ft", "y_ft", "heading_deg", "lines", "points"),
    [
        ("robot-laboratory", 16, 2, 0, 40, 20),
        ("robot-laboratory", 16, 2, 90, 30, 15),
        ("robot-laboratory", 29, 12, 90, 15, 8),
        ("robot-laboratory", 26, 21, 90, 15, 8),
        ("hallway", 32, 4, 0, 60, 40),
        ("hallway", 32, 4, 90, 12, 8),
        ("hallway", 52, 4, 0, 60, 40),
        ("hallway", 72, 4, 90, 30, 15),
        ("hallway", 72, 4, 270, 12, 8),
        ("allens-office", 6, 2, 60, 30, 15),
        ("allens-office", 13, 12, 60, 12, 6),
        ("allens-office", 13, 12, 180, 20, 10),
    ],
)
def test_there_is_enough_to_see_on_the_way(
    world: World, locale: str, x_ft: float, y_ft: float, heading_deg: float, lines: int, points: int
) -> None:
    robot = Pose2(x_ft * FT, y_ft * FT, math.radians(heading_deg))
    view = MOUNT.camera_from_robot @ (world.world_from_locale(locale) @ robot.lifted()).inverse()
    found = visible_lines(world, CAMERA, view, min_contrast=0.04, min_length_px=12)
    d = np.abs(found.segments_px[:, 1] - found.segments_px[:, 0])
    assert len(found) >= lines and len(visible_points(world, CAMERA, view, min_contrast=0.04)) >= points
    assert np.count_nonzero(d[:, 1] > 4 * d[:, 0]) >= 4 and np.count_nonzero(d[:, 0] > d[:, 1]) >= 4


def test_the_hallway_does_not_repeat_itself(world: World) -> None:
    doors = sorted(mark.lines_world[..., 0].mean() for mark in world.landmarks
                   if mark.kind in ("door", "doorway") and "hallway" in (mark.locale, mark.neighbour))
    gaps = np.diff(doors)
    assert len(doors) >= 12 and len(np.unique(np.round(gaps, 1))) >= 9


def test_a_plan_shows_every_room_and_thing(world: World) -> None:
    plan = plan_svg(world)
    assert plan.startswith("<svg") and plan.count('<text class="name"') == len(world.rooms)
    drawn = build_drawing(world).shapes
    doorways = {doorway.name for room in world.rooms for doorway in world.doorways_of(room)}
    assert {shape.text for shape in drawn if shape.kind == "door-name"} == doorways
    notes = {shape.text for shape in drawn if shape.kind == "note"}
    assert {"N", "5 m"} | {LEGEND[kind] for kind in {shape.kind for shape in drawn} & LEGEND.keys()} == notes
    assert all(f">{room}</text>" in plan for room in world.rooms)
    assert all(f"<title>{thing.name}</title>" in plan for thing in world.things)
