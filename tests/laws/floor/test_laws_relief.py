"""Laws of the relief: a board that is drawn ray by ray, on the floor or over it, flat marks, and dirt on the lens."""

from __future__ import annotations

import math
from typing import NamedTuple

import cv2
import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from knowledge_sources.methods.arrays import Floats
from knowledge_sources.methods.floor.model_floor import STEP_PX, build_floor_grid
from knowledge_sources.methods.floor.relief import FLAT, HALF, STANDING, Relief, TwoPictures, find_relief
from knowledge_sources.methods.floor.standing_regions import (
    compute_parallax_odds,
    find_footprint,
    find_regions,
    measure_height,
)
from world_models.camera import Camera, CameraMount
from world_models.frames import Pose2

CAMERA = Camera.from_field_of_view(math.radians(65.0))
MOUNT = CameraMount(1.0, 0.1)
BUILT = build_floor_grid(CAMERA, MOUNT, MOUNT.height_m, 9.0)
assert BUILT is not None
GRID = BUILT
SIZE = CAMERA.width // STEP_PX
EVERYWHERE = np.ones(GRID.shape, bool)
MOVES_M = st.floats(0.3, 0.6)
SEEDS = st.integers(0, 2**32 - 1)
HIGH_M = 0.35
GREY = np.zeros((SIZE, SIZE), np.float32)
FLOOR = cv2.GaussianBlur(np.random.default_rng(7).uniform(60.0, 180.0, (800, 800)), (0, 0), 2.0).astype(np.float32)
"""Grey levels of a floor, a pixel each centimetre and a half."""


class Board(NamedTuple):
    """A board of 0.8 m by HIGH_M across the way, so far before the robot before it moved, so high over the floor."""

    seed: int
    at_m: float
    low_m: float = 0.0

    @property
    def texture(self) -> NDArray[np.float32]:
        noise = np.random.default_rng(self.seed).uniform(0.0, 255.0, (28, 64))
        return np.asarray(cv2.resize(noise, (160, 70), interpolation=cv2.INTER_LINEAR), np.float32)


BOARDS = st.builds(Board, SEEDS, st.floats(2.2, 2.8))


def draw(board: Board | None, robot: Pose2) -> tuple[NDArray[np.float32], NDArray[np.bool_]]:
    """A picture from a pose, reduced, and which pixels of it show the board."""
    u = (np.arange(SIZE) + 0.5) * STEP_PX - 0.5
    rays = CAMERA.rays(np.stack(np.meshgrid(u, u), axis=-1)) @ MOUNT.camera_from_robot.rotation
    turn = np.array([[math.cos(robot.heading_rad), -math.sin(robot.heading_rad)],
                     [math.sin(robot.heading_rad), math.cos(robot.heading_rad)]])
    out = rays[..., :2] @ turn.T
    eye = np.array((robot @ Pose2(MOUNT.forward_m, 0.0, 0.0)).position)
    with np.errstate(divide="ignore", invalid="ignore"):
        far = np.where(rays[..., 2] < -1e-3, MOUNT.height_m / -rays[..., 2], 1e3)
    x, y = np.moveaxis(eye + out * far[..., None], -1, 0)
    grey = cv2.remap(FLOOR, *((66.7 * (part + 6.0)).astype(np.float32) for part in (x, y)), cv2.INTER_LINEAR,
                     borderMode=cv2.BORDER_REFLECT)
    grey = (120.0 + (grey - 120.0) * np.clip(4.0 - far, 0.0, 1.0)).astype(np.float32)  # no pixel is as sharp far away
    if board is None:
        return grey, np.zeros(grey.shape, bool)
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        depth = (board.at_m - eye[0]) / out[..., 0]
        depth = np.clip(depth, -1e3, 1e3)
    left, high = eye[1] + out[..., 1] * depth, MOUNT.height_m + rays[..., 2] * depth - board.low_m
    shown = (depth > 0.0) & (np.abs(left) < 0.4) & (high > 0.0) & (high < HIGH_M)
    columns, rows = (np.clip(200.0 * part, 0, most).astype(np.float32) for part, most in (
        (left + 0.4, 159), (high, 69)))
    return np.where(shown, cv2.remap(board.texture, columns, rows, cv2.INTER_LINEAR), grey).astype(np.float32), shown


class Scene(NamedTuple):
    """The relief of a picture that was taken after a move, and which pixels of the grid show the board in it."""

    relief: Relief
    board: NDArray[np.bool_]


def see(
    board: Board | None, moved: Pose2, told: Pose2 | None = None, sigmas: tuple[float, float] = (0.0, 0.0)
) -> Scene:
    (before, _), (now, shown) = draw(board, Pose2(0.0, 0.0, 0.0)), draw(board, moved)
    relief = find_relief(TwoPictures(GRID, now, before, told or moved, CAMERA, MOUNT), ~shown[GRID.top:], *sigmas)
    assert relief is not None
    return Scene(relief, shown[GRID.top:])


def inner(mask: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Without what is so near to its border that a patch reaches beyond it."""
    return np.asarray(cv2.erode(mask.astype(np.uint8), np.ones((2 * HALF + 3, 2 * HALF + 3), np.uint8)) > 0)


def true_parts(board: Board, moved_m: float) -> Floats:
    """How far the board is, as parts of the distance of the floor behind it."""
    return np.asarray((board.at_m - moved_m - MOUNT.forward_m) / (GRID.points_robot[..., 0] - MOUNT.forward_m))


@settings(max_examples=25, deadline=None)
@given(BOARDS, MOVES_M)
def test_what_stands_is_told_to_stand_and_how_far_it_is(board: Board, moved_m: float) -> None:
    """Mostly where it is much nearer than the floor behind it; and it hardly ever seems flat."""
    scene = see(board, Pose2(moved_m, 0.0, 0.0))
    parts = true_parts(board, moved_m)
    asked = inner(scene.board) & scene.relief.tells_of(parts) & (parts > 0.45) & (parts < 0.9)
    assume(np.count_nonzero(asked) > 50)
    standing = scene.relief.kinds == STANDING
    assert np.count_nonzero(asked & standing) > 0.2 * np.count_nonzero(asked)
    off = np.abs(scene.relief.parts - parts)[asked & standing]
    assert np.median(off) <= 0.05
    assert np.count_nonzero(asked & (scene.relief.kinds == FLAT)) < 0.02 * np.count_nonzero(asked)


@settings(max_examples=25, deadline=None)
@given(MOVES_M, st.floats(-0.1, 0.1), st.floats(-0.3, 0.3))
def test_floor_is_told_to_be_flat_and_hardly_anywhere_to_stand(ahead_m: float, left_m: float, turn_rad: float) -> None:
    kinds = see(None, Pose2(ahead_m, left_m, turn_rad)).relief.kinds
    assert np.count_nonzero(kinds == STANDING) < 0.002 * kinds.size
    assert np.count_nonzero(kinds == FLAT) > 10 * np.count_nonzero(kinds == STANDING)


@settings(max_examples=20, deadline=None)
@given(BOARDS, MOVES_M, st.tuples(*[st.floats(-1.5, 1.5)] * 3))
def test_a_motion_that_is_told_a_little_wrong_is_corrected_by_the_floor(
    board: Board, moved_m: float, errors: tuple[float, float, float]
) -> None:
    """By so many standard deviations, of a centimetre and a third of a degree."""
    moved = Pose2(moved_m, 0.0, 0.0)
    told = Pose2(moved_m + 0.01 * errors[0], 0.01 * errors[1], 0.006 * errors[2])
    right, wrong = see(board, moved).relief, see(board, moved, told, (0.01, 0.006)).relief
    assert np.count_nonzero(right.kinds != wrong.kinds) < 0.1 * right.kinds.size
    assert np.count_nonzero((wrong.kinds == STANDING) & (right.kinds == FLAT)) < 0.005 * right.kinds.size


@settings(max_examples=15, deadline=None)
@given(BOARDS, st.integers(0, 40))
def test_without_motion_nothing_is_told(board: Board, noise: int) -> None:
    kinds = see(board, Pose2(0.0, 0.0, 0.0), Pose2(1e-4 * noise, 0.0, 0.0)).relief.kinds
    assert not (kinds == STANDING).any()


def test_a_motion_that_nobody_knows_tells_nothing() -> None:
    """Where the floor has no texture, by which it could be found."""
    plain = np.full((CAMERA.height // STEP_PX, SIZE), 120.0, np.float32)
    both = TwoPictures(GRID, plain, plain, Pose2(0.4, 0.0, 0.0), CAMERA, MOUNT)
    assert find_relief(both, EVERYWHERE, 0.05, 0.02) is None
    known = find_relief(both, EVERYWHERE, 0.001, 0.0005)
    assert known is not None and not known.kinds.any()


def test_a_picture_of_another_place_tells_nothing() -> None:
    (one, _), (other, _) = draw(None, Pose2(0.0, 0.0, 0.0)), draw(None, Pose2(3.0, 2.0, 1.0))
    assert find_relief(TwoPictures(GRID, other, one, Pose2(0.5, 0.0, 0.0), CAMERA, MOUNT), EVERYWHERE) is None


@settings(max_examples=15, deadline=None)
@given(BOARDS, MOVES_M, st.floats(-0.08, 0.08), st.floats(-0.2, 0.2))
def test_mirrored_pictures_and_motion_give_a_mirrored_relief(
    board: Board, ahead_m: float, left_m: float, turn_rad: float
) -> None:
    moved = Pose2(ahead_m, left_m, turn_rad)
    (before, _), (now, shown) = draw(board, Pose2(0.0, 0.0, 0.0)), draw(board, moved)
    one = find_relief(TwoPictures(GRID, now, before, moved, CAMERA, MOUNT), ~shown[GRID.top:])
    now, before, shown = (np.ascontiguousarray(array[:, ::-1]) for array in (now, before, shown))
    other = find_relief(TwoPictures(GRID, now, before, Pose2(ahead_m, -left_m, -turn_rad), CAMERA, MOUNT),
                        ~shown[GRID.top:])
    assert one is not None and other is not None
    assert np.count_nonzero(one.kinds != other.kinds[:, ::-1]) < 0.01 * one.kinds.size


@settings(max_examples=20, deadline=None)
@given(BOARDS, MOVES_M)
def test_a_board_that_looks_like_the_floor_is_found_where_it_stands(board: Board, moved_m: float) -> None:
    """By its relief alone: no pixel is said to be unlike the floor."""
    scene = see(board, Pose2(moved_m, 0.0, 0.0))
    parts = true_parts(board, moved_m)
    asked = inner(scene.board) & scene.relief.tells_of(parts) & (parts > 0.45)
    assume(np.count_nonzero(asked & (scene.relief.kinds == STANDING)) > 40)
    regions = find_regions(np.zeros(GRID.shape, bool), EVERYWHERE, GRID, scene.relief)
    assert regions
    assert compute_parallax_odds(regions[0], scene.relief, GRID) > 1.0
    near_m = float(np.median(find_footprint(regions[0], GRID)[:, 0]))
    assert near_m == pytest.approx(board.at_m - moved_m, abs=0.35)


@settings(max_examples=20, deadline=None)
@given(SEEDS, st.floats(2.3, 2.9), st.sampled_from([0.15, 0.25]), MOVES_M)
def test_what_hangs_over_the_floor_is_as_near_as_its_height_makes_it(
    seed: int, at_m: float, low_m: float, moved_m: float
) -> None:
    """Or it is taken to stand where it seems to, where nothing tells; never nearer than it is."""
    scene = see(Board(seed, at_m, low_m), Pose2(moved_m, 0.0, 0.0))
    assume(not scene.board[-2:].any())
    regions = find_regions(scene.board, EVERYWHERE, GRID, scene.relief)
    near_m = float(find_footprint(regions[0], GRID)[:, 0].min())
    seeming_m = MOUNT.forward_m + (at_m - moved_m - MOUNT.forward_m) / (1.0 - low_m / MOUNT.height_m)
    assert 0.85 * (at_m - moved_m) <= near_m <= 1.05 * seeming_m
    height_m, sigma_m = measure_height(regions[0], GRID)
    assert height_m <= low_m + HIGH_M + 0.15 or math.isinf(sigma_m)


@settings(max_examples=20, deadline=None)
@given(st.floats(1.2, 2.2), st.floats(0.3, 0.5), st.integers(3, 12), st.integers(0, 30), SEEDS)
def test_a_seat_and_its_leg_stand_equally_far_away(at_m: float, low_m: float, leg: int, seen: int, seed: int) -> None:
    """Though the leg's foot is lower in the picture than the seat, and only the seat is seen to stand; and a few
    pixels elsewhere seem to be much nearer.
    """
    high_m = MOUNT.height_m * (1.0 - at_m / GRID.ranges_m)
    columns = np.arange(SIZE)
    mask = (high_m >= 0.0) & (high_m < 0.7) & (np.abs(columns - 128) < 30)
    mask &= (high_m > low_m) | (columns - 98 < leg)
    noise = np.random.default_rng(seed).normal(1.0, 0.02, GRID.shape)
    is_seen = mask & (high_m > low_m) & (columns > 99 + leg) & (columns < 150 + seen)
    parts = np.where(is_seen, np.minimum(at_m / GRID.ranges_m * noise, 0.95), 1.0)
    chance = mask & (columns > 154) & (columns < 157) & (seen < 4)
    parts = np.where(chance, 0.4, parts).astype(np.float32)
    kinds = np.where(parts < 1.0, STANDING, 0).astype(np.uint8)
    region, = find_regions(mask, EVERYWHERE, GRID, Relief(kinds, parts, np.ones(GRID.shape, np.float32)))
    feet_m = GRID.ranges_m[tuple(region.feet.T)] * region.parts
    assert np.abs(feet_m / at_m - 1.0).max() < 0.15
    assert len(feet_m) > 50


@settings(max_examples=20, deadline=None)
@given(st.floats(1.7, 2.6), st.floats(-0.5, 0.5), st.floats(0.15, 0.4), MOVES_M)
def test_what_lies_flat_is_told_to(
    x_m: float, y_m: float, half_m: float, moved_m: float
) -> None:
    shown, masks = [], []
    for gone_m in (moved_m, 0.0):
        picture, mask = draw(None, Pose2(gone_m, 0.0, 0.0))[0], np.zeros((CAMERA.height // STEP_PX, SIZE), bool)
        off = np.abs(GRID.points_robot + np.array([gone_m - x_m, -y_m]))
        mask[GRID.top:] = np.all(off < half_m, axis=-1)
        picture[mask] = 20.0
        shown.append(picture)
        masks.append(mask)
    both = TwoPictures(GRID, *shown, Pose2(moved_m, 0.0, 0.0), CAMERA, MOUNT)
    relief = find_relief(both, ~masks[0][GRID.top:])
    assert relief is not None
    regions = find_regions(masks[0][GRID.top:], EVERYWHERE, GRID, relief)
    assume(regions)
    assert compute_parallax_odds(regions[0], relief, GRID) <= 1.0


@settings(max_examples=60)
@given(tilt=st.floats(0.0, 0.4), roll=st.floats(-0.1, 0.1), yaw=st.floats(-0.2, 0.2), high_m=st.floats(0.4, 1.4),
       step_m=st.floats(-0.05, 0.05), moved=st.tuples(st.floats(-0.1, 0.8), st.floats(-0.3, 0.3), st.floats(-0.6, 0.6)),
       depth=st.floats(0.4, 3.7), seed=SEEDS)
def test_a_map_shows_what_the_camera_would_point_by_point(
    tilt: float, roll: float, yaw: float, high_m: float, step_m: float, moved: tuple[float, float, float],
    depth: float, seed: int,
) -> None:
    mount = CameraMount(high_m, 0.1, tilt, roll, yaw)
    grid = build_floor_grid(CAMERA, mount, high_m - step_m, 9.0)
    assume(grid is not None and np.isfinite(grid.points_robot).all())
    assert grid is not None
    both = TwoPictures(grid, GREY, GREY, Pose2(*moved), CAMERA, mount)
    plane, rng = both.find_map(depth), np.random.default_rng(seed)
    rows, columns = (rng.integers(0, size, 30) for size in grid.shape)
    flat = both.earlier_from_now.apply(grid.eye_robot + depth * (grid.points_robot[rows, columns] - grid.eye_robot))
    points = np.column_stack([flat, np.full(30, mount.height_m - grid.camera_height_m * depth)])
    there = mount.camera_from_robot.apply(points)
    if plane is None:
        return
    assert (there[:, 2] > 0.0).all()
    expected = (CAMERA.project(there) + 0.5) / STEP_PX - 0.5
    found = cv2.perspectiveTransform(np.stack([columns, rows], axis=1)[None].astype(float), plane)[0]
    assert np.allclose(found, expected, rtol=1e-9, atol=1e-6)
