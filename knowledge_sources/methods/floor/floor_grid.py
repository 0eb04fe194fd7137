"""Which point of the floor each pixel of a picture shows, by the camera's known mounting (inverse perspective)."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from knowledge_sources.methods.arrays import Floats
from world_models.camera import Camera, CameraMount

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
    """

    top: int
    camera_height_m: float
    eye_robot: Floats
    pixels: Floats
    points_robot: Floats
    ranges_m: Floats
    bearings_rad: Floats

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
    return FloorGrid(top, camera_height_m, eye, pixels[top:], points, ranges[top:], bearings)
