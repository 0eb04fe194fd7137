"""One picture of a building that is not known yet: where its axes lie, feet of walls, uprights, and floor round it.

Most buildings have two directions at right angles (J. Coughlan, A. Yuille, Manhattan World, ICCV 1999). Each picture
tells the heading by them, so that no error of a turn adds up; what is left is linear (:mod:`~harvey_survey.axis_map`).
All is in the axes' frame: parallel to the building's axes, origin below the camera.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from knowledge_sources.methods.features import find_lines, read_picture
from knowledge_sources.methods.features.lines import LineSegments
from knowledge_sources.methods.features.manhattan import find_level_direction
from knowledge_sources.methods.floor.appearance import MAX_UNLIKE, compute_appearance, measure_unlike
from world_models.camera import Camera, CameraMount
from world_models.frames import wrap_angle

Floats = NDArray[np.float64]
Mask = NDArray[np.bool_]

RIGHT_RAD = math.pi / 2.0
AXIS_RAD = math.radians(1.5)
"""A level line runs along an axis that is not further from it."""
MAX_HEADING_RAD = math.radians(0.4)
"""A picture whose heading is less well known is not measured in [rad]."""
LEAST_HEADING_RAD = math.radians(0.03)
UPRIGHT_TILT = 0.02
"""Largest vertical part of the normal of the plane of an upright and the camera."""
MIN_BASE_PX, MIN_UPRIGHT_PX = 25.0, 25.0
MAX_SIGHT_M = 14.0
BEARING_STEP_RAD, DISTANCES = math.radians(0.3), 220
"""Of the floor round the robot: in which directions, and at how many distances, evenly in the picture."""
BESIDE_PX = 3.0
"""So far to both sides of a line it is looked whether there is floor [px]."""
MIN_FLOOR, MAX_FLOOR = 0.7, 0.3
"""Least part of floor before the foot of a wall, and largest behind it."""


@dataclass(frozen=True, eq=False, slots=True)
class FloorLooks:
    """What a floor looks like: mean (3,) and covariance (3, 3) of its looks, and its colour (3,) 0..255."""

    mean: Floats
    covariance: Floats
    colour: Floats

    def is_like(self, appearance: Floats) -> Mask:
        """Which of the looks (..., 3) are its."""
        return np.asarray(measure_unlike(appearance, self.mean, self.covariance) <= MAX_UNLIKE**2)


def is_floor(appearance: Floats, floors: Sequence[FloorLooks]) -> Mask:
    """Which of the looks (..., 3) are those of a floor that is known."""
    found = np.zeros(appearance.shape[:-1], bool)
    for floor in floors:
        found |= floor.is_like(appearance)
    return found


class Foot(NamedTuple):
    """The foot of a wall: a line of the floor along an axis, floor before it and none behind.

    Attributes:
        side: 0 south, 1 east, 2 north, 3 west of the camera.
        off_m, sigma_m: from the robot across the line: y of south and north, x of east and west.
        low_m, high_m: from where to where the line is seen, along it, from the robot.
    """

    side: int
    off_m: float
    sigma_m: float
    low_m: float
    high_m: float


class Upright(NamedTuple):
    """An upright line: its direction [rad, axes' frame] with its deviation, and slopes of its lower and upper end.

    At a distance of d it reaches from ``height + d * lower`` to ``height + d * upper``; an end at the border of the
    picture is cut: infinite.
    """

    bearing_rad: float
    sigma_rad: float
    lower: float
    upper: float


@dataclass(frozen=True, eq=False)
class AxisView:
    """One picture.

    Attributes:
        heading_rad, sigma_rad: of the robot in the axes' frame.
        camera, mount: pinhole and mounting.
        picture: (h, w, 3) red, green, blue, rectified.
        lines: its segments.
    """

    heading_rad: float
    sigma_rad: float
    camera: Camera
    mount: CameraMount
    picture: NDArray[np.uint8]
    lines: LineSegments

    @property
    def forward_m(self) -> Floats:
        """(2,) the camera from the robot's axis, in the axes' frame."""
        h = self.heading_rad
        return self.mount.forward_m * np.array([math.cos(h), math.sin(h)])

    @cached_property
    def bearings(self) -> Floats:
        """(b,) directions of the polar floor in the axes' frame [rad]."""
        return np.asarray(_polar_grid(self.camera, self.mount)[0] + self.heading_rad)

    @property
    def distances_m(self) -> Floats:
        """(d,) distances of the polar floor from the camera, the nearest first [m]."""
        return np.asarray(_polar_grid(self.camera, self.mount)[1])

    @cached_property
    def polar(self) -> Floats:
        """(b, d, 3) looks of the floor in these directions at these distances; NaN outside the picture."""
        *_, u, v, inside = _polar_grid(self.camera, self.mount)
        colours = cv2.remap(self.picture, u, v, cv2.INTER_LINEAR).astype(float)
        found = compute_appearance(colours)
        found[~inside] = np.nan
        return np.asarray(found)

    def colours_at(self, points: Floats) -> tuple[Floats, Mask]:
        """Colours (..., 3) at points (..., 3) [m, axes' frame from the camera's foot], and which are in the picture."""
        c, s = math.cos(self.heading_rad), math.sin(self.heading_rad)
        x, y = points[..., 0] * c + points[..., 1] * s, points[..., 1] * c - points[..., 0] * s
        seen = self.mount.camera_from_robot.apply(np.stack([x + self.mount.forward_m, y, points[..., 2]], axis=-1))
        ahead = seen[..., 2] > 0.1
        pixels = self.camera.project(np.where(ahead[..., None], seen, [0.0, 0.0, 1.0]))
        inside = ahead & self.camera.inside(pixels, 1.0)
        u, v = (np.where(inside, pixels[..., k], 0.0).astype(np.float32) for k in (0, 1))
        flat = cv2.remap(self.picture, u.reshape(u.shape[0], -1), v.reshape(u.shape[0], -1), cv2.INTER_LINEAR)
        return flat.reshape(*u.shape, 3).astype(float), inside

    def find_feet(self, floors: Sequence[FloorLooks]) -> list[Foot]:
        """Feet of walls where floors look so."""
        lines = self.lines.take(self.lines.lengths_px >= MIN_BASE_PX)
        ends = _to_floor(lines.segments_px, self)
        far = np.linalg.norm(ends, axis=2).max(axis=1)
        step = ends[:, 1] - ends[:, 0]
        _, angle, angle_sigma = _measure_angles(lines, self.camera, self.mount)
        slack = np.minimum(3.0 * angle_sigma, 2.0 * AXIS_RAD)
        kept = np.flatnonzero((far < MAX_SIGHT_M) & (np.abs(_fold(angle + self.heading_rad)) < AXIS_RAD + slack))
        across = np.where(np.abs(step[:, 0]) > np.abs(step[:, 1]), 1, 0)
        rows = [i for i in kept if self._is_foot(lines.segments_px[i], floors)]
        across, ends = across[rows], ends[rows]
        pick = np.arange(len(rows))
        middle = ends.mean(axis=1)
        offset = middle[pick, across]
        shifted = _to_floor(_shift(lines.segments_px[rows], lines.sigma_offset_px[rows]), self).mean(axis=1)
        sigma = np.hypot(shifted[pick, across] - offset, self.sigma_rad * np.abs(middle[pick, 1 - across]))
        side = np.where(across == 1, np.where(offset > 0.0, 2, 0), np.where(offset > 0.0, 1, 3))
        low, high = np.sort(ends[pick, :, 1 - across], axis=1).T + self.forward_m[1 - across]
        parts = (side, offset + self.forward_m[across], np.hypot(sigma, 0.003), low, high)
        return [Foot(*foot) for foot in zip(*(part.tolist() for part in parts), strict=True)]

    def _is_foot(self, segment: Floats, floors: Sequence[FloorLooks]) -> bool:
        """Whether there is floor below a segment and none above it."""
        share = np.linspace(0.05, 0.95, 12)[:, None]
        points = segment[0] + share * (segment[1] - segment[0])
        along = segment[1] - segment[0]
        down = np.array([-along[1], along[0]]) / np.linalg.norm(along)
        down = down if down[1] > 0.0 else -down
        sides = np.stack([points + BESIDE_PX * down, points - BESIDE_PX * down]).astype(np.float32)
        inside = self.camera.inside(sides)
        colours = cv2.remap(self.picture, sides[..., 0], sides[..., 1], cv2.INTER_LINEAR).astype(float)
        like = is_floor(compute_appearance(colours), floors)
        if inside.all(axis=0).sum() < 6:
            return False
        below, above = like[0][inside[0]].mean(), like[1][inside[1]].mean()
        return bool(below >= MIN_FLOOR and above <= MAX_FLOOR)

    @cached_property
    def uprights(self) -> list[Upright]:
        """The upright lines."""
        lines = self.lines.take(self.lines.lengths_px >= MIN_UPRIGHT_PX)
        rays = _robot_rays(lines.segments_px, self.camera, self.mount)
        rows = np.flatnonzero(np.abs(_normals(rays)[:, 2]) < UPRIGHT_TILT)
        lines, rays = lines.take(rows), rays[rows]
        level = np.linalg.norm(rays[..., :2], axis=2)
        slope = np.sort(rays[..., 2] / level, axis=1)
        middle = rays.mean(axis=1)
        bearing = np.arctan2(middle[:, 1], middle[:, 0])
        moved = _robot_rays(_shift(lines.segments_px, lines.sigma_offset_px), self.camera, self.mount).mean(axis=1)
        sigma = np.abs(np.arctan2(moved[:, 1], moved[:, 0]) - bearing)
        v = np.sort(lines.segments_px[..., 1], axis=1)  # the picture's upper border is the upper end
        slope[v[:, 1] > self.camera.height - 4.0, 0] = -np.inf
        slope[v[:, 0] < 3.0, 1] = np.inf
        rows = np.column_stack([bearing + self.heading_rad, np.hypot(sigma, self.sigma_rad), slope])
        return [Upright(*row) for row in zip(*rows.T.tolist(), strict=True)]


def see_axes(jpeg: bytes, camera: Camera, mount: CameraMount, heading_rad: float) -> AxisView | None:
    """A picture by its axes; None where they are not seen well enough.

    Args:
        camera: with the lens as it is.
        heading_rad: about where the robot heads; it must be right within 40 degrees.

    Raises:
        ValueError: it is not a picture.
    """
    pinhole, shown = camera.pinhole, read_picture(jpeg)
    lines = find_lines(shown.rectified(camera, pinhole))
    first = find_level_direction(lines.segments_px, pinhole, mount.camera_from_robot)
    if first is None:
        return None
    axis, sigma_rad = _refine_axis(lines, pinhole, mount, first)
    if sigma_rad > MAX_HEADING_RAD:
        return None
    heading = heading_rad + math.remainder(-axis - heading_rad, RIGHT_RAD)
    color = shown.color
    if camera.distortion is not None:
        from knowledge_sources.methods.features.picture import get_rectifier
        color = get_rectifier(camera, pinhole).rectify(color)
    return AxisView(wrap_angle(heading), sigma_rad, pinhole, mount, np.asarray(color), lines)


def _refine_axis(lines: LineSegments, camera: Camera, mount: CameraMount, first: float) -> tuple[float, float]:
    """The axes' direction in the robot's frame, modulo a right angle, by all level lines; its deviation."""
    normal, angle, sigma = _measure_angles(lines, camera, mount)
    usable = (np.hypot(normal[:, 0], normal[:, 1]) > 0.15) & (np.abs(normal[:, 2]) > 0.05) & np.isfinite(sigma)
    angle, sigma = angle[usable], np.maximum(sigma[usable], math.radians(0.05))
    best, deviation = first, math.inf
    for width in (math.radians(2.0), math.radians(1.0), math.radians(0.6)):
        off = _fold(angle - best)
        weight = np.maximum(0.0, 1.0 - (off / (width + sigma)) ** 2) ** 2 / sigma**2
        if weight.sum() <= 0.0 or np.count_nonzero(weight) < 3:
            return best, math.inf
        best += float(weight @ off / weight.sum())
        spread = max(1.0, float(np.sqrt(weight @ (off / sigma) ** 2 / weight.sum())))
        deviation = spread / math.sqrt(weight.sum())
    return best, math.hypot(deviation, LEAST_HEADING_RAD)


def _measure_angles(lines: LineSegments, camera: Camera, mount: CameraMount) -> tuple[Floats, Floats, Floats]:
    """Of each segment the normal of its plane with the camera; the direction of the level line in it, modulo a right
    angle, with its deviation [rad, the robot's frame]."""
    normal = _normals(_robot_rays(lines.segments_px, camera, mount))
    turned = _normals(_robot_rays(_turn(lines.segments_px, lines.sigma_angle_rad), camera, mount))
    angle, other = (np.arctan2(n[:, 0], -n[:, 1]) for n in (normal, turned))
    return normal, angle, np.abs(_fold(other - angle))


def _fold(angle_rad: Floats) -> Floats:
    """Within half a right angle of 0."""
    return np.asarray(np.mod(angle_rad + RIGHT_RAD / 2.0, RIGHT_RAD) - RIGHT_RAD / 2.0)


def _normals(rays: Floats) -> Floats:
    normal = np.cross(rays[:, 0], rays[:, 1])
    return np.asarray(normal / np.maximum(np.linalg.norm(normal, axis=1), 1e-12)[:, None])


def _robot_rays(pixels: Floats, camera: Camera, mount: CameraMount) -> Floats:
    return np.asarray(camera.rays(pixels) @ mount.camera_from_robot.rotation)


def _to_floor(pixels: Floats, view: AxisView) -> Floats:
    """Points (..., 2) of the floor [m, axes' frame from the camera's foot]; NaN above the horizon."""
    rays = _robot_rays(pixels, view.camera, view.mount)
    with np.errstate(divide="ignore", invalid="ignore"):
        reach = np.where(rays[..., 2] < -1e-3, view.mount.height_m / -rays[..., 2], np.inf)
        flat = np.where(np.isfinite(reach)[..., None], rays[..., :2] * reach[..., None], np.nan)
        c, s = math.cos(view.heading_rad), math.sin(view.heading_rad)
        return np.asarray(np.stack([c * flat[..., 0] - s * flat[..., 1], s * flat[..., 0] + c * flat[..., 1]], axis=-1))


def _shift(segments: Floats, by_px: Floats) -> Floats:
    along = segments[:, 1] - segments[:, 0]
    across = np.stack([-along[:, 1], along[:, 0]], axis=1) / np.linalg.norm(along, axis=1)[:, None]
    return np.asarray(segments + (by_px[:, None] * across)[:, None])


def _turn(segments: Floats, by_rad: Floats) -> Floats:
    along = segments[:, 1] - segments[:, 0]
    across = 0.5 * by_rad[:, None] * np.stack([-along[:, 1], along[:, 0]], axis=1)
    return np.stack([segments[:, 0] - across, segments[:, 1] + across], axis=1)


@lru_cache(maxsize=4)
def _polar_grid(
    camera: Camera, mount: CameraMount
) -> tuple[Floats, Floats, NDArray[np.float32], NDArray[np.float32], Mask]:
    """Directions (b,) from the robot's heading, distances (d,) from the camera, and their pixels (b, d)."""
    corners = _robot_rays(np.array([[0.0, 0.0], [0.0, camera.height - 1.0], [camera.width - 1.0, 0.0],
                                    [camera.width - 1.0, camera.height - 1.0]]), camera, mount)
    widest = float(np.abs(np.arctan2(corners[:, 1], corners[:, 0])).max())
    bearings = np.arange(-widest, widest, BEARING_STEP_RAD)
    lowest = float((corners[:, 2] / np.linalg.norm(corners[:, :2], axis=1)).min())
    nearest = mount.height_m / max(-lowest * 1.2, 0.1)
    distances = 1.0 / np.linspace(1.0 / nearest, 1.0 / MAX_SIGHT_M, DISTANCES)
    x = mount.forward_m + distances * np.cos(bearings)[:, None]
    points = np.stack([x, distances * np.sin(bearings)[:, None], np.zeros_like(x)], axis=-1)
    pixels = camera.project(mount.camera_from_robot.apply(points))
    u, v = (np.ascontiguousarray(pixels[..., k], np.float32) for k in (0, 1))
    return bearings, distances, u, v, camera.inside(pixels, 1.0)
