"""Does a picture show a leaf in an opening, or what is beyond? Colors against the model's, and against each other.

Light is not modelled, so that only ratios of colors count: what is beyond has the model's colors up to one gain. A leaf
has one color from its foot to its head, whatever that is; and where the floor beyond should be seen at the foot of the
opening, there is more of the leaf.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import cv2
import numpy as np

from knowledge_sources.methods.arrays import Floats, Image
from knowledge_sources.methods.doors.opening import Opening
from world_models.robot import RobotModel

MIN_GREY = 6.0  # least median brightness of an opening that is judged [grey levels]
MAX_GREY = 250.0  # a sample is overexposed where one of its colors is brighter [grey levels]
MIN_EXPOSED_SHARE = 0.8  # least share of an opening's samples that are not overexposed, where it is judged
DARK_OFFSET = 4.0  # grey levels added before a ratio of colors is taken, against noise in the dark
MIN_COMPARED = 20  # fewest samples for which the model has a color
MAX_LEAF_BRIGHTNESS = 0.2  # largest difference of log brightness within a leaf
MAX_LEAF_TINT = 0.08  # largest difference of log color, without brightness, within a leaf
MAX_GAIN_BRIGHTNESS = 0.15  # largest difference of log brightness from the model's, up to one gain
MAX_GAIN_TINT = 0.06  # largest difference of log color, without brightness, from the model's, up to one gain
FOOT_M = 0.35  # height of what counts as the foot of an opening
MIN_FOOT_SAMPLES = 8  # fewest samples at the foot, and above it, by which both compare
MIN_FRAME_SAMPLES = 12  # fewest samples round an opening by which it is told whether something stands before it
MIN_FRAME_SHARE = 0.6  # least share of them that has the model's color, up to one gain, where nothing stands before it
MAX_FRAME_LEAF_SHARE = 0.4  # largest share of them that has the color of the opening, where that is a leaf
MAX_LOG_RATIO = 4.5  # most that one picture may add to the log odds of a door: 90 to 1

MAX_COMPARED = 60
"""Samples that the others are compared with."""


@dataclass(frozen=True, slots=True)
class LeafEvidence:
    """What a picture says of an opening.

    Attributes:
        samples: number of samples; compared: of those for which the model has a color.
        uniform: largest share of all samples that have one color, 0..1.
        expected_uniform: the same share of what the model has beyond.
        agreeing: largest share of the compared samples that have the model's color, up to one gain.
        foot: log ratio of the colors at the foot of the opening and above it; NaN where one is not in view.
        expected_foot: the same of what the model has beyond.
        frame: share of the samples round the opening that have the model's color, 0..1; NaN where there are too few.
        frame_leaf: share of them that has the opening's own color.
    """

    samples: int
    compared: int
    uniform: float
    expected_uniform: float
    agreeing: float
    foot: float
    expected_foot: float
    frame: float
    frame_leaf: float

    @property
    def features(self) -> tuple[float, ...]:
        """What the log odds of a leaf are a sum of, each with its weight of :data:`WEIGHTS`."""
        foot = 0.0 if math.isnan(self.foot) else self.foot
        is_expected = not math.isnan(self.foot + self.expected_foot)
        told = min(1.0, self.expected_foot / FULL_FOOT) if is_expected else 0.0
        alike = max(0.0, 1.0 - foot / ALIKE_FOOT)
        one = max(0.0, (self.uniform - LEAST_UNIFORM) / (1.0 - LEAST_UNIFORM))
        return (
            one, one * (1.0 - self.expected_uniform), 1.0 - self.uniform, self.agreeing,
            self.agreeing * (1.0 - self.expected_uniform), told * alike, min(1.0, foot / FULL_FOOT), 1.0)


FULL_FOOT, ALIKE_FOOT, LEAST_UNIFORM = 0.3, 0.2, 0.7
FEATURES = ("one color", "one color where several are expected", "several colors", "as expected",
            "as expected where several are", "no floor beyond", "another color at the foot", "bias")
WEIGHTS = (4.04, 1.33, -3.65, -7.24, -1.59, 2.18, -1.03, 4.79)
"""Of each of the features: logistic regression on 2,305 rendered pictures of doors of generated floors (seeds 2000 to
2109), a third of them with a thing near the door. Of 1,039 open doors none had log odds above 3."""


def measure_opening(
    robot: RobotModel, opening: Opening, image: Image
) -> LeafEvidence | None:
    """Measure an opening in a picture (h, w, 3), as the lens made it, maybe reduced; None where it is too dark or too
    bright: all that is overexposed has one color.
    """
    lens = robot.lens
    pixels = np.concatenate([opening.pixels, opening.frame_pixels])
    at = pixels if lens == robot.camera else lens.project(robot.camera.rays(pixels))
    height, width = image.shape[:2]
    part = (at + 0.5) / (lens.width, lens.height) * (width, height)
    column, row = np.clip(part.astype(np.int64), 0, (width - 1, height - 1)).T
    seen, around = np.split(cv2.blur(image, (3, 3))[row, column].astype(np.float64), [len(opening.pixels)])
    is_exposed = seen.max(axis=1) <= MAX_GREY
    if np.median(seen) < MIN_GREY or is_exposed.mean() < MIN_EXPOSED_SHARE:
        return None
    colors = np.log(seen + DARK_OFFSET)
    compared = opening.is_whole & ~np.isnan(opening.colors[:, 0])
    if np.count_nonzero(compared) < MIN_COMPARED:
        return None
    expected = np.log(255.0 * opening.colors[compared] + DARK_OFFSET)
    frame, frame_leaf = _compare_frame(
        np.log(around + DARK_OFFSET), opening.frame_colors, np.median(colors, axis=0))
    one, other = MAX_LEAF_BRIGHTNESS, MAX_LEAF_TINT
    return LeafEvidence(
        len(colors), len(expected),
        find_largest_share(colors, one, other), find_largest_share(expected, one, other),
        find_largest_share(colors[compared] - expected, MAX_GAIN_BRIGHTNESS, MAX_GAIN_TINT),
        _compare_foot(colors, opening.height_m),
        _compare_foot(expected, opening.height_m[compared]),
        frame, frame_leaf,
    )


def find_largest_share(logs: Floats, brightness: float, tint: float) -> float:
    """The largest part of log colors (n, 3) that are like one of them in brightness and in tint, 0..1."""
    some = logs[np.linspace(0, len(logs) - 1, min(len(logs), MAX_COMPARED)).astype(np.int64)]
    off = logs[:, None] - some[None]
    level = off.mean(axis=2)
    tints = np.abs(off - level[..., None]).max(axis=2)
    return float(((np.abs(level) <= brightness) & (tints <= tint)).mean(axis=0).max())


def _compare_foot(logs: Floats, height_m: Floats) -> float:
    """How different the colors at the foot are from those above; NaN where too few of either are in view."""
    low, high = logs[height_m < FOOT_M], logs[height_m > 2.0 * FOOT_M]
    if min(len(low), len(high)) < MIN_FOOT_SAMPLES:
        return math.nan
    return float(np.abs(np.median(low, axis=0) - np.median(high, axis=0)).max())


def _compare_frame(seen: Floats, colors: Floats, leaf: Floats) -> tuple[float, float]:
    """The shares of what is round an opening that have the model's color and the opening's own; NaN without samples."""
    known = ~np.isnan(colors[:, 0])
    if np.count_nonzero(known) < MIN_FRAME_SAMPLES:
        return math.nan, math.nan
    expected = np.log(255.0 * colors[known] + DARK_OFFSET)
    agreeing = find_largest_share(seen[known] - expected, MAX_GAIN_BRIGHTNESS, MAX_GAIN_TINT)
    off = seen - leaf
    level = off.mean(axis=1)
    tint = np.abs(off - level[:, None]).max(axis=1)
    alike = (np.abs(level) <= MAX_LEAF_BRIGHTNESS) & (tint <= MAX_LEAF_TINT)
    return agreeing, float(alike.mean())


def weigh_leaf(evidence: LeafEvidence) -> float:
    """The log likelihood ratio of a leaf against an open doorway, as much as one picture may say.

    A leaf stands in its frame: where what is round the opening is not as the model has it, or has the color of the
    opening, something may stand before it.
    """
    ratio = float(np.dot(evidence.features, WEIGHTS))
    if ratio > 0.0 and not is_framed(evidence):
        return 0.0
    return min(max(ratio, -MAX_LOG_RATIO), MAX_LOG_RATIO)


def is_framed(evidence: LeafEvidence) -> bool:
    """Whether the opening is seen in its frame of casing and wall."""
    return evidence.frame >= MIN_FRAME_SHARE and evidence.frame_leaf <= MAX_FRAME_LEAF_SHARE


def describe(evidence: LeafEvidence, ratio: float) -> str:
    """What is seen in an opening, in words."""
    if ratio > 0.0:
        foot = "" if math.isnan(evidence.foot) else ", no floor beyond" if evidence.foot < ALIKE_FOOT else ""
        return f"a leaf ({evidence.uniform:.0%} of it of one color{foot})"
    return f"what is beyond ({evidence.agreeing:.0%} of it as the model has it)"
