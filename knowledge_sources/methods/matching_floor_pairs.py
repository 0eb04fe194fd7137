"""Model and data lines that may belong together, given where the robot may stand: pairs linear in its pose."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from knowledge_sources.methods.matching_hough import undirected
from knowledge_sources.methods.pose.lines import LineSet, line_set
from knowledge_sources.methods.pose.planar import camera_states, line_jacobian, planar_prior
from world_models.camera import NEAR_M, Camera
from world_models.frames import Pose, Pose2

Array = NDArray[np.float64]
Index = NDArray[np.intp]
Mask = NDArray[np.bool_]

GATE_SIGMAS = 3.0
GATE_PX = 3.0
GATE_RAD = 0.12
"""Beyond what the prior allows, a pair may be off by this much: the segment's own error."""
GATE_ALONG_PX = 30.0
STEEPEST_RAD = 0.6
"""Pairs that differ more in direction are not looked at."""


@dataclass(frozen=True, slots=True, eq=False)
class FloorScene:
    """The call's givens: model and data lines, camera, mount and prior."""

    model: Array
    data: Array
    data_lines: LineSet
    camera: Camera
    mount: Pose
    mean: Array
    information: Array
    root: Array


@dataclass(frozen=True, slots=True, eq=False)
class FloorPairs:
    """p pairs at a state: distances (p, 2) [px], slopes (p, 2, 3), along (p, 2) from 0 to ``lengths`` (p,) [px]."""

    model: Index
    data: Index
    distances: Array
    slopes: Array
    along: Array
    lengths: Array
    angles: Array
    shares: Array


def floor_scene(model: Any, data: Any, camera: Camera, mount: Pose, prior: Pose2, covariance: Any) -> FloorScene:
    belief = planar_prior(prior, covariance)
    data = np.asarray(data, float).reshape(-1, 2, 2)
    model = np.asarray(model, float).reshape(-1, 2, 3)
    if not len(model):
        raise ValueError("expected at least one model line, got none")
    data_lines = line_set(np.broadcast_to(model[:1], (len(data), 2, 3)), data, camera, 1.0)
    root = np.linalg.cholesky(np.linalg.inv(belief.information))
    pinhole = replace(camera, distortion=None)
    return FloorScene(
        model, camera.undistort(data), data_lines, pinhole, mount, belief.mean, belief.information, root
    )


def _model_lines(scene: FloorScene, rows: Index, columns: Index) -> LineSet:
    """Model lines ``rows`` paired with the data lines ``columns``."""
    span = scene.model[:, 1] - scene.model[:, 0]
    directions = span / np.linalg.norm(span, axis=1, keepdims=True)
    moments = np.cross(scene.model[:, 0], directions)
    seen = scene.data_lines.take(columns)
    return replace(seen, points=scene.model[rows], directions=directions[rows], moments=moments[rows])


def _projected(scene: FloorScene, state: Array) -> tuple[Array, Mask]:
    """(m, 2, 2) model lines in the image plane, cut at the near plane but not at the border; whether any is left."""
    turn, shift = camera_states(state, scene.mount)
    p = scene.model @ turn.T + shift
    z = p[..., 2]
    drop = np.where(np.abs(z[:, 1] - z[:, 0]) < 1e-9, 1.0, z[:, 1] - z[:, 0])
    cut = p[:, 0] + ((NEAR_M - z[:, 0]) / drop)[:, None] * (p[:, 1] - p[:, 0])
    behind = z < NEAR_M
    p = np.where(behind[..., None], cut[:, None, :], p)
    visible: Mask = ~np.all(behind, axis=1)
    p[~visible] = (0.0, 0.0, 1.0)
    return scene.camera.project(p), visible


def projected_lengths(scene: FloorScene, state: Array) -> tuple[Array, Mask]:
    px, visible = _projected(scene, state)
    return np.maximum(np.linalg.norm(px[:, 1] - px[:, 0], axis=1), 1.0), visible


def gated_pairs(scene: FloorScene) -> FloorPairs:
    """Pairs within 3 deviations of the prediction, in offset at both ends and in angle."""
    px, visible = _projected(scene, scene.mean)
    span = px[:, 1] - px[:, 0]
    lengths = np.maximum(np.linalg.norm(span, axis=1), 1.0)
    angles = np.arctan2(span[:, 1], span[:, 0])
    data_span = scene.data[:, 1] - scene.data[:, 0]
    data_angles = np.arctan2(data_span[:, 1], data_span[:, 0])
    turn = np.abs(undirected(data_angles[None] - angles[:, None]))
    i, k = np.nonzero((turn <= STEEPEST_RAD) & visible[:, None])
    pairs = pairs_at(scene, scene.mean, i, k)
    moved = pairs.slopes @ scene.root
    spread = np.sqrt(np.sum(moved**2, axis=-1))
    data_lengths = np.linalg.norm(data_span, axis=1)[k]
    turned = np.sqrt(np.sum((moved[:, 1] - moved[:, 0]) ** 2, axis=-1)) / np.maximum(data_lengths, 1.0)
    near = np.all(np.abs(pairs.distances) <= GATE_SIGMAS * spread + GATE_PX, axis=1)
    near &= turn[i, k] <= GATE_SIGMAS * turned + GATE_RAD
    reach = GATE_SIGMAS * spread.max(axis=1) + GATE_ALONG_PX
    near &= (pairs.along.max(axis=1) >= -reach) & (pairs.along.min(axis=1) <= lengths[i] + reach)
    return taken(pairs, near)


def pairs_at(scene: FloorScene, state: Array, i: Index, k: Index) -> FloorPairs:
    lines = _model_lines(scene, i, k)
    distances, slopes = line_jacobian(lines.points[:, 0], lines.directions, lines, state, scene.mount)
    px, _ = _projected(scene, state)
    span = px[:, 1] - px[:, 0]
    lengths = np.maximum(np.linalg.norm(span, axis=1), 1.0)
    units = span / lengths[:, None]
    along = np.sum((scene.data[k] - px[i, 0][:, None, :]) * units[i][:, None, :], axis=-1)
    data_span = scene.data[k, 1] - scene.data[k, 0]
    angles = undirected(np.arctan2(data_span[:, 1], data_span[:, 0]) - np.arctan2(units[i, 1], units[i, 0]))
    shares = np.minimum(np.linalg.norm(data_span, axis=1), lengths[i])
    return FloorPairs(i, k, distances, slopes, along, lengths[i], angles, shares)


def taken(pairs: FloorPairs, chosen: Mask) -> FloorPairs:
    return FloorPairs(*(getattr(pairs, name)[chosen] for name in FloorPairs.__slots__))


def near_pairs(pairs: FloorPairs, pair_px: float, pair_rad: float) -> Mask:
    near = (np.abs(pairs.distances).max(axis=1) <= pair_px) & (np.abs(pairs.angles) <= pair_rad)
    beside = (pairs.along.max(axis=1) < -pair_px) | (pairs.along.min(axis=1) > pairs.lengths + pair_px)
    return np.asarray(near & ~beside)
