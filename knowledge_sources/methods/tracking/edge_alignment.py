"""Where the edges of the model truly lie in a picture, and the pose that they tell when it is nearly known (§5).

A template of a landmark is cut where the landmark is believed to be: what is followed by it is no surer than the
belief. So before templates are cut, the belief is put right by the visible model lines: along each, every few pixels,
the steepest place across it is sought, and the pose on the floor that moves the lines onto these places is solved for.
Source: §5 ("the projected and actual locations of the landmark images"); the search across the line is that of
Harris and Stennett, RAPID (1990).
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from knowledge_sources.methods.pose.planar import compute_point_jacobian
from world_models.frames import Pose2, wrap_angle
from world_models.robot import RobotModel

Floats = NDArray[np.float64]
Image = NDArray[np.uint8]

EVERY_PX = 8.0
"""Distance of the places along a line at which the picture is searched across it."""
INSET_PX = 4.0
"""So far from a line's ends other lines disturb."""
ACROSS_PX = (4.0, 2.0)
"""How far to both sides is searched, round after round."""
STEP_PX = 0.5
STEEP = 2.0
"""Grey levels per pixel below which there is no edge."""
RIVAL = 0.6
"""Another edge in reach that is so steep, as a part of the steepest, makes the place ambiguous."""
SIGMA_PX = 0.4
"""Standard deviation of an edge's place, the model's own errors included."""
OWN = 3.0
"""A line has so many independent places at the most: what puts it off is the same all along it."""
CUTOFF_PX = 1.2
"""Further from its line than this, an edge is another one."""
DOUBT_M, DOUBT_RAD = 0.02, 0.01
"""What is believed counts as no surer than this: it comes from templates, which err together, and edges tell anew."""
LEAST_LINES, LEAST_PART = 6, 0.5
"""So many lines, and this part of those near which there is an edge, must agree."""
ROUNDS = 4
MOST_LINES = 75.0
"""Percent of the places along lines that must be sure to within the first search's reach."""


@dataclass(frozen=True, slots=True, eq=False)
class EdgeAlignment:
    """A pose that model lines tell, its covariance (3, 3), world, and how many lines agree with it."""

    world_from_robot: Pose2
    covariance: Floats
    lines: int


def align_to_edges(
    robot: RobotModel, image: Image, lines_world: Floats, world_from_robot: Pose2, covariance: Floats
) -> EdgeAlignment | None:
    """The pose that moves model lines onto the edges of a picture; None where too few of them are found.

    It is None too where the belief is so loose that the nearest edge need not be a line's own; where that is so of some
    lines only, they are left out until the others have made it sure enough.

    Args:
        image: (h, w) grey, without lens distortion.
        lines_world: (n, 2, 3) the visible pieces of model lines.
        world_from_robot, covariance: what is believed, (3, 3) over (x, y, heading), world.
    """
    smooth = np.asarray(cv2.GaussianBlur(image, (0, 0), 1.0), np.uint8)
    pose, doubt, found = world_from_robot, covariance, None
    for across_px in ACROSS_PX:
        seen = _edges(robot, smooth, lines_world, pose, across_px)
        if seen is None:
            return None
        doubt_px = seen.doubt_px(doubt)
        if found is None and _for_most(doubt_px) > across_px:
            return None
        found = _solved(seen.only(doubt_px <= across_px), pose, world_from_robot, covariance)
        if found is None:
            return None
        pose, doubt = found.world_from_robot, found.covariance
    return found


@dataclass(frozen=True, slots=True, eq=False)
class _Edges:
    """Edges near model lines: signed distances (n,) [px], their derivatives (n, 3), the line (n,) of each."""

    offsets_px: Floats
    slopes: Floats
    line: NDArray[np.int64]

    def doubt_px(self, covariance: Floats) -> Floats:
        """(n,) how far a pose that is so sure may put each across its line: 3 deviations [px]."""
        variances = np.einsum("ni,ij,nj->n", self.slopes, covariance, self.slopes)
        return np.asarray(3.0 * np.sqrt(np.maximum(variances, 0.0)))

    def only(self, which: NDArray[np.bool_]) -> _Edges:
        """Some of them."""
        return _Edges(self.offsets_px[which], self.slopes[which], self.line[which])


def _edges(robot: RobotModel, image: NDArray[np.uint8], lines: Floats, pose: Pose2, across_px: float) -> _Edges | None:
    """The steepest place across each line, every few pixels along it, where there is just one."""
    camera = robot.camera
    state = np.array([pose.x_m, pose.y_m, pose.heading_rad])
    ends_px = camera.project(robot.camera_from_world(pose).apply(lines.reshape(-1, 3))).reshape(-1, 2, 2)
    line, part = _places(ends_px)
    if not len(line):
        return None
    # what is halfway in the picture is not halfway in space; so points are intersected with the line by their part
    world = _on_line(robot, lines[line], pose, part)
    p, at_px, jacobian = compute_point_jacobian(
        world, np.array([camera.fx, camera.fy]), state, robot.mount.camera_from_robot)
    along = ends_px[line, 1] - ends_px[line, 0]
    along /= np.linalg.norm(along, axis=1, keepdims=True)
    normal = np.stack([-along[:, 1], along[:, 0]], axis=1)
    offset, good = _steepest(image, at_px + np.array([camera.cx, camera.cy]), normal, across_px)
    good &= p[:, 2] > 0.0
    slopes = np.einsum("ni,nij->nj", normal, jacobian)
    return _Edges(offset[good], slopes[good], line[good])


def _for_most(doubt_px: Floats) -> float:
    return float(np.percentile(doubt_px, MOST_LINES)) if len(doubt_px) else np.inf


def _places(ends_px: Floats) -> tuple[NDArray[np.int64], Floats]:
    """Which line (n,), and which part of it in the picture (n,), 0..1."""
    length = np.linalg.norm(ends_px[:, 1] - ends_px[:, 0], axis=1)
    room = length - 2.0 * INSET_PX
    count = np.where(np.isfinite(room) & (room > 0.0), np.floor(np.nan_to_num(room) / EVERY_PX) + 1.0, 0.0).astype(int)
    line = np.repeat(np.arange(len(ends_px)), count)
    nth = np.arange(len(line)) - np.repeat(np.cumsum(count) - count, count)
    px = INSET_PX + (nth + 0.5) * (room[line] / count[line])
    return line, px / length[line]


def _on_line(robot: RobotModel, lines: Floats, pose: Pose2, part: Floats) -> Floats:
    """(n, 3) the points of lines (n, 2, 3) that are seen at a part (n,) of the way between their ends' images."""
    ends = robot.camera_from_world(pose).apply(lines.reshape(-1, 3)).reshape(-1, 2, 3)
    near, far = ends[:, 0, 2], ends[:, 1, 2]
    there = part * near / (part * near + (1.0 - part) * far)
    return np.asarray(lines[:, 0] + there[:, None] * (lines[:, 1] - lines[:, 0]))


def _steepest(
    image: NDArray[np.uint8], at_px: Floats, normal: Floats, across_px: float
) -> tuple[Floats, NDArray[np.bool_]]:
    """Signed distance (n,) along the normals to the steepest place within reach [px], and whether it stands alone."""
    reach = np.arange(-across_px - STEP_PX, across_px + 1.5 * STEP_PX, STEP_PX)
    where = (at_px[:, None, :] + reach[None, :, None] * normal[:, None, :]).astype(np.float32)
    height, width = image.shape[:2]
    inside = np.all((where >= 0.0) & (where <= (width - 1.0, height - 1.0)), axis=(1, 2))
    grey = cv2.remap(image.astype(np.float32), where[..., 0], where[..., 1], cv2.INTER_LINEAR)
    steep = np.abs(grey[:, 2:] - grey[:, :-2]) / (2.0 * STEP_PX)
    top = np.clip(np.argmax(steep, axis=1), 1, steep.shape[1] - 2)
    rows = np.arange(len(steep))
    a, b, c = steep[rows, top - 1], steep[rows, top], steep[rows, top + 1]
    bend = a - 2.0 * b + c
    shift = np.where(bend < 0.0, 0.5 * (a - c) / np.where(bend < 0.0, bend, 1.0), 0.0)
    is_peak = (b >= a) & (b >= c) & (b >= STEEP)
    peaks = (steep[:, 1:-1] >= steep[:, :-2]) & (steep[:, 1:-1] > steep[:, 2:]) & (steep[:, 1:-1] >= RIVAL * b[:, None])
    offset = (reach[1:-1][top] + shift * STEP_PX).astype(float)
    return offset, np.asarray(inside & is_peak & (np.count_nonzero(peaks, axis=1) <= 1))


def _solved(edges: _Edges, at: Pose2, prior: Pose2, covariance: Floats) -> EdgeAlignment | None:
    """Least squares with a cut-off, from a robust start, with what was believed as one more measurement."""
    information = np.linalg.inv(covariance + np.diag([DOUBT_M**2, DOUBT_M**2, DOUBT_RAD**2]))
    away = np.array([at.x_m - prior.x_m, at.y_m - prior.y_m, wrap_angle(at.heading_rad - prior.heading_rad)])
    per_line = np.bincount(edges.line, minlength=int(edges.line.max(initial=0)) + 1)[edges.line]
    weight = np.minimum(1.0, OWN / np.maximum(per_line, 1)) / SIGMA_PX**2
    step = np.zeros(3)
    for number in range(ROUNDS):
        left = edges.offsets_px - edges.slopes @ step
        robust = 1.0 / np.maximum(1.0, np.abs(left) / SIGMA_PX) if number == 0 else np.abs(left) <= CUTOFF_PX
        w = weight * robust
        hessian = edges.slopes.T @ (w[:, None] * edges.slopes) + information
        step = np.linalg.solve(hessian, edges.slopes.T @ (w * edges.offsets_px) - information @ away)
    lines = len(np.unique(edges.line[np.abs(edges.offsets_px - edges.slopes @ step) <= CUTOFF_PX]))
    if lines < max(LEAST_LINES, LEAST_PART * len(np.unique(edges.line))):
        return None
    pose = Pose2(at.x_m + float(step[0]), at.y_m + float(step[1]), wrap_angle(at.heading_rad + float(step[2])))
    return EdgeAlignment(pose, np.linalg.inv(hessian), lines)
