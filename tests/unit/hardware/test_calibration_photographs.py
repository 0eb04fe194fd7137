"""Calibration of real photographs: OpenCV's samples of a chessboard, 640 x 480, left and right camera of a pair.

They are in `opencv/samples/data` of the source distribution of opencv-python-headless: unpack it and name that folder
in OPENCV_SAMPLES.
"""

from __future__ import annotations

import os
from pathlib import Path

import cv2
import numpy as np
import pytest

from knowledge_sources.methods.calibration import BoardView, Calibration, Pattern, calibrate, find_corners

FOLDER = Path(os.environ.get("OPENCV_SAMPLES", "no folder"))
PATTERN = Pattern(9, 6, 0.025)

pytestmark = pytest.mark.skipif(not FOLDER.is_dir(), reason="OPENCV_SAMPLES names no folder of chessboard photographs")


def views_of(side: str) -> list[BoardView]:
    paths = sorted(FOLDER.glob(f"{side}[0-9][0-9].jpg"))
    assert len(paths) == 13
    found = [(path.name, find_corners(cv2.imread(str(path), cv2.IMREAD_GRAYSCALE), PATTERN)) for path in paths]
    return [BoardView(name, corners) for name, corners in found if not isinstance(corners, str)]


def calibrated(views: list[BoardView], *, with_k3: bool = False) -> Calibration:
    return calibrate(views, PATTERN, (640, 480), with_k3=with_k3)


@pytest.mark.parametrize("side", ["left", "right"])
def test_every_board_is_found_and_fits(side: str) -> None:
    views = views_of(side)
    assert len(views) == 13
    found = calibrated(views)
    assert found.rms_px < 0.2 and len(found.rejected) <= 1


@pytest.mark.parametrize("side", ["left", "right"])
def test_two_halves_of_the_photographs_agree_as_they_say(side: str) -> None:
    """Nobody knows the true camera: but two calibrations that share no photograph must agree within what they tell."""
    views = views_of(side)
    first, second = calibrated(views[::2]), calibrated(views[1::2])
    sigma = np.hypot(first.deviations, second.deviations)
    apart = np.abs(first.values - second.values) / sigma
    assert np.all(apart < 3.0)


def test_the_camera_is_the_one_that_opencv_publishes() -> None:
    theirs = cv2.FileStorage(str(FOLDER / "left_intrinsics.yml"), cv2.FILE_STORAGE_READ)
    matrix = theirs.getNode("camera_matrix").mat()
    theirs.release()
    found = calibrated(views_of("left"), with_k3=True)
    expected = np.array([matrix[0, 0], matrix[1, 1], matrix[0, 2], matrix[1, 2]])
    assert np.all(np.abs(found.values[:4] - expected) < 3.0)
