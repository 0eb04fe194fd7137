"""The results of the pose solvers."""

from __future__ import annotations

from dataclasses import dataclass

from knowledge_sources.methods.arrays import Floats, Mask
from world_models.frames import Pose, Pose2

DISTANCE = "too far from the model line"
BEHIND = "behind the camera"
NO_OVERLAP = "beside the model line's ends"
NO_LENGTH = "segment without length"


@dataclass(frozen=True, slots=True, eq=False)
class PoseEstimate:
    """A camera pose from n matched lines.

    Attributes:
        camera_from_world: the pose.
        covariance: (6, 6) of the left perturbation (rotation [rad], translation [m]) of :meth:`Pose.perturbed`.
        inliers: (n,) the lines that decided the pose.
        residuals_px: (n, 2) signed distances of the (undistorted) segment ends to the projected model line [px].
        rejected: n reasons, ``None`` for an inlier.
        cost: the solver's own objective at the pose.
        iterations: Levenberg-Marquardt steps taken.
        reason: ``None`` if the lines decided the pose; else why the prior did, wholly or in part.
    """

    camera_from_world: Pose
    covariance: Floats
    inliers: Mask
    residuals_px: Floats
    rejected: tuple[str | None, ...]
    cost: float = 0.0
    iterations: int = 0
    reason: str | None = None

    @property
    def ok(self) -> bool:
        """Whether the lines alone decided the pose."""
        return self.reason is None


@dataclass(frozen=True, slots=True, eq=False)
class PlanarEstimate:
    """A robot pose on the floor from n matched lines or points.

    Attributes:
        world_from_robot: the pose.
        covariance: (3, 3) of (x [m], y [m], heading [rad]).
        inliers: (n,) the lines or points that decided the pose.
        residuals_px: (n, 2) signed; lines: distances of both segment ends to the projected model line,
            points: u and v [px].
        rejected: n reasons, ``None`` for an inlier.
        cost: squared residuals over their variance, each at most the rejection bound, plus the prior's share.
        reason: ``None`` if the image decided the pose; else why the prior did, wholly or in part.
    """

    world_from_robot: Pose2
    covariance: Floats
    inliers: Mask
    residuals_px: Floats
    rejected: tuple[str | None, ...]
    cost: float = 0.0
    reason: str | None = None

    @property
    def ok(self) -> bool:
        """Whether the image alone (with the prior covariance, if one was given) decided the pose."""
        return self.reason is None
