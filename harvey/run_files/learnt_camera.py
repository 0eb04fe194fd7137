"""The camera as a run has learnt it, as a camera file: what ``harvey calibrate`` writes, for the next mission."""

from __future__ import annotations

import math

from world_models.camera import CameraDeviation
from world_models.entries.robot import CameraState
from world_models.files.toml.camera_file import camera_text


def build_camera_text(camera: CameraState, mission: str) -> str:
    """The text of a camera file with what was learnt, and its standard deviations."""
    if not camera.covariance:
        raise ValueError("expected a camera of which something was learnt, got one as told")
    tilt, roll, yaw, height, focal, _, _ = (math.sqrt(row[i]) for i, row in enumerate(camera.covariance))
    deviation = CameraDeviation(tilt, height, camera.sigma_forward_m, focal, roll, yaw)
    notes = (f"learnt in the mission {mission}, by {len(camera.counted)} pictures", )
    return camera_text(camera.lens, camera.mount, notes, deviation)
