"""The lens: distorts a pinhole picture by OpenCV's model (Brown-Conrady), as an independent check on the robot's own.

The renderer draws a pinhole picture at twice the resolution, as wide as the lens looks; each pixel is the mean of four
points of it. The ray of a pixel is found by Newton's method.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from sim.render.renderer import Renderer
from world_models.camera import Camera
from world_models.frames import Pose

OVERSAMPLING = 2
"""Pixels of the pinhole picture along each side of a pixel of the picture."""
MAX_NEWTON_STEPS, MAX_RESIDUAL = 25, 1e-12
"""Of the solution for a ray; the residual is in focal lengths."""
MAX_RAY = 8.0
"""Largest distance of a ray from the axis, in focal lengths (83 degrees)."""
Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Optics:
    """A camera's lens as a map into a pinhole picture.

    Attributes:
        pinhole: the pinhole camera that is rendered.
        source_px: columns and rows in its picture, (OVERSAMPLING h, OVERSAMPLING w) each, of the points of the pixels;
            None where the camera is a pinhole itself.
    """

    pinhole: Camera
    source_px: tuple[NDArray[np.float32], NDArray[np.float32]] | None = None

    @staticmethod
    def of(camera: Camera) -> Optics:
        """The lens of a camera. Raises ValueError where its distortion cannot be inverted within the picture."""
        if camera.distortion is None:
            return Optics(camera)
        rays = undistort(_subpixel_rays(camera), np.asarray(camera.distortion))
        fx, fy = OVERSAMPLING * camera.fx, OVERSAMPLING * camera.fy
        focal = np.array([fx, fy])
        low, high = (rays * focal).min(axis=(0, 1)) - 4.0, (rays * focal).max(axis=(0, 1)) + 4.0
        width, height = (int(n) for n in np.ceil(high - low) + 1)
        pinhole = Camera(fx, fy, -float(low[0]), -float(low[1]), width, height)
        u, v = np.moveaxis(rays * focal - low, -1, 0).astype(np.float32)
        return Optics(pinhole, (np.ascontiguousarray(u), np.ascontiguousarray(v)))

    def radiance(self, renderer: Renderer, camera_from_world: Pose) -> NDArray[np.float32]:
        """The noiseless image (height, width, 3), RGB in 0..1."""
        drawn = renderer.radiance(self.pinhole, camera_from_world)
        if self.source_px is None:
            return drawn
        fine = np.asarray(cv2.remap(drawn, *self.source_px, cv2.INTER_LINEAR), np.float32)
        size = fine.shape[1] // OVERSAMPLING, fine.shape[0] // OVERSAMPLING
        return np.asarray(cv2.resize(fine, size, interpolation=cv2.INTER_AREA), np.float32)


def check_lens(camera: Camera) -> None:
    """Raises ValueError where a camera's distortion cannot be inverted at the border of its picture."""
    if camera.distortion is not None:
        rays = (camera.border() - (camera.cx, camera.cy)) / (camera.fx, camera.fy)
        undistort(rays, np.asarray(camera.distortion))


def distort(rays: Floats, distortion: Floats) -> tuple[Floats, tuple[Floats, Floats, Floats]]:
    """Distort rays (..., 2) = (x / z, y / z) by (k1, k2, p1, p2[, k3[, k4, k5, k6]]).

    Returns the distorted rays, and their derivatives dx/dx, dx/dy = dy/dx and dy/dy, (...) each.
    """
    k1, k2, p1, p2, k3, k4, k5, k6 = np.pad(distortion, (0, 8 - len(distortion)))
    x, y = rays[..., 0], rays[..., 1]
    r2 = x * x + y * y
    under = 1.0 + k4 * r2 + k5 * r2**2 + k6 * r2**3
    radial = (1.0 + k1 * r2 + k2 * r2**2 + k3 * r2**3) / under
    slope = 2.0 * (k1 - radial * k4 + 2.0 * (k2 - radial * k5) * r2 + 3.0 * (k3 - radial * k6) * r2**2) / under
    out = np.stack([x * radial + 2.0 * p1 * x * y + p2 * (r2 + 2.0 * x * x),
                    y * radial + p1 * (r2 + 2.0 * y * y) + 2.0 * p2 * x * y], axis=-1)
    cross = x * y * slope + 2.0 * (p1 * x + p2 * y)
    dxx = radial + x * x * slope + 2.0 * p1 * y + 6.0 * p2 * x
    dyy = radial + y * y * slope + 6.0 * p1 * y + 2.0 * p2 * x
    return out, (dxx, cross, dyy)


def undistort(rays: Floats, distortion: Floats) -> Floats:
    """Invert :func:`distort` by Newton's method: the rays (..., 2) before the lens of distorted ``rays``.

    Raises:
        ValueError: there are none, or the distortion is not one-to-one there.
    """
    before = rays.copy()
    for _ in range(MAX_NEWTON_STEPS):
        out, (dxx, cross, dyy) = distort(before, distortion)
        determinant = dxx * dyy - cross * cross
        error = rays - out
        if float(np.max(np.abs(error))) < MAX_RESIDUAL:
            break
        ex, ey = error[..., 0], error[..., 1]
        step = np.stack([dyy * ex - cross * ey, dxx * ey - cross * ex], axis=-1)
        before = before + np.clip(step / np.where(np.abs(determinant) < 1e-9, 1e-9, determinant)[..., None], -0.3, 0.3)
    else:
        determinant = np.zeros(1)
    if not (np.all(determinant > 0.0) and np.all(np.abs(before) < MAX_RAY)):
        raise ValueError("expected a distortion that has one ray for every pixel, got "
                         f"{[float(k) for k in distortion]}, which has none at the rim of this picture")
    return before


def _subpixel_rays(camera: Camera) -> Floats:
    """(OVERSAMPLING h, OVERSAMPLING w, 2) points inside the pixels, as distorted rays."""
    u, v = ((np.arange(OVERSAMPLING * size) + 0.5) / OVERSAMPLING - 0.5 for size in (camera.width, camera.height))
    return np.stack(np.meshgrid((u - camera.cx) / camera.fx, (v - camera.cy) / camera.fy), axis=-1)
