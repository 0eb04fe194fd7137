"""Matching with all six unknowns of the camera, for a camera that nobody holds level (§6.1)."""

from __future__ import annotations

from typing import Any

from knowledge_sources.methods.matching.freedom import in_space
from knowledge_sources.methods.matching.pose_matching import PosedMatch, Tuning, match_posed
from world_models.camera import Camera
from world_models.frames import Pose


def match_in_space(
    model_lines_world: Any,
    data_px: Any,
    camera: Camera,
    prior: Pose,
    prior_covariance: Any,
    **tuning: float,
) -> PosedMatch:
    """Match model lines to data lines within what the prior allows; see :func:`match_posed`.

    Args:
        model_lines_world: (m, 2, 3) the pieces visible from about the prior [m]. data_px: (k, 2, 2) as seen.
        prior, prior_covariance: ``camera_from_world`` and (6, 6) of its left perturbation (rotation, translation).
        tuning: see :class:`Tuning`.

    Raises:
        ValueError: no model line, or a wrong shape.
    """
    return match_posed(model_lines_world, data_px, camera, in_space(prior, prior_covariance), Tuning(**tuning))
