"""The last steps of every solver: sign of the depths, rejections, and the prior where it is better."""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache

import numpy as np

from knowledge_sources.methods.arrays import Floats, Mask
from knowledge_sources.methods.pose.estimate import BEHIND, DISTANCE, NO_LENGTH, NO_OVERLAP, PoseEstimate
from knowledge_sources.methods.pose.line_set import LineSet
from knowledge_sources.methods.pose.numerics.image_error import find_in_front, measure_lines
from knowledge_sources.methods.pose.numerics.levenberg_marquardt import orthonormalise
from knowledge_sources.settings.pose import PoseSettings
from world_models.frames import Pose, frozen

FEW_LINES = "fewer than 3 lines: the prior decides the rest"
UNDECIDED = "the lines leave a direction open: the prior decides it"
NOT_BETTER = "no pose fits better than the prior"
ALL_BEHIND = "every pose found lies behind the camera: the prior is returned"
NO_SUBSET = "no subset of lines agrees: the prior is returned"

MIN_LENGTH_PX = 1e-9
"""A shorter segment has no direction."""


def compute_weak_information(settings: PoseSettings) -> Floats:
    """(6, 6) information of a prior without a covariance: too little to move a pose that lines decide. Read-only."""
    return _compute_weak_information(settings.weak_rotation_rad, settings.weak_translation_m)


@lru_cache(maxsize=8)
def _compute_weak_information(rotation_rad: float, translation_m: float) -> Floats:
    return frozen(np.diag([rotation_rad**-2] * 3 + [translation_m**-2] * 3))


def has_open_direction(hessian: Floats, settings: PoseSettings) -> bool:
    """Whether, in some direction, the lines know less than a weak prior."""
    scale = 1.0 / np.sqrt(np.diag(compute_weak_information(settings)))
    return bool(np.linalg.eigvalsh(hessian * scale[:, None] * scale)[0] < 1.0)


def is_mostly_in_front(lines: LineSet, rotation: Floats, translation: Floats) -> bool:
    """Whether more than half of the lines pass in front of the camera."""
    return len(lines) == 0 or 2 * int(np.count_nonzero(find_in_front(lines, rotation, translation))) > len(lines)


def find_rejections(
    lines: LineSet, rotation: Floats, translation: Floats, near: Mask, settings: PoseSettings
) -> tuple[str | None, ...]:
    """Why each line is no inlier (n); ``near`` (n,) says which are near enough to their model line."""
    _, front, overlap = measure_lines(lines, rotation, translation, settings.max_beside_px)
    tests = (
        (lines.lengths_px <= MIN_LENGTH_PX, NO_LENGTH), (~near, DISTANCE), (~front, BEHIND), (~overlap, NO_OVERLAP)
    )
    out: list[str | None] = [None] * len(lines)
    for mask, reason in tests:
        for i in np.flatnonzero(mask):
            out[i] = out[i] or reason
    return tuple(out)


def reject_behind(lines: LineSet, rotation: Floats, translation: Floats) -> tuple[str | None, ...]:
    """Reasons of a solver that rejects only what lies behind the camera."""
    return tuple(None if f else BEHIND for f in find_in_front(lines, rotation, translation))


def build_estimate(
    lines: LineSet,
    rotation: Floats,
    translation: Floats,
    covariance: Floats,
    rejected: tuple[str | None, ...],
    cost: float,
    iterations: int,
    reason: str | None,
) -> PoseEstimate:
    """The estimate at a pose, with its residuals."""
    return PoseEstimate(
        camera_from_world=Pose(orthonormalise(rotation), translation),
        covariance=0.5 * (covariance + covariance.T),
        inliers=np.array([r is None for r in rejected], dtype=bool),
        residuals_px=measure_lines(lines, rotation, translation)[0],
        rejected=rejected,
        cost=cost,
        iterations=iterations,
        reason=reason,
    )


def build_prior_estimate(lines: LineSet, prior: Pose, reason: str, settings: PoseSettings) -> PoseEstimate:
    """The prior unchanged, with the reason why; lines behind it are no inliers."""
    rejected = reject_behind(lines, prior.rotation, prior.translation)
    covariance = np.asarray(np.linalg.inv(compute_weak_information(settings)), float)
    return build_estimate(lines, prior.rotation, prior.translation, covariance, rejected, float("inf"), 0, reason)


def check_in_front(
    lines: LineSet, prior: Pose, estimate: PoseEstimate, settings: PoseSettings, kept: Mask | None = None
) -> PoseEstimate:
    """The estimate if most of its lines (those ``kept``) lie in front of the camera, else the prior."""
    pose = estimate.camera_from_world
    if is_mostly_in_front(lines if kept is None else lines.take(kept), pose.rotation, pose.translation):
        return estimate
    return replace(build_prior_estimate(lines, prior, ALL_BEHIND, settings), iterations=estimate.iterations)
