"""Matching with the floor's own three unknowns: what a robot that carries the camera can do (§6.1)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from knowledge_sources.methods.matching.freedom import on_floor
from knowledge_sources.methods.matching.pose_matching import PosedMatch, Tuning, match_posed
from world_models.camera import Camera
from world_models.frames import Pose, Pose2


@dataclass(frozen=True, slots=True, eq=False)
class FloorMatch(PosedMatch):
    """The best correspondence and where it puts the robot, ``world_from_robot``: refine it with a planar solver."""

    world_from_robot: Pose2


def match_on_floor(
    model_lines_world: Any,
    data_px: Any,
    camera: Camera,
    camera_from_robot: Pose,
    prior: Pose2,
    prior_covariance: Any,
    **tuning: float,
) -> FloorMatch:
    """Match model lines to data lines within what the prior allows; see :func:`match_posed`.

    Args:
        model_lines_world: (m, 2, 3) the pieces visible from about the prior [m]. data_px: (k, 2, 2) as seen.
        camera_from_robot: the mount. prior, prior_covariance: ``world_from_robot`` and (3, 3) of (x, y, heading).
        tuning: see :class:`Tuning`.

    Raises:
        ValueError: no model line, or a wrong shape.
    """
    freedom = on_floor(camera_from_robot, prior, prior_covariance)
    found = match_posed(model_lines_world, data_px, camera, freedom, Tuning(**tuning))
    return FloorMatch(
        found.pairs, found.camera_from_world, found.e_fit, found.e_omission, found.coverage, found.residuals_px,
        freedom.robot(found.camera_from_world),
    )
