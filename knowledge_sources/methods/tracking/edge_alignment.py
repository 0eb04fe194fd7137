"""Alignment of a nearly known pose to the edges of a picture (§5, RAPID).

A template of a landmark is cut where the landmark is believed to be, so what is tracked by it is no better known than
the belief. Before templates are cut, the belief is therefore corrected by the visible model lines: along each, every
few pixels, the steepest place across it is looked for, and the pose on the floor that moves the lines onto these places
is solved for by reweighted least squares.
Source: §5 ("the projected and actual locations of the landmark images"); the search across the line is that of
C. Harris, C. Stennett, RAPID, BMVC 1990.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import cv2
import numpy as np

from knowledge_sources.methods.arrays import Floats, Image, Ints, Mask
from knowledge_sources.methods.pose import compute_point_jacobian, compute_pose_slopes, to_pose2
from world_models.frames import Pose2
from world_models.robot import RobotModel

MIN_EDGE_LINES = 6  # least number of lines that must agree with the fit
EDGE_SMOOTHING_PX = 1.0  # standard deviation of the smoothing before edges are located
EDGE_SPACING_PX = 8.0
"""Distance of the places along a model line at which its edge is looked for (Harris and Stennett 1990)."""
EDGE_INSET_PX = 4.0  # distance from a line's ends within which no edge is looked for, as other lines disturb
FIRST_EDGE_REACH_PX = 4.0  # distance across a line up to which its edge is looked for in the first round
LAST_EDGE_REACH_PX = 2.0  # distance across a line up to which its edge is looked for in the last round
EDGE_STEP_PX = 0.5  # step of the search across a line
EDGE_GATE_SIGMAS = 3.0  # standard deviations of a line's place that must lie within the reach
MIN_SURE_SHARE = 0.75  # least share of the places along lines that must pass this test in the first round
MIN_EDGE_GRADIENT_PER_PX = 2.0  # least gradient of an edge
MAX_SECOND_EDGE_SHARE = 0.6  # largest gradient of another edge within reach, as a share of the steepest
EDGE_SIGMA_PX = 0.4  # standard deviation of an edge's place, the model's own errors included (experiment table1)
EDGES_PER_LINE = 3.0  # largest weight of one line in places, as its error is the same all along it
MAX_EDGE_RESIDUAL_PX = 1.2  # largest distance of an edge from its model line after the fit
PRIOR_SIGMA_M = 0.02  # standard deviation added to the believed place, as templates err together (experiment table1)
PRIOR_SIGMA_RAD = 0.01
"""Standard deviation added to the believed heading, as templates err together (experiment table1)."""
INFLATION = np.diag([PRIOR_SIGMA_M**2, PRIOR_SIGMA_M**2, PRIOR_SIGMA_RAD**2])
EDGE_ITERATIONS = 4  # steps of the reweighted least-squares fit
MIN_EDGE_LINE_SHARE = 0.5  # least share of the lines with an edge near them that must agree with the fit


@dataclass(frozen=True, slots=True, eq=False)
class EdgeAlignment:
    """A pose aligned to edges, its covariance (3, 3) in the world, and how many lines agree with it."""

    world_from_robot: Pose2
    covariance: Floats
    lines: int


def align_to_edges(
    robot: RobotModel, image: Image, lines_world: Floats, world_from_robot: Pose2, covariance: Floats,
    camera_covariance: Floats,
) -> EdgeAlignment | None:
    """Find the pose that moves model lines onto the edges of a picture.

    Args:
        image: (h, w) grey, without lens distortion.
        lines_world: (n, 2, 3) the visible pieces of model lines.
        world_from_robot, covariance: what is believed, (3, 3) over (x, y, heading), world.
        camera_covariance: (7, 7) over ``CAMERA_UNKNOWNS``; the yaw is left out, as the heading is the camera's.

    Returns:
        None where too few lines agree, or where the belief is so loose that the nearest edge may belong to another
        line. Where that is so of some lines only, they are left out until the others have narrowed the belief.
    """
    smooth = np.asarray(cv2.GaussianBlur(image, (0, 0), EDGE_SMOOTHING_PX), np.uint8)
    pose, doubt, found = world_from_robot, covariance, None
    for reach_px in (FIRST_EDGE_REACH_PX, LAST_EDGE_REACH_PX):
        edges = _find_edges(robot, smooth, lines_world, pose, reach_px)
        if edges is None:
            return None
        doubt_px = EDGE_GATE_SIGMAS * edges.compute_sigmas(doubt)
        if found is None and (not len(doubt_px) or np.quantile(doubt_px, MIN_SURE_SHARE) > reach_px):
            return None
        found = _solve(edges.take(doubt_px <= reach_px), pose, world_from_robot, covariance)
        if found is None:
            return None
        pose, doubt = found.world_from_robot, found.covariance
    slopes = compute_pose_slopes(lines_world, robot.camera, robot.mount, pose)
    return found and _weigh_with_camera(found, world_from_robot, covariance, slopes @ camera_covariance @ slopes.T)


def _weigh_with_camera(found: EdgeAlignment, prior: Pose2, covariance: Floats, of_camera: Floats) -> EdgeAlignment:
    """What the edges tell is as unsure as the camera makes the pose, ``of_camera`` (3, 3); the belief is not.

    So the alignment comes between the belief and what the edges alone tell, and is never less sure than the belief.
    """
    of_belief = np.linalg.inv(covariance + INFLATION)
    information = np.linalg.inv(found.covariance)
    less = np.linalg.inv(np.eye(3) + (information - of_belief) @ of_camera)
    weighed = np.linalg.inv(of_belief + less @ (information - of_belief))
    step = weighed @ less @ information @ found.world_from_robot.minus(prior)
    return replace(found, world_from_robot=to_pose2(prior.vector + step), covariance=0.5 * (weighed + weighed.T))


@dataclass(frozen=True, slots=True, eq=False)
class _Edges:
    """Edges near model lines: signed distances (n,) [px], their derivatives by the pose (n, 3), the line (n,) of each.
    """

    offsets_px: Floats
    slopes: Floats
    line: Ints

    def compute_sigmas(self, covariance: Floats) -> Floats:
        """(n,) standard deviation of each edge across its line under a pose of that covariance (3, 3) [px]."""
        variances = np.einsum("ni,ij,nj->n", self.slopes, covariance, self.slopes)
        return np.asarray(np.sqrt(np.maximum(variances, 0.0)))

    def take(self, which: Mask) -> _Edges:
        """Those that a mask chooses."""
        return _Edges(self.offsets_px[which], self.slopes[which], self.line[which])


def _find_edges(robot: RobotModel, image: Image, lines: Floats, pose: Pose2, reach_px: float) -> _Edges | None:
    """The steepest place across each line, every few pixels along it, where it is the only one."""
    camera = robot.camera
    ends_px = camera.project(robot.camera_from_world(pose).apply(lines.reshape(-1, 3))).reshape(-1, 2, 2)
    line, part = _choose_places(ends_px)
    if not len(line):
        return None
    world = _intersect_lines(robot, lines[line], pose, part)
    p, at_px, jacobian = compute_point_jacobian(world, camera, pose, robot.mount.camera_from_robot)
    along = ends_px[line, 1] - ends_px[line, 0]
    along /= np.linalg.norm(along, axis=1, keepdims=True)
    normal = np.stack([-along[:, 1], along[:, 0]], axis=1)
    offset, good = _find_steepest(image, at_px + np.array([camera.cx, camera.cy]), normal, reach_px)
    good &= p[:, 2] > 0.0
    slopes = np.einsum("ni,nij->nj", normal, jacobian)
    return _Edges(offset[good], slopes[good], line[good])


def _choose_places(ends_px: Floats) -> tuple[Ints, Floats]:
    """Places along lines (k, 2, 2) in the picture: the line (n,), and the part of it (n,), 0 to 1."""
    inset_px = EDGE_INSET_PX
    length = np.linalg.norm(ends_px[:, 1] - ends_px[:, 0], axis=1)
    room = length - 2.0 * inset_px
    usable = np.isfinite(room) & (room > 0.0)
    count = np.where(usable, np.floor(np.nan_to_num(room) / EDGE_SPACING_PX) + 1.0, 0.0).astype(int)
    line = np.repeat(np.arange(len(ends_px)), count)
    nth = np.arange(len(line)) - np.repeat(np.cumsum(count) - count, count)
    px = inset_px + (nth + 0.5) * (room[line] / count[line])
    return line, px / length[line]


def _intersect_lines(robot: RobotModel, lines: Floats, pose: Pose2, part: Floats) -> Floats:
    """(n, 3) the points of lines (n, 2, 3) that are seen at a part (n,) of the way between their ends' images.

    By perspective, what is halfway in the picture is not halfway in space.
    """
    ends = robot.camera_from_world(pose).apply(lines.reshape(-1, 3)).reshape(-1, 2, 3)
    near, far = ends[:, 0, 2], ends[:, 1, 2]
    there = part * near / (part * near + (1.0 - part) * far)
    return np.asarray(lines[:, 0] + there[:, None] * (lines[:, 1] - lines[:, 0]))


def _find_steepest(image: Image, at_px: Floats, normal: Floats, reach_px: float) -> tuple[Floats, Mask]:
    """Signed distance (n,) along the normals to the steepest place within reach [px], and whether it is unique."""
    step_px = EDGE_STEP_PX
    reach = np.arange(-reach_px - step_px, reach_px + 1.5 * step_px, step_px)
    where = (at_px[:, None, :] + reach[None, :, None] * normal[:, None, :]).astype(np.float32)
    height, width = image.shape[:2]
    inside = np.all((where >= 0.0) & (where <= (width - 1.0, height - 1.0)), axis=(1, 2))
    grey = cv2.remap(image.astype(np.float32), where[..., 0], where[..., 1], cv2.INTER_LINEAR)
    steep = np.abs(grey[:, 2:] - grey[:, :-2]) / (2.0 * step_px)
    top = np.clip(np.argmax(steep, axis=1), 1, steep.shape[1] - 2)
    rows = np.arange(len(steep))
    a, b, c = steep[rows, top - 1], steep[rows, top], steep[rows, top + 1]
    bend = a - 2.0 * b + c
    shift = np.where(bend < 0.0, 0.5 * (a - c) / np.where(bend < 0.0, bend, 1.0), 0.0)
    is_peak = (b >= a) & (b >= c) & (b >= MIN_EDGE_GRADIENT_PER_PX)
    mid = steep[:, 1:-1]
    peaks = (mid >= steep[:, :-2]) & (mid > steep[:, 2:]) & (mid >= MAX_SECOND_EDGE_SHARE * b[:, None])
    offset = (reach[1:-1][top] + shift * step_px).astype(float)
    return offset, np.asarray(inside & is_peak & (np.count_nonzero(peaks, axis=1) <= 1))


def _solve(
    edges: _Edges, at: Pose2, prior: Pose2, covariance: Floats
) -> EdgeAlignment | None:
    """Least squares with a hard cut-off, from one step with Huber weights; the belief is one more measurement."""
    sigma_px, cutoff_px = EDGE_SIGMA_PX, MAX_EDGE_RESIDUAL_PX
    information = np.linalg.inv(covariance + INFLATION)
    away = at.minus(prior)
    per_line = np.bincount(edges.line, minlength=int(edges.line.max(initial=0)) + 1)[edges.line]
    weight = np.minimum(1.0, EDGES_PER_LINE / np.maximum(per_line, 1)) / sigma_px**2
    step = np.zeros(3)
    for number in range(EDGE_ITERATIONS):
        residual = np.abs(edges.offsets_px - edges.slopes @ step)
        w = weight * (1.0 / np.maximum(1.0, residual / sigma_px) if number == 0 else residual <= cutoff_px)
        hessian = edges.slopes.T @ (w[:, None] * edges.slopes) + information
        pull = edges.slopes.T @ (w * edges.offsets_px) - information @ away
        step = np.asarray(np.linalg.solve(hessian, pull), float)
    lines = len(np.unique(edges.line[np.abs(edges.offsets_px - edges.slopes @ step) <= cutoff_px]))
    if lines < max(MIN_EDGE_LINES, MIN_EDGE_LINE_SHARE * len(np.unique(edges.line))):
        return None
    return EdgeAlignment(to_pose2(at.vector + step), np.linalg.inv(hessian), lines)
