"""Template tracking: landmarks are followed from frame to frame, and correct the pose (§5, Figure 10)."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np

from knowledge_sources.methods.arrays import Floats, Image, Mask
from knowledge_sources.methods.features import (
    Correlation,
    Template,
    compute_second_peak,
    correlate,
    extract_template,
    lies_inside,
    measure_corner_strengths,
    read_picture,
)
from knowledge_sources.methods.pose import compute_point_jacobian, planar_from_points
from knowledge_sources.settings import DEFAULT, Settings
from world_models.building.model_errors import INEXACT_M
from world_models.camera import NEAR_PLANE_M, Camera
from world_models.entries import Anchor, Hypothesis, Track
from world_models.frames import Pose2
from world_models.robot import RobotModel
from world_models.visibility.lines_and_points import visible_points

TOLERANCE_SIGMAS = 3.0  # standard deviations of the believed pose that the action level may correct (§3.2)
TEMPLATE_HALF_PX = 10  # half-width of a landmark's template (experiment table1)
MAX_TRACKS = 14  # largest number of landmarks followed at a time (experiment table1)
MIN_SPACING_PX = 28.0  # least distance in the picture between landmarks
MAX_LANDMARK_DISTANCE_M = 15.0  # largest distance of a landmark when it is chosen
MIN_LANDMARK_CONTRAST = 0.08  # least contrast of a model point that may be followed
MIN_CORNER_PER_PX = 3.0  # least corner strength of a landmark's patch (Shi-Tomasi)
MAX_SECOND_PEAK = 0.8  # largest correlation of a landmark's patch with another place near it when it is chosen
SECOND_PEAK_WINDOW_PX = 14.0  # half-width of the window in which another such place is looked for
MIN_PEAK = 0.7  # least correlation of a template with the place where it is found
MIN_DISTINCTIVENESS = 0.08  # least margin of that correlation over the one at the second best place
MIN_SEARCH_PX = 6.0  # least half-width of the window searched for a template
MAX_SEARCH_PX = 48.0  # largest half-width of the window searched for a template
SEARCH_SIGMAS = 4.0  # half-width of that window in standard deviations of the predicted place
SEARCH_MARGIN_PX = 2.0  # what is added to that half-width
MIN_SIGMA_PX = 0.3
"""Least standard deviation of a landmark's place, as the model's corner is not exactly the seen one (experiment
table1)."""
LEAST_SIGMAS = np.array([1e-3, 1e-3, 3e-4])
"""Least standard deviations of what wheels and tracks tell of a motion [m, m, rad], whatever they say."""
MIN_SCALE = 0.55  # least scale of a landmark's view against its template
MAX_SCALE = 1.8  # largest scale of a landmark's view against its template

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
    covariance: Floats,
) -> list[TrackUpdate]:
    """Predict each landmark from the believed pose, and find its template near the prediction.

    Args:
        template_of: the template of a track.
        image: (h, w) grey, without lens distortion.
        pose, covariance: ``world_from_robot`` as believed, and (3, 3) over (x, y, heading), world.
    """
    if not tracks:
        return []
    depth, predicted, spread = _predict(robot, np.array([t.point_world for t in tracks]), pose, covariance)
    obstruction = robot.camera.obstruction
    hidden = np.zeros(len(tracks), bool) if obstruction is None else obstruction.covers(predicted, TEMPLATE_HALF_PX)
    out = []
    for track, z, at, sigma, is_hidden in zip(
            tracks, depth.tolist(), predicted, spread.tolist(), hidden.tolist(), strict=True):
        scale = track.template_depth_m / max(z, NEAR_PLANE_M)
        in_view = z > NEAR_PLANE_M and not is_hidden and lies_inside(image.shape, at, TEMPLATE_HALF_PX + 2)
        expected = in_view and MIN_SCALE <= scale <= MAX_SCALE
        found = None
        if expected:
            search = min(max(SEARCH_SIGMAS * sigma + SEARCH_MARGIN_PX, MIN_SEARCH_PX), MAX_SEARCH_PX)
            found = correlate(template_of(track), image, at, search, scale=scale)
        out.append(TrackUpdate(_update_track(track, at, found, expected), expected))
    return out


@lru_cache(maxsize=MAX_TEMPLATES)
def cut_template(
    lens: Camera, pinhole: Camera, jpeg: bytes, at_px: tuple[float, float], half_px: int
) -> Template:
    """The template round a pixel of a rectified picture; cached, as it serves for many frames."""
    return extract_template(read_picture(jpeg).rectified(lens, pinhole), at_px, half_px)


def correct_pose(
    robot: RobotModel, seen: list[Track], anchors: tuple[Anchor, ...], pose: Pose2, covariance: Floats,
    model_m: float = 0.0,
) -> PoseCorrection:
    """Solve for the pose from landmarks that were found; no surer than the beliefs at which their templates were cut.

    Landmarks tell the motion since then, and so does what was believed before: how far off the belief was when the
    templates were cut says nothing of that motion. So it counts neither as freedom to move nor twice.

    Args:
        pose, covariance: ``world_from_robot`` as believed, and (3, 3) over (x, y, heading), world.
        model_m: deviation of the landmarks from where the model has them; 0: nobody has said it, they may be inexact.
    """
    since = _hold_positive(covariance - _compute_anchor_covariance(pose, seen, anchors))
    by_model_px = _compute_sigmas_by_model(robot, seen, anchors, pose, model_m or INEXACT_M)
    estimate = planar_from_points(
        np.array([t.point_world for t in seen]), np.array([t.found_px for t in seen]), robot.camera,
        robot.mount.camera_from_robot, pose, since, sigma_px=np.hypot([t.sigma_px for t in seen], by_model_px))
    after = estimate.world_from_robot
    spread = np.asarray(estimate.covariance + _compute_anchor_covariance(after, seen, anchors))
    return PoseCorrection(after, spread, int(np.count_nonzero(estimate.inliers)))


def select_landmarks(
    robot: RobotModel, kept: tuple[Track, ...], frame: str, image: Image, pose: Pose2
) -> tuple[Track, ...]:
    """Choose new tracks besides those that are kept: visible model points that are strong corners, unique, well apart.

    Args:
        frame: the entry of the picture ``image`` (h, w), in which their templates will be cut.
        pose: ``world_from_robot`` as believed.
    """
    half_px = TEMPLATE_HALF_PX
    camera_from_world = robot.camera_from_world(pose)
    points = visible_points(
        robot.world, robot.camera, camera_from_world, margin_px=half_px + 4.0,
        min_contrast=MIN_LANDMARK_CONTRAST, max_distance_m=MAX_LANDMARK_DISTANCE_M,
    )
    strength = measure_corner_strengths(image, points.points_px, half_px)
    taken_px = [t.found_px or t.predicted_px for t in kept]
    free = (strength >= MIN_CORNER_PER_PX) & _are_apart(points.points_px, taken_px, MIN_SPACING_PX)
    new: list[Track] = []
    for i in np.argsort(-strength, kind="stable"):
        px, point = points.points_px[i], points.points_world[i]
        if len(kept) + len(new) >= MAX_TRACKS:
            break
        if not free[i]:
            continue
        if compute_second_peak(image, px, half_px, SECOND_PEAK_WINDOW_PX) < MAX_SECOND_PEAK:
            free &= _are_apart(points.points_px, px, MIN_SPACING_PX)
            name = points.marks[int(points.landmark[i])].name
            new.append(_begin_track(point, px, float(camera_from_world.apply(point)[2]), name, frame, MIN_SIGMA_PX))
    return tuple(new)


def _predict(robot: RobotModel, points: Floats, pose: Pose2, covariance: Floats) -> tuple[Floats, Floats, Floats]:
    """Depths (n,) [m], pixels (n, 2) and the standard deviation (n,) of the pixels [px] of points (n, 3), world."""
    p, _, jacobian = compute_point_jacobian(points, robot.camera, pose, robot.mount.camera_from_robot)
    ahead = np.where(p[:, 2:] > NEAR_PLANE_M, p, [0.0, 0.0, 1.0])
    spread = np.einsum("nij,jk,nik->ni", jacobian, covariance, jacobian)
    return p[:, 2], robot.camera.project(ahead), np.sqrt(np.max(spread, axis=1))


def _are_apart(points_px: Floats, taken_px: Any, spacing_px: float) -> Mask:
    """(n,) which points (n, 2) lie far enough from every landmark (k, 2) that is taken."""
    away = points_px[:, None] - np.asarray(taken_px, float).reshape(-1, 2)
    return np.asarray(np.all(away[..., 0] ** 2 + away[..., 1] ** 2 >= spacing_px**2, axis=1))


def _update_track(track: Track, predicted_px: Floats, found: Correlation | None, expected: bool) -> Track:
    """A track as of the newest frame; what correlates badly, ambiguously or at the window's border is not found."""
    predicted = (float(predicted_px[0]), float(predicted_px[1]))
    if not expected:
        return replace(track, predicted_px=predicted, found_px=None)
    if (
        found is None or found.peak < MIN_PEAK or found.at_border
        or found.distinctiveness < MIN_DISTINCTIVENESS
    ):
        peak = -1.0 if found is None else found.peak
        return replace(track, predicted_px=predicted, found_px=None, peak=peak, misses=track.misses + 1)
    at = (float(found.position_px[0]), float(found.position_px[1]))
    sigma = max(MIN_SIGMA_PX, found.sigma_px)
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


def _compute_sigmas_by_model(
    robot: RobotModel, seen: list[Track], anchors: tuple[Anchor, ...], pose: Pose2, model_m: float
) -> Floats:
    """(n,) by how much landmarks are seen elsewhere [px] that are nearer or farther than the model has them.

    Nothing while the robot only turns: their templates were cut where the model has them.
    """
    at, camera_from_world = {a.frame: (a.x_m, a.y_m) for a in anchors}, robot.camera_from_world(pose)
    gone = np.array([(pose.x_m - x, pose.y_m - y, 0.0) for x, y in (at[t.template_frame] for t in seen)])
    points = np.array([t.point_world for t in seen])
    rays = points - camera_from_world.inverse().translation + gone
    farther = points + model_m * rays / np.linalg.norm(rays, axis=1, keepdims=True)
    moved_px = np.subtract(*(robot.camera.project(camera_from_world.apply(some)) for some in (farther, points)))
    return np.asarray(np.linalg.norm(moved_px, axis=1))


def _hold_positive(covariance: Floats) -> Floats:
    """A difference of covariances (3, 3) as one: nothing is surer than :data:`LEAST_SIGMAS`."""
    scale = np.outer(LEAST_SIGMAS, LEAST_SIGMAS)
    values, vectors = np.linalg.eigh(covariance / scale)
    return np.asarray((vectors * np.maximum(values, 1.0)) @ vectors.T * scale)


def action_px(robot: RobotModel, belief: Hypothesis, points_world: Floats, settings: Settings = DEFAULT) -> float:
    """The action level's tolerance [px]: how far landmarks may be off by the uncertainty of the believed pose (§3.2).

    An error of the heading moves the image by the focal length times the error; an error of the place by the focal
    length times the error over the distance ahead of the landmarks, ``points_world`` (n, 3). Without landmarks only the
    heading counts. ``min_tolerance_px`` is added for the error of correlation itself; the plan level's bound is the
    largest tolerance.
    """
    pose = belief.world_from_robot(robot.world)
    ahead_m = robot.on_floor_of(belief.locale).camera_from_world(pose).apply(points_world.reshape(-1, 3))[:, 2]
    near = ahead_m[ahead_m > NEAR_PLANE_M]
    spread = math.hypot(belief.sigma_rad, belief.sigma_m / float(np.median(near)) if len(near) else 0.0)
    action = settings.action
    return min(action.min_tolerance_px + TOLERANCE_SIGMAS * robot.camera.fx * spread,
               settings.plan.max_deviation_px)
