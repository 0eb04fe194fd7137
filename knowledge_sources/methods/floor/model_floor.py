"""Which point of the floor each pixel of a picture shows, and where the model has floor there.

The grid is by the camera's known mounting (inverse perspective).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from knowledge_sources.methods.arrays import Floats, Ints
from knowledge_sources.methods.verification import cast_rays
from world_models.camera import Camera, CameraMount
from world_models.frames import Pose2
from world_models.robot import RobotModel
from world_models.visibility.culling import image_window

SIGHT_M = 4.5  # the floor is looked at up to this distance from the camera

STEP_PX = 2
"""The floor is looked at in a picture of half the width and height."""


@dataclass(frozen=True, eq=False)
class FloorGrid:
    """The part of a picture, reduced by STEP_PX, in which the floor may be near enough to be looked at.

    Attributes:
        top: first row of the reduced picture that belongs to it.
        camera_height_m: above the floor; eye_robot: (2,) of the camera in the robot's frame [m].
        pixels: (rows, columns, 2) of the rectified picture [px].
        points_robot: (rows, columns, 2) where they meet the floor, in the robot's frame [m].
        ranges_m: (rows, columns) from the point below the camera.
        bearings_rad: (columns,) from the robot's heading, at the lower border.
        floor_from_pixels: (3, 3) homography from column and row to the floor in the robot's frame [m].
    """

    top: int
    camera_height_m: float
    eye_robot: Floats
    pixels: Floats
    points_robot: Floats
    ranges_m: Floats
    bearings_rad: Floats
    floor_from_pixels: Floats

    @property
    def shape(self) -> tuple[int, int]:
        rows, columns = self.ranges_m.shape
        return rows, columns


@lru_cache(maxsize=8)
def build_floor_grid(
    camera: Camera, mount: CameraMount, camera_height_m: float, max_range_m: float
) -> FloorGrid | None:
    """The grid of a pinhole camera; None where no row of the picture shows floor within the range."""
    u = (np.arange(camera.width // STEP_PX) + 0.5) * STEP_PX - 0.5
    v = (np.arange(camera.height // STEP_PX) + 0.5) * STEP_PX - 0.5
    pixels = np.stack(np.meshgrid(u, v), axis=-1)
    ahead = camera.rays(pixels) @ mount.camera_from_robot.rotation  # rows: directions in the robot's frame
    with np.errstate(divide="ignore", invalid="ignore"):
        far = np.where(ahead[..., 2] < -1e-6, camera_height_m / -ahead[..., 2], np.inf)
        around = ahead[..., :2] * far[..., None]
    ranges = np.hypot(around[..., 0], around[..., 1])
    near = np.flatnonzero((ranges <= max_range_m).any(axis=1))
    if not len(near) or near[-1] != len(v) - 1:
        return None
    top = int(near[0])
    eye = np.array([mount.forward_m, 0.0])
    points = around[top:] + eye
    bearings = np.arctan2(around[-1, :, 1], around[-1, :, 0])
    whole = np.array([[STEP_PX, 0.0, pixels[top, 0, 0]], [0.0, STEP_PX, pixels[top, 0, 1]], [0.0, 0.0, 1.0]])
    x, y, z = mount.camera_from_robot.rotation.T @ np.linalg.inv(camera.matrix) @ whole
    plane = np.stack([camera_height_m * x - eye[0] * z, camera_height_m * y, -z])
    return FloorGrid(top, camera_height_m, eye, pixels[top:], points, ranges[top:], bearings, plane)


MIN_UP = 0.99
"""A surface whose normal has at least this upward part is level."""
DEPTHS_M = ((0.0, 0.6), (0.6, 1.0), (1.0, 2.0), (2.0, 4.0))
"""What of the model is so near moves aside in the picture by the error of the robot's place."""
MIN_DEPTH_M = 0.4
STEP = 2
"""Rays are cast through every second row and column of the grid."""


@dataclass(frozen=True, eq=False)
class ModelFloor:
    """What the model has in the pixels of a :class:`~knowledge_sources.methods.floor.model_floor.FloorGrid`.

    Attributes:
        kinds: (rows, columns) which of ``colours`` the floor there has; -1: no floor.
        colours: (k, 3) shaded, 0..1; NaN: unknown.
        is_plain: (rows, columns) floor, and no other part of the model is near enough to be taken for it.
        ranges_m: (rows, columns) how far away along the floor what the model has is; infinite where it has nothing.
        standing_m: (rows, columns) the same of the nearest that is no floor and near enough to be seen there.
    """

    kinds: Ints
    colours: Floats
    is_plain: NDArray[np.bool_]
    ranges_m: NDArray[np.float32]
    standing_m: NDArray[np.float32]

    @cached_property
    def is_unknown(self) -> NDArray[np.bool_]:
        """(rows, columns) plain floor of a colour that is not known."""
        return np.asarray(self.is_plain & np.append(np.isnan(self.colours).any(axis=1), False)[self.kinds])

    def behind(self, hidden: NDArray[np.bool_]) -> ModelFloor:
        """The same where something before the camera hides some pixels (rows, columns): these show no floor."""
        return replace(self, is_plain=self.is_plain & ~hidden)


def predict_model_floor(
    robot: RobotModel, pose: Pose2, grid: FloorGrid, floor_m: float, rolled_over_m: float, margin_px: float,
    aside_px_m: float = 0.0,
) -> ModelFloor:
    """Predict the floor from a pose.

    Args:
        floor_m: height of the floor [m, world]; what is level and at most ``rolled_over_m`` above it is floor too.
        margin_px: pixels of the picture that are so near to another part of the model are not plain.
        aside_px_m: what is added to that for a part of the model, divided by its depth: the place is not exactly known.
    """
    camera_from_world = robot.camera_from_world(pose)
    nearest_m = max(DEPTHS_M[0][0], MIN_DEPTH_M)
    aside = STEP * (1 + int(np.ceil((margin_px + aside_px_m / nearest_m) / STEP_PX)) // STEP)
    shape = grid.shape[0], grid.shape[1] + 2 * aside
    rays, bounds = _find_rays(robot.camera, grid, aside)
    columns = len(range(0, shape[1], STEP))
    left, top, right, bottom = image_window(robot.camera)
    window = min(left, float(bounds[0])), top, max(right, float(bounds[2])), bottom
    colours, normals, surface, depth = cast_rays(
        robot.world, camera_from_world, rays, bounds, window, columns, 1)
    if not len(colours):
        nothing = np.full(grid.shape, -1)
        nowhere = np.full(grid.shape, np.inf, np.float32)
        return ModelFloor(nothing, np.zeros((0, 3)), nothing >= 0, nowhere, nowhere)
    world_from_camera = camera_from_world.inverse()
    met = np.isfinite(depth)
    heights = np.full(len(rays), np.inf)
    heights[met] = world_from_camera.apply(rays[met] * depth[met, None])[:, 2] - floor_m
    is_floor = met & (normals[surface, 2] > MIN_UP) & (np.abs(heights) <= rolled_over_m)
    keys, kind_of = _find_kinds(colours)
    kinds = _spread(np.where(is_floor, kind_of[surface], -1), columns, shape)
    depths = _spread(np.where(is_floor, np.inf, depth), columns, shape)
    away = np.full(len(rays), np.inf, np.float32)
    away[met] = np.linalg.norm(world_from_camera.apply(rays[met] * depth[met, None])[:, :2]
                               - world_from_camera.translation[:2], axis=1)
    ranges_m = _spread(away, columns, shape)
    upright_m = np.where(np.isfinite(depths), ranges_m, np.float32(np.inf))
    is_plain, standing_m = _find_plain(kinds, margin_px), _find_least(upright_m, margin_px)
    for least_m, most_m in DEPTHS_M:
        near = ((depths > least_m) & (depths <= most_m)).astype(np.uint8)
        if aside_px_m > 0.0 and near.any():
            half = int(np.ceil((margin_px + aside_px_m / max(least_m, MIN_DEPTH_M)) / STEP_PX))
            beside = np.ones((1, 2 * half + 1), np.uint8)
            is_plain &= cv2.dilate(near, beside) == 0
            own_m = np.where(near > 0, upright_m, np.float32(np.inf))
            standing_m = np.minimum(standing_m, cv2.erode(own_m, beside))
    inner = np.s_[:, aside:-aside]
    return ModelFloor(kinds[inner], keys, is_plain[inner], ranges_m[inner], standing_m[inner])


@lru_cache(maxsize=8)
def _find_rays(camera: Camera, grid: FloorGrid, aside: int) -> tuple[Floats, Floats]:
    """(n, 3) with z = 1, also ``aside`` pixels outside of the picture; and their least and largest x and y (4,)."""
    rays = np.ascontiguousarray(camera.rays(_widen(grid.pixels, aside)[::STEP, ::STEP].reshape(-1, 2)))
    return rays, np.concatenate([rays[:, :2].min(axis=0), rays[:, :2].max(axis=0)])


def _spread(values: NDArray[Any], columns: int, shape: tuple[int, int]) -> NDArray[Any]:
    """(rows, columns) of values (n,) of the rays that are cast."""
    cast = values.reshape(-1, columns)
    return np.repeat(np.repeat(cast, STEP, axis=0), STEP, axis=1)[: shape[0], : shape[1]]


def _find_kinds(colours: Floats) -> tuple[Floats, Ints]:
    """(k, 3) the different ones of colours (n, 3), in order, and (n,) which of them each is; the unknown ones are one.

    As numpy's unique along an axis, but a tenth of its time for the few surfaces that are in sight.
    """
    rows = [tuple(row) for row in np.nan_to_num(np.round(colours, 4), nan=-1.0).tolist()]
    keys = sorted(set(rows))
    number = {key: k for k, key in enumerate(keys)}
    different = np.array(keys)
    return np.where(different < 0.0, np.nan, different), np.array([number[row] for row in rows], np.int64)


def _widen(pixels: Floats, count: int) -> Floats:
    """(rows, columns + 2 count, 2) pixels of a grid, with more columns on both sides."""
    u = pixels[0, 0, 0] + np.arange(-count, pixels.shape[1] + count) * (pixels[0, 1, 0] - pixels[0, 0, 0])
    return np.stack(np.meshgrid(u, pixels[:, 0, 1]), axis=-1)


def _find_plain(kinds: Ints, margin_px: float) -> NDArray[np.bool_]:
    """Pixels round which all have the same kind of floor; above and below the picture it goes on."""
    mask = _square(margin_px)
    values = (kinds + 1).astype(np.float32)
    low = cv2.erode(values, mask, borderType=cv2.BORDER_REPLICATE)
    high = cv2.dilate(values, mask, borderType=cv2.BORDER_REPLICATE)
    return np.asarray((low == high) & (kinds >= 0))


def _find_least(values: NDArray[np.float32], margin_px: float) -> NDArray[np.float32]:
    """The least of values (rows, columns) round each pixel."""
    return np.asarray(cv2.erode(values, _square(margin_px), borderType=cv2.BORDER_REPLICATE), np.float32)


def _square(margin_px: float) -> NDArray[np.uint8]:
    side = 2 * (int(np.ceil(margin_px / STEP_PX)) + STEP // 2) + 1
    return np.ones((side, side), np.uint8)
