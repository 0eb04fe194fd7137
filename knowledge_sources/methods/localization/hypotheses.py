"""Pose hypotheses: their weights, and whether the views predicted from them can be told apart."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from knowledge_sources.methods.arrays import Floats
from knowledge_sources.methods.verification.agreement import compute_coverage
from knowledge_sources.methods.verification.predicted_lines import predict_lines
from knowledge_sources.settings import DEFAULT, Settings
from world_models.frames import Pose2
from world_models.robot import RobotModel

PredictView = Callable[[Pose2], Floats]
"""Returns the lines (n, 2, 2) that should be visible from a pose [px]."""


@dataclass(frozen=True, slots=True)
class PoseHypothesis:
    """A pose in a room, and its weight among the hypotheses (they sum to one)."""

    room: str
    world_from_robot: Pose2
    weight: float


def normalize_log_likelihoods(log_likelihoods: Sequence[float]) -> tuple[float, ...]:
    """Turn log likelihoods into weights that sum to one (softmax)."""
    if not log_likelihoods:
        return ()
    best = max(log_likelihoods)
    parts = [math.exp(value - best) for value in log_likelihoods]
    total = math.fsum(parts)
    return tuple(part / total for part in parts)


def make_view_predictor(robot: RobotModel, settings: Settings = DEFAULT) -> PredictView:
    """Return a function that predicts the long and clear lines visible from a pose."""
    def predict(pose: Pose2) -> Floats:
        lines = predict_lines(robot, pose, settings.verification).segments_px
        length = np.linalg.norm(lines[:, 1] - lines[:, 0], axis=1)
        return np.asarray(lines[length >= settings.localization.min_compared_length_px])

    return predict


def compute_view_difference(one: Floats, other: Floats, settings: Settings = DEFAULT) -> float:
    """Compute by how many lines two views (n, 2, 2) and (m, 2, 2) differ: those of either that the other lacks."""
    return math.fsum(_count_missing(a, b, settings) for a, b in ((one, other), (other, one)))


def are_distinguishable(
    ones: Sequence[Floats], others: Sequence[Floats], settings: Settings = DEFAULT, *, clearly: float = 1.0
) -> bool:
    """Whether the views from one pose differ from those from another: all of them together, or one or two clearly.

    A few lines always differ: those just long, near or clear enough to be predicted from one pose only. Of many views
    that are alike and one that is not, all together are alike; so the one or two that differ most count by themselves.

    Args:
        clearly: by how many times as much as is needed they are to differ.
    """
    differ = [compute_view_difference(one, other, settings) for one, other in zip(ones, others, strict=True)]
    lines = [len(one) + len(other) for one, other in zip(ones, others, strict=True)]
    most = sorted(range(len(differ)), key=lambda k: -differ[k])
    clear = settings.localization.clear_difference
    return _is_difference(differ, lines, clearly, settings) or any(
        _is_difference([differ[k] for k in most[:n]], [lines[k] for k in most[:n]], clear, settings) for n in (1, 2))


def _is_difference(differ: Sequence[float], lines: Sequence[int], clearly: float, settings: Settings) -> bool:
    tuning = settings.localization
    least = max(tuning.min_different_lines, tuning.min_different_fraction * math.fsum(lines))
    return math.fsum(differ) >= clearly * least


def _count_missing(one: Floats, other: Floats, settings: Settings) -> float:
    """Number of lines of a view that are not in another; a line that is half there counts half."""
    if not len(one):
        return 0.0
    if not len(other):
        return float(len(one))
    tuning = settings.localization
    covered = compute_coverage(one, other, tuning.same_line_px, tuning.same_line_rad, settings.verification)
    return float(np.sum(1.0 - np.nan_to_num(covered)))
