"""Model and data lines that may belong together, given where the camera may be: pairs linear in its unknowns."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

from knowledge_sources.methods.matching.pose_parameters import Array, PoseParameters
from knowledge_sources.methods.pose.line_set import LineSet, build_line_set
from world_models.camera import NEAR_PLANE_M, Camera
from world_models.frames import Pose

Index = NDArray[np.intp]
Mask = NDArray[np.bool_]
compiled = njit(cache=True, error_model="numpy")

GATE_SIGMAS = 3.0
GATE_PX = 3.0
GATE_RAD = 0.12
"""Beyond what the prior allows, a pair may be off by this much: the segment's own error."""
GATE_ALONG_PX = 30.0
STEEPEST_RAD = 0.6
"""Pairs that differ more in direction are not looked at."""
TINY = 1e-12


@dataclass(frozen=True, slots=True, eq=False)
class LineScene:
    """The call's givens: model lines; data lines (k, 2, 2) without distortion and their rays (k, 2, 3); the prior."""

    model: LineSet
    data: Array
    rays: Array
    camera: Camera
    freedom: PoseParameters


@dataclass(frozen=True, slots=True, eq=False)
class PosePairs:
    """p pairs at a pose: distances (p, 2) [px], slopes (p, 2, d), along (p, 2) from 0 to ``lengths`` (p,) [px].

    ``angles`` (p,) are those of the data lines from their model lines [rad], ``shares`` (p,) the shorter lengths [px].
    """

    model: Index
    data: Index
    distances: Array
    slopes: Array
    along: Array
    lengths: Array
    angles: Array
    shares: Array

    def take(self, chosen: Mask) -> PosePairs:
        """The pairs of a mask."""
        return PosePairs(*(getattr(self, name)[chosen] for name in PosePairs.__slots__))


def build_scene(model: Any, data: Any, camera: Camera, freedom: PoseParameters) -> LineScene:
    """Prepare the lines. Raises ValueError: no model line, or a wrong shape."""
    lines = np.asarray(model, float).reshape(-1, 2, 3)
    if not len(lines):
        raise ValueError("expected at least one model line, got none")
    segments = np.asarray(data, float).reshape(-1, 2, 2)
    anywhere = np.broadcast_to([[0.0, 0.0], [1.0, 0.0]], (len(lines), 2, 2))
    seen = build_line_set(np.broadcast_to(lines[:1], (len(segments), 2, 3)), segments, camera, 1.0)
    return LineScene(
        build_line_set(lines, anywhere, camera, 1.0),
        np.ascontiguousarray(camera.undistort(segments)),
        seen.rays,
        replace(camera, distortion=None),
        freedom,
    )


def projected(scene: LineScene, pose: Pose) -> tuple[Array, Array, Mask]:
    """(m, 2, 2) model lines in the image plane, cut at the near plane but not at the border; lengths; what is left."""
    c = scene.camera
    seen: tuple[Array, Array, Mask] = _projected(
        scene.model.points, np.array(pose.rotation), np.array(pose.translation), c.fx, c.fy, c.cx, c.cy
    )
    return seen


def gated_pairs(scene: LineScene) -> PosePairs:
    """Pairs within 3 deviations of the prediction, in offset at both ends and in angle."""
    px, _, visible = projected(scene, scene.freedom.prior)
    i, k = _nearly_parallel(px, visible, scene.data)
    pairs = linearise_pairs(scene, scene.freedom.prior, i, k)
    data_lengths = np.linalg.norm(scene.data[:, 1] - scene.data[:, 0], axis=1)
    return pairs.take(
        _within(pairs.distances, pairs.slopes, pairs.along, pairs.lengths, pairs.angles, data_lengths[k],
                scene.freedom.root)
    )


def linearise_pairs(scene: LineScene, pose: Pose, i: Index, k: Index) -> PosePairs:
    """Model lines ``i`` with data lines ``k``, linearised at a pose."""
    px, lengths, _ = projected(scene, pose)
    model = scene.model
    found = _linearised(
        model.directions, model.moments, px, scene.data, scene.rays, model.focal_px, np.array(pose.rotation),
        np.array(pose.translation), scene.freedom.basis(pose), i, k,
    )
    distances, slopes, along, angles, shares = found
    return PosePairs(i, k, distances, slopes, along, lengths[i], angles, shares)


def near_pairs(pairs: PosePairs, pair_px: float, pair_rad: float) -> Mask:
    """(p,) which lie within the limits across, overlap along and are nearly parallel."""
    near = (np.abs(pairs.distances).max(axis=1) <= pair_px) & (np.abs(pairs.angles) <= pair_rad)
    beside = (pairs.along.max(axis=1) < -pair_px) | (pairs.along.min(axis=1) > pairs.lengths + pair_px)
    return np.asarray(near & ~beside)


@compiled
def _projected(
    points: Any, turn: Any, shift: Any, fx: float, fy: float, cx: float, cy: float
) -> tuple[Any, Any, Any]:
    px, lengths, visible = np.empty((len(points), 2, 2)), np.ones(len(points)), np.ones(len(points), np.bool_)
    for m in range(len(points)):
        first, second = turn @ points[m, 0] + shift, turn @ points[m, 1] + shift
        visible[m] = first[2] >= NEAR_PLANE_M or second[2] >= NEAR_PLANE_M
        if not visible[m]:
            px[m, :, 0], px[m, :, 1] = cx, cy
            continue
        if first[2] < NEAR_PLANE_M:
            first = second + (second[2] - NEAR_PLANE_M) / (second[2] - first[2]) * (first - second)
        elif second[2] < NEAR_PLANE_M:
            second = first + (first[2] - NEAR_PLANE_M) / (first[2] - second[2]) * (second - first)
        px[m, 0, 0], px[m, 0, 1] = fx * first[0] / first[2] + cx, fy * first[1] / first[2] + cy
        px[m, 1, 0], px[m, 1, 1] = fx * second[0] / second[2] + cx, fy * second[1] / second[2] + cy
        lengths[m] = max(math.hypot(px[m, 1, 0] - px[m, 0, 0], px[m, 1, 1] - px[m, 0, 1]), 1.0)
    return px, lengths, visible


@compiled
def _nearly_parallel(px: Any, visible: Any, data: Any) -> tuple[Any, Any]:
    """Indices of the model and data lines of every pair whose directions differ by :data:`STEEPEST_RAD` at the most."""
    i, k = np.empty(len(px) * len(data), np.intp), np.empty(len(px) * len(data), np.intp)
    angles = np.empty(len(data))
    for d in range(len(data)):
        angles[d] = math.atan2(data[d, 1, 1] - data[d, 0, 1], data[d, 1, 0] - data[d, 0, 0])
    count = 0
    for m in range(len(px)):
        angle = math.atan2(px[m, 1, 1] - px[m, 0, 1], px[m, 1, 0] - px[m, 0, 0])
        for d in range(len(data)):
            if visible[m] and abs(_undirected(angles[d] - angle)) <= STEEPEST_RAD:
                i[count], k[count] = m, d
                count += 1
    return i[:count].copy(), k[:count].copy()


@compiled
def _within(
    distances: Any, slopes: Any, along: Any, lengths: Any, angles: Any, data_lengths: Any, root: Any
) -> Any:
    """(p,) which pairs lie where the prior, ``root``, allows them."""
    pairs, _, unknowns = slopes.shape
    near = np.empty(pairs, np.bool_)
    for p in range(pairs):
        spreads, turned = np.zeros(2), 0.0
        for c in range(unknowns):
            first = second = 0.0
            for a in range(unknowns):
                first, second = first + slopes[p, 0, a] * root[a, c], second + slopes[p, 1, a] * root[a, c]
            spreads[0], spreads[1] = spreads[0] + first * first, spreads[1] + second * second
            turned += (second - first) ** 2
        spreads = np.sqrt(spreads)
        reach = GATE_SIGMAS * spreads.max() + GATE_ALONG_PX
        near[p] = (
            abs(distances[p, 0]) <= GATE_SIGMAS * spreads[0] + GATE_PX
            and abs(distances[p, 1]) <= GATE_SIGMAS * spreads[1] + GATE_PX
            and abs(angles[p]) <= GATE_SIGMAS * math.sqrt(turned) / max(data_lengths[p], 1.0) + GATE_RAD
            and max(along[p, 0], along[p, 1]) >= -reach
            and min(along[p, 0], along[p, 1]) <= lengths[p] + reach
        )
    return near


@compiled
def _linearised(
    directions: Any, moments: Any, px: Any, data: Any, rays: Any, focal: Any, turn: Any, shift: Any, basis: Any,
    i: Any, k: Any,
) -> tuple[Any, Any, Any, Any, Any]:
    """Distances (p, 2), slopes (p, 2, d), along (p, 2), angles (p,) and shares (p,) of pairs at a pose.

    A turn w moves a projection plane's normal m by w x m; a shift t by t x d, d the model line's direction.
    """
    pairs, unknowns = len(i), basis.shape[1]
    distances, along = np.empty((pairs, 2)), np.empty((pairs, 2))
    slopes, angles, shares = np.empty((pairs, 2, unknowns)), np.empty(pairs), np.empty(pairs)
    planes, tilts, reaches, moves = _planes(directions, moments, focal, turn, shift, basis)
    for p in range(pairs):
        m, n = i[p], k[p]
        u, v = px[m, 1, 0] - px[m, 0, 0], px[m, 1, 1] - px[m, 0, 1]
        length = max(math.hypot(u, v), 1.0)
        data_u, data_v = data[n, 1, 0] - data[n, 0, 0], data[n, 1, 1] - data[n, 0, 1]
        angles[p] = _undirected(math.atan2(data_v, data_u) - math.atan2(v, u))
        shares[p] = min(math.hypot(data_u, data_v), length)
        for e in range(2):
            along[p, e] = ((data[n, e, 0] - px[m, 0, 0]) * u + (data[n, e, 1] - px[m, 0, 1]) * v) / length
            distance = 0.0
            for a in range(3):
                distance += rays[n, e, a] * planes[m, a] / reaches[m]
            distances[p, e] = distance
            for c in range(unknowns):
                slope = 0.0
                for a in range(3):
                    slope += (rays[n, e, a] - distance * tilts[m, a]) * moves[m, c, a]
                slopes[p, e, c] = slope / reaches[m]
    return distances, slopes, along, angles, shares


@compiled
def _planes(
    directions: Any, moments: Any, focal: Any, turn: Any, shift: Any, basis: Any
) -> tuple[Any, Any, Any, Any]:
    """Projection planes' normals (m, 3), what a distance loses by their tilt (m, 3), their reach in the image (m,).

    And (m, d, 3) how each unknown moves the normals.
    """
    lines, unknowns = len(directions), basis.shape[1]
    planes, tilts, reaches = np.empty((lines, 3)), np.zeros((lines, 3)), np.empty(lines)
    moves, direction = np.empty((lines, unknowns, 3)), np.empty(3)
    for m in range(lines):
        for a in range(3):
            direction[a] = turn[a, 0] * directions[m, 0] + turn[a, 1] * directions[m, 1] + turn[a, 2] * directions[m, 2]
            planes[m, a] = turn[a, 0] * moments[m, 0] + turn[a, 1] * moments[m, 1] + turn[a, 2] * moments[m, 2]
        for a in range(3):
            b, c = (a + 1) % 3, (a + 2) % 3
            planes[m, a] += shift[b] * direction[c] - shift[c] * direction[b]
        x, y = planes[m, 0] / focal[0], planes[m, 1] / focal[1]
        reaches[m] = max(math.hypot(x, y), TINY)
        tilts[m, 0], tilts[m, 1] = x / focal[0] / reaches[m], y / focal[1] / reaches[m]
        for n in range(unknowns):
            for a in range(3):
                b, c = (a + 1) % 3, (a + 2) % 3
                moves[m, n, a] = (
                    basis[b, n] * planes[m, c] - basis[c, n] * planes[m, b]
                    + basis[3 + b, n] * direction[c] - basis[3 + c, n] * direction[b]
                )
    return planes, tilts, reaches, moves


@compiled
def _undirected(angle: float) -> float:
    """The angle between undirected lines, in [-pi/2, pi/2)."""
    return (angle + 0.5 * math.pi) % math.pi - 0.5 * math.pi
