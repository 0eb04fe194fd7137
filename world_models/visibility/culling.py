"""Culling (§3.4): which locales the camera sees into by portals, and what surfaces hide by their shadow volumes.

All points and lines of shadow volumes are in the camera frame [m].
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from world_models.building.building import Building
from world_models.building.geometry.outlines import subtract_intervals
from world_models.building.locales import Doorway
from world_models.camera import NEAR_PLANE_M, Camera
from world_models.compiled import compiled
from world_models.frames import Pose

Point = tuple[float, float, float]

Window = tuple[float, float, float, float]
"""Left, top, right, bottom of a rectangle in normalized image coordinates (x / z and y / z in the camera frame)."""

MIN_PORTAL_DISTANCE_M = 0.3
"""A doorway nearer than this counts as filling the image: parts of it may be closer than the near plane."""

MAX_DOORWAY_REACH_M = 2.0
"""A camera in a doorway is no further than this from the bounds of the rooms that it joins."""

MAX_SIGHT_M = 40.0
"""Rooms further away are not seen by a camera outside all rooms."""

MAX_PORTALS = 1024
"""Size of the cache of portals, in locales."""

WINDOW_MARGIN = 0.02
"""By how much a doorway's window is enlarged, in normalized image coordinates."""


@lru_cache(maxsize=8)
def image_window(camera: Camera) -> Window:
    """The largest window that the camera sees all of; the whole image where the lens does not distort."""
    u = np.linspace(-0.5, camera.width - 0.5, 33)
    v = np.linspace(-0.5, camera.height - 0.5, 33)
    left, right = (camera.rays(np.column_stack([np.full(33, x), v]))[:, 0] for x in (u[0], u[-1]))
    top, bottom = (camera.rays(np.column_stack([u, np.full(33, y)]))[:, 1] for y in (v[0], v[-1]))
    return float(left.max()), float(top.max()), float(right.min()), float(bottom.min())


def find_visible_locales(building: Building, window: Window, camera_from_world: Pose) -> dict[str, Window]:
    """The locales in view, each with its window; the camera's own locale has the whole image's ``window``."""
    centre = camera_from_world.inverse().translation
    seen = dict.fromkeys(locales_at_camera(building, centre), window)
    view = _CameraView(camera_from_world, float(centre[0]), float(centre[1]))
    todo = list(seen)
    while todo:
        here = todo.pop(0)
        for portal in portals_of(building, here):
            grown = _unite(seen.get(portal.there), _intersect(seen[here], view.window_of(portal)))
            if grown is not None and grown != seen.get(portal.there):
                seen[portal.there] = grown
                todo.append(portal.there)
    return seen


@dataclass(frozen=True, slots=True)
class Portal:
    """An open doorway as seen from inside one of its locales. Plain floats: few numbers, used often.

    Attributes:
        there: the locale beyond.
        corners: of the opening on this locale's wall: left foot, right foot, right head, left head [m, world].
    """

    there: str
    corners: tuple[Point, ...]


def portals_of(building: Building, locale: str) -> tuple[Portal, ...]:
    """The open doorways of a locale; cached."""
    return building.cached("portals", MAX_PORTALS, locale, lambda: _build_portals(building, locale))


def _build_portals(building: Building, locale: str) -> tuple[Portal, ...]:
    floor_m = building.floor_m(locale)
    return tuple(_build_portal(doorway, locale, floor_m) for doorway in building.doorways_of(locale))


def _build_portal(doorway: Doorway, locale: str, floor_m: float) -> Portal:
    (lx, ly), (rx, ry) = doorway.threshold_of(locale).tolist()
    top = floor_m + doorway.height_m
    return Portal(doorway.other(locale), ((lx, ly, floor_m), (rx, ry, floor_m), (rx, ry, top), (lx, ly, top)))


class _CameraView:
    """A camera pose in plain floats, with the camera's position on the plan [m, world]."""

    def __init__(self, camera_from_world: Pose, x: float, y: float) -> None:
        self._rows = [(*row, t) for row, t in zip(camera_from_world.rotation.tolist(),
                                                  camera_from_world.translation.tolist(), strict=True)]
        self._x, self._y = x, y

    def window_of(self, portal: Portal) -> Window | None:
        """The window that bounds a doorway; None where it is behind the camera."""
        if self._distance_m(portal) < MIN_PORTAL_DISTANCE_M:
            return -math.inf, -math.inf, math.inf, math.inf
        return _bounding_window(_clip_to_near_plane([self._in_camera(corner) for corner in portal.corners]))

    def _distance_m(self, portal: Portal) -> float:
        """Distance on the plan from the segment between the feet of the jambs."""
        (ax, ay, _), (bx, by, _) = portal.corners[:2]
        dx, dy = bx - ax, by - ay
        t = ((self._x - ax) * dx + (self._y - ay) * dy) / max(dx * dx + dy * dy, 1e-18)
        t = min(max(t, 0.0), 1.0)
        return math.hypot(ax + t * dx - self._x, ay + t * dy - self._y)

    def _in_camera(self, corner: Point) -> Point:
        """A point in the camera frame."""
        x, y, z = corner
        a, b, c = (r[0] * x + r[1] * y + r[2] * z + r[3] for r in self._rows)
        return a, b, c


def locales_at_camera(building: Building, centre_world: NDArray[np.float64]) -> tuple[str, ...]:
    """The room that the camera is in; both rooms in a doorway; elsewhere all rooms within MAX_SIGHT_M."""
    here = building.locale_at(centre_world)
    if here is not None and building.is_room(here):
        return (here,)
    for room in building.rooms_near(centre_world, MAX_DOORWAY_REACH_M):
        for doorway in building.doorways_of(room):
            if np.linalg.norm(doorway.centre_world - centre_world[:2]) < doorway.width_m / 2 + doorway.depth_m:
                return doorway.between
    return building.rooms_near(centre_world, MAX_SIGHT_M)


def _clip_to_near_plane(polygon_camera: Sequence[Point]) -> list[Point]:
    """The part of a polygon in front of the near plane (Sutherland-Hodgman) [m, camera frame]."""
    out: list[Point] = []
    for index, b in enumerate(polygon_camera):
        a = polygon_camera[index - 1]
        if (a[2] >= NEAR_PLANE_M) != (b[2] >= NEAR_PLANE_M):
            t = (NEAR_PLANE_M - a[2]) / (b[2] - a[2])
            out.append((a[0] + t * (b[0] - a[0]), a[1] + t * (b[1] - a[1]), NEAR_PLANE_M))
        if b[2] >= NEAR_PLANE_M:
            out.append(b)
    return out


def _bounding_window(polygon_camera: Sequence[Point]) -> Window | None:
    """The window round a polygon in front of the camera, enlarged by WINDOW_MARGIN."""
    if not polygon_camera:
        return None
    xs, ys = [x / z for x, _, z in polygon_camera], [y / z for _, y, z in polygon_camera]
    return min(xs) - WINDOW_MARGIN, min(ys) - WINDOW_MARGIN, max(xs) + WINDOW_MARGIN, max(ys) + WINDOW_MARGIN


def _intersect(one: Window, other: Window | None) -> Window | None:
    """The common part of two windows; None where there is none."""
    if other is None:
        return None
    x0, y0, x1, y1 = max(one[0], other[0]), max(one[1], other[1]), min(one[2], other[2]), min(one[3], other[3])
    return (x0, y0, x1, y1) if x0 < x1 and y0 < y1 else None


def _unite(one: Window | None, other: Window | None) -> Window | None:
    """The window round two windows; None is an empty one."""
    if one is None or other is None:
        return one or other
    return min(one[0], other[0]), min(one[1], other[1]), max(one[2], other[2]), max(one[3], other[3])


Floats = NDArray[np.float64]

CONTACT_M = 0.002
"""A point no deeper than this below a surface lies on it and is visible; details stand out by twice as much."""

MIN_PIECE = 1e-6
"""Smallest visible part of a line, relative to its length: smaller gaps are cracks between adjoining surfaces."""


@dataclass(frozen=True, eq=False)
class Shadows:
    """Shadow volumes of m front-facing surfaces with up to K corners.

    Attributes:
        bounds: (4, K + 1, m) half-spaces (g, h): a point p is in the shadow where all g . p + h >= 0; the last one is
            the surface's own plane.
        windows: (m, 4) windows round the surfaces.
        nearest_m: (m,) depth of the surface's nearest corner.
    """

    bounds: Floats
    windows: Floats
    nearest_m: Floats


def build_shadows(polygons: Floats, planes: Floats, windows: Floats) -> Shadows:
    """Shadow volumes of polygons (m, K, 3) with planes (m, 4), normals towards the camera, and windows (m, 4)."""
    bounds = np.zeros((4, polygons.shape[1] + 1, len(polygons)))
    x, y, z = np.ascontiguousarray(polygons.T)
    u, v, w = (np.concatenate([c[1:], c[:1]]) for c in (x, y, z))
    bounds[0, :-1], bounds[1, :-1], bounds[2, :-1] = z * v - y * w, x * w - z * u, y * u - x * v
    bounds[:3, -1] = -planes[:, :3].T
    bounds[3, -1] = planes[:, 3] - CONTACT_M
    return Shadows(bounds, windows, z.min(axis=0))


def clipped_spans(lines: Floats, window: Window) -> Floats:
    """(n, 2) parameters of the part of each segment (n, 2, 3) in front of the near plane and within the window."""
    x0, y0, x1, y1 = window
    x, y, z = (lines[..., i].T for i in range(3))
    values = np.stack([z - NEAR_PLANE_M, x - x0 * z, x1 * z - x, y - y0 * z, y1 * z - y])
    return _interval(values[:, 0], values[:, 1])


def _interval(start: Floats, end: Floats) -> Floats:
    """(n, 2) interval where k linear functions, given by values (k, n) at 0 and 1, are all >= 0; empty: low >= high."""
    before, after = start < 0, end < 0
    with np.errstate(divide="ignore", invalid="ignore"):
        root = start / (start - end)
    low = np.where(before, np.where(after, 2.0, root), 0.0)
    high = np.where(after & ~before, root, 1.0)
    return np.stack([low.max(axis=0), high.min(axis=0)], axis=1)


def cut_segments(lines: Floats, span: Floats) -> Floats:
    """(n, 2, 3) the part of each segment (n, 2, 3) between its two parameters (n, 2)."""
    a, d = lines[:, :1], lines[:, 1:] - lines[:, :1]
    return np.asarray(a + span[:, :, None] * d)


def lengths_px(segments_px: Floats) -> Floats:
    """(n,) lengths of segments (n, 2, 2) [px]."""
    return np.asarray(np.hypot(*(segments_px[:, 1] - segments_px[:, 0]).T))


def bounding_windows(points: Floats) -> Floats:
    """(n, 4) windows round n sets of points (n, k, 3); infinite where a point is behind the near plane."""
    x, y, z = np.ascontiguousarray(points.T)
    with np.errstate(divide="ignore", invalid="ignore"):
        x, y = x / z, y / z
    windows = np.stack([x.min(axis=0), y.min(axis=0), x.max(axis=0), y.max(axis=0)], axis=1)
    windows[z.min(axis=0) < 0.99 * NEAR_PLANE_M] = (-np.inf, -np.inf, np.inf, np.inf)
    return windows


def overlap(one: Floats, other: Floats) -> NDArray[np.bool_]:
    """(...) whether windows (..., 4) have a point in common."""
    common = (one[..., 0] <= other[..., 2]) & (one[..., 1] <= other[..., 3])
    common &= (other[..., 0] <= one[..., 2]) & (other[..., 1] <= one[..., 3])
    return np.asarray(common)


def visible_spans(lines: Floats, shadows: Shadows) -> tuple[NDArray[np.int64], Floats]:
    """The k visible parts of segments (n, 2, 3): index of the segment (k,), and parameters (k, 2)."""
    taken: list[list[tuple[float, float]]] = [[] for _ in lines]
    hidden = _find_hidden_spans(lines, bounding_windows(lines), shadows.bounds, shadows.windows, shadows.nearest_m)
    for number, low, high in zip(*hidden, strict=True):
        taken[number].append((low, high))
    rows = [(number, *span) for number, parts in enumerate(taken)
            for span in subtract_intervals((0.0, 1.0), parts, MIN_PIECE)]
    table = np.array(rows, float).reshape(-1, 3)
    return table[:, 0].astype(np.int64), table[:, 1:]


@compiled
def _find_hidden_spans(
    lines: Floats, own: Floats, bounds: Floats, windows: Floats, nearest_m: Floats
) -> tuple[list[int], list[float], list[float]]:  # pragma: no cover
    """Each part of a segment (n, 2, 3) with its window (n, 4) that is in a shadow: its number and both parameters."""
    numbers, lows, highs = [0 for _ in range(0)], [0.0 for _ in range(0)], [0.0 for _ in range(0)]
    planes = bounds.shape[1]
    for i in range(len(lines)):
        (ax, ay, az), (bx, by, bz) = lines[i, 0], lines[i, 1]
        for j in range(len(windows)):
            if not nearest_m[j] < max(az, bz):
                continue
            if not (own[i, 0] <= windows[j, 2] and own[i, 1] <= windows[j, 3]
                    and windows[j, 0] <= own[i, 2] and windows[j, 1] <= own[i, 3]):
                continue
            low, high = 0.0, 1.0
            for k in range(planes - 1, -1, -1):  # the surface's own plane first: it excludes most
                gx, gy, gz, h = bounds[0, k, j], bounds[1, k, j], bounds[2, k, j], bounds[3, k, j]
                start, end = gx * ax + gy * ay + gz * az + h, gx * bx + gy * by + gz * bz + h
                if start < 0.0 and end < 0.0:
                    low = 2.0
                    break
                if start < 0.0:
                    low = max(low, start / (start - end))
                elif end < 0.0:
                    high = min(high, start / (start - end))
            if high > low:
                numbers.append(i)
                lows.append(low)
                highs.append(high)
    return numbers, lows, highs


def _value(bounds: Floats, points: Floats) -> Floats:
    """(..., n) g . p + h for bounds (4, ..., n) and points (n, 3)."""
    gx, gy, gz, h = bounds
    x, y, z = points.T
    return np.asarray(gx * x + gy * y + gz * z + h)


def hidden_points(points: Floats, shadows: Shadows) -> NDArray[np.bool_]:
    """(n,) whether points (n, 3) lie in a shadow."""
    near_enough = shadows.nearest_m[None, :] < points[:, 2:]
    own = bounding_windows(points[:, None])
    point, surface = np.nonzero(overlap(own[:, None], shadows.windows[None]) & near_enough)
    inside = np.all(_value(shadows.bounds[:, :, surface], points[point]) >= 0, axis=0)
    hidden = np.zeros(len(points), bool)
    hidden[point[inside]] = True
    return hidden
