"""Does a door or a wall stand beside its place, and how far? Its edges against the segments of a picture.

A casing or a baseboard has several edges, a hand apart, so that one segment may be any of them. So no segment is
matched to an edge: for each place at which the door may stand it is asked how well all its edges are found there,
against how often a segment lies there by chance. What the picture leaves open stays a wide or a split belief, and says
little. Of two walls that face each other it is asked how far apart they are: where the robot is between them is not
known better than the walls are, and both are seen beside by the same.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from knowledge_sources.methods.arrays import Floats
from knowledge_sources.methods.pose.planar import compute_camera_poses
from world_models.camera import Camera
from world_models.frames import Pose, Pose2

PLACES_M = np.linspace(-0.4, 0.4, 161)
"""Where a door may stand, from its place in the file along its wall: no casing is misplaced by its own half width."""
BESIDE_M, MEASURED_M = 0.08, 0.01
"""Deviations of what stands beside, and of what stands where it was measured."""
ONE_PLACE_M = 0.045  # places no further from the likeliest are of one belief: half of what edges of a casing are apart
EDGE_SIGMA_PX = 1.0  # of a segment beside the edge that it shows, by lens, pose and matcher together
P_SHOWN = 0.75  # part of the edges in view that a picture shows; others are hidden, or too faint
INDEPENDENT = 0.5  # weight of an edge: those of one casing are shown or missed together
NEAR_PX = 40.0  # so far aside it is counted how often a segment like an edge is found
MAX_TURN_RAD = 0.06  # between an edge and a segment that shows it
MIN_COVERED = 0.3  # part of an edge that a segment has to cover
MIN_LENGTH_PX = 12.0  # shorter edges are not looked for
MIN_MOVE_PX = 6.0  # an edge that moves by less in the picture over half of the places tells nothing
MIN_EDGES = 3
TINY = 1e-300


@dataclass(frozen=True, slots=True)
class FoundBeside:
    """Where a picture has a door, or how far apart two walls are.

    Attributes:
        off_m, sigma_m: how far beside its place in the file.
        log_ratio: by how much what stands there explains the picture better than what stands in its place.
        edges: how many edges tell.
    """

    off_m: float
    sigma_m: float
    log_ratio: float
    edges: int


def find_beside(
    lines_world: Floats, along: Floats, known_m: float, segments_px: Floats, camera: Camera, mount: Pose, pose: Pose2,
    sigma_m: float,
) -> FoundBeside | None:
    """What a picture from a pose (world) tells of a door's place; None where too few of its edges tell anything.

    Args:
        lines_world: (n, 2, 3) its edges that should be seen, as they are believed to stand now [m].
        along: (3,) unit direction in which it may stand beside.
        known_m: how far beside the file it is believed to stand now.
        segments_px: (s, 2, 2). mount: ``camera_from_robot``.
        sigma_m: of the pose in that direction.
    """
    seen = weigh_places(lines_world, along, known_m, segments_px, camera, mount, pose)
    return None if seen is None else _conclude(PLACES_M, _blur(seen[0], sigma_m), 1.0, seen[1])


def find_width(one: tuple[Floats, int], other: tuple[Floats, int]) -> FoundBeside:
    """By how much two walls are farther apart than in the file, by the weighed places (:func:`weigh_places`) of each,
    outward of the room; both from one pose, which may be off by anything.
    """
    tops = one[0].max(), other[0].max()
    apart = np.convolve(np.exp(one[0] - tops[0]), np.exp(other[0] - tops[1]))
    places = np.linspace(2.0 * PLACES_M[0], 2.0 * PLACES_M[-1], len(apart))
    return _conclude(places, np.log(apart + TINY) + tops[0] + tops[1], math.sqrt(2.0), one[1] + other[1])


def _conclude(places_m: Floats, log_likelihood: Floats, spread: float, edges: int) -> FoundBeside:
    """What the log likelihoods (p,) of places (p,) [m] say; ``spread``: of what is not exact, to that of one door."""
    beside, there = (_log_mean(places_m, log_likelihood, spread * of_m) for of_m in (BESIDE_M, MEASURED_M))
    weights = np.exp(log_likelihood - log_likelihood.max() - 0.5 * (places_m / (spread * BESIDE_M)) ** 2)
    near = np.where(np.abs(places_m - places_m[np.argmax(weights)]) <= ONE_PLACE_M, weights, 0.0)
    part, near = near.sum() / weights.sum(), near / near.sum()
    off_m = float(near @ places_m)
    return FoundBeside(off_m, math.sqrt(float(near @ (places_m - off_m) ** 2)), beside - there + math.log(part), edges)


def weigh_places(
    lines_world: Floats, along: Floats, known_m: float, segments_px: Floats, camera: Camera, mount: Pose, pose: Pose2,
) -> tuple[Floats, int] | None:
    """(p,) the log likelihood of each place, and by how many edges; as :func:`find_beside`, from exactly this pose."""
    segments = np.asarray(segments_px, float)
    rotation, translation = compute_camera_poses(pose.vector, mount)
    shifts = (PLACES_M - known_m)[:, None] * along
    moved = lines_world[:, None] + shifts[None, :, None]
    projected, _ = camera.project_segments(moved.reshape(-1, 2, 3), Pose(rotation, translation))
    total, edges = np.zeros(len(PLACES_M)), 0
    for edge in projected.reshape(len(lines_world), len(PLACES_M), 2, 2):
        seen = _weigh_edge(edge, segments)
        if seen is not None:
            total, edges = total + INDEPENDENT * seen, edges + 1
    return (total, edges) if edges >= MIN_EDGES else None


def _weigh_edge(places: Floats, segments: Floats) -> Floats | None:
    """(p,) the log likelihood of an edge (p, 2, 2) [px], place by place; None where it tells nothing.

    Of a place from which it is out of the picture it tells nothing.
    """
    lengths = np.linalg.norm(places[:, 1] - places[:, 0], axis=1)
    in_view = lengths >= MIN_LENGTH_PX
    if 2 * np.count_nonzero(in_view) < len(places):
        return None
    edge, lengths = places[in_view], lengths[in_view]
    middle = len(edge) // 2
    along = (edge[:, 1] - edge[:, 0]) / lengths[:, None]
    across = np.column_stack([-along[:, 1], along[:, 0]])
    if abs(float((edge[-1] - edge[0]).mean(axis=0) @ across[middle])) < 2.0 * MIN_MOVE_PX:
        return None
    by = segments[:, 1] - segments[:, 0]
    is_like = np.abs(across @ (by / np.linalg.norm(by, axis=1)[:, None]).T) <= math.sin(MAX_TURN_RAD)
    some = is_like.any(axis=0)  # most lines of a picture are turned otherwise
    off = segments[some][None] - edge[:, None, :1]
    beside, at = (np.abs(np.einsum("pc,psec->pse", across, off)), np.einsum("pc,psec->pse", along, off))
    ends = np.clip(at, 0.0, lengths[:, None, None])
    is_like = is_like[:, some] & (np.abs(ends[..., 1] - ends[..., 0]) >= MIN_COVERED * lengths[:, None])
    away = np.where(is_like, np.maximum(beside[..., 0], beside[..., 1]), np.inf)
    chance = max(int(np.count_nonzero(away[middle] < NEAR_PX)), 1) / (2.0 * NEAR_PX)
    nearest = away.min(axis=1, initial=np.inf)
    found = np.exp(-0.5 * (nearest / EDGE_SIGMA_PX) ** 2) / (math.sqrt(math.tau) * EDGE_SIGMA_PX)
    told = np.zeros(len(places))
    told[in_view] = np.log(1.0 - P_SHOWN + P_SHOWN * found / chance)
    return told


def _blur(log_likelihood: Floats, sigma_m: float) -> Floats:
    """The log likelihood (p,) of each place where the pose is not known better than that."""
    off = (PLACES_M[:, None] - PLACES_M) / max(sigma_m, 1e-3)
    kernel = np.exp(-0.5 * off**2)
    most = log_likelihood.max()
    return np.asarray(most + np.log(kernel @ np.exp(log_likelihood - most) / kernel.sum(axis=1)))


def _log_mean(places_m: Floats, log_likelihood: Floats, spread_m: float) -> float:
    """The log likelihood (p,) in the mean over places with such a deviation round the file's."""
    prior = np.exp(-0.5 * (places_m / spread_m) ** 2)
    most = log_likelihood.max()
    return float(most + np.log(prior @ np.exp(log_likelihood - most) / prior.sum()))
