"""Template tracking: landmarks are followed from frame to frame, and correct the pose (§5, Figure 10)."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np

from knowledge_sources.methods.arrays import Floats, Image, Mask
from knowledge_sources.methods.features.correlation import (
    Correlation,
    Template,
    compute_second_peak,
    correlate,
    extract_template,
    lies_inside,
    measure_corner_strengths,
)
from knowledge_sources.methods.features.picture import read_picture
from knowledge_sources.methods.pose.planar import compute_point_jacobian, planar_from_points
from knowledge_sources.settings import DEFAULT, Settings
from knowledge_sources.settings.features import FeaturesSettings
from knowledge_sources.settings.tracking import TrackingSettings
from world_models.camera import NEAR_PLANE_M, Camera
from world_models.entries.percepts import Anchor, Track
from world_models.frames import Pose2
from world_models.robot import RobotModel
from world_models.visibility.lines_and_points import visible_points

MAX_TEMPLATES = 256
"""Size of the cache of templates."""


class TrackUpdate(NamedTuple):
    """One track in the newest frame, and whether it should have been seen there."""

    track: Track
    expected: bool


class PoseCorrection(NamedTuple):
    """The pose from landmarks, its covariance (3, 3) in the world, and how many landmarks agree with it."""

    world_from_robot: Pose2
    covariance: Floats
    agreeing: int


def follow_landmarks(
    robot: RobotModel, tracks: tuple[Track, ...], template_of: Callable[[Track], Template], image: Image, pose: Pose2,
    covariance: Floats, settings: Settings = DEFAULT,
) -> list[TrackUpdate]:
    """Predict each landmark from the believed pose, and find its template near the prediction.

    Args:
        template_of: the template of a track.
        image: (h, w) grey, without lens distortion.
        pose, covariance: ``world_from_robot`` as believed, and (3, 3) over (x, y, heading), world.
    """
    if not tracks:
        return []
    s = settings.tracking
    depth, predicted, spread = _predict(robot, np.array([t.point_world for t in tracks]), pose, covariance)
    obstruction = robot.camera.obstruction
    hidden = np.zeros(len(tracks), bool) if obstruction is None else obstruction.covers(predicted, s.template_half_px)
    out = []
    for track, z, at, sigma, is_hidden in zip(
            tracks, depth.tolist(), predicted, spread.tolist(), hidden.tolist(), strict=True):
        scale = track.template_depth_m / max(z, NEAR_PLANE_M)
        in_view = z > NEAR_PLANE_M and not is_hidden and lies_inside(image.shape, at, s.template_half_px + 2)
        expected = in_view and s.min_scale <= scale <= s.max_scale
        found = None
        if expected:
            search = min(max(s.search_sigmas * sigma + s.search_margin_px, s.min_search_px), s.max_search_px)
            found = correlate(template_of(track), image, at, search, scale=scale)
        out.append(TrackUpdate(_update_track(track, at, found, expected, s), expected))
    return out


@lru_cache(maxsize=MAX_TEMPLATES)
def cut_template(
    lens: Camera, pinhole: Camera, jpeg: bytes, at_px: tuple[float, float], half_px: int, settings: FeaturesSettings
) -> Template:
    """The template round a pixel of a rectified picture; cached, as it serves for many frames."""
    return extract_template(read_picture(jpeg).rectified(lens, pinhole), at_px, half_px)


def correct_pose(
    robot: RobotModel, seen: list[Track], anchors: tuple[Anchor, ...], pose: Pose2, covariance: Floats,
    settings: Settings = DEFAULT,
) -> PoseCorrection:
    """Solve for the pose from landmarks that were found; no surer than the beliefs at which their templates were cut.

    Args:
        pose, covariance: ``world_from_robot`` as believed, and (3, 3) over (x, y, heading), world.
    """
    estimate = planar_from_points(
        np.array([t.point_world for t in seen]),
        np.array([t.found_px for t in seen]),
        robot.camera,
        robot.mount.camera_from_robot,
        pose,
        covariance,
        sigma_px=np.array([t.sigma_px for t in seen]),
        settings=settings.pose,
    )
    after = estimate.world_from_robot
    spread = np.asarray(estimate.covariance + _compute_anchor_covariance(after, seen, anchors))
    return PoseCorrection(after, spread, int(np.count_nonzero(estimate.inliers)))


def select_landmarks(
    robot: RobotModel, kept: tuple[Track, ...], frame: str, image: Image, pose: Pose2, settings: Settings = DEFAULT
) -> tuple[Track, ...]:
    """Choose new tracks beside those that are kept: visible model points that are strong corners, unique, well apart.

    Args:
        frame: the entry of the picture ``image`` (h, w), in which their templates will be cut.
        pose: ``world_from_robot`` as believed.
    """
    s = settings.tracking
    half_px = s.template_half_px
    camera_from_world = robot.camera_from_world(pose)
    points = visible_points(
        robot.world, robot.camera, camera_from_world, margin_px=half_px + 4.0,
        min_contrast=s.min_landmark_contrast, max_distance_m=s.max_landmark_distance_m,
    )
    strength = measure_corner_strengths(image, points.points_px, half_px)
    taken_px = [t.found_px or t.predicted_px for t in kept]
    free = (strength >= s.min_corner_per_px) & _are_apart(points.points_px, taken_px, s.min_spacing_px)
    new: list[Track] = []
    for i in np.argsort(-strength, kind="stable"):
        px, point = points.points_px[i], points.points_world[i]
        if len(kept) + len(new) >= s.max_tracks:
            break
        if not free[i]:
            continue
        if compute_second_peak(image, px, half_px, s.second_peak_window_px) < s.max_second_peak:
            free &= _are_apart(points.points_px, px, s.min_spacing_px)
            name = points.marks[int(points.landmark[i])].name
            new.append(_begin_track(point, px, float(camera_from_world.apply(point)[2]), name, frame, s.min_sigma_px))
    return tuple(new)


def _predict(robot: RobotModel, points: Floats, pose: Pose2, covariance: Floats) -> tuple[Floats, Floats, Floats]:
    """Depths (n,) [m], pixels (n, 2) and the standard deviation (n,) of the pixels [px] of points (n, 3), world."""
    state = np.array([pose.x_m, pose.y_m, pose.heading_rad])
    focal = np.array([robot.camera.fx, robot.camera.fy])
    p, _, jacobian = compute_point_jacobian(points, focal, state, robot.mount.camera_from_robot)
    ahead = np.where(p[:, 2:] > NEAR_PLANE_M, p, [0.0, 0.0, 1.0])
    spread = np.einsum("nij,jk,nik->ni", jacobian, covariance, jacobian)
    return p[:, 2], robot.camera.project(ahead), np.sqrt(np.max(spread, axis=1))


def _are_apart(points_px: Floats, taken_px: Any, spacing_px: float) -> Mask:
    """(n,) which points (n, 2) lie far enough from every landmark (k, 2) that is taken."""
    away = points_px[:, None] - np.asarray(taken_px, float).reshape(-1, 2)
    return np.asarray(np.all(away[..., 0] ** 2 + away[..., 1] ** 2 >= spacing_px**2, axis=1))


def _update_track(
    track: Track, predicted_px: Floats, found: Correlation | None, expected: bool, settings: TrackingSettings
) -> Track:
    """A track as of the newest frame; what correlates badly, ambiguously or at the window's border is not found."""
    predicted = (float(predicted_px[0]), float(predicted_px[1]))
    if not expected:
        return replace(track, predicted_px=predicted, found_px=None)
    if (
        found is None or found.peak < settings.min_peak or found.at_border
        or found.distinctiveness < settings.min_distinctiveness
    ):
        peak = -1.0 if found is None else found.peak
        return replace(track, predicted_px=predicted, found_px=None, peak=peak, misses=track.misses + 1)
    at = (float(found.position_px[0]), float(found.position_px[1]))
    sigma = max(settings.min_sigma_px, found.sigma_px)
    return replace(track, predicted_px=predicted, found_px=at, peak=found.peak, sigma_px=sigma, misses=0)


def _begin_track(point: Floats, px: Floats, depth_m: float, landmark: str, frame: str, sigma_px: float) -> Track:
    x, y, z = (float(c) for c in point)
    at = (float(px[0]), float(px[1]))
    return Track(landmark, (x, y, z), frame, at, float(depth_m), at, at, 1.0, sigma_px)


def _compute_anchor_covariance(pose: Pose2, seen: list[Track], anchors: tuple[Anchor, ...]) -> Floats:
    """(3, 3) mean covariance of the beliefs at which the templates were cut, carried over to a pose."""
    by_frame = {a.frame: a for a in anchors}
    parts = []
    for track in seen:
        anchor = by_frame[track.template_frame]
        lever = np.eye(3)
        lever[0, 2], lever[1, 2] = -(pose.y_m - anchor.y_m), pose.x_m - anchor.x_m
        parts.append(lever @ np.array(anchor.covariance) @ lever.T)
    return np.asarray(np.mean(parts, axis=0))
