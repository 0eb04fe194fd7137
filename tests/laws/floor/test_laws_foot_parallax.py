"""Laws of two pictures: a board that is drawn ray by ray, on the floor or over it, flat marks, and dirt on the lens.

Dirt is no thing on the floor: it stays in the picture while the robot moves, which nothing else does.
"""

from __future__ import annotations

import math

import cv2
import numpy as np
import pytest
from hypothesis import assume, example, given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from knowledge_sources.methods.arrays import Floats
from knowledge_sources.methods.floor.model_floor import STEP_PX, build_floor_grid
from knowledge_sources.methods.floor.standing_regions import (
    FOOT_PART_STEP,
    TwoPictures,
    find_footprint,
    find_regions,
    is_on_the_lens,
    measure_foot_part,
)
from world_models.camera import Camera, CameraMount
from world_models.frames import Pose2

CAMERA = Camera.from_field_of_view(math.radians(65.0))
MOUNT = CameraMount(1.0, 0.1)
BUILT = build_floor_grid(CAMERA, MOUNT, MOUNT.height_m, 9.0)
assert BUILT is not None
GRID = BUILT


def draw(texture: Floats, at_m: float, low_m: float, moved_m: float) -> tuple[NDArray[np.float32], NDArray[np.bool_]]:
    """Grey and which pixels show the board: it stands across the way, ``at_m`` ahead of the robot before it moved."""
    u = (np.arange(CAMERA.width // STEP_PX) + 0.5) * STEP_PX - 0.5
    rays = CAMERA.rays(np.stack(np.meshgrid(u, u), axis=-1)) @ MOUNT.camera_from_robot.rotation
    away = at_m - moved_m - MOUNT.forward_m
    with np.errstate(divide="ignore", invalid="ignore"):
        y, z = rays[..., 1] * away / rays[..., 0], MOUNT.height_m + rays[..., 2] * away / rays[..., 0]
    on = (np.abs(y) < 0.4) & (z > low_m) & (z < low_m + 0.35) & (rays[..., 0] > 0.0)
    rows, columns = (np.clip(200.0 * part, 0, texture.shape[0] - 1).astype(np.float32) for part in (z - low_m, y + 0.4))
    shown = cv2.remap(texture.astype(np.float32), columns, rows, cv2.INTER_LINEAR)
    return np.where(on, shown, 120.0).astype(np.float32), on


def measure(seed: int, at_m: float, low_m: float, moved_m: float) -> tuple[float, float] | None:
    """The part that is measured of a board with random texture, and how far its nearest point is then [m].

    None where the picture cuts off the board's lower border, which is not measured then.
    """
    noise = np.random.default_rng(seed).uniform(0.0, 255.0, (40, 40))
    texture = cv2.resize(noise, (200, 200), interpolation=cv2.INTER_LINEAR)
    earlier, _ = draw(texture, at_m, low_m, 0.0)
    now, board = draw(texture, at_m, low_m, moved_m)
    if board[-2:].any():
        return None
    (region,) = find_regions(board[GRID.top:], np.ones(GRID.shape, bool), GRID)
    part = measure_foot_part(region, TwoPictures(GRID, now, earlier, Pose2(moved_m, 0.0, 0.0), CAMERA, MOUNT))
    return part, float(find_footprint(region, GRID, part)[:, 0].min())


@settings(max_examples=25, deadline=None)
@given(st.integers(0, 2**32 - 1), st.floats(2.2, 3.0), st.sampled_from([0.0, 0.0, 0.15, 0.2, 0.3]), st.floats(0.4, 0.6))
@example(0, 2.75, 0.15, 0.5625)
def test_a_border_is_on_the_floor_or_as_far_as_its_height_makes_it(
    seed: int, at_m: float, low_m: float, moved_m: float
) -> None:
    """It is never said to hang at another height than it does; where a texture does not tell, it is taken to stand."""
    measured = measure(seed, at_m, low_m, moved_m)
    assume(measured is not None)
    assert measured is not None
    part, near_m = measured
    true_part = 1.0 - low_m / MOUNT.height_m
    assert part == 1.0 or part == pytest.approx(true_part, abs=2.0 * FOOT_PART_STEP)
    if low_m == 0.0:
        assert part == 1.0
    if part < 1.0 or low_m == 0.0:
        assert near_m == pytest.approx(at_m - moved_m, abs=3.0 * FOOT_PART_STEP * (at_m - moved_m) / true_part)


@pytest.mark.parametrize(("low_m", "told"), [(0.15, 20), (0.2, 30), (0.3, 34)])
def test_of_forty_borders_over_the_floor_most_are_told(low_m: float, told: int) -> None:
    """Of 125 textures, places and moves each 64, 87 and 95 % were told; of 40 a third fewer would be noticed."""
    draws = [np.random.default_rng(seed).uniform([2.2, 0.4], [3.0, 0.6]) for seed in range(40)]
    measured = [measure(seed, at_m, low_m, moved_m) for seed, (at_m, moved_m) in enumerate(draws)]
    assert sum(one is not None and one[0] < 1.0 for one in measured) >= told


@settings(max_examples=25, deadline=None)
@given(st.integers(0, 2**32 - 1), st.floats(2.2, 3.0))
def test_without_motion_nothing_is_told(seed: int, at_m: float) -> None:
    noise = np.random.default_rng(seed).uniform(0.0, 255.0, (40, 40))
    picture, board = draw(cv2.resize(noise, (200, 200)), at_m, 0.2, 0.0)
    (region,) = find_regions(board[GRID.top:], np.ones(GRID.shape, bool), GRID)
    both = TwoPictures(GRID, picture, picture, Pose2(0.0, 0.0, 0.0), CAMERA, MOUNT)
    assert measure_foot_part(region, both) == 1.0
    assert not is_on_the_lens(region, both)


SIZE = CAMERA.width // STEP_PX
TOLD_OF_FORTY = 32
FLOOR = cv2.GaussianBlur(np.random.default_rng(7).uniform(90.0, 150.0, (400, 400)), (0, 0), 1.5).astype(np.float32)


def texture(seed: int) -> NDArray[np.float64]:
    noise = np.random.default_rng(seed).uniform(0.0, 255.0, (40, 40))
    return np.asarray(cv2.resize(noise, (200, 200), interpolation=cv2.INTER_LINEAR))


def draw_floor(moved_m: float) -> NDArray[np.float32]:
    """A textured floor as the camera sees it after the robot has moved ahead."""
    picture = np.full((CAMERA.height // STEP_PX, SIZE), 120.0, np.float32)
    at = GRID.points_robot + np.array([moved_m, 0.0])
    rows, columns = ((50.0 * (at[..., k] + 4.0)).astype(np.float32) for k in (0, 1))
    picture[GRID.top:] = cv2.remap(FLOOR, columns, rows, cv2.INTER_LINEAR)
    return picture


def tell(now: NDArray[np.float32], earlier: NDArray[np.float32], mask: NDArray[np.bool_], moved_m: float) -> bool:
    regions = find_regions(mask[GRID.top:], np.ones(GRID.shape, bool), GRID)
    both = TwoPictures(GRID, now, earlier, Pose2(moved_m, 0.0, 0.0), CAMERA, MOUNT)
    return bool(regions) and is_on_the_lens(regions[0], both)


def test_most_of_what_stays_in_the_picture_is_told_to_be_on_the_lens() -> None:
    told = 0
    for seed in range(40):
        rng = np.random.default_rng(seed)
        left, size = rng.integers([20, 24], [SIZE - 70, 48])
        grey, moved_m = rng.uniform(0.0, 60.0), rng.uniform(0.25, 0.6)
        bottom = CAMERA.height // STEP_PX - int(rng.integers(8, 60))
        mask = np.zeros((CAMERA.height // STEP_PX, SIZE), bool)
        mask[max(GRID.top + 4, bottom - size):bottom, left:left + size] = True
        earlier, now = draw_floor(0.0), draw_floor(moved_m)
        earlier[mask] = now[mask] = grey
        told += tell(now, earlier, mask, moved_m)
    assert told >= TOLD_OF_FORTY


@settings(max_examples=25, deadline=None)
@given(st.integers(0, 2**32 - 1), st.floats(1.8, 3.0), st.sampled_from([0.0, 0.15]), st.floats(0.25, 0.6))
def test_what_stands_on_the_floor_or_over_it_is_not(seed: int, at_m: float, low_m: float, moved_m: float) -> None:
    (earlier, was), (now, board) = draw(texture(seed), at_m, low_m, 0.0), draw(texture(seed), at_m, low_m, moved_m)
    floors = draw_floor(0.0), draw_floor(moved_m)
    shown = np.where(board, now, floors[1]), np.where(was, earlier, floors[0])
    assert not tell(*shown, board, moved_m)


@settings(max_examples=25, deadline=None)
@given(st.floats(1.6, 2.6), st.floats(-0.5, 0.5), st.floats(0.15, 0.4), st.floats(0.25, 0.6))
def test_nor_is_what_lies_flat_on_it(x_m: float, y_m: float, half_m: float, moved_m: float) -> None:
    shown, masks = [], []
    for gone_m in (moved_m, 0.0):
        picture, mask = draw_floor(gone_m), np.zeros((CAMERA.height // STEP_PX, SIZE), bool)
        off = np.abs(GRID.points_robot + np.array([gone_m - x_m, -y_m]))
        mask[GRID.top:] = np.all(off < half_m, axis=-1)
        picture[mask] = 20.0
        shown.append(picture)
        masks.append(mask)
    assert not tell(shown[0], shown[1], masks[0], moved_m)
