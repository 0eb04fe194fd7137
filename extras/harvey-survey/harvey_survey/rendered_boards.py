"""A calibration board before a camera, as the simulator's renderer draws it: pictures with a known camera."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from experiments.generated.scenes import Patch, PatchFace
from harvey_survey.intrinsics import Pattern
from sim.render.optics import Optics
from sim.render.renderer import Renderer
from sim.render.sensor import SensorParameters, compress_jpeg, expose
from world_models.camera import Camera
from world_models.frames import Pose

UNIFORM_SCALE_M = 1e6
"""Texture scale at which a plain surface has one colour."""
WHITE, BLACK, WALL = (0.75, 0.75, 0.75), (0.05, 0.05, 0.05), (0.4, 0.4, 0.4)


def board_renderer(pattern: Pattern, samples: int = 8) -> Renderer:
    """A renderer of a calibration board, in its own frame, before a wall. It is seen from z < 0."""
    is_black = pattern.draw() == 0
    pixel_m = pattern.square_m * (pattern.columns + 1) / is_black.shape[1]

    def rectangle(x0: float, y0: float, x1: float, y1: float) -> Any:
        return pixel_m * np.array([(x0, y0, 0.0), (x0, y1, 0.0), (x1, y1, 0.0), (x1, y0, 0.0)])

    high, wide = is_black.shape
    margin = wide // (pattern.columns + 1)
    paper = Patch("paper", rectangle(-margin, -margin, wide + margin, high + margin), WHITE, "plain", UNIFORM_SCALE_M)
    black = [Patch(f"{number}", rectangle(*block), BLACK, "plain", UNIFORM_SCALE_M)
             for number, block in enumerate(_find_blocks(is_black))]
    far_m = [(-40.0, -40.0, 9.0), (-40.0, 40.0, 9.0), (40.0, 40.0, 9.0), (40.0, -40.0, 9.0)]
    wall = Patch("wall", far_m, WALL, "plain", UNIFORM_SCALE_M)
    return Renderer.of_faces((PatchFace((wall,)), PatchFace((paper, *black))), samples)


def _find_blocks(is_black: NDArray[np.bool_]) -> list[tuple[int, int, int, int]]:
    """Rectangles (left, top, right, bottom) that make up what is black: a run of a row, with the same below it."""
    blocks: list[tuple[int, int, int, int]] = []
    began = dict[tuple[int, int], int]()
    for y, row in enumerate([*is_black, np.zeros_like(is_black[0])]):
        edges = np.flatnonzero(np.diff(row.astype(int), prepend=0, append=0)).tolist()
        runs = set(zip(edges[::2], edges[1::2], strict=True))
        blocks += [(left, began.pop((left, right)), right, y) for left, right in began.keys() - runs]
        began |= dict.fromkeys(runs - began.keys(), y)
    return blocks


def board_view(camera: Camera, pattern: Pattern, rng: np.random.Generator) -> Pose:
    """A random ``camera_from_board``, as a person holds a board.

    The board is 35 % to 80 % as wide as the picture, tilted by up to 45 degrees, turned a little, and wholly visible.
    """
    wide_m, high_m = pattern.square_m * (pattern.columns + 1), pattern.square_m * (pattern.rows + 1)
    outer = np.array([(x, y, 0.0) for x in (0.0, wide_m) for y in (0.0, high_m)])
    while True:
        way, tilt, turn = rng.uniform(-math.pi, math.pi), rng.uniform(0.0, 0.8), rng.normal(0.0, 0.15)
        leaning = Pose.from_rotation_vector(tilt * np.array([math.cos(way), math.sin(way), 0.0]), np.zeros(3))
        turned = Pose.from_rotation_vector(np.array([0.0, 0.0, turn]), np.zeros(3))
        depth_m = camera.fx * wide_m / (camera.width * rng.uniform(0.35, 0.8))
        aside = camera.rays(rng.uniform(0.1, 0.9, 2) * (camera.width, camera.height)) * depth_m
        there = leaning @ turned
        pose = Pose(there.rotation, aside - there.rotation @ outer.mean(axis=0))
        shown = pose.apply(outer)
        if np.all(shown[:, 2] > 0.1) and np.all(camera.inside(camera.project(shown), 4.0)):
            return pose


def board_picture(
    renderer: Renderer, optics: Optics, camera_from_board: Pose, sensor: SensorParameters, rng: np.random.Generator
) -> bytes:
    """The JPEG bytes of a picture of the board."""
    return compress_jpeg(expose(optics.radiance(renderer, camera_from_board), sensor, rng), sensor.jpeg_quality)
