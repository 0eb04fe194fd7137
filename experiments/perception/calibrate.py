"""Calibration on chessboards whose camera is known: are the deviations that it tells true?

Boards are rendered through a distorting lens by the simulator, whose projection is not the one that is fitted, with
blur, noise and JPEG. Over many calibrations the errors, in units of the deviations that came with them, must be
those of a normal distribution: 68.3, 95.4 and 99.7 % within 1, 2 and 3.
"""

from __future__ import annotations

import math
import sys

import numpy as np
from numpy.typing import NDArray
from tqdm import tqdm

from experiments.report import Cell, Report
from knowledge_sources.methods.calibration.chessboard import Pattern, find_corners
from knowledge_sources.methods.calibration.intrinsics import PARAMETERS, BoardView, Calibration, calibrate
from knowledge_sources.methods.features.images import decode
from sim.made_up.chessboard import chessboard_picture, chessboard_renderer, chessboard_view
from sim.render.optics import Optics
from sim.render.renderer import Renderer
from sim.render.sensor import SensorParameters
from world_models.camera import Camera

PATTERN = Pattern(9, 6, 0.025)
CAMERA = Camera(402.0, 405.0, 250.3, 259.1, 512, 512, (-0.2, 0.05, 0.001, -0.0005))
VIEWS, SEEDS, QUICK_SEEDS = 20, 20, 3
NORMAL = tuple(math.erf(k / math.sqrt(2.0)) for k in (1, 2, 3))
COLUMNS = ("what", "true", "mean error", "told deviation", "error / deviation, RMS")
Floats = NDArray[np.float64]


def run(quick: bool, seed: int) -> Report:
    """Calibrations from ``VIEWS`` views each, seeds ``seed``, ``seed + 1``, ..."""
    seeds = range(seed, seed + (QUICK_SEEDS if quick else SEEDS))
    renderer, optics = chessboard_renderer(PATTERN.columns, PATTERN.rows, PATTERN.square_m), Optics.of(CAMERA)
    done = [_calibrated(renderer, optics, s) for s in tqdm(seeds, file=sys.stderr, disable=not sys.stderr.isatty())]
    truth = np.array([CAMERA.fx, CAMERA.fy, CAMERA.cx, CAMERA.cy, *CAMERA.distortion])[: len(done[0].values)]
    errors = np.array([c.values for c in done]) - truth
    told = np.array([c.deviations for c in done])
    relative = errors / told
    shares = [float(np.mean(np.abs(relative) <= k)) for k in (1, 2, 3)]
    rows = [_row(*cells) for cells in zip(PARAMETERS, truth, errors.T, told.T, relative.T, strict=False)]
    rows += [(f"within {k} deviations", f"{100 * n:.1f} %", f"{100 * s:.1f} %", None, None)
             for k, n, s in zip((1, 2, 3), NORMAL, shares, strict=True)]
    noise = float(np.mean([c.sigma_px for c in done]))
    return Report(
        "Calibration from rendered chessboards", COLUMNS, tuple(rows),
        notes=(
            f"{len(seeds)} calibrations, seeds {seeds[0]} to {seeds[-1]}, from {VIEWS} views each of "
            f"{PATTERN.columns} x {PATTERN.rows} inner corners, {CAMERA.width} x {CAMERA.height} px; "
            "blur 0.5 px, noise, JPEG quality 92.",
            f"Corners are found to {noise:.3f} px (one coordinate). Parameters of one calibration hang together, so "
            f"the shares scatter more than {len(relative) * len(truth)} independent values would.",
            "The last rows: what a normal distribution would have, and what was found.",
        ),
        claims=(
            ("every parameter within 4 of its told deviations, every time", bool(np.all(np.abs(relative) <= 4))),
            ("95 % or more within 3 deviations", shares[2] >= 0.95),
            ("between 55 and 80 % within 1 deviation", 0.55 <= shares[0] <= 0.80 or quick),
            ("no parameter's errors are over 1.7 times what was told", quick or bool(np.max(_rms(relative)) < 1.7)),
        ),
    )


def _calibrated(renderer: Renderer, optics: Optics, seed: int) -> Calibration:
    rng = np.random.default_rng(seed)
    views: list[BoardView] = []
    while len(views) < VIEWS:
        pose = chessboard_view(CAMERA, PATTERN.columns, PATTERN.rows, PATTERN.square_m, rng)
        picture = decode(chessboard_picture(renderer, optics, pose, SensorParameters(), rng))
        corners = find_corners(picture, PATTERN)
        if not isinstance(corners, str):
            views.append(BoardView(f"view {len(views)}", corners))
    return calibrate(views, PATTERN, (CAMERA.width, CAMERA.height))


def _row(name: str, true: float, errors: Floats, told: Floats, relative: Floats) -> tuple[Cell, ...]:
    return name, float(true), float(np.mean(errors)), float(np.mean(told)), float(_rms(relative))


def _rms(values: Floats) -> Floats:
    return np.asarray(np.sqrt(np.mean(values**2, axis=0)))
