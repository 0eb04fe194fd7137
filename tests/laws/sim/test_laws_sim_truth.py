"""Laws of a truth that differs: it is seen and felt where and while it is there, and nowhere and never else."""

from __future__ import annotations

import math
from functools import cache

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from sim.body.simulated_body import SimulatedBody
from sim.body.simulated_building import SimulatedBuilding
from sim.ground_truth.table import Lasting
from sim.ground_truth.things import ROLLED_OVER, SHAPES
from sim.ground_truth.true_changes import TrueChange, find_active
from sim.scenario import load_scenario, parse_scenario
from sim.stage import Stage, build_stage
from world_models.camera import Camera, CameraMount
from world_models.entries import Course, MotorCommand, Place, Ride, RideReport
from world_models.frames import Pose2

CAMERA, MOUNT = Camera.from_field_of_view(math.radians(65.0), 160, 160), CameraMount(1.0)
HALL = 'world = "two_ways"\ngoal = "(ptrans (north-hall (4,4,0)) (archive (9,6,0)))"\n[render]\nsamples = 4\n'
DOOR = '[[truth.doors]]\nname = "archive-north-door"\n'


@cache
def stage_of(text: str) -> Stage:
    return build_stage(parse_scenario(HALL + text))


def extra(kind: str, x_m: float, y_m: float, heading_rad: float, at_s: float = 0.0, until_s: float = 1e9) -> str:
    return (f'[[truth.extra]]\nkind = "{kind}"\nlocale = "north-hall"\nx_m = {x_m}\ny_m = {y_m}\n'
            f"heading_rad = {heading_rad}\nat_s = {at_s}\nuntil_s = {until_s}\n")


def see(building: SimulatedBuilding, pose: Pose2) -> NDArray[np.float32]:
    return building.renderer.radiance(CAMERA, MOUNT.camera_from_robot @ pose.lifted().inverse())


def outline_px(building: SimulatedBuilding, pose: Pose2, margin_px: float = 1.0) -> NDArray[np.bool_]:
    """Where the camera may see what was added: the box round each of its faces before the camera."""
    shown = np.zeros((CAMERA.height, CAMERA.width), bool)
    camera_from_world = MOUNT.camera_from_robot @ pose.lifted().inverse()
    for face in building.added:
        corners = camera_from_world.apply(face.polygon_world)
        assert np.all(corners[:, 2] > 0.05), "the test puts it before the camera"
        pixels = CAMERA.project(corners)
        (u0, v0), (u1, v1) = np.floor(pixels.min(axis=0) - margin_px), np.ceil(pixels.max(axis=0) + margin_px) + 1
        shown[max(0, int(v0)) : max(0, int(v1)), max(0, int(u0)) : max(0, int(u1))] = True
    return shown


@settings(deadline=None, max_examples=30)
@given(kind=st.sampled_from(sorted(set(SHAPES) - {"partition"})), x_m=st.floats(3.5, 7.0), y_m=st.floats(0.9, 1.5),
       heading_rad=st.floats(-3.0, 3.0))
def test_what_is_there_is_seen_where_it_stands_and_nowhere_else(
    kind: str, x_m: float, y_m: float, heading_rad: float
) -> None:
    plain, other = stage_of(""), build_stage(parse_scenario(HALL + extra(kind, x_m, y_m, heading_rad)))
    pose = plain.start_world
    differs = np.any(see(plain.building, pose) != see(other.building, pose), axis=2)
    shown = outline_px(other.building, pose)
    assert differs.any() and not np.any(differs & ~shown)


@settings(deadline=None, max_examples=20)
@given(kind=st.sampled_from(sorted(set(SHAPES) - set(ROLLED_OVER))), aside=st.floats(-0.1, 0.1),
       heading_rad=st.floats(-3.0, 3.0))
def test_what_is_there_is_hit(kind: str, aside: float, heading_rad: float) -> None:
    middle = 1.2192 + aside
    body = build_stage(parse_scenario(HALL + extra(kind, 4.2, middle, heading_rad))).body(1)
    for _ in range(7):
        body.move(0.6)
    assert body.truth.collisions > 0 and body.truth.world_from_robot.x_m < stage_of("").start_world.x_m + 3.0


@pytest.mark.parametrize("state", [
    'state = "shut"', 'state = "ajar"\nopen_deg = 30',
    'state = "ajar"\ninto = "archive"\nhinge = "right"\nopen_deg = 15',
])
@pytest.mark.parametrize("continuous", [False, True])
def test_a_door_that_is_truly_shut_is_hit(state: str, continuous: bool) -> None:
    shut = drive_at_the_door(stage_of(f"{DOOR}{state}\n"), continuous)
    assert shut.truth.collisions > 0 and shut.truth.locale != "archive"
    free = drive_at_the_door(stage_of(""), continuous)
    assert free.truth.collisions == 0 and free.truth.locale == "archive"


def drive_at_the_door(stage: Stage, continuous: bool) -> SimulatedBody:
    (door,) = [d for d in stage.world.doorways if d.name == "archive-north-door"]
    start = door.pose_from("north-hall") @ Pose2(-1.4, 0.0, 0.0)
    body = SimulatedBody(stage.building, start, CAMERA, MOUNT, seed=3)
    for _ in range(180 if continuous else 4):
        if continuous:
            body.steer(Course("Leg-1", 0.6, 0.0))
        else:
            body.execute(MotorCommand(0.0, 0.6))
    return body


@settings(deadline=None, max_examples=10)
@given(at_s=st.floats(0.5, 3.0), lasts_s=st.floats(0.5, 3.0))
def test_what_comes_and_goes_is_there_while_it_lasts(at_s: float, lasts_s: float) -> None:
    until_s = at_s + lasts_s
    stage, plain = build_stage(parse_scenario(HALL + extra("cart", 5.0, 1.2, 0.3, at_s, until_s))), stage_of("")
    body, there = stage.body(0), stage.start_world @ Pose2(5.0 - 1.2192, 0.0, 0.0)
    while body.truth.time_s < until_s + 1.0:
        is_there = at_s <= body.truth.time_s < until_s
        assert bool(body.building.added) == is_there
        assert (body.building.obstacles.clearance_m(there) < 0.0) == is_there
        seen = see(body.building, stage.start_world)
        assert np.array_equal(seen, see(plain.building, stage.start_world)) != is_there
        body.wait(0.2)


def test_on_another_floor_what_differs_there_is_there_too() -> None:
    scenario = load_scenario("elevator-ride")
    box = '[[truth.extra]]\nkind = "box"\nlocale = "first-hallway"\nx_ft = 20\ny_ft = 4\nat_s = 5\n'
    stage = build_stage(parse_scenario(f"{scenario.source.text}\n{box}", "ride", scenario.folder))
    body, world = stage.body(0), stage.world
    link = next(link for link in world.links if link.name == "elevator-1-2")
    up, down = sorted(link.between, key=world.floor_m, reverse=True)
    there = Place("first-hallway", 20 * 0.3048, 4 * 0.3048).in_world(world)
    body.put_robot(Pose2(*link.stop_of(up)))
    assert body.building.obstacles.clearance_m(there) > 0.0
    assert isinstance(body.ride(Ride("PlanSketch-1", 0, link.name, up, down)), RideReport)
    assert body.building.floor_m == world.floor_m(down) and body.building.obstacles.clearance_m(there) < 0.0


def test_what_would_come_to_where_the_robot_stands_waits_until_it_has_gone() -> None:
    body = build_stage(parse_scenario(HALL + extra("box", 1.3, 1.2, 0.0, 1.0))).body(0)
    body.wait(2.0)
    assert not body.building.added
    body.move(1.5)
    assert body.building.added and body.truth.collisions == 0


def test_what_differs_in_nothing_gives_the_same_picture_to_the_byte() -> None:
    later = build_stage(parse_scenario(HALL + extra("box", 5.0, 1.2, 0.0, 1000.0)))
    assert later.body(2).look().jpeg == stage_of("").body(2).look().jpeg


@given(spans=st.lists(st.tuples(st.sampled_from("abc"), st.floats(0, 9), st.floats(0.1, 9)), max_size=6),
       time_s=st.floats(0, 20))
def test_of_changes_about_the_same_one_holds_at_most_and_only_while_it_is_due(
    spans: list[tuple[str, float, float]], time_s: float
) -> None:
    changes = [TrueChange(Lasting(at_s=at, until_s=at + lasts), about) for about, at, lasts in spans]
    active = find_active(changes, time_s)
    assert len({changes[i].about for i in active}) == len(active)
    due = [i for i, change in enumerate(changes) if change.lasting.at_s <= time_s < change.lasting.until_s]
    assert set(active) == {max(j for j in due if changes[j].about == changes[i].about) for i in due}
