"""Calibration from rendered boards: are the reported standard deviations true?

Boards are rendered through a distorting lens by the simulator, whose projection shares no code with the one fitted,
with blur, noise and JPEG. Over many calibrations the errors, in units of their reported standard deviations, must be
normal: 68.3, 95.4 and 99.7 % within 1, 2 and 3.
"""

from __future__ import annotations

import math
import sys

import numpy as np
from numpy.typing import NDArray
from tqdm import tqdm

from experiments.generated.scenes import build_print
from experiments.report import Cell, Report
from harvey_survey.intrinsics import PARAMETERS, BoardView, Calibration, Pattern, calibrate, find_board
from knowledge_sources.methods.features import read_picture
from sim.render.optics import Optics
from sim.render.renderer import Renderer
from sim.render.sensor import SensorParameters, compress_jpeg, expose
from world_models.camera import Camera
from world_models.frames import Pose


def board_renderer(pattern: Pattern) -> Renderer:
    """A renderer of a calibration board, in its own frame, before a wall. It is seen from z < 0."""
    is_black = pattern.draw() == 0
    margin_px = is_black.shape[1] // (pattern.columns + 1)
    return Renderer.of_faces(build_print(is_black, pattern.square_m / margin_px, margin_px), 8)


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


PATTERN = Pattern(7, 5, 0.025)
CAMERA = Camera(402.0, 405.0, 250.3, 259.1, 512, 512, (-0.2, 0.05, 0.001, -0.0005))
VIEWS, SEEDS, QUICK_SEEDS = 20, 20, 3
NORMAL = tuple(math.erf(k / math.sqrt(2.0)) for k in (1, 2, 3))
COLUMNS = ("what", "true", "mean error", "reported sigma", "error / sigma, RMS")
Floats = NDArray[np.float64]


def run(quick: bool, seed: int) -> Report:
    """Calibrate from ``VIEWS`` views each, with seeds ``seed``, ``seed + 1``, ..."""
    seeds = range(seed, seed + (QUICK_SEEDS if quick else SEEDS))
    renderer, optics = board_renderer(PATTERN), Optics.of(CAMERA)
    shown = tqdm(seeds, file=sys.stderr, disable=not sys.stderr.isatty())
    calibrations = [_calibrate(renderer, optics, s) for s in shown]
    truth = np.array([CAMERA.fx, CAMERA.fy, CAMERA.cx, CAMERA.cy, *CAMERA.distortion])[: len(calibrations[0].values)]
    errors = np.array([c.values for c in calibrations]) - truth
    sigmas = np.array([c.deviations for c in calibrations])
    relative = errors / sigmas
    shares = [float(np.mean(np.abs(relative) <= k)) for k in (1, 2, 3)]
    rows: list[tuple[Cell, ...]] = [
        (name, float(true), float(np.mean(error)), float(np.mean(sigma)), float(_rms(off)))
        for name, true, error, sigma, off in zip(PARAMETERS, truth, errors.T, sigmas.T, relative.T, strict=False)]
    rows += [(f"within {k} sigma", f"{100 * n:.1f} %", f"{100 * s:.1f} %", None, None)
             for k, n, s in zip((1, 2, 3), NORMAL, shares, strict=True)]
    noise = float(np.mean([c.rms_px for c in calibrations]) / math.sqrt(2.0))
    return Report(
        "Calibration from rendered boards", COLUMNS, tuple(rows),
        notes=(
            f"{len(seeds)} calibrations, seeds {seeds[0]} to {seeds[-1]}, from {VIEWS} views each of "
            f"{PATTERN.columns} x {PATTERN.rows} inner corners, {CAMERA.width} x {CAMERA.height} px; "
            "blur 0.5 px, noise, JPEG quality 92.",
            f"Corners are found to {noise:.3f} px (one coordinate). Parameters of one calibration are correlated, so "
            f"the shares scatter more than {len(relative) * len(truth)} independent values would.",
            "The last rows: a normal distribution's shares, and the measured ones.",
        ),
        claims=(
            ("every parameter within 4 sigma, in every calibration", bool(np.all(np.abs(relative) <= 4))),
            ("95 % or more within 3 sigma", shares[2] >= 0.95),
            *(() if quick else (
                ("between 55 and 80 % within 1 sigma", 0.55 <= shares[0] <= 0.80),
                ("no parameter's RMS error is over 1.7 sigma", bool(np.max(_rms(relative)) < 1.7)),
            )),
        ),
    )


def _calibrate(renderer: Renderer, optics: Optics, seed: int) -> Calibration:
    rng = np.random.default_rng(seed)
    views: list[BoardView] = []
    while len(views) < VIEWS:
        pose = board_view(CAMERA, PATTERN, rng)
        picture = read_picture(board_picture(renderer, optics, pose, SensorParameters(), rng)).grey
        view = find_board(f"view {len(views)}", picture, PATTERN)
        if isinstance(view, BoardView):
            views.append(view)
    return calibrate(views, PATTERN, (CAMERA.width, CAMERA.height))


def _rms(values: Floats) -> Floats:
    return np.asarray(np.sqrt(np.mean(values**2, axis=0)))
