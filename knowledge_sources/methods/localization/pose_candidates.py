"""Pose candidates on a floor: grid search by oriented chamfer matching, hill climbing, non-maximum suppression.

Each direction of line has a map of the distance to the next segment of about that direction. A pose is scored by
reading the maps where points of the model lines are projected: those that are visible from its position, in any
direction, which are computed once for a room and cached. All positions of all rooms, with the four headings that level
lines leave, are scored against all views at once. Source: G. Borgefors, Hierarchical chamfer matching, PAMI 1988,
with directions apart as in M.-Y. Liu et al., Fast directional chamfer matching, CVPR 2010.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import cv2
import numpy as np
import shapely

from knowledge_sources.methods.arrays import Floats, Floats32, Ints, Mask
from knowledge_sources.methods.features import RIGHT_ANGLE_RAD, find_level_direction
from knowledge_sources.methods.localization.views import CameraView
from knowledge_sources.methods.motion import compute_free_space
from knowledge_sources.methods.verification import take_distinct
from world_models.building.building import Building
from world_models.camera import Camera
from world_models.compiled import compiled
from world_models.frames import Pose, Pose2, wrap_angle
from world_models.robot import RobotModel

POSITION_STEP_M = 0.25  # spacing of the positions that are tried in a room
POSITION_CLEARANCE_M = 0.2
"""Distance of positions from walls and things: less than the robot's radius, as a bump may move it."""
VISIBILITY_CELL_M = 0.75  # side of the cells of which each shares one set of visible points
POINT_SPACING_M = 0.25  # spacing of points along model lines
MAX_LINE_POINTS = 60  # most points along one model line
MAX_POINT_DISTANCE_M = 14.0  # largest distance of a visible point
MIN_POINT_CONTRAST = 0.05  # smallest contrast of a line with visible points, 0..1
OCCLUSION_TOLERANCE_M = 0.01  # distance behind a surface from which a point is hidden by it
MAX_LEVEL_SLOPE = 0.05  # largest slope of a model line that counts as level

MAX_MAPS = 256
"""Size of the cache of visibility maps."""
CHAMFER_DIRECTIONS = 12  # directions of lines that have a distance map each
CHAMFER_REACH_PX = 24.0  # distance from which a segment no longer counts
CHAMFER_SHRINK = 4  # pixels of the picture along each side of a pixel of the map
MIN_POINT_DEPTH_M = 0.3  # smallest depth of a projected point
PRIOR_POINTS = 50.0  # points that agree by chance, added to each score: few points are little evidence
GRID_STRIDE = 2  # one of so many points is projected when the grid is scored
SIEVE_STRIDE = 8  # the same when the grid is sieved
SIEVED_PART = 0.05  # part of the grid that goes through the sieve, the best of it
MIN_SIEVED = 3_000  # a smaller grid is not sieved
MIN_CANDIDATE_DISTANCE_M = 0.45  # distance from which two candidates are distinct
MIN_CANDIDATE_ANGLE_RAD = math.radians(10.0)  # angle from which two candidates are distinct
DISTINCT = MIN_CANDIDATE_DISTANCE_M, MIN_CANDIDATE_ANGLE_RAD
MAX_CLIMBED = 60  # best poses of the grid that are improved by hill climbing
COARSE_CLIMB_M = 0.1  # step of the first round of hill climbing
COARSE_CLIMB_RAD = math.radians(0.8)  # step of the first round of hill climbing
FINE_CLIMB_M = 0.05  # step of the second round of hill climbing
FINE_CLIMB_RAD = math.radians(0.5)  # step of the second round of hill climbing
MIN_RELATIVE_SCORE = 0.6  # smallest score of a candidate, as a part of the best


class ChamferMaps(NamedTuple):
    """Nearness of segments by direction and place in a picture.

    Attributes:
        near: (d, h, w) 1 on a segment of about that direction, falling to 0 at the reach; in reduced pixels.
        chance: (d,) its mean: the score of a point of a line that is not there.
    """

    near: Floats32
    chance: Floats32


def compute_chamfer_maps(segments_px: Any, camera: Camera) -> ChamferMaps:
    """Compute maps of segments (n, 2, 2); each is drawn under its own direction and the two next to it."""
    shrink, directions = CHAMFER_SHRINK, CHAMFER_DIRECTIONS
    size = -(-camera.height // shrink), -(-camera.width // shrink)
    empty = np.full((directions, *size), 255, np.uint8)
    for (u0, v0), (u1, v1) in np.asarray(segments_px, float).reshape(-1, 2, 2):
        own = round(math.atan2(v1 - v0, u1 - u0) / math.pi * directions)
        ends = tuple((round(float(u) / shrink), round(float(v) / shrink)) for u, v in ((u0, v0), (u1, v1)))
        for k in (own - 1, own, own + 1):
            cv2.line(empty[k % directions], ends[0], ends[1], 0, 1)
    reach = CHAMFER_REACH_PX / shrink
    away = [np.minimum(cv2.distanceTransform(layer, cv2.DIST_L2, 3), reach) / reach for layer in empty]
    near = np.ascontiguousarray(1.0 - np.asarray(away), np.float32)
    return ChamferMaps(near, near.mean(axis=(1, 2)))


def compute_chamfer_scores(
    maps: ChamferMaps, camera: Camera, camera_from_robot: Pose, poses: Floats, points_world: Floats,
    directions_world: Floats, first: Ints, visible: Ints, cell: Ints, stride: int = 1,
) -> Floats:
    """Score poses of the robot by the points of model lines that they show.

    Args:
        poses: (n, 3) x, y, heading [m, rad, world].
        points_world, directions_world: (p, 3) points of lines and unit directions of their lines.
        first, visible, cell: pose i shows the points ``visible[first[cell[i]] : first[cell[i] + 1]]``.
        stride: one of so many of these points is projected.

    Returns:
        (n, 3) for each pose: nearness summed over the points in view, the sum expected by chance, number of points.
    """
    lens = np.array([camera.fx, camera.fy, camera.cx, camera.cy, camera.width, camera.height], float)
    return np.asarray(_score(
        maps.near, maps.chance, lens, np.array(camera_from_robot.rotation), np.array(camera_from_robot.translation),
        np.array(poses, float), points_world, directions_world, first, visible, np.array(cell, np.int64), stride,
        CHAMFER_SHRINK, MIN_POINT_DEPTH_M))


@compiled
def _score(
    near: Any, chance: Any, lens: Any, mount: Any, shift: Any, poses: Any, points: Any, directions: Any, first: Any,
    visible: Any, cell: Any, stride: int, shrink: int, min_depth_m: float,
) -> Any:
    out = np.zeros((len(poses), 3))
    bins, height, width = near.shape
    for i in range(len(poses)):
        c, s = math.cos(poses[i, 2]), math.sin(poses[i, 2])
        x0, y0 = poses[i, 0], poses[i, 1]
        r00, r01 = mount[0, 0] * c - mount[0, 1] * s, mount[0, 0] * s + mount[0, 1] * c
        r10, r11 = mount[1, 0] * c - mount[1, 1] * s, mount[1, 0] * s + mount[1, 1] * c
        r20, r21 = mount[2, 0] * c - mount[2, 1] * s, mount[2, 0] * s + mount[2, 1] * c
        total, by_chance, count = 0.0, 0.0, 0
        for j in range(first[cell[i]], first[cell[i] + 1], stride):
            k = visible[j]
            x, y, up = points[k, 0] - x0, points[k, 1] - y0, points[k, 2]
            z = r20 * x + r21 * y + mount[2, 2] * up + shift[2]
            if z < min_depth_m:
                continue
            across = r00 * x + r01 * y + mount[0, 2] * up + shift[0]
            u = lens[0] * across / z + lens[2]
            if u < 0.0 or u >= lens[4]:
                continue
            down = r10 * x + r11 * y + mount[1, 2] * up + shift[1]
            v = lens[1] * down / z + lens[3]
            if v < 0.0 or v >= lens[5]:
                continue
            a, b, w = directions[k, 0], directions[k, 1], directions[k, 2]
            da, db = r00 * a + r01 * b + mount[0, 2] * w, r10 * a + r11 * b + mount[1, 2] * w
            dz = r20 * a + r21 * b + mount[2, 2] * w
            turn = math.atan2(lens[1] * (db * z - dz * down), lens[0] * (da * z - dz * across)) / math.pi * bins
            d = math.floor(turn + 0.5) % bins
            total += near[d, min(height - 1, int(v / shrink + 0.5)), min(width - 1, int(u / shrink + 0.5))]
            by_chance += chance[d]
            count += 1
        out[i, 0], out[i, 1], out[i, 2] = total, by_chance, count
    return out


_NEIGHBORS = np.stack(np.meshgrid((-1.0, 0.0, 1.0), (-1.0, 0.0, 1.0), (-1.0, 0.0, 1.0), indexing="ij"),
                      axis=-1).reshape(-1, 3)
_NEIGHBORS.setflags(write=False)
"""(27, 3) steps of hill climbing in x, y and heading."""


class PoseCandidate(NamedTuple):
    """A pose of the robot now that is worth refining: its room, the pose, and its score (at most 1)."""

    room: str
    world_from_robot: Pose2
    score: float


def find_pose_candidates(
    robot: RobotModel, views: Sequence[CameraView], rooms: Sequence[str], max_count: int
) -> tuple[PoseCandidate, ...]:
    """Find the poses in these rooms that fit all views best, the best first, distinct from each other.

    Empty where no view shows level lines. A large grid is sieved by few of the points.
    """
    search = PictureSearch.from_views(robot, views)
    return () if search is None else search.find(rooms, max_count)


def are_distinct(a: Pose2, b: Pose2) -> bool:
    """Whether two poses are far enough apart to be two candidates."""
    return (a.distance_to(b) > MIN_CANDIDATE_DISTANCE_M
            or abs(wrap_angle(a.heading_rad - b.heading_rad)) > MIN_CANDIDATE_ANGLE_RAD)


@dataclass(frozen=True, slots=True, eq=False)
class PictureSearch:
    """What poses are scored by: the views, their chamfer maps, and the direction of level lines in the robot's frame.

    It is computed once for the pictures, and shared by all poses that are compared with them.
    """

    robot: RobotModel
    views: tuple[CameraView, ...]
    maps: tuple[ChamferMaps, ...]
    direction_rad: float

    @staticmethod
    def from_views(robot: RobotModel, views: Sequence[CameraView]) -> PictureSearch | None:
        """None where no view shows level lines. The view with the longest segments that does is taken."""
        mount = robot.mount.camera_from_robot
        for view in sorted(views, key=lambda v: -_total_length(v.segments_px)):
            direction = find_level_direction(view.segments_px, robot.camera, mount)
            if direction is not None:
                maps = tuple(compute_chamfer_maps(take_distinct(v.segments_px), robot.camera)
                             for v in views)
                heading = direction + view.now_from_then.heading_rad
                return PictureSearch(robot, tuple(views), maps, heading)
        return None

    def find(self, rooms: Sequence[str], max_count: int) -> tuple[PoseCandidate, ...]:
        """The poses in these rooms that fit all views best, the best first, distinct from each other."""
        maps = [get_visibility_map(self.robot.world, room, self.robot.mount.height_m) for room in rooms]
        grids = [self.build_grid(room_map) for room_map in maps]
        kept = self._sieve(maps, grids)
        at = np.concatenate([np.zeros((0, 3)), *(grid[some] for grid, some in zip(grids, kept, strict=True))])
        owner = np.repeat(np.arange(len(maps)), [len(some) for some in kept])
        score = np.concatenate([np.zeros(0), *(
            self.score(m, grid[some], np.tile(m.cell, 4)[some], GRID_STRIDE)
            for m, grid, some in zip(maps, grids, kept, strict=True) if len(some))])
        first = _suppress(at, score, MAX_CLIMBED)
        climbed = [self.climb(maps[owner[i]], at[i]) for i in first]
        ends = np.array([pose for pose, _ in climbed]).reshape(-1, 3)
        fits = np.array([fit for _, fit in climbed])
        min_score = MIN_RELATIVE_SCORE * float(np.max(fits, initial=0.0))
        return tuple(PoseCandidate(rooms[owner[first[i]]], Pose2(*ends[i]), float(fits[i]))
                     for i in _suppress(ends, fits, max_count) if fits[i] >= min_score)

    def rate(self, room: str, pose: Pose2) -> float:
        """The score of one pose in a room, at the best of the poses close to it."""
        here = np.array([pose.position])
        return self.climb(_build_map(self.robot.world, room, self.robot.mount.height_m, here), pose.vector)[1]

    def _sieve(self, maps: Sequence[VisibilityMap], grids: Sequence[Floats]) -> list[Ints]:
        """Of the grid of each room the indices that are scored by more than a few points."""
        count = sum(len(grid) for grid in grids)
        if count < MIN_SIEVED:
            return [np.arange(len(grid)) for grid in grids]
        scores = [self.score(m, grid, np.tile(m.cell, 4), SIEVE_STRIDE) for m, grid in zip(maps, grids, strict=True)]
        least = float(np.quantile(np.concatenate(scores), 1.0 - max(SIEVED_PART, MIN_SIEVED / count)))
        return [np.flatnonzero(some >= least) for some in scores]

    def build_grid(self, room_map: VisibilityMap) -> Floats:
        """(4 n, 3) the positions of a room, with each of the four headings that its walls leave."""
        headings = [room_map.axis_rad - self.direction_rad + k * RIGHT_ANGLE_RAD for k in range(4)]
        positions = room_map.positions
        return np.concatenate([np.column_stack([positions, np.full(len(positions), h)]) for h in headings])

    def score(self, room_map: VisibilityMap, poses: Floats, cell: Ints, stride: int = 1) -> Floats:
        """(n,) by how much the visible points agree with all views beyond chance."""
        total = np.zeros((len(poses), 3))
        for view, maps in zip(self.views, self.maps, strict=True):
            g = view.now_from_then
            c, s = np.cos(poses[:, 2]), np.sin(poses[:, 2])
            then = np.column_stack([poses[:, 0] + c * g.x_m - s * g.y_m, poses[:, 1] + s * g.x_m + c * g.y_m,
                                    poses[:, 2] + g.heading_rad])
            total += compute_chamfer_scores(
                maps, self.robot.camera, self.robot.mount.camera_from_robot, then, room_map.points,
                room_map.directions, room_map.first, room_map.visible, cell, stride)
        return np.asarray((total[:, 0] - total[:, 1]) / (total[:, 2] + PRIOR_POINTS / stride))

    def climb(self, room_map: VisibilityMap, pose: Floats) -> tuple[Floats, float]:
        """The best pose after one coarse and one fine step, and its score."""
        nearest, score = int(np.argmin(np.sum((room_map.positions - pose[:2]) ** 2, axis=1))), 0.0
        for step_m, step_rad in ((COARSE_CLIMB_M, COARSE_CLIMB_RAD), (FINE_CLIMB_M, FINE_CLIMB_RAD)):
            near = pose + _NEIGHBORS * (step_m, step_m, step_rad)
            scores = self.score(room_map, near, np.full(len(near), room_map.cell[nearest]))
            best = int(np.argmax(scores))
            pose, score = near[best], float(scores[best])
        return pose, score


def _total_length(segments_px: Floats) -> float:
    return float(np.sum(np.linalg.norm(segments_px[:, 1] - segments_px[:, 0], axis=1)))


def _suppress(poses: Floats, scores: Floats, max_count: int) -> list[int]:
    """Non-maximum suppression: indices of the best poses (n, 3), the best first, each distinct from those before."""
    kept: list[int] = []
    order = np.argsort(-scores, kind="stable")
    free = np.ones(len(poses), bool)
    for i in order.tolist():
        if free[i]:
            kept.append(i)
            if len(kept) == max_count:
                break
            off = poses - poses[i]
            turned = np.abs(np.remainder(off[:, 2] + math.pi, 2.0 * math.pi) - math.pi)
            free &= ((np.hypot(off[:, 0], off[:, 1]) > MIN_CANDIDATE_DISTANCE_M)
                     | (turned > MIN_CANDIDATE_ANGLE_RAD))
    return kept


@dataclass(frozen=True, eq=False, slots=True)
class VisibilityMap:
    """What is visible from the positions of a room.

    Attributes:
        positions: (n, 2) where the robot may be [m, world].
        cell: (n,) the cell of each position.
        eyes: (c, 2) of each cell the position nearest to its middle [m, world].
        points, directions: (p, 3) points along model lines [m, world], and the unit direction of each one's line.
        first: (c + 1,) the points ``visible[first[i] : first[i + 1]]`` are visible from eye i.
        visible: indices of points.
        axis_rad: direction of most of the walls, modulo a right angle.
    """

    positions: Floats
    cell: Ints
    eyes: Floats
    points: Floats
    directions: Floats
    first: Ints
    visible: Ints
    axis_rad: float


def get_visibility_map(building: Building, room: str, eye_m: float) -> VisibilityMap:
    """Return the visibility map of a room for a camera at a height above the world's zero. Cached."""
    return building.cached("visibility maps", MAX_MAPS, (room, eye_m),
                           lambda: _build_map(building, room, eye_m, _find_positions(building, room)))


def sample_lines(lines_world: Floats) -> tuple[Floats, Floats, Ints]:
    """Return points (k, 3) along lines (n, 2, 3), the unit direction (k, 3) of each one's line, and which line (k,)."""
    lines = np.asarray(lines_world, float).reshape(-1, 2, 3)
    along = lines[:, 1] - lines[:, 0]
    length = np.linalg.norm(along, axis=1)
    count = np.clip(np.rint(length / POINT_SPACING_M), 2, MAX_LINE_POINTS).astype(np.int64)
    owner = np.repeat(np.arange(len(lines)), count)
    number = np.arange(len(owner)) - np.repeat(np.cumsum(count) - count, count)
    t = (number + 0.5) / count[owner]
    unit = along / np.maximum(length, 1e-9)[:, None]
    return lines[owner, 0] + t[:, None] * along[owner], unit[owner], owner


def _build_map(building: Building, room: str, eye_m: float, positions: Floats) -> VisibilityMap:
    cells, cell = np.unique(np.floor(positions / VISIBILITY_CELL_M).astype(np.int64), axis=0, return_inverse=True)
    cell = cell.reshape(-1).astype(np.int64)
    eyes = _choose_eyes(positions, cell, cells)
    scene = building.scene_of((room,))
    points, directions, owner = sample_lines(scene.edges.lines_world)
    first, visible = [0], []
    for eye in np.column_stack([eyes, np.full(len(eyes), eye_m)]):
        clear = scene.edges.contrasts(eye)[owner] >= MIN_POINT_CONTRAST
        near = np.linalg.norm(points - eye, axis=1) < MAX_POINT_DISTANCE_M
        some = np.flatnonzero(clear & near)
        seen = _are_visible(eye, points[some], scene.planes_world, scene.polygons_world, OCCLUSION_TOLERANCE_M)
        visible.append(some[seen])
        first.append(first[-1] + len(visible[-1]))
    return VisibilityMap(
        positions, cell, eyes, points, directions, np.array(first, np.int64),
        np.concatenate([np.zeros(0, np.int64), *visible]),
        _find_axis(scene.edges.lines_world),
    )


def _choose_eyes(positions: Floats, cell: Ints, cells: Ints) -> Floats:
    """(c, 2) of each cell the position nearest to its middle; the middle itself may be beyond a wall."""
    away = np.sum((positions - (cells[cell] + 0.5) * VISIBILITY_CELL_M) ** 2, axis=1)
    order = np.lexsort((away, cell))
    return np.asarray(positions[order[np.searchsorted(cell[order], np.arange(len(cells)))]])


def _find_positions(building: Building, room: str) -> Floats:
    """(n, 2) grid points in a room's free space, and points of its open doorways up to their middle [m, world]."""
    sills = [d.thresholds_world.mean(axis=1)[:: 1 if d.between[0] == room else -1] for d in building.doorways_of(room)]
    in_doorways = np.array([point for own, other in sills for point in (own, 0.5 * (own + other))]).reshape(-1, 2)
    free = compute_free_space(building.outline(room), building.obstacles(room), POSITION_CLEARANCE_M)
    if free.is_empty:
        return in_doorways
    step = POSITION_STEP_M
    x0, y0, x1, y1 = (float(v) for v in free.bounds)
    xs = np.arange(math.ceil(x0 / step), math.floor(x1 / step) + 1) * step
    ys = np.arange(math.ceil(y0 / step), math.floor(y1 / step) + 1) * step
    grid = np.stack(np.meshgrid(xs, ys, indexing="ij"), axis=-1).reshape(-1, 2)
    shapely.prepare(free)
    return np.concatenate([grid[shapely.intersects_xy(free, grid[:, 0], grid[:, 1])], in_doorways])


def _find_axis(lines_world: Floats) -> float:
    """Mean direction of the level lines, weighted by length, modulo a right angle [rad]."""
    along = lines_world[:, 1] - lines_world[:, 0]
    level = np.abs(along[:, 2]) < MAX_LEVEL_SLOPE * np.maximum(np.linalg.norm(along, axis=1), 1e-9)
    turned = 4.0 * np.arctan2(along[level, 1], along[level, 0])
    weight = np.linalg.norm(along[level], axis=1)
    return math.atan2(float(np.sum(weight * np.sin(turned))), float(np.sum(weight * np.cos(turned)))) / 4.0


def _are_visible(eye: Floats, points: Floats, planes: Floats, polygons: Floats, tolerance_m: float) -> Mask:
    """(n,) which points (n, 3) are hidden by no surface that faces the eye."""
    facing = planes[:, :3] @ eye - planes[:, 3] > 1e-6
    return np.asarray(_find_visible(eye, np.ascontiguousarray(points), planes[facing], polygons[facing], tolerance_m))


@compiled
def _find_visible(eye: Any, points: Any, planes: Any, polygons: Any, tolerance_m: float) -> Any:
    """(n,) which points are visible. The polygon that hid the last point is tried first."""
    out = np.ones(len(points), np.bool_)
    corners = polygons.shape[1]
    height = np.empty(len(planes))
    for j in range(len(planes)):
        height[j] = planes[j, 0] * eye[0] + planes[j, 1] * eye[1] + planes[j, 2] * eye[2] - planes[j, 3]
    last = -1
    for i in range(len(points)):
        px, py, pz = points[i, 0], points[i, 1], points[i, 2]
        for step in range(-1, len(planes)):
            j = last if step < 0 else step
            if j < 0:
                continue
            below = planes[j, 0] * px + planes[j, 1] * py + planes[j, 2] * pz - planes[j, 3]
            if below > -tolerance_m:
                continue
            t = height[j] / (height[j] - below)
            x, y, z = eye[0] + t * (px - eye[0]), eye[1] + t * (py - eye[1]), eye[2] + t * (pz - eye[2])
            hit = True
            for a in range(corners):
                b = a + 1 if a + 1 < corners else 0
                ux, uy, uz = (polygons[j, b, 0] - polygons[j, a, 0], polygons[j, b, 1] - polygons[j, a, 1],
                              polygons[j, b, 2] - polygons[j, a, 2])
                vx, vy, vz = x - polygons[j, a, 0], y - polygons[j, a, 1], z - polygons[j, a, 2]
                side = (planes[j, 0] * (uy * vz - uz * vy) + planes[j, 1] * (uz * vx - ux * vz)
                        + planes[j, 2] * (ux * vy - uy * vx))
                if side < -1e-9:
                    hit = False
                    break
            if hit:
                out[i] = False
                last = j
                break
    return out
