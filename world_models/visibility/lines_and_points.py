"""Which model lines and corners a camera sees: exact hidden-line removal by shadow volumes.

Seen from the optical centre, a convex one-sided surface hides what lies in its shadow volume: beyond its plane and
within the pyramid of its sides. Each of these bounds is linear in a point, so that the hidden part of a segment is an
interval, computed for all pairs of lines and surfaces at once (:mod:`world_models.visibility.culling`). Locales that no
chain of doorways opens to the camera are left out beforehand (§3.4: the locale network as a focusing mechanism).
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from world_models.building.building import Building
from world_models.building.geometry.landmarks import Landmark
from world_models.building.geometry.scene import Scene
from world_models.camera import NEAR_PLANE_M, Camera
from world_models.frames import Pose
from world_models.visibility.culling import (
    MIN_PIECE,
    Shadows,
    Window,
    bounding_windows,
    build_shadows,
    clipped_spans,
    cut_segments,
    find_visible_locales,
    hidden_points,
    image_window,
    lengths_px,
    overlap,
    visible_spans,
)

Floats = NDArray[np.float64]

MAX_VIEWS = 16
"""Size of the cache of views: as many as a sketch has milestones, or a milestone directions."""


@dataclass(frozen=True, eq=False, slots=True)
class VisibleLines:
    """The visible pieces of model lines.

    Attributes:
        segments_px: (n, 2, 2) projections.
        lines_world: (n, 2, 3) the visible pieces [m].
        landmark, line: (n,) which line (``marks[landmark].lines_world[line]``).
        contrast: (n,) expected brightness step across the line, 0..1.
        marks: landmarks by their number in the world, these among them.
    """

    segments_px: Floats
    lines_world: Floats
    landmark: NDArray[np.int64]
    line: NDArray[np.int64]
    contrast: Floats
    marks: Mapping[int, Landmark]

    def __len__(self) -> int:
        return len(self.segments_px)

    def __getitem__(self, keep: Any) -> VisibleLines:
        """Some of them, by mask or index array."""
        return VisibleLines(self.segments_px[keep], self.lines_world[keep], self.landmark[keep], self.line[keep],
                            self.contrast[keep], self.marks)


@dataclass(frozen=True, eq=False, slots=True)
class VisiblePoints:
    """The visible corners of landmarks.

    Attributes:
        points_px: (n, 2) projections.
        points_world: (n, 3) [m].
        landmark, point: (n,) which corner (``marks[landmark].points_world[point]``).
        contrast: (n,) second largest expected brightness step among the lines that meet there, 0..1.
        marks: landmarks by their number in the world, these among them.
    """

    points_px: Floats
    points_world: Floats
    landmark: NDArray[np.int64]
    point: NDArray[np.int64]
    contrast: Floats
    marks: Mapping[int, Landmark]

    def __len__(self) -> int:
        return len(self.points_px)

    def __getitem__(self, keep: Any) -> VisiblePoints:
        """Some of them, by mask or index array."""
        return VisiblePoints(self.points_px[keep], self.points_world[keep], self.landmark[keep], self.point[keep],
                             self.contrast[keep], self.marks)


def visible_lines(
    building: Building,
    camera: Camera,
    camera_from_world: Pose,
    *,
    locales: Collection[str] | None = None,
    min_length_px: float = 6.0,
    min_contrast: float = 0.02,
    min_separation_px: float = 2.0,
    max_distance_m: float = 40.0,
) -> VisibleLines:
    """The visible pieces of model lines, hidden lines removed, clipped to the image; the last views are cached.

    Args:
        locales: only lines of landmarks in these (all: ``None``); things elsewhere still hide them.
        min_length_px: shorter pieces are left out.
        min_contrast: lines of lower contrast are left out.
        min_separation_px: of lines within this distance of each other in the image only the one of highest contrast
            is kept (0: keep all).
        max_distance_m: pieces whose nearer end is further away are left out.
    """
    wanted = None if locales is None else tuple(sorted(locales))
    key = (camera, camera_from_world.rotation.tobytes(), camera_from_world.translation.tobytes(), wanted,
           min_length_px, min_contrast, min_separation_px, max_distance_m)
    return building.cached(
        "visible lines", MAX_VIEWS, key,
        lambda: _visible_lines(building, camera, camera_from_world, locales, min_length_px, min_contrast,
                               min_separation_px, max_distance_m))


def _visible_lines(
    building: Building, camera: Camera, camera_from_world: Pose, locales: Collection[str] | None, min_length_px: float,
    min_contrast: float, min_separation_px: float, max_distance_m: float,
) -> VisibleLines:
    view = _CameraView(building, camera, camera_from_world)
    scene = view.scene
    contrast = scene.edges.contrasts(camera_from_world.inverse().translation)
    index = np.flatnonzero(_in_locales(scene, scene.line_locales, locales) & (contrast >= min_contrast))
    lines = camera_from_world.apply(scene.edges.lines_world[index]).reshape(-1, 2, 3)
    span = clipped_spans(lines, view.window)
    ahead = np.flatnonzero(span[:, 1] - span[:, 0] > MIN_PIECE)
    index, lines = index[ahead], cut_segments(lines[ahead], span[ahead])
    keep = lengths_px(camera.project(lines)) >= min_length_px
    keep[keep] &= np.linalg.norm(lines[keep], axis=2).min(axis=1) < max_distance_m
    keep[keep] &= overlap(bounding_windows(lines[keep]), view.windows_for(scene.line_locales[index[keep]]))
    index, lines = index[keep], lines[keep]
    owner, span = visible_spans(lines, view.shadows())
    index, lines = index[owner], cut_segments(lines[owner], span)
    segments = camera.project(lines)
    found = VisibleLines(segments, camera_from_world.inverse().apply(lines), scene.line_landmark[index],
                         scene.line_index[index], contrast[index], scene.marks)
    found = found[lengths_px(segments) >= min_length_px]
    if min_separation_px > 0:
        found = found[_suppress_close_lines(found, min_separation_px)]
    return found if camera.obstruction is None else found[camera.obstruction.shows(found.segments_px)]


def visible_points(
    building: Building,
    camera: Camera,
    camera_from_world: Pose,
    *,
    locales: Collection[str] | None = None,
    min_contrast: float = 0.02,
    margin_px: float = 0.0,
    max_distance_m: float = 40.0,
) -> VisiblePoints:
    """The visible landmark corners, at least ``margin_px`` from the border of the image.

    A corner is visible where at least two model lines with ``min_contrast`` meet. For the other arguments see
    :func:`visible_lines`.
    """
    view = _CameraView(building, camera, camera_from_world)
    scene = view.scene
    centre = camera_from_world.inverse().translation
    steps = np.append(scene.edges.contrasts(centre), 0.0)[scene.corner_lines]
    contrast = np.sort(steps, axis=1)[:, -2]
    near = np.linalg.norm(scene.corners_world - centre, axis=1) < max_distance_m
    index = np.flatnonzero(_in_locales(scene, scene.corner_locales, locales) & near & (contrast >= min_contrast))
    points = camera_from_world.apply(scene.corners_world[index]).reshape(-1, 3)
    ahead = points[:, 2] > NEAR_PLANE_M
    index, points = index[ahead], points[ahead]
    pixels = camera.project(points)
    keep = camera.inside(pixels, margin_px)
    keep[keep] &= ~hidden_points(points[keep], view.shadows())
    if camera.obstruction is not None:
        keep[keep] &= ~camera.obstruction.covers(pixels[keep])
    index = index[keep]
    return VisiblePoints(pixels[keep], scene.corners_world[index], scene.corner_landmark[index],
                         scene.corner_index[index], contrast[index], scene.marks)


class _CameraView:
    """The locales and surfaces in view of one camera pose."""

    def __init__(self, building: Building, camera: Camera, camera_from_world: Pose) -> None:
        self.camera_from_world = camera_from_world
        self.window = image_window(camera)
        seen = find_visible_locales(building, self.window, camera_from_world)
        self.scene: Scene = building.scene_of(seen)
        nowhere: Window = (np.inf, np.inf, -np.inf, -np.inf)
        self.windows = np.array([seen.get(name, nowhere) for name in self.scene.locales]).reshape(-1, 4)

    def windows_for(self, locales: NDArray[np.int64]) -> Floats:
        """(n, 4) the window round both windows of the two locales (n, 2) of each element."""
        one, other = self.windows[locales[:, 0]], self.windows[locales[:, 1]]
        return np.concatenate([np.minimum(one[:, :2], other[:, :2]), np.maximum(one[:, 2:], other[:, 2:])], axis=1)

    def shadows(self) -> Shadows:
        """Shadow volumes of the surfaces that face the camera and are in view."""
        scene, pose = self.scene, self.camera_from_world
        centre = pose.inverse().translation
        facing = scene.planes_world[:, :3] @ centre - scene.planes_world[:, 3] > 1e-6
        index = np.flatnonzero(facing)
        depths = scene.polygons_world[index] @ pose.rotation[2]
        index = index[depths.max(axis=1, initial=-np.inf) + pose.translation[2] > NEAR_PLANE_M]
        polygons = pose.apply(scene.polygons_world[index])
        windows = bounding_windows(polygons)
        keep = overlap(windows, self.windows_for(scene.surface_locales[index]))
        index, polygons, windows = index[keep], polygons[keep], windows[keep]
        planes = np.column_stack([scene.planes_world[index, :3] @ pose.rotation.T, scene.planes_world[index, 3]])
        planes[:, 3] += planes[:, :3] @ pose.translation
        return build_shadows(polygons, planes, windows)


def _in_locales(scene: Scene, rooms: NDArray[np.int64], locales: Collection[str] | None) -> Any:
    """(n,) whether one of the two locales (n, 2) of each element is among ``locales``."""
    if locales is None:
        return True
    return np.array([name in locales for name in scene.locales], bool)[rooms].any(axis=1)


def _suppress_close_lines(lines: VisibleLines, separation_px: float) -> NDArray[np.int64]:
    """Indices of lines to keep, in order: non-maximum suppression by contrast.

    A line is suppressed that lies for half its length within the separation of a line of higher contrast.
    """
    (ax, ay), (bx, by) = lines.segments_px[:, 0].T, lines.segments_px[:, 1].T
    length = np.hypot(bx - ax, by - ay)
    ux, uy = ((bx - ax) / length)[:, None], ((by - ay) / length)[:, None]
    along, off = [], []
    for x, y in ((ax, ay), (bx, by)):
        dx, dy = x - ax[:, None], y - ay[:, None]
        along.append(dx * ux + dy * uy)
        off.append(np.abs(dx * uy - dy * ux))
    shared = np.minimum(np.maximum(*along), length[:, None]) - np.maximum(np.minimum(*along), 0.0)
    covers = (np.maximum(*off) < separation_px) & (shared > 0.5 * length)
    kept, covered = [], np.zeros(len(lines), bool)
    for i in np.argsort(-lines.contrast, kind="stable").tolist():
        if not covered[i]:
            kept.append(i)
            covered |= covers[i]
    return np.array(sorted(kept), np.int64)
