"""Following landmarks from frame to frame by template correlation (§5, Figure 10), and what follows for the pose."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from knowledge_sources.methods.correlation import (
    Template,
    corner_strength,
    correlate,
    extract_template,
    fits,
    self_correlation,
)
from knowledge_sources.methods.pose.planar import point_jacobian
from knowledge_sources.methods.pose.planar_from_points import planar_from_points
from world_models.camera import NEAR_M
from world_models.frames import Pose2
from world_models.percepts import Anchor, Track
from world_models.robot import RobotModel
from world_models.visibility import visible_points

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
SCALES = (0.55, 1.8)
"""How much larger or smaller than its template a landmark may have become."""


class Followed(NamedTuple):
    """One track in the newest frame, and whether it should have been seen there."""

    track: Track
    expected: bool


class Correction(NamedTuple):
    """The pose that the landmarks tell, its covariance (3, 3), world, and how many of them agree with it."""

    world_from_robot: Pose2
    covariance: Floats
    agreeing: int


def follow(
    robot: RobotModel, tracks: tuple[Track, ...], pictures: Mapping[str, Image], image: Image, pose: Pose2,
    covariance: Floats,
) -> list[Followed]:
    """Predict each landmark from the believed pose, and find it in the window that the belief leaves open.

    Args:
        pictures: the frames in which the tracks' templates lie, by id.
        pose, covariance: ``world_from_robot`` as believed, and (3, 3) over (x, y, heading), world.
    """
    if not tracks:
        return []
    depth, predicted, spread = _predicted(robot, np.array([t.point_world for t in tracks]), pose, covariance)
    out = []
    for track, z, at, sigma in zip(tracks, depth, predicted, spread, strict=True):
        t = replace(track, predicted_px=(float(at[0]), float(at[1])), found_px=None)
        scale = t.template_depth_m / max(float(z), NEAR_M)
        if z > NEAR_M and fits(image.shape, at, HALF_PX + 2) and SCALES[0] <= scale <= SCALES[1]:
            template = extract_template(pictures[t.template_frame], t.template_px, HALF_PX)
            out.append(Followed(_correlated(t, template, image, float(sigma), scale), True))
        else:
            out.append(Followed(t, False))
    return out


def correct(
    robot: RobotModel, seen: list[Track], anchors: tuple[Anchor, ...], pose: Pose2, covariance: Floats
) -> Correction:
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
    return Correction(after, spread, int(np.count_nonzero(estimate.inliers)))


def begin(robot: RobotModel, kept: tuple[Track, ...], frame: str, image: Image, pose: Pose2) -> tuple[Track, ...]:
    """New tracks beside those that are kept: corners of the model that are visible, distinctive, and well apart."""
    camera_from_world = robot.camera_from_world(pose)
    points = visible_points(
        robot.world, robot.camera, camera_from_world, margin_px=HALF_PX + 4.0, min_contrast=0.08, max_distance_m=15.0
    )
    strength = np.array([corner_strength(image, px, HALF_PX) for px in points.points_px])
    taken = [np.array(t.found_px or t.predicted_px) for t in kept]
    new: list[Track] = []
    for i in np.argsort(-strength, kind="stable"):
        if strength[i] < LEAST_CORNER or len(taken) >= TRACKS:
            break
        px, point = points.points_px[i], points.points_world[i]
        if all(np.linalg.norm(px - other) >= SPACING_PX for other in taken) and _is_unique(image, px):
            taken.append(px)
            name = robot.world.landmarks[points.landmark[i]].name
            new.append(_begun(point, px, float(camera_from_world.apply(point)[2]), name, frame))
    return tuple(new)


def _predicted(
    robot: RobotModel, points: Floats, pose: Pose2, covariance: Floats
) -> tuple[Floats, Floats, Floats]:
    """Depths (n,), pixels (n, 2) and the standard deviation (n,) of the pixels [px]."""
    state = np.array([pose.x_m, pose.y_m, pose.heading_rad])
    focal = np.array([robot.camera.fx, robot.camera.fy])
    p, _, jacobian = point_jacobian(points, focal, state, robot.mount.camera_from_robot)
    ahead = np.where(p[:, 2:] > NEAR_M, p, [0.0, 0.0, 1.0])
    spread = np.einsum("nij,jk,nik->ni", jacobian, covariance, jacobian)
    return p[:, 2], robot.camera.project(ahead), np.sqrt(np.max(spread, axis=1))


def _is_unique(image: Image, px: Floats) -> bool:
    return bool(self_correlation(image, px, HALF_PX, UNIQUE_PX).second_peak < UNIQUE)


def _correlated(track: Track, template: Template, image: Image, sigma: float, scale: float) -> Track:
    search = min(max(SIGMAS * sigma + 2.0, SEARCH_PX[0]), SEARCH_PX[1])
    found = correlate(template, image, np.array(track.predicted_px), search, scale=scale)
    if found is None or found.peak < LEAST_PEAK or found.at_border or found.peak - found.second_peak < LEAST_MARGIN:
        return replace(track, misses=track.misses + 1, peak=-1.0 if found is None else found.peak)
    at = (float(found.position_px[0]), float(found.position_px[1]))
    return replace(track, found_px=at, peak=float(found.peak), sigma_px=max(0.3, float(found.sigma_px)), misses=0)


def _begun(point: Floats, px: Floats, depth_m: float, landmark: str, frame: str) -> Track:
    x, y, z = (float(c) for c in point)
    at = (float(px[0]), float(px[1]))
    return Track(landmark, (x, y, z), frame, at, float(depth_m), at, at, 1.0, 0.3)


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
