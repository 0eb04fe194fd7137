"""Is the robot at this pose, by the colors of faces? Predicted colors against those of the picture (§1.2).

Light is not modelled, so only ratios of colors are compared: one gain for each channel is free. Each face is measured
in the region of the segmented picture that holds most of its points, so that occluders do not count. The same test
with the model's colors given to the wrong faces tells how much agrees by chance.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from knowledge_sources.methods.arrays import Floats, Image, Ints
from knowledge_sources.methods.features import segment_regions
from knowledge_sources.methods.verification.predicted_colors import BORDER_MARGIN_PX, MIN_FACE_POINTS, FaceColor
from world_models.camera import NEAR_PLANE_M
from world_models.frames import Pose2
from world_models.robot import RobotModel

REGION_IMAGE_PX = 64  # side of the reduced picture that is segmented into regions
MIN_REGION_AREA_PX = 8  # smallest region of the reduced picture [px of area]
MAX_BRIGHTNESS_LOG_RATIO = 0.3  # largest difference of log brightness of two faces that agree
MAX_TINT_LOG_RATIO = 0.1  # largest difference of log color, without brightness, of two faces that agree
MIN_COLOR_FACES = 3  # fewest faces by which colors are testable
MAX_COLOR_CHANCE = 0.8  # largest part of the faces that may agree by chance where colors are testable
DARK_OFFSET = 4.0  # grey levels added before a ratio of colors is taken, against noise in the dark


@dataclass(frozen=True, slots=True)
class ColorCheck:
    """What a picture says of the colors of the faces that should be visible.

    Attributes:
        count: number of faces that were compared.
        agreeing: part of them that has the model's color, 0..1.
        chance: part of them that has another face's color, 0..1.
        is_testable: whether enough faces, and of different colors, were compared.
    """

    count: int
    agreeing: float
    chance: float
    is_testable: bool


NOT_TESTED = ColorCheck(0, 0.0, 0.0, is_testable=False)
"""Too few faces to compare."""


def check_colors(
    robot: RobotModel, pose: Pose2, image: Image, face_colors: Sequence[FaceColor]
) -> ColorCheck:
    """Compare a picture with the face colors predicted from a pose.

    Args:
        image: (h, w, 3) as the lens made it, maybe reduced.
        face_colors: from :func:`~knowledge_sources.methods.verification.predicted_colors.predict_face_colors`.
    """
    if not face_colors:
        return NOT_TESTED
    face = np.repeat(np.arange(len(face_colors)), [len(points) for _, points in face_colors])
    points = robot.camera_from_world(pose).apply(np.array([p for _, points in face_colors for p in points]))
    ahead = points[:, 2] > NEAR_PLANE_M
    pixels = robot.lens.project(np.where(ahead[:, None], points, (0.0, 0.0, 1.0)))
    inside = ahead & robot.lens.inside(pixels, BORDER_MARGIN_PX)
    if not inside.any():
        return NOT_TESTED
    parts = (pixels[inside] + 0.5) / (robot.lens.width, robot.lens.height)
    side = REGION_IMAGE_PX
    tiny = cv2.resize(image, (side, side), interpolation=cv2.INTER_AREA).mean(axis=2)
    labels = segment_regions(tiny, sector_px=side, min_area_px=MIN_REGION_AREA_PX)
    smooth = np.asarray(cv2.blur(image, (3, 3)), np.float64)
    colors = np.array([color for color, _ in face_colors])
    return _measure(_sample(smooth, parts), _sample(labels, parts), face[inside], colors)


def predict_color_check(face_colors: Sequence[FaceColor]) -> ColorCheck:
    """Predict the check of a picture in which all faces have the model's colors."""
    if len(face_colors) < MIN_COLOR_FACES:
        return NOT_TESTED
    expected = _log(np.array([color for color, _ in face_colors]))
    return _compare(expected, expected)


def _sample(image: NDArray[Any], parts: Floats) -> NDArray[Any]:
    """The pixels at places given as parts (n, 2) of the width and the height."""
    height, width = image.shape[:2]
    column, row = np.minimum((parts * (width, height)).astype(np.int64), (width - 1, height - 1)).T
    return np.asarray(image[row, column])


def _measure(seen: Floats, labels: NDArray[np.int32], face: Ints, colors: Floats) -> ColorCheck:
    """From the colors (n, 3) and regions (n,) seen at points of faces (n,), and the colors (f, 3) of the faces."""
    tested = [f for f in range(len(colors)) if np.count_nonzero(face == f) >= MIN_FACE_POINTS]
    if len(tested) < MIN_COLOR_FACES:
        return NOT_TESTED
    own = []
    for f in tested:
        mine = np.flatnonzero(face == f)
        most = np.bincount(labels[mine]).argmax()
        ordered = np.sort(seen[mine[labels[mine] == most]], axis=0)  # the median: np.median is slow for so few
        own.append(0.5 * (ordered[(len(ordered) - 1) // 2] + ordered[len(ordered) // 2]))
    return _compare(np.log(np.array(own) + DARK_OFFSET), _log(colors[tested]))


def _log(colors: Floats) -> Floats:
    return np.asarray(np.log(255.0 * colors + DARK_OFFSET))


def _compare(measured: Floats, expected: Floats) -> ColorCheck:
    """From the log colors (f, 3) of faces as measured and as expected: expected ones are also permuted cyclically."""
    permuted = np.stack([np.roll(expected, shift, axis=0) for shift in range(len(expected))])
    agreeing = _count_agreeing(measured - permuted)
    chance = float(np.mean(agreeing[1:]))
    is_testable = len(expected) >= MIN_COLOR_FACES and chance <= MAX_COLOR_CHANCE
    return ColorCheck(len(expected), float(agreeing[0]), chance, is_testable)


def _count_agreeing(ratios: Floats) -> Floats:
    """(s,) the largest part of the faces whose log ratios (s, f, 3) are those of one of them."""
    off = ratios[:, :, None] - ratios[:, None]
    brightness = off.mean(axis=3)
    tints = np.abs(off - brightness[..., None]).max(axis=3)
    agree = (np.abs(brightness) <= MAX_BRIGHTNESS_LOG_RATIO) & (tints <= MAX_TINT_LOG_RATIO)
    return np.asarray(agree.mean(axis=2).max(axis=1))
