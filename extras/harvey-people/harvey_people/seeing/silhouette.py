"""Silhouette: what people hide of a picture, and what is left of a milestone then."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import shapely
from numpy.typing import NDArray

from harvey_people.behaving.meeting import PERSON_M, foresee
from harvey_people.seeing.mover import Mover
from knowledge_sources.methods.verification.predicted_colors import MIN_FACE_POINTS
from world_models.building.model_errors import pack_errors
from world_models.entries import Milestone
from world_models.frames import Pose2
from world_models.obstruction import Obstruction
from world_models.robot import RobotModel

Floats = NDArray[np.float64]
TALL_M = 1.9
"""Few people are taller."""
NEAREST_M = 0.2
"""What is nearer to the camera's plane than this is not outlined."""


def outline(robot: RobotModel, here: Pose2, mover: Mover, at_s: float) -> Obstruction | None:
    """What somebody hides of a picture from a pose, to one standard deviation of the place; None: nothing of it."""
    mean, covariance, *_ = foresee(mover, np.array([at_s - mover.at_s]))
    radius_m = PERSON_M + math.sqrt(float(np.linalg.eigvalsh(covariance[0])[-1]))
    angles = np.linspace(0.0, math.tau, 16, endpoint=False)
    ring = mean[0] + radius_m * np.stack([np.cos(angles), np.sin(angles)], axis=1)
    floor_m = robot.world.floor_m(mover.locale)
    corners = np.concatenate([np.column_stack([ring, np.full(len(ring), floor_m + up_m)]) for up_m in (0.0, TALL_M)])
    ahead = robot.camera_from_world(here).apply(corners)
    seen = ahead[ahead[:, 2] > NEAREST_M]
    if len(seen) < 3:
        return None
    hull = shapely.convex_hull(shapely.MultiPoint(robot.camera.project(seen)))
    picture = shapely.box(0.0, 0.0, robot.camera.width, robot.camera.height)
    if not isinstance(hull, shapely.Polygon) or not hull.intersects(picture):
        return None
    return Obstruction(tuple((round(float(u), 1), round(float(v), 1)) for u, v in hull.exterior.coords[:-1]))


def take_hidden(milestone: Milestone, outlines: Sequence[Obstruction], robot: RobotModel, here: Pose2) -> Milestone:
    """The milestone without lines and points of faces that are hidden; the same where none is."""
    lines_px = np.array(milestone.expected_px, float).reshape(-1, 2, 2)
    shown = np.flatnonzero(np.all([one.shows(lines_px) for one in outlines], axis=0))
    if len(shown) == len(lines_px):
        return milestone
    camera = robot.camera_from_world(here)

    def clear(points: tuple[tuple[float, ...], ...]) -> tuple[tuple[float, ...], ...]:
        ahead = camera.apply(np.array(points, float).reshape(-1, 3))
        pixels = robot.camera.project(np.where(ahead[:, 2:] > NEAREST_M, ahead, (0.0, 0.0, 1.0)))
        hidden = np.any([one.covers(pixels) for one in outlines], axis=0)
        return tuple(point for point, is_hidden in zip(points, hidden, strict=True) if not is_hidden)

    colors = ((color, clear(points)) for color, points in milestone.face_colors)
    return replace(
        milestone, expected=tuple(milestone.expected[i] for i in shown),
        expected_px=tuple(milestone.expected_px[i] for i in shown),
        landmark_of=tuple(milestone.landmark_of[i] for i in shown),
        displacements=pack_errors(milestone.errors.take(shown)),
        face_colors=tuple((color, points) for color, points in colors if len(points) >= MIN_FACE_POINTS))
