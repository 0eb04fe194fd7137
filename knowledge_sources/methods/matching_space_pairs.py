"""Model and data lines that may belong together, given where the camera may be: pairs linear in its six unknowns."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from knowledge_sources.methods.matching_hough import undirected
from knowledge_sources.methods.pose.image_error import image_jacobian
from knowledge_sources.methods.pose.lines import LineSet, line_set
from world_models.camera import NEAR_M, Camera
from world_models.frames import Pose

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
class SpaceScene:
    """The call's givens: model lines as (m) lines, data lines (k, 2, 2) without distortion, camera and prior.

    ``root`` (6, 6) takes deviations of one to left perturbations of the prior; ``information`` is its inverse square.
    """

    model: LineSet
    data: Array
    data_lines: LineSet
    camera: Camera
    prior: Pose
    information: Array
    root: Array


@dataclass(frozen=True, slots=True, eq=False)
class SpacePairs:
    """p pairs at a pose: distances (p, 2) [px], slopes (p, 2, 6), along (p, 2) from 0 to ``lengths`` (p,) [px].

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

    def take(self, chosen: Mask) -> SpacePairs:
        """The pairs of a mask."""
        return SpacePairs(*(getattr(self, name)[chosen] for name in SpacePairs.__slots__))


def space_scene(model: Any, data: Any, camera: Camera, prior: Pose, covariance: Any) -> SpaceScene:
    """Check the shapes and prepare the lines.

    Raises:
        ValueError: no model line, or a wrong shape.
    """
    lines = np.asarray(model, float).reshape(-1, 2, 3)
    if not len(lines):
        raise ValueError("expected at least one model line, got none")
    spread = np.asarray(covariance, float)
    if spread.shape != (6, 6):
        raise ValueError(f"expected a prior_covariance of shape (6, 6), got {spread.shape}")
    segments = np.asarray(data, float).reshape(-1, 2, 2)
    anywhere = np.broadcast_to([[0.0, 0.0], [1.0, 0.0]], (len(lines), 2, 2))
    return SpaceScene(
        line_set(lines, anywhere, camera, 1.0),
        camera.undistort(segments),
        line_set(np.broadcast_to(lines[:1], (len(segments), 2, 3)), segments, camera, 1.0),
        replace(camera, distortion=None),
        prior,
        np.linalg.inv(spread),
        np.linalg.cholesky(spread),
    )


def away(scene: SpaceScene, pose: Pose) -> Array:
    """(6,) left perturbation that takes the prior to a pose."""
    apart = pose @ scene.prior.inverse()
    return np.concatenate([apart.rotation_vector, apart.translation])


def projected(scene: SpaceScene, pose: Pose) -> tuple[Array, Array, Mask]:
    """(m, 2, 2) model lines in the image plane, cut at the near plane but not at the border; lengths; what is left."""
    p = pose.apply(scene.model.points)
    z = p[..., 2]
    drop = np.where(np.abs(z[:, 1] - z[:, 0]) < 1e-9, 1.0, z[:, 1] - z[:, 0])
    cut = p[:, 0] + ((NEAR_M - z[:, 0]) / drop)[:, None] * (p[:, 1] - p[:, 0])
    behind = z < NEAR_M
    p = np.where(behind[..., None], cut[:, None, :], p)
    visible: Mask = ~np.all(behind, axis=1)
    p[~visible] = (0.0, 0.0, 1.0)
    px = scene.camera.project(p)
    return px, np.maximum(np.linalg.norm(px[:, 1] - px[:, 0], axis=1), 1.0), visible


def gated_pairs(scene: SpaceScene) -> SpacePairs:
    """Pairs within 3 deviations of the prediction, in offset at both ends and in angle."""
    px, _, visible = projected(scene, scene.prior)
    turn = np.abs(undirected(_angles(scene.data)[None] - _angles(px)[:, None]))
    i, k = np.nonzero((turn <= STEEPEST_RAD) & visible[:, None])
    pairs = pairs_at(scene, scene.prior, i, k)
    moved = pairs.slopes @ scene.root
    spread = np.sqrt(np.sum(moved**2, axis=-1))
    lengths = np.maximum(np.linalg.norm(scene.data[k, 1] - scene.data[k, 0], axis=1), 1.0)
    turned = np.sqrt(np.sum((moved[:, 1] - moved[:, 0]) ** 2, axis=-1)) / lengths
    reach = GATE_SIGMAS * spread.max(axis=1) + GATE_ALONG_PX
    near = np.all(np.abs(pairs.distances) <= GATE_SIGMAS * spread + GATE_PX, axis=1)
    near &= np.abs(pairs.angles) <= GATE_SIGMAS * turned + GATE_RAD
    near &= (pairs.along.max(axis=1) >= -reach) & (pairs.along.min(axis=1) <= pairs.lengths + reach)
    return pairs.take(near)


def pairs_at(scene: SpaceScene, pose: Pose, i: Index, k: Index) -> SpacePairs:
    """Model lines ``i`` with data lines ``k``, linearised at a pose."""
    seen = scene.data_lines.take(k)
    model = scene.model
    lines = replace(seen, points=model.points[i], directions=model.directions[i], moments=model.moments[i])
    distances, slopes = image_jacobian(lines, pose.rotation, pose.translation)
    px, lengths, _ = projected(scene, pose)
    units = (px[:, 1] - px[:, 0]) / lengths[:, None]
    along = np.sum((scene.data[k] - px[i, 0][:, None, :]) * units[i][:, None, :], axis=-1)
    angles = undirected(_angles(scene.data[k]) - _angles(px[i]))
    shares = np.minimum(np.linalg.norm(scene.data[k, 1] - scene.data[k, 0], axis=1), lengths[i])
    return SpacePairs(i, k, distances, slopes, along, lengths[i], angles, shares)


def near_pairs(pairs: SpacePairs, pair_px: float, pair_rad: float) -> Mask:
    """(p,) which lie within the limits across, overlap along and are nearly parallel."""
    near = (np.abs(pairs.distances).max(axis=1) <= pair_px) & (np.abs(pairs.angles) <= pair_rad)
    beside = (pairs.along.max(axis=1) < -pair_px) | (pairs.along.min(axis=1) > pairs.lengths + pair_px)
    return np.asarray(near & ~beside)


def _angles(segments: Array) -> Array:
    span = segments[:, 1] - segments[:, 0]
    return np.arctan2(span[:, 1], span[:, 0])
