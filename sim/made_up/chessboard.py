"""A chessboard before a camera, in views as a person would take them, for tests of the calibration."""

from __future__ import annotations

import math

import numpy as np

from sim.made_up.box_room import Patch, PatchFace
from sim.render.optics import Optics
from sim.render.renderer import Renderer
from sim.render.sensor import SensorParameters, compress_jpeg, expose
from world_models.camera import Camera
from world_models.frames import Pose

UNIFORM_SCALE_M = 1e6
"""Texture scale at which a plain surface has one colour."""
WHITE, BLACK, WALL = (0.75, 0.75, 0.75), (0.05, 0.05, 0.05), (0.4, 0.4, 0.4)


def chessboard_renderer(columns: int, rows: int, square_m: float, samples: int = 8) -> Renderer:
    """A renderer of a board with (columns, rows) inner corners, before a wall.

    Board frame: the plane z = 0, origin at the first inner corner, x along a row. It is seen from z < 0, with x to the
    right and y down.
    """
    def rectangle(x0: float, y0: float, x1: float, y1: float, z: float) -> np.ndarray:
        return np.array([(x0, y0, z), (x0, y1, z), (x1, y1, z), (x1, y0, z)])

    low, wide, high = -1.9, columns + 0.9, rows + 0.9
    paper = Patch("paper", square_m * rectangle(low, low, wide, high, 0.0), WHITE, "plain", UNIFORM_SCALE_M)
    squares = [
        Patch(f"{i}-{j}", square_m * rectangle(i, j, i + 1, j + 1, 0.0), BLACK, "plain", UNIFORM_SCALE_M)
        for i in range(-1, columns) for j in range(-1, rows) if (i + j) % 2 == 0
    ]
    wall = Patch("wall", rectangle(-40.0, -40.0, 40.0, 40.0, 9.0), WALL, "plain", UNIFORM_SCALE_M)
    return Renderer.of_faces((PatchFace((wall,)), PatchFace((paper, *squares))), samples)


def chessboard_view(
    camera: Camera, columns: int, rows: int, square_m: float, rng: np.random.Generator, reach: float = 1.0
) -> Pose:
    """A random ``camera_from_board``, as a person holds a board.

    The board is 35 % to 80 % as wide as the picture, tilted by up to 45 degrees, turned a little, and wholly visible.
    ``reach`` is the part of the margin at the border that it may enter: 1 leaves 4 px.
    """
    outer = np.array([(x, y, 0.0) for x in (-1.0, columns) for y in (-1.0, rows)]) * square_m
    middle = outer.mean(axis=0)
    while True:
        way, tilt, turn = rng.uniform(-math.pi, math.pi), rng.uniform(0.0, 0.8), rng.normal(0.0, 0.15)
        leaning = Pose.from_rotation_vector(tilt * np.array([math.cos(way), math.sin(way), 0.0]), np.zeros(3))
        turned = Pose.from_rotation_vector(np.array([0.0, 0.0, turn]), np.zeros(3))
        depth_m = camera.fx * (columns + 1) * square_m / (camera.width * rng.uniform(0.35, 0.8))
        aside = camera.rays(rng.uniform(0.1, 0.9, 2) * (camera.width, camera.height)) * depth_m
        there = leaning @ turned
        pose = Pose(there.rotation, aside - there.rotation @ middle)
        shown = pose.apply(outer)
        if np.all(shown[:, 2] > 0.1) and np.all(camera.inside(camera.project(shown), 4.0 / reach)):
            return pose


def chessboard_picture(
    renderer: Renderer, optics: Optics, camera_from_board: Pose, sensor: SensorParameters, rng: np.random.Generator
) -> bytes:
    """The JPEG bytes of a picture of the board."""
    return compress_jpeg(expose(optics.radiance(renderer, camera_from_board), sensor, rng), sensor.jpeg_quality)
