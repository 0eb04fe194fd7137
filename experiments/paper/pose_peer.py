"""PoseLib, the peer of the pose tables, if it is installed."""

from __future__ import annotations

import importlib
from typing import Any

import numpy as np
from numpy.typing import NDArray

from world_models.camera import Camera
from world_models.frames import Pose

Array = NDArray[np.float64]

NOT_INSTALLED = "not installed"


class Peer:
    """PoseLib's two estimators for poses from lines with a prior."""

    def __init__(self, library: Any) -> None:
        self._library = library

    @staticmethod
    def find() -> Peer | None:
        """Import PoseLib; None if it is not installed."""
        try:
            return Peer(importlib.import_module("poselib"))
        except ImportError:
            return None

    def refine(
        self, lines: Array, segments: Array, camera: Camera, prior: Pose, *, loss: str, scale_px: float = 1.0
    ) -> Pose:
        """``refine_absolute_pose_pnpl`` with the loss "TRIVIAL" or "CAUCHY"."""
        options = {"loss_type": loss, "loss_scale": scale_px}
        pose, _ = self._library.refine_absolute_pose_pnpl(
            *_arrays(lines, segments), self._pose(prior), _camera(camera), options, options
        )
        return _to_pose(pose)

    def ransac(self, lines: Array, segments: Array, camera: Camera, prior: Pose, *, max_residual_px: float) -> Pose:
        """``estimate_absolute_pose_pnpl``: LO-RANSAC with the prior, and a final refinement with Cauchy loss."""
        options = {"max_reproj_error": max_residual_px, "max_epipolar_error": max_residual_px, "seed": 0}
        losses = {"loss_type": "CAUCHY", "loss_scale": 0.5 * max_residual_px}
        pose, _ = self._library.estimate_absolute_pose_pnpl(
            *_arrays(lines, segments), _camera(camera), options, losses, self._pose(prior)
        )
        return _to_pose(pose)

    def _pose(self, pose: Pose) -> Any:
        out = self._library.CameraPose()
        out.R, out.t = pose.rotation.copy(), pose.translation.copy()
        return out


def _arrays(lines: Array, segments: Array) -> tuple[Array, ...]:
    parts = (segments[:, 0], segments[:, 1], lines[:, 0], lines[:, 1])
    return (np.zeros((0, 2)), np.zeros((0, 3)), *(np.ascontiguousarray(p, dtype=np.float64) for p in parts))


def _camera(camera: Camera) -> dict[str, Any]:
    return {
        "model": "PINHOLE",
        "width": camera.width,
        "height": camera.height,
        "params": [camera.fx, camera.fy, camera.cx, camera.cy],
    }


def _to_pose(pose: Any) -> Pose:
    return Pose(np.asarray(pose.R), np.asarray(pose.t))
