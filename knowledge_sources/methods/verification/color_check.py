"""Have the faces that should be seen the colours that the model says, relative to each other? (§1.2)

Light is not modelled, so nothing absolute is compared. The model says which faces are seen and in what colour; the
picture is cut into regions (:mod:`knowledge_sources.methods.features.regions`), and of each face the region that holds
most of it speaks for it, lest what stands before the face do so. One gain for each channel is free, as the lamps have
it; what remains is compared, and so it is with the model's colours dealt out to the wrong faces, which tells how much
agrees by chance.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import cv2
import numpy as np
from numba import njit
from numpy.typing import NDArray

from knowledge_sources.methods.features.regions import segment_regions
from world_models.building.faces import area_vector
from world_models.building.locale_source import LocaleGeometry
from world_models.building.regions import Finish, expected_brightness
from world_models.camera import NEAR_PLANE_M, Camera
from world_models.frames import Pose, Pose2
from world_models.robot import RobotModel
from world_models.visibility.portals import Window, find_visible_locales, image_window

Floats = NDArray[np.float64]
Look = tuple[tuple[float, ...], tuple[tuple[float, ...], ...]]
"""What should be seen of a face: its colour (red, green, blue; 0..1, as bright as the model has it), and points of it
that are in sight [m, world]."""

GRID = 32
MARGIN_PX, ROUND_PX = 12.0, 5.0
"""Samples keep off the picture's border, and off the edges of faces."""
POINTS, LOOKS = 6, 16
"""At most so many points of a face, and faces."""
REGIONS_PX, LEAST_AREA_PX = 64, 8
"""The picture is made so small before it is cut into regions, in one sector."""
DARK = 4.0
"""Grey levels that are added before a ratio is taken: noise in the dark is not a colour."""
ALIKE_LEVEL, ALIKE_TINT = 0.3, 0.1
"""Logarithms of brightness and colour that differ less than this agree: faces are lit by as much more or less."""
LEAST_FACES, MOST_CHANCE = 3, 0.8
KEPT_VIEWS = 64
CORNERS = 8
"""Regions of more corners are not probed."""
WHITE = Finish((1.0, 1.0, 1.0))


@dataclass(frozen=True, slots=True)
class ColorCheck:
    """What a picture says of the faces that should be seen.

    Attributes:
        faces: how many could be tested.
        agree: part of them that has the colour that the model says, 0..1.
        chance: part of them that would if the colours were dealt out otherwise.
    """

    count: int
    agreeing: float
    chance: float

    @property
    def is_testable(self) -> bool:
        """Whether there was enough to compare, and of different colours."""
        return self.count >= LEAST_FACES and self.chance <= MOST_CHANCE


NOT_TESTED = ColorCheck(0, 0.0, 0.0)
"""Too few faces to compare."""


def predict_face_colors(robot: RobotModel, pose: Pose2) -> tuple[Look, ...]:
    """The faces in view from a pose, those first of which most is seen; asked again soon, the answer is at hand."""
    camera, camera_from_world = robot.camera, robot.camera_from_world(pose)
    key = camera, camera_from_world.rotation.tobytes(), camera_from_world.translation.tobytes()
    return robot.world.cached(
        "expected looks", KEPT_VIEWS, key, lambda: _expected_looks(robot, camera, camera_from_world))


def _expected_looks(robot: RobotModel, camera: Camera, camera_from_world: Pose) -> tuple[Look, ...]:
    rays, (left, top, right, bottom), window = _rays(camera)
    rooms = sorted(find_visible_locales(robot.world, window, camera_from_world))
    packets = {(p.locale, p.neighbour or ""): p for room in rooms for p in robot.world.locale_source.geometry(room)}
    if not packets:
        return ()
    parts = [_surfaces(robot.world.cache, packets[key]) for key in sorted(packets)]
    corners, colours, normals = (np.concatenate([part[i] for part in parts]) for i in range(3))
    centre = camera_from_world.inverse().translation
    facing = np.flatnonzero(np.einsum("ij,ij->i", normals, centre - corners[:, 0]) > 1e-6)
    near = camera_from_world.apply(corners[facing].reshape(-1, 3)).reshape(-1, CORNERS, 3)
    boxes = _boxes(near)
    in_view = np.flatnonzero(np.any(near[..., 2] > NEAR_PLANE_M, axis=1) & (boxes[:, 0] <= right)
                             & (boxes[:, 2] >= left) & (boxes[:, 1] <= bottom) & (boxes[:, 3] >= top))
    facing = facing[in_view]
    turned = normals[facing] @ camera_from_world.rotation.T
    surface, depth = _first_hits(near[in_view], turned, boxes[in_view], rays)
    if camera.obstruction is not None:
        surface[camera.obstruction.covers(_samples(camera.width, camera.height)).ravel()] = -1
    hit = np.unique(surface[surface >= 0])
    if not len(hit):
        return ()
    appearance = np.round(np.column_stack([colours, normals])[facing[hit]], 4)
    keys, group = np.unique(appearance, axis=0, return_inverse=True)
    group_of = np.full(len(facing) + 1, -1)  # the last one stands for no surface
    group_of[hit] = group.ravel()
    of = group_of[surface].reshape(-1, 5)
    whole = np.flatnonzero((of[:, 0] >= 0) & np.all(of == of[:, :1], axis=1))
    at = rays[::5][whole] * depth[::5][whole, None]
    points = camera_from_world.inverse().apply(at).reshape(-1, 3)
    return tuple(_look(keys[g, :3], points[of[whole, 0] == g]) for g in _largest(of[whole, 0]))


@lru_cache(maxsize=8)
def _rays(camera: Camera) -> tuple[Floats, Floats, Window]:
    """Rays (n, 3), z = 1, through the samples of a picture, five together, the rectangle round them (4,), and the
    picture's own.
    """
    rays = camera.rays(_samples(camera.width, camera.height)).reshape(-1, 3)
    rays = np.ascontiguousarray(rays / rays[:, 2:])
    return rays, np.concatenate([rays[:, :2].min(axis=0), rays[:, :2].max(axis=0)]), image_window(camera)


def decode_small_color(jpeg: bytes) -> NDArray[np.uint8]:
    """A quarter of the picture's size in colour (h, w, 3), red first; far quicker than all of it."""
    image = cv2.imdecode(np.frombuffer(jpeg, np.uint8), cv2.IMREAD_REDUCED_COLOR_4)
    if image is None:
        raise ValueError(f"expected the bytes of a JPEG picture, got {len(jpeg)} bytes that are not one")
    return np.asarray(image[:, :, ::-1], np.uint8)


def check_colors(robot: RobotModel, pose: Pose2, image: NDArray[np.uint8], looks: Sequence[Look]) -> ColorCheck:
    """Compare the picture (h, w, 3), as the lens made it and maybe smaller, with the looks expected from the pose."""
    if not looks:
        return NOT_TESTED
    face = np.repeat(np.arange(len(looks)), [len(points) for _, points in looks])
    points = robot.camera_from_world(pose).apply(np.array([p for _, points in looks for p in points]))
    ahead = points[:, 2] > NEAR_PLANE_M
    pixels = robot.lens.project(np.where(ahead[:, None], points, (0.0, 0.0, 1.0)))
    inside = ahead & robot.lens.inside(pixels, MARGIN_PX)
    if not inside.any():
        return NOT_TESTED
    parts = (pixels[inside] + 0.5) / (robot.lens.width, robot.lens.height)
    tiny = cv2.resize(image, (REGIONS_PX, REGIONS_PX), interpolation=cv2.INTER_AREA).mean(axis=2)
    labels = segment_regions(tiny, sector_px=REGIONS_PX, min_area_px=LEAST_AREA_PX).labels
    smooth = np.asarray(cv2.blur(image, (3, 3)), np.float64)
    return _compared(_at(smooth, parts), _at(labels, parts), face[inside], np.array([colour for colour, _ in looks]))


def _at(image: NDArray[Any], parts: Floats) -> NDArray[Any]:
    """The pixels at places given as parts (n, 2) of the width and the height."""
    height, width = image.shape[:2]
    column, row = np.minimum((parts * (width, height)).astype(np.int64), (width - 1, height - 1)).T
    return np.asarray(image[row, column])


def predict_color_check(looks: Sequence[Look]) -> ColorCheck:
    """The check of a picture in which all is as the model says."""
    if len(looks) < LEAST_FACES:
        return NOT_TESTED
    return _told(meant := _logs(np.array([colour for colour, _ in looks])), meant)


def _compared(seen: Floats, labels: NDArray[np.int32], face: NDArray[np.int64], colours: Floats) -> ColorCheck:
    """From the colours (n, 3) and regions (n,) seen at points of faces (n,) that have these colours (f, 3)."""
    tested = [f for f in range(len(colours)) if np.count_nonzero(face == f) >= 2]
    if len(tested) < LEAST_FACES:
        return NOT_TESTED
    own = []
    for f in tested:
        mine = np.flatnonzero(face == f)
        most = np.bincount(labels[mine]).argmax()
        ordered = np.sort(seen[mine[labels[mine] == most]], axis=0)  # the median: numpy's own is slow for so few
        own.append(0.5 * (ordered[(len(ordered) - 1) // 2] + ordered[len(ordered) // 2]))
    return _told(np.log(np.array(own) + DARK), _logs(colours[tested]))


def _logs(colours: Floats) -> Floats:
    return np.asarray(np.log(255.0 * colours + DARK))


def _told(had: Floats, meant: Floats) -> ColorCheck:
    """From the logarithms of the colours (f, 3) that faces had, and that they should have."""
    dealt = np.stack([np.roll(meant, shift, axis=0) for shift in range(len(meant))])
    alike = _alike(had - dealt)
    return ColorCheck(len(meant), float(alike[0]), float(np.mean(alike[1:])))


def _alike(ratios: Floats) -> Floats:
    """(s,) the largest part of the faces whose log ratios (s, f, 3) are those of one of them."""
    off = ratios[:, :, None] - ratios[:, None]
    levels = off.mean(axis=3)
    tints = np.abs(off - levels[..., None]).max(axis=3)
    agree = (np.abs(levels) <= ALIKE_LEVEL) & (tints <= ALIKE_TINT)
    return np.asarray(agree.mean(axis=2).max(axis=1))


def _samples(width: int, height: int) -> Floats:
    """(n, 5, 2) a grid of pixels, each with four round it [px]."""
    u = np.linspace(MARGIN_PX + ROUND_PX, width - 1 - MARGIN_PX - ROUND_PX, GRID)
    v = np.linspace(MARGIN_PX + ROUND_PX, height - 1 - MARGIN_PX - ROUND_PX, GRID)
    middle = np.stack(np.meshgrid(u, v), axis=-1).reshape(-1, 1, 2)
    around = ROUND_PX * np.array([(0, 0), (1, 0), (-1, 0), (0, 1), (0, -1)], float)
    return np.asarray(middle + around)


def _largest(groups: NDArray[np.int64]) -> list[int]:
    """The groups of which there are most, at least two of each."""
    names, counts = np.unique(groups, return_counts=True)
    return [int(names[i]) for i in np.argsort(-counts, kind="stable")[:LOOKS] if counts[i] >= 2]


def _look(colour: Floats, points: Floats) -> Look:
    """A face's look by a few of its points, from all over it."""
    some = sorted({i * (len(points) - 1) // (POINTS - 1) for i in range(POINTS)})
    red, green, blue = colour.tolist()
    return (red, green, blue), tuple(map(tuple, points[some].round(3).tolist()))


def _surfaces(memo: dict[str, Any], packet: LocaleGeometry) -> tuple[Floats, Floats, Floats]:
    """Corners (m, CORNERS, 3), colours in the model's light (m, 3) and normals (m, 3) of a packet's regions; made once.
    """
    known: dict[object, tuple[Floats, Floats, Floats]] = memo.setdefault("looks", {})
    key = packet.locale, packet.neighbour
    if key not in known:
        regions = [region for _, face in packet.faces for region in (*face.front, *face.back)
                   if len(region.polygon_world) <= CORNERS]
        corners = np.array([[*r.polygon_world, *[r.polygon_world[-1]] * (CORNERS - len(r.polygon_world))]
                            for r in regions]).reshape(-1, CORNERS, 3)
        normals = np.array([area_vector(region.polygon_world) for region in regions]).reshape(-1, 3)
        normals = normals / np.maximum(np.linalg.norm(normals, axis=1), 1e-12)[:, None]
        light = np.array([expected_brightness(WHITE, normal) for normal in normals]).reshape(-1, 1)
        known[key] = corners, np.array([region.colour for region in regions]).reshape(-1, 3) * light, normals
    return known[key]


def _boxes(corners: Floats) -> Floats:
    """(m, 4) the rectangle x / z, y / z (low, high) round polygons (m, k, 3); everything where one is partly behind."""
    across, down, deep = np.ascontiguousarray(corners.transpose(2, 1, 0))
    depth = np.maximum(deep, NEAR_PLANE_M)
    x, y = across / depth, down / depth  # (k, m): numpy takes the least of many rows faster than of many short ones
    box = np.column_stack([x.min(axis=0), y.min(axis=0), x.max(axis=0), y.max(axis=0)])
    box[deep.min(axis=0) <= NEAR_PLANE_M] = (-np.inf, -np.inf, np.inf, np.inf)
    return np.asarray(box)


@njit(cache=True, error_model="numpy")
def _first_hits(corners: Any, normals: Any, boxes: Any, rays: Any) -> Any:
    """Which of the polygons (m, k, 3), in the camera's frame, each ray (x, y, 1) meets first (-1: none), and how deep.

    The rays are five round each sample of the grid. A point of a polygon's plane is in it where it is on the same side
    of all planes through the eye and one edge.
    """
    surface, depth = np.full(len(rays), -1, np.int64), np.full(len(rays), np.inf)
    columns, rows = rays[: 5 * GRID : 5, 0], rays[:: 5 * GRID, 1]
    edges = np.empty((corners.shape[1], 3))
    for m in range(len(corners)):
        n, c = normals[m], corners[m]
        sides = 0
        for k in range(len(c)):  # the last corner is repeated: what is no edge is left out
            a, b = c[k], c[(k + 1) % len(c)]
            if a[0] != b[0] or a[1] != b[1] or a[2] != b[2]:
                edges[sides, 0] = a[1] * b[2] - a[2] * b[1]
                edges[sides, 1] = a[2] * b[0] - a[0] * b[2]
                edges[sides, 2] = a[0] * b[1] - a[1] * b[0]
                sides += 1
        left, right = np.searchsorted(columns, boxes[m, 0]) - 1, np.searchsorted(columns, boxes[m, 2]) + 1
        top, bottom = np.searchsorted(rows, boxes[m, 1]) - 1, np.searchsorted(rows, boxes[m, 3]) + 1
        ahead = n[0] * c[0, 0] + n[1] * c[0, 1] + n[2] * c[0, 2]
        for row in range(max(top, 0), min(bottom, GRID)):
            for i in range(5 * (GRID * row + max(left, 0)), 5 * (GRID * row + min(right, GRID))):
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
