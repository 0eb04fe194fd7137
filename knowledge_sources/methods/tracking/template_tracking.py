"""Following landmarks from frame to frame by template correlation (§5, Figure 10), and what follows for the pose."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from knowledge_sources.methods.features.correlation import (
    Correlation,
    Template,
    compute_second_peak,
    corner_strengths,
    correlate,
    lies_inside,
)
from knowledge_sources.methods.pose.planar import compute_point_jacobian
from knowledge_sources.methods.pose.planar_from_points import planar_from_points
from world_models.camera import NEAR_PLANE_M
from world_models.entries.percepts import Anchor, Track
from world_models.frames import Pose2
from world_models.robot import RobotModel
from world_models.visibility.lines_and_points import visible_points

Floats = NDArray[np.float64]
Image = NDArray[np.uint8]
HALF_PX = 10
"""Templates are squares of 2 HALF_PX + 1 pixels."""
TRACKS = 14
"""How many landmarks are followed at the most."""
SPACING_PX = 28.0
"""How far apart new ones are taken."""
LEAST_PEAK = 0.7
LEAST_MARGIN = 0.08
"""How much better than at the second best place in its window a landmark must correlate: is the peak unique?"""
LEAST_CORNER = 3.0
"""Grey levels per pixel below which a patch is no corner."""
UNIQUE = 0.8
"""A landmark's patch must not look more like another place within UNIQUE_PX than this (correlation)."""
UNIQUE_PX = 14.0
SEARCH_PX = (6.0, 48.0)
SIGMAS = 4.0
LEAST_SIGMA_PX = 0.3
"""A landmark's place is no surer than this, however sharp its peak: the model's corner is not quite the picture's."""
SCALES = (0.55, 1.8)
"""How much larger or smaller than its template a landmark may have become."""


class TrackUpdate(NamedTuple):
    """One track in the newest frame, and whether it should have been seen there."""

    track: Track
    expected: bool


class PoseCorrection(NamedTuple):
    """The pose that the landmarks tell, its covariance (3, 3), world, and how many of them agree with it."""

    world_from_robot: Pose2
    covariance: Floats
    agreeing: int


def follow_landmarks(
    robot: RobotModel, tracks: tuple[Track, ...], template_of: Callable[[Track], Template], image: Image, pose: Pose2,
    covariance: Floats,
) -> list[TrackUpdate]:
    """Predict each landmark from the believed pose, and find it in the window that the belief leaves open.

    Args:
        template_of: the patch by which a track is known.
        pose, covariance: ``world_from_robot`` as believed, and (3, 3) over (x, y, heading), world.
    """
    if not tracks:
        return []
    depth, predicted, spread = _predicted(robot, np.array([t.point_world for t in tracks]), pose, covariance)
    before = robot.camera.obstruction
    hidden = np.zeros(len(tracks), bool) if before is None else before.covers(predicted, HALF_PX)
    out = []
    for track, z, at, sigma, is_hidden in zip(
            tracks, depth.tolist(), predicted, spread.tolist(), hidden.tolist(), strict=True):
        scale = track.template_depth_m / max(z, NEAR_PLANE_M)
        in_view = z > NEAR_PLANE_M and not is_hidden and lies_inside(image.shape, at, HALF_PX + 2)
        expected = in_view and SCALES[0] <= scale <= SCALES[1]
        found = None
        if expected:
            search = min(max(SIGMAS * sigma + 2.0, SEARCH_PX[0]), SEARCH_PX[1])
            found = correlate(template_of(track), image, at, search, scale=scale)
        out.append(TrackUpdate(_updated(track, at, found, expected), expected))
    return out


def correct_pose(
    robot: RobotModel, seen: list[Track], anchors: tuple[Anchor, ...], pose: Pose2, covariance: Floats
) -> PoseCorrection:
    """The pose from landmarks that were found; no surer than the beliefs from which their templates were cut."""
    estimate = planar_from_points(
        np.array([t.point_world for t in seen]),
        np.array([t.found_px for t in seen]),
        robot.camera,
        robot.mount.camera_from_robot,
        pose,
        covariance,
        sigma_px=np.array([t.sigma_px for t in seen]),
    )
    after = estimate.world_from_robot
    spread = np.asarray(estimate.covariance + _inherited(after, seen, anchors))
    return PoseCorrection(after, spread, int(np.count_nonzero(estimate.inliers)))


def select_landmarks(
    robot: RobotModel, kept: tuple[Track, ...], frame: str, image: Image, pose: Pose2
) -> tuple[Track, ...]:
    """New tracks beside those that are kept: corners of the model that are visible, distinctive, and well apart."""
    camera_from_world = robot.camera_from_world(pose)
    points = visible_points(
        robot.world, robot.camera, camera_from_world, margin_px=HALF_PX + 4.0, min_contrast=0.08, max_distance_m=15.0
    )
    strength = corner_strengths(image, points.points_px, HALF_PX)
    free = (strength >= LEAST_CORNER) & _apart(points.points_px, [t.found_px or t.predicted_px for t in kept])
    new: list[Track] = []
    for i in np.argsort(-strength, kind="stable"):
        px, point = points.points_px[i], points.points_world[i]
        if len(kept) + len(new) >= TRACKS:
            break
        if free[i] and compute_second_peak(image, px, HALF_PX, UNIQUE_PX) < UNIQUE:
            free &= _apart(points.points_px, px)
            name = robot.world.landmarks[points.landmark[i]].name
            new.append(_begun(point, px, float(camera_from_world.apply(point)[2]), name, frame))
    return tuple(new)


def _predicted(
    robot: RobotModel, points: Floats, pose: Pose2, covariance: Floats
) -> tuple[Floats, Floats, Floats]:
    """Depths (n,), pixels (n, 2) and the standard deviation (n,) of the pixels [px]."""
    state = np.array([pose.x_m, pose.y_m, pose.heading_rad])
    focal = np.array([robot.camera.fx, robot.camera.fy])
    p, _, jacobian = compute_point_jacobian(points, focal, state, robot.mount.camera_from_robot)
    ahead = np.where(p[:, 2:] > NEAR_PLANE_M, p, [0.0, 0.0, 1.0])
    spread = np.einsum("nij,jk,nik->ni", jacobian, covariance, jacobian)
    return p[:, 2], robot.camera.project(ahead), np.sqrt(np.max(spread, axis=1))


def _apart(points_px: Floats, taken_px: Any) -> NDArray[np.bool_]:
    """(n,) which points (n, 2) lie far enough from every landmark (k, 2) that is taken."""
    away = points_px[:, None] - np.asarray(taken_px, float).reshape(-1, 2)
    return np.asarray(np.all(away[..., 0] ** 2 + away[..., 1] ** 2 >= SPACING_PX**2, axis=1))


def _updated(track: Track, predicted_px: Floats, found: Correlation | None, expected: bool) -> Track:
    """A track as of the newest frame; what correlates badly, ambiguously or at the window's border is not found."""
    predicted = (float(predicted_px[0]), float(predicted_px[1]))
    if not expected:
        return replace(track, predicted_px=predicted, found_px=None)
    if found is None or found.peak < LEAST_PEAK or found.at_border or found.distinctiveness < LEAST_MARGIN:
        peak = -1.0 if found is None else found.peak
        return replace(track, predicted_px=predicted, found_px=None, peak=peak, misses=track.misses + 1)
    at = (float(found.position_px[0]), float(found.position_px[1]))
    sigma = max(LEAST_SIGMA_PX, found.sigma_px)
    return replace(track, predicted_px=predicted, found_px=at, peak=found.peak, sigma_px=sigma, misses=0)


def _begun(point: Floats, px: Floats, depth_m: float, landmark: str, frame: str) -> Track:
    x, y, z = (float(c) for c in point)
    at = (float(px[0]), float(px[1]))
    return Track(landmark, (x, y, z), frame, at, float(depth_m), at, at, 1.0, LEAST_SIGMA_PX)


def _inherited(pose: Pose2, seen: list[Track], anchors: tuple[Anchor, ...]) -> Floats:
    """(3, 3) mean covariance of the beliefs from which the templates were cut, carried over to here."""
    share = {a.frame: a for a in anchors}
    parts = []
    for track in seen:
        anchor = share[track.template_frame]
        lever = np.eye(3)
        lever[0, 2], lever[1, 2] = -(pose.y_m - anchor.y_m), pose.x_m - anchor.x_m
        parts.append(lever @ np.array(anchor.covariance) @ lever.T)
    return np.asarray(np.mean(parts, axis=0))
