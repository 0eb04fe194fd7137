"""How far the segments of a look lie beside their lines in the picture, and how that changes with what may be off."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from harvey_survey.seen_pictures import SeenPicture
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


def measure_offsets(look: SeenPicture, pose: Pose2, camera_step: Floats, pieces_world: Floats) -> Floats:
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


def match_again(
    look: SeenPicture, pose: Pose2, camera_step: Floats, pieces_world: Floats, within_px: float
) -> SeenPicture:
    """The look with each of its segments paired with the line that it lies on, and with no other.

    Args:
        pieces_world: (m, 2, 3) where the visible piece of each expected line is [m].
        within_px: both ends of a segment lie no further beside its line.
    """
    off, shared, lengths, _ = _lay_beside(look, pose, camera_step, pieces_world)
    off = np.where(shared > 0.5 * lengths, off, np.inf)
    nearest = np.argmin(off, axis=0)
    kept = np.flatnonzero(off[nearest, np.arange(off.shape[1])] < within_px)
    return replace(look, pairs=nearest[kept], segments_px=look.every_px[kept])


def measure_support(
    look: SeenPicture, pose: Pose2, camera_step: Floats, pieces_world: Floats, within_px: float
) -> float:
    """How many of the lines (m, 2, 3) segments lie on, each by the part of its length on which they do."""
    off, shared, _, line_px = _lay_beside(look, pose, camera_step, pieces_world)
    covered = np.sum(np.where(off < within_px, np.maximum(shared, 0.0), 0.0), axis=1)
    return float(np.sum(np.minimum(1.0, covered / line_px)))


def _lay_beside(
    look: SeenPicture, pose: Pose2, camera_step: Floats, pieces_world: Floats
) -> tuple[Floats, Floats, Floats, Floats]:
    """Of m lines and s segments: how far a segment's further end lies beside the line, and what length they share
    (m, s); the lengths along the line of the segments (m, s), and of the lines (m,) [px]."""
    camera, mount = move_camera(look.camera, look.mount, camera_step)
    ends = camera.project((mount.camera_from_robot @ pose.lifted().inverse()).apply(pieces_world))
    along = ends[:, 1] - ends[:, 0]
    line_px = np.linalg.norm(along, axis=1)
    along = along / line_px[:, None]
    to = look.every_px[None] - ends[:, None, :1]
    off = np.abs(to[..., 1] * along[:, None, None, 0] - to[..., 0] * along[:, None, None, 1]).max(axis=2)
    at = np.sort(np.einsum("msei,mi->mse", to, along), axis=2)
    shared = np.minimum(at[..., 1], line_px[:, None]) - np.maximum(at[..., 0], 0.0)
    return off, shared, at[..., 1] - at[..., 0], line_px


def measure_slopes(look: SeenPicture, pose: Pose2, camera_step: Floats, pieces_world: Floats) -> tuple[Floats, Floats]:
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
