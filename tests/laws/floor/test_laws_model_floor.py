"""Where the model has floor in a picture does not depend on where the picture ends."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import cache

import numpy as np
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from harvey.simulation.simulated_run import build_robot_model
from knowledge_sources.methods.floor.model_floor import (
    STEP_PX,
    ModelFloor,
    _find_kinds,
    build_floor_grid,
    predict_model_floor,
)
from sim.scenario import load_scenario
from world_models.camera import Camera
from world_models.frames import Pose2
from world_models.robot import RobotModel

CUT = 40
"""So many columns of the reduced picture are cut off on each side; even, as rays are cast through every second."""


@cache
def robot() -> RobotModel:
    return build_robot_model(load_scenario("lab-to-allens-office"))


def predict(camera: Camera, pose: Pose2, margin_px: float, aside_px_m: float) -> ModelFloor:
    grid = build_floor_grid(camera, robot().mount, robot().mount.height_m, 5.0)
    assert grid is not None
    seeing = replace(robot(), camera=camera, lens=camera)
    return predict_model_floor(seeing, pose, grid, 0.0, 0.05, margin_px, aside_px_m)


@settings(deadline=None, max_examples=25)
@given(seed=st.integers(0, 2**32 - 1), margin_px=st.floats(1.0, 16.0), aside_px_m=st.floats(0.0, 6.0))
def test_what_lies_just_beside_the_picture_keeps_floor_near_it_from_being_plain(
    seed: int, margin_px: float, aside_px_m: float
) -> None:
    """A narrower picture tells of its pixels what a wider one tells of them."""
    rng = np.random.default_rng(seed)
    corners = np.array(robot().world.outline("hallway"))
    x_m, y_m = rng.uniform(corners.min(axis=0) + 0.5, corners.max(axis=0) - 0.5)
    pose = Pose2(x_m, y_m, rng.uniform(-math.pi, math.pi))
    wide = robot().camera
    narrow = replace(wide, width=wide.width - 2 * CUT * STEP_PX, cx=wide.cx - CUT * STEP_PX)
    whole, part = (predict(camera, pose, margin_px, aside_px_m) for camera in (wide, narrow))
    assume(whole.is_plain.any())
    rows = part.is_plain.shape[0]
    np.testing.assert_array_equal(part.is_plain, whole.is_plain[-rows:, CUT:-CUT])
    np.testing.assert_array_equal(part.kinds >= 0, whole.kinds[-rows:, CUT:-CUT] >= 0)


@given(st.lists(st.sampled_from([(0.5, 0.4, 0.3), (0.5, 0.4, 0.30002), (0.2, 0.9, 0.1), (math.nan,) * 3]), min_size=1))
def test_kinds_are_the_different_colours_in_order_and_all_that_are_unknown_are_one(
    colours: list[tuple[float, float, float]]
) -> None:
    rows = np.array(colours)
    keys, kind_of = _find_kinds(rows)
    assert np.array_equal(keys[kind_of], np.round(rows, 4), equal_nan=True)
    expected = np.unique(np.nan_to_num(np.round(rows, 4), nan=-1.0), axis=0)
    assert np.array_equal(np.nan_to_num(keys, nan=-1.0), expected)
