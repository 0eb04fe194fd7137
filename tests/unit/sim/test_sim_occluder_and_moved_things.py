"""What hides the view, and what was moved: seen by the camera, felt by the robot, unknown to the model."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from box_rooms import box_room
from sim.body.simulated_body import SimulatedBody
from sim.body.simulated_building import SimulatedBuilding
from sim.faults.built_in_faults import Occlusion
from sim.faults.fault import Fault
from sim.ground_truth.things import MovedThing, move_things
from sim.render.sensor import Occluder
from sim.scenario import load_scenario
from world_models.camera import Camera, CameraMount
from world_models.files.world_files import load_world
from world_models.frames import Pose2

CAMERA = Camera.from_field_of_view(math.radians(65.0), 64, 64)
BUILDING = SimulatedBuilding.of_faces(box_room(), samples=1)


def body(*faults: Fault) -> SimulatedBody:
    return SimulatedBody(BUILDING, Pose2(1.0, 2.0, 0.0), CAMERA, CameraMount(1.0), seed=4, faults=faults)


@given(part=st.floats(0.01, 0.9), seed=st.integers(0, 1000))
def test_an_occluder_hides_the_part_that_it_is_said_to_hide(part: float, seed: int) -> None:
    occluder = Occluder.draw(part, 1.0, np.random.default_rng(seed))
    hidden = occluder.cover(np.full((200, 200, 3), 2.0, np.float32)) < 1.0
    assert hidden[..., 0].mean() == pytest.approx(part, abs=0.01)
    rows, columns = np.nonzero(hidden[..., 0])
    assert hidden[..., 0].sum() == (np.ptp(rows) + 1) * (np.ptp(columns) + 1)


def test_an_occlusion_comes_and_goes_at_its_time_and_changes_no_other_noise() -> None:
    plain, hidden = body(), body(Occlusion(after_s=0.05, duration_s=0.25, part=0.2))
    same = [plain.look().jpeg == hidden.look().jpeg for _ in range(5)]
    assert same == [False, False, False, True, True]


def test_what_was_moved_stands_elsewhere_with_all_that_is_on_it_and_nothing_else_does() -> None:
    world = load_world(load_scenario("rough-day").world)
    faces = world.faces_within("hallway")
    moved = move_things(faces, (MovedThing("hallway/fire-hose", 0.5, -0.25), MovedThing("hallway/fire-hose", 0.5)))
    for before, after in zip(faces, moved, strict=True):
        by_m = (1.0, -0.25, 0.0) if before.name.startswith("hallway/fire-hose/") else (0.0, 0.0, 0.0)
        pairs = zip((before, *before.front, *before.back), (after, *after.front, *after.back), strict=True)
        for one, other in pairs:
            np.testing.assert_allclose(other.polygon_world, one.polygon_world + by_m)
