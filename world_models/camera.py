"""The sensor model (§3.2): pinhole projection, lens distortion, clipping, and the camera's mounting.

Pixels: the centre of the top-left pixel is (0.0, 0.0), u to the right, v down (OpenCV's convention).
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from world_models.frames import Pose, frozen
from world_models.obstruction import Obstruction

NEAR_PLANE_M = 0.05
"""Near plane: points at a smaller depth are not projected."""

MAX_UNDISTORT_STEPS, UNDISTORT_TOLERANCE, MIN_RADIAL = 300, 1e-12, 0.2
"""Of the fixed-point iteration that undoes distortion: steps, size of the last step (normalized coordinates), and
smallest radial factor; at a stronger barrel distortion no ray falls on a pixel."""

_ZOOMS = tuple(1.0 + 0.01 * i for i in range(101))
"""Factors on the focal lengths that :attr:`Camera.pinhole` tries, in order."""


@dataclass(frozen=True, eq=False)
class Camera:
    """A pinhole camera with OpenCV's distortion model.

    Attributes:
        fx, fy: focal lengths [px].
        cx, cy: principal point [px].
        width, height: image size [px].
        distortion: ``None`` or (k1, k2, p1, p2[, k3]), OpenCV's order.
        obstruction: what hides a part of the undistorted picture, if anything does.

    Raises:
        ValueError: focal lengths or size not positive, or not 4 or 5 finite distortion coefficients.
    """

    fx: float
    fy: float
    cx: float
    cy: float
    width: int
    height: int
    distortion: Any = None
    obstruction: Obstruction | None = None

    def __post_init__(self) -> None:
        if not (self.fx > 0 and self.fy > 0 and self.width > 0 and self.height > 0):
            raise ValueError(
                "expected positive focal lengths and image size, got "
                f"fx={self.fx}, fy={self.fy}, width={self.width}, height={self.height}"
            )
        if self.distortion is not None:
            k = np.asarray(self.distortion, float).ravel()
            if k.size not in (4, 5) or not np.all(np.isfinite(k)):
                raise ValueError(f"expected 4 or 5 finite distortion coefficients, got {self.distortion!r}")
            object.__setattr__(self, "distortion", frozen(np.pad(k, (0, 5 - k.size))))

    @staticmethod
    def from_field_of_view(horizontal_rad: float, width: int = 512, height: int = 512) -> Camera:
        """A camera with square pixels, the principal point in the middle and no distortion."""
        f = width / (2.0 * math.tan(horizontal_rad / 2.0))
        return Camera(f, f, (width - 1) / 2.0, (height - 1) / 2.0, width, height)

    @property
    def matrix(self) -> NDArray[np.float64]:
        """(3, 3) intrinsic matrix K."""
        return np.array([[self.fx, 0.0, self.cx], [0.0, self.fy, self.cy], [0.0, 0.0, 1.0]])

    @property
    def pinhole(self) -> Camera:
        """The distortion-free camera that pictures are rectified to.

        Its focal lengths are this camera's, enlarged where the rectified picture would have empty borders (a
        pincushion lens).
        """
        if self.distortion is None:
            return self
        plain = replace(self, distortion=None)
        zoomed = (replace(plain, fx=f * self.fx, fy=f * self.fy) for f in _ZOOMS)
        return next((camera for camera in zoomed if self._fills(camera)), plain)

    def project(self, points_camera: Any) -> NDArray[np.float64]:
        """Pixels (..., 2) of points (..., 3) [m, camera frame], which must lie in front of the camera.

        The caller clips (see :meth:`project_segments`).
        """
        p = np.asarray(points_camera, float)
        xy = self._distort(p[..., :2] / p[..., 2:3])
        return xy * (self.fx, self.fy) + (self.cx, self.cy)

    def rays(self, pixels: Any) -> NDArray[np.float64]:
        """Directions (..., 3), z = 1, in the camera frame, of distorted pixels (..., 2)."""
        xy = self._undistort((np.asarray(pixels, float) - (self.cx, self.cy)) / (self.fx, self.fy))
        return np.concatenate([xy, np.ones_like(xy[..., :1])], axis=-1)

    def undistort(self, pixels: Any) -> NDArray[np.float64]:
        """Undistorted pixels (..., 2) of distorted pixels (..., 2), with the same focal lengths."""
        if self.distortion is None:
            return np.asarray(pixels, float)
        return self.rays(pixels)[..., :2] * (self.fx, self.fy) + (self.cx, self.cy)

    def inside(self, pixels: Any, margin_px: float = 0.0) -> NDArray[np.bool_]:
        """Which pixels (..., 2) lie in the image, at least ``margin_px`` from its border."""
        p = np.asarray(pixels, float)
        high = np.array([self.width - 0.5, self.height - 0.5]) - margin_px
        return np.asarray(np.all((p >= margin_px - 0.5) & (p <= high), axis=-1))

    def project_segments(
        self, lines_world: Any, camera_from_world: Pose
    ) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
        """Project segments (n, 2, 3) [m, world], clipped to the near plane and to the image.

        Clipping to the image is along the straight undistorted line.

        Returns:
            segments_px (n, 2, 2), NaN where nothing is visible, and the mask (n,) of visible segments.
        """
        lines = np.asarray(lines_world, float).reshape(-1, 2, 3)
        p = camera_from_world.apply(lines)
        out = np.full((len(lines), 2, 2), np.nan)
        if not len(lines):
            return out, np.zeros(0, bool)
        # Near plane: an end behind it moves along the segment to the plane.
        z = p[..., 2]
        front = z > NEAR_PLANE_M
        dz = z[:, 1] - z[:, 0]
        t = (NEAR_PLANE_M - z[:, 0]) / np.where(np.abs(dz) < 1e-12, 1.0, dz)
        cut = p[:, 0] + t[:, None] * (p[:, 1] - p[:, 0])
        for end in (0, 1):
            move = ~front[:, end] & front[:, 1 - end]
            p[move, end] = cut[move]
        keep = front.any(axis=1)
        px = np.full_like(out, np.nan)
        px[keep] = self.project(p[keep])
        clipped, inside = clip_segments(px[keep], self.width, self.height)
        out[keep] = clipped
        mask = np.zeros(len(lines), bool)
        mask[np.flatnonzero(keep)[inside]] = True
        out[~mask] = np.nan
        return out, mask

    def _fills(self, pinhole: Camera) -> bool:
        """Whether the whole picture of a distortion-free camera is within this camera's picture."""
        return bool(np.all(self.inside(self.project(pinhole.rays(pinhole.border())), -0.5)))

    def border(self, steps: int = 33) -> NDArray[np.float64]:
        """(4 steps, 2) points on the border of the picture [px]."""
        u = np.linspace(-0.5, self.width - 0.5, steps)
        v = np.linspace(-0.5, self.height - 0.5, steps)
        sides = [(u, np.full(steps, y)) for y in v[[0, -1]]] + [(np.full(steps, x), v) for x in u[[0, -1]]]
        return np.concatenate([np.column_stack(side) for side in sides])

    def _distort(self, xy: NDArray[np.float64]) -> NDArray[np.float64]:
        """Distorted normalized coordinates (..., 2)."""
        if self.distortion is None:
            return xy
        k1, k2, p1, p2, k3 = self.distortion
        x, y = xy[..., 0], xy[..., 1]
        r2 = x * x + y * y
        radial = 1.0 + r2 * (k1 + r2 * (k2 + r2 * k3))
        return np.stack(
            [
                x * radial + 2.0 * p1 * x * y + p2 * (r2 + 2.0 * x * x),
                y * radial + p1 * (r2 + 2.0 * y * y) + 2.0 * p2 * x * y,
            ],
            axis=-1,
        )

    def _undistort(self, xy: NDArray[np.float64]) -> NDArray[np.float64]:
        """Undistorted normalized coordinates (..., 2), by fixed-point iteration as in OpenCV."""
        if self.distortion is None:
            return xy
        k1, k2, p1, p2, k3 = self.distortion
        x0, y0 = x, y = xy[..., 0], xy[..., 1]
        for _ in range(MAX_UNDISTORT_STEPS):
            r2 = x * x + y * y
            radial = np.maximum(1.0 + r2 * (k1 + r2 * (k2 + r2 * k3)), MIN_RADIAL)
            before = x, y
            x, y = ((x0 - 2.0 * p1 * x * y - p2 * (r2 + 2.0 * x * x)) / radial,
                    (y0 - p1 * (r2 + 2.0 * y * y) - 2.0 * p2 * x * y) / radial)
            if all(np.all(np.abs(now - then) <= UNDISTORT_TOLERANCE) for now, then in zip((x, y), before, strict=True)):
                break
        return np.stack([x, y], axis=-1)


@dataclass(frozen=True, slots=True)
class CameraMount:
    """Pose of the camera on the robot.

    Attributes:
        height_m: optical centre above the floor [m].
        forward_m: optical centre ahead of the turning axis [m].
        tilt_rad: downward tilt of the optical axis [rad].
        roll_rad: about the optical axis, clockwise as the camera looks: its right side is low [rad].
        yaw_rad: of the optical axis from the robot's heading, positive to the left [rad].
    """

    height_m: float
    forward_m: float = 0.0
    tilt_rad: float = 0.0
    roll_rad: float = 0.0
    yaw_rad: float = 0.0

    @property
    def camera_from_robot(self) -> Pose:
        return _place_camera(self)


@lru_cache(maxsize=64)
def _place_camera(mount: CameraMount) -> Pose:
    """Where the camera of a mount is: asked for at each line that is predicted, and seldom another mount's."""
    c, s = math.cos(mount.tilt_rad), math.sin(mount.tilt_rad)
    # Rows are the camera's axes (right, down, forward) in the robot's frame.
    rotation = np.array([[0.0, -1.0, 0.0], [-s, 0.0, -c], [c, 0.0, -s]])
    if mount.yaw_rad:
        c, s = math.cos(mount.yaw_rad), math.sin(mount.yaw_rad)
        rotation = rotation @ np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]])
    if mount.roll_rad:
        c, s = math.cos(mount.roll_rad), math.sin(mount.roll_rad)
        rotation = np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]]) @ rotation
    return Pose(rotation, -rotation @ np.array([mount.forward_m, 0.0, mount.height_m]))


CAMERA_UNKNOWNS = ("tilt_rad", "roll_rad", "yaw_rad", "height_m", "focal", "cx_px", "cy_px")
"""What is learnt of a camera, in this order: its mounting [rad, m], its focal lengths as a part of them, and its
principal point [px]."""
YAW = CAMERA_UNKNOWNS.index("yaw_rad")


def move_camera(camera: Camera, mount: CameraMount, step: Any) -> tuple[Camera, CameraMount]:
    """A camera and its mounting after a step (7,) of :data:`CAMERA_UNKNOWNS`; both focal lengths grow by one factor."""
    tilt, roll, yaw, height, focal, cx, cy = (float(part) for part in step)
    lens = camera if focal == cx == cy == 0.0 else replace(
        camera, fx=camera.fx * (1.0 + focal), fy=camera.fy * (1.0 + focal), cx=camera.cx + cx, cy=camera.cy + cy)
    return lens, CameraMount(mount.height_m + height, mount.forward_m, mount.tilt_rad + tilt, mount.roll_rad + roll,
                             mount.yaw_rad + yaw)


def subtract_cameras(camera: Camera, mount: CameraMount, other: Camera, other_mount: CameraMount) -> tuple[float, ...]:
    """The step (7,) of :data:`CAMERA_UNKNOWNS` that takes the other camera and its mounting to these."""
    return (mount.tilt_rad - other_mount.tilt_rad, mount.roll_rad - other_mount.roll_rad,
            mount.yaw_rad - other_mount.yaw_rad, mount.height_m - other_mount.height_m, camera.fx / other.fx - 1.0,
            camera.cx - other.cx, camera.cy - other.cy)


@dataclass(frozen=True, slots=True)
class CameraDeviation:
    """How well a camera and its mounting are known: standard deviations, 0 where nobody has stated any.

    Attributes:
        tilt_rad, height_m, forward_m: of the mounting.
        focal: of the focal length, as a part of it.
        roll_rad, yaw_rad: of the mounting.
    """

    tilt_rad: float = 0.0
    height_m: float = 0.0
    forward_m: float = 0.0
    focal: float = 0.0
    roll_rad: float = 0.0
    yaw_rad: float = 0.0


NOT_STATED = CameraDeviation()
"""Nobody has stated how well a camera is known."""


def clip_segments(
    segments_px: NDArray[np.float64], width: int, height: int
) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
    """Liang-Barsky clipping of segments (n, 2, 2) [px] to the image; the mask (n,) marks visible ones."""
    seg = np.asarray(segments_px, float).reshape(-1, 2, 2)
    a, d = seg[:, 0], seg[:, 1] - seg[:, 0]
    t0, t1 = np.zeros(len(seg)), np.ones(len(seg))
    visible = np.ones(len(seg), bool)
    for axis, size in ((0, width), (1, height)):
        for sign, limit in ((-1.0, 0.5), (1.0, size - 0.5)):
            step, room = sign * d[:, axis], limit - sign * a[:, axis]
            parallel = np.abs(step) < 1e-12
            t = room / np.where(parallel, 1.0, step)
            t0 = np.where(~parallel & (step < 0), np.maximum(t0, t), t0)
            t1 = np.where(~parallel & (step > 0), np.minimum(t1, t), t1)
            visible &= ~(parallel & (room < 0))
    visible &= t0 < t1
    ends = np.stack([a + t0[:, None] * d, a + t1[:, None] * d], axis=1)
    return ends, visible
