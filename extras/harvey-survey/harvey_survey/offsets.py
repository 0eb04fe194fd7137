"""How far the segments of a look lie beside their lines in the picture, and how that changes with what may be off."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from harvey_survey.looks import Look
from knowledge_sources.methods.features import SIGMA_ACROSS_PX
from world_models.camera import CAMERA_UNKNOWNS, move_camera
from world_models.frames import Pose2

Floats = NDArray[np.float64]

POSE_STEPS = (1e-4, 1e-4, 1e-5)
CAMERA_STEPS = (1e-5, 1e-5, 1e-5, 1e-4, 1e-5, 1e-2, 1e-2)
MOVE_M = 1e-4
"""Steps by which slopes are measured, in the units of what is off."""
SIGMA_PX = SIGMA_ACROSS_PX
"""Standard deviation of a segment's end across its line [px]."""


def measure_offsets(look: Look, pose: Pose2, camera_step: Floats, pieces_world: Floats) -> Floats:
    """(p, 2) how far both ends of each segment lie beside their lines [px].

    Args:
        camera_step: (7,) of :data:`~world_models.camera.CAMERA_UNKNOWNS`.
        pieces_world: (p, 2, 3) where the line of each pair is [m].
    """
    camera, mount = move_camera(look.camera, look.mount, camera_step)
    camera_from_world = mount.camera_from_robot @ pose.lifted().inverse()
    ends = camera.project(camera_from_world.apply(pieces_world))
    along = ends[:, 1] - ends[:, 0]
    across = np.stack([-along[:, 1], along[:, 0]], axis=1) / np.linalg.norm(along, axis=1, keepdims=True)
    return np.asarray(np.einsum("pei,pi->pe", look.segments_px - ends[:, :1], across))


def measure_slopes(look: Look, pose: Pose2, camera_step: Floats, pieces_world: Floats) -> tuple[Floats, Floats]:
    """By how much the offsets change with pose and camera, (p, 2, 10), and with the place of each line, (p, 2, 3)."""
    here = measure_offsets(look, pose, camera_step, pieces_world)
    by_state = []
    for i, step in enumerate(POSE_STEPS):
        moved = Pose2(*(pose.vector + step * np.eye(3)[i]).tolist())
        by_state.append((measure_offsets(look, moved, camera_step, pieces_world) - here) / step)
    for i, step in enumerate(CAMERA_STEPS):
        stepped = camera_step + step * np.eye(len(CAMERA_UNKNOWNS))[i]
        by_state.append((measure_offsets(look, pose, stepped, pieces_world) - here) / step)
    by_place = [(measure_offsets(look, pose, camera_step, pieces_world + MOVE_M * np.eye(3)[i]) - here) / MOVE_M
                for i in range(3)]
    return np.stack(by_state, axis=-1), np.stack(by_place, axis=-1)
