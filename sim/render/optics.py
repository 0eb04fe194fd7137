"""The lens: bends what an ideal camera would see, by the model that OpenCV uses, written out here once more.

The renderer draws what a pinhole sees, twice as fine and as wide as the lens looks; each pixel of the picture is the
mean of four points of it. Where a ray came from that falls on a pixel is solved for by Newton's method: an independent
check on ``world_models.camera``.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from sim.render.renderer import Renderer
from world_models.camera import Camera
from world_models.frames import Pose

FINER = 2
"""The ideal picture has so many pixels for each pixel's side, and each pixel is the mean of as many squared."""
STEPS, NEAR = 25, 1e-12
WIDEST = 8.0
"""No ray further out than this (in focal lengths) is looked for: 83 degrees."""
Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Optics:
    """What a camera sees through its lens.

    Attributes:
        ideal: the pinhole that is drawn.
        places: column and row (FINER h, FINER w) in its picture of the points of the pixels [px]; None for a pinhole.
    """

    ideal: Camera
    places: tuple[NDArray[np.float32], NDArray[np.float32]] | None = None

    @staticmethod
    def of(camera: Camera) -> Optics:
        """The lens of a camera. Raises ValueError where it bends rays so much that two fall on one pixel."""
        if camera.distortion is None:
            return Optics(camera)
        rays = undistort(_points(camera), np.asarray(camera.distortion))
        fx, fy = FINER * camera.fx, FINER * camera.fy
        focal = np.array([fx, fy])
        low, high = (rays * focal).min(axis=(0, 1)) - 4.0, (rays * focal).max(axis=(0, 1)) + 4.0
        width, height = (int(n) for n in np.ceil(high - low) + 1)
        ideal = Camera(fx, fy, -float(low[0]), -float(low[1]), width, height)
        u, v = np.moveaxis(rays * focal - low, -1, 0).astype(np.float32)
        return Optics(ideal, (np.ascontiguousarray(u), np.ascontiguousarray(v)))

    def radiance(self, renderer: Renderer, camera_from_world: Pose) -> NDArray[np.float32]:
        """The noiseless image (height, width, 3), RGB in 0..1."""
        drawn = renderer.radiance(self.ideal, camera_from_world)
        if self.places is None:
            return drawn
        fine = np.asarray(cv2.remap(drawn, *self.places, cv2.INTER_LINEAR), np.float32)
        size = fine.shape[1] // FINER, fine.shape[0] // FINER
        return np.asarray(cv2.resize(fine, size, interpolation=cv2.INTER_AREA), np.float32)


def check_lens(camera: Camera) -> None:
    """Raises ValueError where a camera's lens cannot be rendered, by the rim of its picture."""
    if camera.distortion is not None:
        rays = (camera.border() - (camera.cx, camera.cy)) / (camera.fx, camera.fy)
        undistort(rays, np.asarray(camera.distortion))


def distort(rays: Floats, distortion: Floats) -> tuple[Floats, tuple[Floats, Floats, Floats]]:
    """Rays (..., 2), x / z and y / z, behind the lens, and their derivatives by those before it: dx/dx, dx/dy = dy/dx,
    dy/dy, (...) each.
    """
    k1, k2, p1, p2, k3 = distortion
    x, y = rays[..., 0], rays[..., 1]
    r2 = x * x + y * y
    radial = 1.0 + k1 * r2 + k2 * r2**2 + k3 * r2**3
    slope = 2.0 * (k1 + 2.0 * k2 * r2 + 3.0 * k3 * r2**2)
    out = np.stack([x * radial + 2.0 * p1 * x * y + p2 * (r2 + 2.0 * x * x),
                    y * radial + p1 * (r2 + 2.0 * y * y) + 2.0 * p2 * x * y], axis=-1)
    cross = x * y * slope + 2.0 * (p1 * x + p2 * y)
    dxx = radial + x * x * slope + 2.0 * p1 * y + 6.0 * p2 * x
    dyy = radial + y * y * slope + 6.0 * p1 * y + 2.0 * p2 * x
    return out, (dxx, cross, dyy)


def undistort(rays: Floats, distortion: Floats) -> Floats:
    """The rays (..., 2) before the lens that are ``rays`` behind it.

    Raises:
        ValueError: there are none, or the lens is beyond where it folds the picture over.
    """
    before = rays.copy()
    for _ in range(STEPS):
        out, (dxx, cross, dyy) = distort(before, distortion)
        unfolded = dxx * dyy - cross * cross
        error = rays - out
        if float(np.max(np.abs(error))) < NEAR:
            break
        ex, ey = error[..., 0], error[..., 1]
        step = np.stack([dyy * ex - cross * ey, dxx * ey - cross * ex], axis=-1)
        before = before + np.clip(step / np.where(np.abs(unfolded) < 1e-9, 1e-9, unfolded)[..., None], -0.3, 0.3)
    else:
        unfolded = np.zeros(1)
    if not (np.all(unfolded > 0.0) and np.all(np.abs(before) < WIDEST)):
        raise ValueError("expected a distortion that has one ray for every pixel, got "
                         f"{[float(k) for k in distortion]}, which has none at the rim of this picture")
    return before


def _points(camera: Camera) -> Floats:
    """(FINER h, FINER w, 2) points inside the pixels, as rays behind the lens."""
    u, v = ((np.arange(FINER * size) + 0.5) / FINER - 0.5 for size in (camera.width, camera.height))
    return np.stack(np.meshgrid((u - camera.cx) / camera.fx, (v - camera.cy) / camera.fy), axis=-1)
