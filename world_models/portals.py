"""Which locales the camera can look into, and through which part of the image: the doorways as a focus (§3.4)."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from world_models.camera import NEAR_M, Camera
from world_models.frames import Pose
from world_models.locales import Doorway
from world_models.outlines import distance_to_border

if TYPE_CHECKING:
    from world_models.world import World

Window = tuple[float, float, float, float]
"""Left, top, right, bottom of a rectangle at depth 1 (x / z and y / z in the camera frame)."""

AT_HAND_M = 0.3
"""A doorway nearer than this may fill the whole image, parts of it closer than the near plane."""

BORDER = 0.02
"""How much wider than its exact image a doorway is taken to be."""


def image_window(camera: Camera) -> Window:
    """The largest such rectangle whose points the camera sees (all of the image where the lens does not distort)."""
    u = np.linspace(-0.5, camera.width - 0.5, 33)
    v = np.linspace(-0.5, camera.height - 0.5, 33)
    left, right = (camera.rays(np.column_stack([np.full(33, x), v]))[:, 0] for x in (u[0], u[-1]))
    top, bottom = (camera.rays(np.column_stack([u, np.full(33, y)]))[:, 1] for y in (v[0], v[-1]))
    return float(left.max()), float(top.max()), float(right.min()), float(bottom.min())


def windows_of(world: World, window: Window, camera_from_world: Pose) -> dict[str, Window]:
    """The locales in view, each with the rectangle through which it is seen; the camera's own one fills the image."""
    centre = camera_from_world.inverse().translation
    seen = dict.fromkeys(locales_at_camera(world, centre), window)
    todo = list(seen)
    while todo:
        here = todo.pop(0)
        for doorway in world.doorways_of(here):
            there = doorway.other(here)
            through = _common(seen[here], _through(doorway, here, world, camera_from_world))
            grown = _joined(seen.get(there), through)
            if grown is not None and grown != seen.get(there):
                seen[there] = grown
                todo.append(there)
    return seen


def locales_at_camera(world: World, centre_world: NDArray[np.float64]) -> tuple[str, ...]:
    """The room that the camera is in; both rooms in a doorway; all rooms from anywhere else."""
    here = world.locale_at(centre_world)
    if here is not None and here in world.rooms:
        return (here,)
    for doorway in world.doorways:
        if np.linalg.norm(doorway.centre_world - centre_world[:2]) < doorway.width_m / 2 + doorway.depth_m:
            return doorway.between
    return world.rooms


def _through(doorway: Doorway, locale: str, world: World, camera_from_world: Pose) -> Window | None:
    """The rectangle that bounds a doorway as seen from inside ``locale``."""
    feet = doorway.threshold_of(locale)
    if distance_to_border(camera_from_world.inverse().translation[:2], feet) < AT_HAND_M:
        return -np.inf, -np.inf, np.inf, np.inf
    base = float(world.world_from_locale(locale).translation[2])
    heights = (base, base + doorway.height_m)
    corners = [(*feet[0], heights[0]), (*feet[1], heights[0]), (*feet[1], heights[1]), (*feet[0], heights[1])]
    return bounds(near_clipped(camera_from_world.apply(corners)))


def near_clipped(polygon_camera: NDArray[np.float64]) -> NDArray[np.float64]:
    """The part of a polygon (k, 3) in front of the near plane (k', 3)."""
    out = []
    for a, b in zip(polygon_camera, np.roll(polygon_camera, -1, axis=0), strict=True):
        if a[2] >= NEAR_M:
            out.append(a)
        if (a[2] >= NEAR_M) != (b[2] >= NEAR_M):
            out.append(a + (NEAR_M - a[2]) / (b[2] - a[2]) * (b - a))
    return np.array(out).reshape(-1, 3)


def bounds(polygon_camera: NDArray[np.float64]) -> Window | None:
    """The rectangle that bounds a polygon (k, 3) in front of the camera, a little enlarged."""
    if not len(polygon_camera):
        return None
    xy = polygon_camera[:, :2] / polygon_camera[:, 2:]
    (x0, y0), (x1, y1) = xy.min(axis=0) - BORDER, xy.max(axis=0) + BORDER
    return float(x0), float(y0), float(x1), float(y1)


def _common(one: Window, other: Window | None) -> Window | None:
    if other is None:
        return None
    x0, y0, x1, y1 = max(one[0], other[0]), max(one[1], other[1]), min(one[2], other[2]), min(one[3], other[3])
    return (x0, y0, x1, y1) if x0 < x1 and y0 < y1 else None


def _joined(one: Window | None, other: Window | None) -> Window | None:
    if one is None or other is None:
        return one or other
    return min(one[0], other[0]), min(one[1], other[1]), max(one[2], other[2]), max(one[3], other[3])
