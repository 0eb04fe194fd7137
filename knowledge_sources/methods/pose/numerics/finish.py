"""What every solver does last: depth signs, reasons, and the prior where the lines do not know better."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from knowledge_sources.methods.pose.estimate import (
    BEHIND,
    DISTANCE,
    NO_LENGTH,
    NO_OVERLAP,
    Array,
    Mask,
    PoseEstimate,
)
from knowledge_sources.methods.pose.line_set import LineSet
from knowledge_sources.methods.pose.numerics.image_error import aspects, find_in_front
from knowledge_sources.methods.pose.numerics.levenberg_marquardt import orthonormal
from world_models.frames import Pose

WEAK_TURN_RAD = 0.3
WEAK_SHIFT_M = 3.0
WEAK_INFORMATION = np.diag([WEAK_TURN_RAD**-2] * 3 + [WEAK_SHIFT_M**-2] * 3)
"""(6, 6) what a prior without a covariance is taken to be worth: too little to move a pose that lines decide."""
WEAK_INFORMATION.setflags(write=False)

FEW_LINES = "fewer than 3 lines: the prior decides the rest"
UNDECIDED = "the lines leave a direction open: the prior decides it"
NOT_BETTER = "no pose fits better than the prior"
ALL_BEHIND = "every pose found lies behind the camera: the prior is returned"
NO_SUBSET = "no subset of lines agrees: the prior is returned"


def open_direction(hessian: Array) -> bool:
    """Whether, in some direction, the lines know less than a weak prior."""
    scale = 1.0 / np.sqrt(np.diag(WEAK_INFORMATION))
    return bool(np.linalg.eigvalsh(hessian * scale[:, None] * scale)[0] < 1.0)


def mostly_in_front(lines: LineSet, rotation: Array, translation: Array) -> bool:
    """Whether more than half of the lines pass in front of the camera."""
    return len(lines) == 0 or 2 * int(np.count_nonzero(find_in_front(lines, rotation, translation))) > len(lines)


def reasons(lines: LineSet, rotation: Array, translation: Array, near: Mask) -> tuple[str | None, ...]:
    """Why each line is no inlier (n); ``near`` (n,) says which are near enough to their model line."""
    _, front, over = aspects(lines, rotation, translation)
    beside = ~over
    tests = ((lines.lengths_px <= 1e-9, NO_LENGTH), (~near, DISTANCE), (~front, BEHIND), (beside, NO_OVERLAP))
    out: list[str | None] = [None] * len(lines)
    for mask, reason in tests:
        for i in np.flatnonzero(mask):
            out[i] = out[i] or reason
    return tuple(out)


def estimate_at(
    lines: LineSet,
    rotation: Array,
    translation: Array,
    covariance: Array,
    rejected: tuple[str | None, ...],
    cost: float,
    iterations: int,
    reason: str | None,
) -> PoseEstimate:
    """The estimate at a pose, with its residuals."""
    return PoseEstimate(
        camera_from_world=Pose(orthonormal(rotation), translation),
        covariance=0.5 * (covariance + covariance.T),
        inliers=np.array([r is None for r in rejected], dtype=bool),
        residuals_px=aspects(lines, rotation, translation)[0],
        rejected=rejected,
        cost=cost,
        iterations=iterations,
        reason=reason,
    )


def prior_estimate(lines: LineSet, prior: Pose, reason: str) -> PoseEstimate:
    """The prior as it came, with the reason why; lines behind it are no inliers."""
    front = find_in_front(lines, prior.rotation, prior.translation)
    rejected = tuple(None if f else BEHIND for f in front)
    covariance = np.linalg.inv(WEAK_INFORMATION)
    return estimate_at(lines, prior.rotation, prior.translation, covariance, rejected, float("inf"), 0, reason)


def all_kept(lines: LineSet, rotation: Array, translation: Array) -> tuple[str | None, ...]:
    """Reasons of a solver that rejects nothing but what lies behind the camera."""
    return tuple(None if f else BEHIND for f in find_in_front(lines, rotation, translation))


def guarded(lines: LineSet, prior: Pose, estimate: PoseEstimate, kept: Mask | None = None) -> PoseEstimate:
    """The estimate if its lines (those ``kept``) lie in front of the camera, else the prior."""
    pose = estimate.camera_from_world
    if mostly_in_front(lines if kept is None else lines.take(kept), pose.rotation, pose.translation):
        return estimate
    return replace(prior_estimate(lines, prior, ALL_BEHIND), iterations=estimate.iterations)
