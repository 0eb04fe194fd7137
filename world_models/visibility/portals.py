"""Which locales the camera can look into, and through which part of the image: the doorways as a focus (§3.4)."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from world_models.building.locales import Doorway
from world_models.camera import NEAR_PLANE_M, Camera
from world_models.frames import Pose

if TYPE_CHECKING:
    from world_models.building.world import World

Point = tuple[float, float, float]

Window = tuple[float, float, float, float]
"""Left, top, right, bottom of a rectangle at depth 1 (x / z and y / z in the camera frame)."""

AT_HAND_M = 0.3
"""A doorway nearer than this may fill the whole image, parts of it closer than the near plane."""

AROUND_DOORWAY_M = 2.0
"""A camera in a doorway is no further from the rooms that it joins."""

SIGHT_M = 40.0
"""Nobody looks further."""

BORDER = 0.02
"""How much wider than its exact image a doorway is taken to be."""


def image_window(camera: Camera) -> Window:
    """The largest such rectangle whose points the camera sees (all of the image where the lens does not distort)."""
    u = np.linspace(-0.5, camera.width - 0.5, 33)
    v = np.linspace(-0.5, camera.height - 0.5, 33)
    left, right = (camera.rays(np.column_stack([np.full(33, x), v]))[:, 0] for x in (u[0], u[-1]))
    top, bottom = (camera.rays(np.column_stack([u, np.full(33, y)]))[:, 1] for y in (v[0], v[-1]))
    return float(left.max()), float(top.max()), float(right.min()), float(bottom.min())


def find_visible_locales(world: World, window: Window, camera_from_world: Pose) -> dict[str, Window]:
    """The locales in view, each with the rectangle through which it is seen; the camera's own one fills the image."""
    centre = camera_from_world.inverse().translation
    seen = dict.fromkeys(locales_at_camera(world, centre), window)
    eye = _Eye(camera_from_world, float(centre[0]), float(centre[1]))
    todo = list(seen)
    while todo:
        here = todo.pop(0)
        for portal in portals_of(world, here):
            grown = _joined(seen.get(portal.there), _common(seen[here], eye.through(portal)))
            if grown is not None and grown != seen.get(portal.there):
                seen[portal.there] = grown
                todo.append(portal.there)
    return seen


@dataclass(frozen=True, slots=True)
class Portal:
    """A doorway as seen from inside one of its locales, in plain numbers: there are few, and they are asked often.

    Attributes:
        there: the locale beyond.
        corners: of the opening on this locale's wall, left foot, right foot, right head, left head [m, world].
    """

    there: str
    corners: tuple[tuple[float, float, float], ...]


def portals_of(world: World, locale: str) -> tuple[Portal, ...]:
    """The open doorways of a locale; made once."""
    made: dict[str, tuple[Portal, ...]] = world.cache.setdefault("portals", {})
    if locale not in made:
        base = float(world.world_from_locale(locale).translation[2])
        made[locale] = tuple(_portal(doorway, locale, base) for doorway in world.doorways_of(locale))
    return made[locale]


def _portal(doorway: Doorway, locale: str, base: float) -> Portal:
    (lx, ly), (rx, ry) = doorway.threshold_of(locale).tolist()
    top = base + doorway.height_m
    return Portal(doorway.other(locale), ((lx, ly, base), (rx, ry, base), (rx, ry, top), (lx, ly, top)))


class _Eye:
    """A camera pose in plain numbers."""

    def __init__(self, camera_from_world: Pose, x: float, y: float) -> None:
        self._rows = [(*row, t) for row, t in zip(camera_from_world.rotation.tolist(),
                                                  camera_from_world.translation.tolist(), strict=True)]
        self._x, self._y = x, y

    def through(self, portal: Portal) -> Window | None:
        """The rectangle that bounds a doorway."""
        if self._away(portal) < AT_HAND_M:
            return -math.inf, -math.inf, math.inf, math.inf
        return bounds(near_clipped([self._camera(corner) for corner in portal.corners]))

    def _away(self, portal: Portal) -> float:
        """Distance from the line between the feet of the jambs."""
        (ax, ay, _), (bx, by, _) = portal.corners[:2]
        dx, dy = bx - ax, by - ay
        t = ((self._x - ax) * dx + (self._y - ay) * dy) / max(dx * dx + dy * dy, 1e-18)
        t = min(max(t, 0.0), 1.0)
        return math.hypot(ax + t * dx - self._x, ay + t * dy - self._y)

    def _camera(self, corner: tuple[float, float, float]) -> Point:
        x, y, z = corner
        a, b, c = (r[0] * x + r[1] * y + r[2] * z + r[3] for r in self._rows)
        return a, b, c


def locales_at_camera(world: World, centre_world: NDArray[np.float64]) -> tuple[str, ...]:
    """The room that the camera is in; both rooms in a doorway; from anywhere else all rooms within sight."""
    here = world.locale_at(centre_world)
    if here is not None and world.is_room(here):
        return (here,)
    for room in world.rooms_near(centre_world, AROUND_DOORWAY_M):
        for doorway in world.doorways_of(room):
            if np.linalg.norm(doorway.centre_world - centre_world[:2]) < doorway.width_m / 2 + doorway.depth_m:
                return doorway.between
    return world.rooms_near(centre_world, SIGHT_M)


def near_clipped(polygon_camera: Sequence[Point]) -> list[Point]:
    """The part of a polygon in front of the near plane."""
    out: list[Point] = []
    for index, b in enumerate(polygon_camera):
        a = polygon_camera[index - 1]
        if (a[2] >= NEAR_PLANE_M) != (b[2] >= NEAR_PLANE_M):
            t = (NEAR_PLANE_M - a[2]) / (b[2] - a[2])
            out.append((a[0] + t * (b[0] - a[0]), a[1] + t * (b[1] - a[1]), NEAR_PLANE_M))
        if b[2] >= NEAR_PLANE_M:
            out.append(b)
    return out


def bounds(polygon_camera: Sequence[Point]) -> Window | None:
    """The rectangle that bounds a polygon in front of the camera, a little enlarged."""
    if not polygon_camera:
        return None
    xs, ys = [x / z for x, _, z in polygon_camera], [y / z for _, y, z in polygon_camera]
    return min(xs) - BORDER, min(ys) - BORDER, max(xs) + BORDER, max(ys) + BORDER


def _common(one: Window, other: Window | None) -> Window | None:
    if other is None:
        return None
    x0, y0, x1, y1 = max(one[0], other[0]), max(one[1], other[1]), min(one[2], other[2]), min(one[3], other[3])
    return (x0, y0, x1, y1) if x0 < x1 and y0 < y1 else None


def _joined(one: Window | None, other: Window | None) -> Window | None:
    if one is None or other is None:
        return one or other
    return min(one[0], other[0]), min(one[1], other[1]), max(one[2], other[2]), max(one[3], other[3])
