"""The faces that should be visible from a pose, with their colors, by ray casting a grid of pixels into the model."""

from __future__ import annotations

from functools import lru_cache
from typing import Any
from weakref import WeakKeyDictionary

import numpy as np

from knowledge_sources.methods.arrays import Floats, Ints
from world_models.building.building import Building
from world_models.building.geometry.faces import Finish, area_vectors, expected_brightness
from world_models.building.geometry.scene import LocaleGeometry
from world_models.camera import NEAR_PLANE_M, Camera
from world_models.compiled import compiled
from world_models.frames import Pose, Pose2
from world_models.robot import RobotModel
from world_models.visibility.culling import Window, find_visible_locales, image_window

COLOR_GRID_SIZE = 32  # samples along each side of the picture in which faces are predicted
BORDER_MARGIN_PX = 12.0  # distance that color samples keep from the border of the picture
EDGE_MARGIN_PX = 5.0  # distance that color samples keep from the edges of faces
MAX_FACE_POINTS = 6  # most samples of a face that are compared
MAX_FACES = 16  # most faces that are predicted, the largest first
CACHED_COLOR_VIEWS = 64  # predicted views of face colors that are kept
MIN_FACE_POINTS = 2  # fewest samples of a face that is compared

FaceColor = tuple[tuple[float, ...], tuple[tuple[float, ...], ...]]
"""The color of a face (red, green, blue; 0..1, as bright as the model has it), and points of it in view [m, world]."""

MAX_CORNERS = 8
"""Corners that the array of polygons has room for; regions of more corners are left out."""
RAYS = 5
"""Rays of a sample: the pixel itself and four around it."""
WHITE = Finish((1.0, 1.0, 1.0))

_SURFACES: WeakKeyDictionary[LocaleGeometry, tuple[Floats, Floats, Floats]] = WeakKeyDictionary()


def predict_face_colors(robot: RobotModel, pose: Pose2) -> tuple[FaceColor, ...]:
    """Predict the faces in view from a pose, the largest first. The last answers are cached."""
    camera, camera_from_world = robot.camera, robot.camera_from_world(pose)
    key = camera, camera_from_world.rotation.tobytes(), camera_from_world.translation.tobytes()
    return robot.world.cached("face colors", CACHED_COLOR_VIEWS, key,
                                  lambda: _predict(robot, camera, camera_from_world))


def _predict(robot: RobotModel, camera: Camera, camera_from_world: Pose) -> tuple[FaceColor, ...]:
    rays, bounds, window = _build_rays(camera)
    colors, normals, surface, depth = cast_rays(
        robot.world, camera_from_world, rays, bounds, window, COLOR_GRID_SIZE)
    surface[np.append(np.isnan(colors[:, 0]), False)[surface]] = -1  # of unknown color: it only hides
    if camera.obstruction is not None:
        surface[camera.obstruction.covers(_sample_pixels(camera.width, camera.height)).ravel()] = -1
    hit = np.unique(surface[surface >= 0])
    if not len(hit):
        return ()
    appearance = np.round(np.column_stack([colors, normals])[hit], 4)
    keys, group = np.unique(appearance, axis=0, return_inverse=True)
    group_of = np.full(len(colors) + 1, -1)  # the last element is that of surface -1
    group_of[hit] = group.ravel()
    of = group_of[surface].reshape(-1, RAYS)
    whole = np.flatnonzero((of[:, 0] >= 0) & np.all(of == of[:, :1], axis=1))
    at = rays[::RAYS][whole] * depth[::RAYS][whole, None]
    points = camera_from_world.inverse().apply(at).reshape(-1, 3)
    return tuple(_to_face_color(keys[g, :3], points[of[whole, 0] == g], MAX_FACE_POINTS)
                 for g in _find_largest(of[whole, 0]))


def cast_rays(
    world: Building, camera_from_world: Pose, rays: Floats, bounds: Floats, window: Window, size: int, each: int = RAYS
) -> tuple[Floats, Floats, Ints, Floats]:
    """Which surface of the model each ray meets first.

    Args:
        rays: (n, 3), z = 1, in the camera frame: a grid of samples, ``size`` in a row, ``each`` rays a sample.
        bounds: (4,) the rectangle around them; window: what of the picture is looked at.

    Returns:
        Shaded colors (m, 3) and normals (m, 3) of the surfaces in view, the number (n,) of each ray's (-1: none), and
        its depth (n,) [m].
    """
    rooms = sorted(find_visible_locales(world, window, camera_from_world))
    packets = {(p.locale, p.neighbour or ""): p for room in rooms for p in world.frames[room].parts}
    if not packets:
        return np.zeros((0, 3)), np.zeros((0, 3)), np.full(len(rays), -1), np.full(len(rays), np.inf)
    parts = [_find_surfaces(packets[key]) for key in sorted(packets)]
    corners, colors, normals = (np.concatenate([part[i] for part in parts]) for i in range(3))
    center = camera_from_world.inverse().translation
    facing = np.flatnonzero(np.einsum("ij,ij->i", normals, center - corners[:, 0]) > 1e-6)
    near = camera_from_world.apply(corners[facing].reshape(-1, 3)).reshape(-1, MAX_CORNERS, 3)
    boxes = _bound(near)
    left, top, right, bottom = bounds
    in_view = np.flatnonzero(np.any(near[..., 2] > NEAR_PLANE_M, axis=1) & (boxes[:, 0] <= right)
                             & (boxes[:, 2] >= left) & (boxes[:, 1] <= bottom) & (boxes[:, 3] >= top))
    facing = facing[in_view]
    turned = normals[facing] @ camera_from_world.rotation.T
    surface, depth = _cast_rays(near[in_view], turned, boxes[in_view], rays, size, each)
    return colors[facing], normals[facing], surface, depth


@lru_cache(maxsize=8)
def _build_rays(camera: Camera) -> tuple[Floats, Floats, Window]:
    """Rays (n, 3), z = 1, through the samples of a picture, the rectangle around them (4,), and the picture's own."""
    rays = camera.rays(_sample_pixels(camera.width, camera.height)).reshape(-1, 3)
    rays = np.ascontiguousarray(rays / rays[:, 2:])
    return rays, np.concatenate([rays[:, :2].min(axis=0), rays[:, :2].max(axis=0)]), image_window(camera)


def _sample_pixels(width: int, height: int) -> Floats:
    """(n, RAYS, 2) a grid of pixels, each with four around it [px]."""
    margin, size = BORDER_MARGIN_PX + EDGE_MARGIN_PX, COLOR_GRID_SIZE
    u, v = np.linspace(margin, width - 1 - margin, size), np.linspace(margin, height - 1 - margin, size)
    middle = np.stack(np.meshgrid(u, v), axis=-1).reshape(-1, 1, 2)
    around = EDGE_MARGIN_PX * np.array([(0, 0), (1, 0), (-1, 0), (0, 1), (0, -1)], float)
    return np.asarray(middle + around)


def _find_largest(groups: Ints) -> list[int]:
    """The most frequent groups, in falling order."""
    names, counts = np.unique(groups, return_counts=True)
    order = np.argsort(-counts, kind="stable")[: MAX_FACES]
    return [int(names[i]) for i in order if counts[i] >= MIN_FACE_POINTS]


def _to_face_color(color: Floats, points: Floats, max_points: int) -> FaceColor:
    """A face's color with a few of its points, spread over all of it."""
    some = sorted({i * (len(points) - 1) // (max_points - 1) for i in range(max_points)})
    red, green, blue = color.tolist()
    return (red, green, blue), tuple(map(tuple, points[some].round(3).tolist()))


def _find_surfaces(packet: LocaleGeometry) -> tuple[Floats, Floats, Floats]:
    """:func:`_build_surfaces`, kept as long as the packet lives."""
    found = _SURFACES.get(packet)
    if found is None:
        found = _SURFACES[packet] = _build_surfaces(packet)
    return found


def _build_surfaces(packet: LocaleGeometry) -> tuple[Floats, Floats, Floats]:
    """Corners (m, MAX_CORNERS, 3), shaded colors (m, 3) and normals (m, 3) of a packet's regions."""
    regions = [region for _, face in packet.faces for region in (*face.front, *face.back)
               if len(region.polygon_world) <= MAX_CORNERS]
    corners = np.array([[*r.polygon_world, *[r.polygon_world[-1]] * (MAX_CORNERS - len(r.polygon_world))]
                        for r in regions]).reshape(-1, MAX_CORNERS, 3)
    normals = area_vectors([region.polygon_world for region in regions])
    normals = normals / np.maximum(np.linalg.norm(normals, axis=1), 1e-12)[:, None]
    light = np.array([expected_brightness(WHITE, normal) for normal in normals]).reshape(-1, 1)
    return corners, np.array([region.colour for region in regions]).reshape(-1, 3) * light, normals


def _bound(corners: Floats) -> Floats:
    """(m, 4) rectangle (x, y low, x, y high), z = 1, around polygons (m, k, 3); infinite where partly behind."""
    across, down, deep = np.ascontiguousarray(corners.transpose(2, 1, 0))
    depth = np.maximum(deep, NEAR_PLANE_M)
    x, y = across / depth, down / depth  # (k, m): numpy takes the minimum of many rows faster than of many short ones
    box = np.column_stack([x.min(axis=0), y.min(axis=0), x.max(axis=0), y.max(axis=0)])
    box[deep.min(axis=0) <= NEAR_PLANE_M] = (-np.inf, -np.inf, np.inf, np.inf)
    return np.asarray(box)


@compiled
def _cast_rays(corners: Any, normals: Any, boxes: Any, rays: Any, size: int, each: int) -> Any:
    """Index of the polygon (m, k, 3), camera frame, that each ray (x, y, 1) meets first (-1: none), and its depth [m].

    The rays are those of a grid of samples, ``size`` in a row, ``each`` rays a sample. A point of a polygon's plane is
    inside where it is on the same side of all planes through the eye and one edge.
    """
    surface, depth = np.full(len(rays), -1, np.int64), np.full(len(rays), np.inf)
    columns, rows = rays[: each * size : each, 0], rays[:: each * size, 1]
    edges = np.empty((corners.shape[1], 3))
    for m in range(len(corners)):
        n, c = normals[m], corners[m]
        sides = 0
        for k in range(len(c)):  # the last corner is repeated: edges of length zero are left out
            a, b = c[k], c[(k + 1) % len(c)]
            if a[0] != b[0] or a[1] != b[1] or a[2] != b[2]:
                edges[sides, 0] = a[1] * b[2] - a[2] * b[1]
                edges[sides, 1] = a[2] * b[0] - a[0] * b[2]
                edges[sides, 2] = a[0] * b[1] - a[1] * b[0]
                sides += 1
        left, right = np.searchsorted(columns, boxes[m, 0]) - 1, np.searchsorted(columns, boxes[m, 2]) + 1
        top, bottom = np.searchsorted(rows, boxes[m, 1]) - 1, np.searchsorted(rows, boxes[m, 3]) + 1
        ahead = n[0] * c[0, 0] + n[1] * c[0, 1] + n[2] * c[0, 2]
        for row in range(max(top, 0), min(bottom, len(rows))):
            for i in range(each * (size * row + max(left, 0)), each * (size * row + min(right, size))):
                x, y = rays[i, 0], rays[i, 1]
                if not (boxes[m, 0] <= x <= boxes[m, 2] and boxes[m, 1] <= y <= boxes[m, 3]):
                    continue
                slope = n[0] * x + n[1] * y + n[2]
                if slope >= -1e-12:
                    continue
                far = ahead / slope
                if far <= NEAR_PLANE_M or far >= depth[i]:
                    continue
                low, high = 0.0, 0.0
                for k in range(sides):
                    side = edges[k, 0] * x + edges[k, 1] * y + edges[k, 2]
                    low, high = min(low, side), max(high, side)
                if low > -1e-12 or high < 1e-12:
                    surface[i], depth[i] = m, far
    return surface, depth
