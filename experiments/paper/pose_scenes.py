"""Synthetic scenes of the pose tables, whose geometry the paper does not give."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from knowledge_sources.methods.pose import build_line_set, compute_image_jacobian, invert_information
from world_models.camera import Camera
from world_models.frames import Pose

Array = NDArray[np.float64]

FEET_PER_M = 1.0 / 0.3048
CAMPUS_CAMERA = Camera.from_field_of_view(math.radians(45.0), 512, 512)
EYE_M = 1.2
"""Height of the camera above the ground."""


@dataclass(frozen=True, slots=True, eq=False)
class PoseScene:
    """Lines in a camera's view, whole or in parts.

    Attributes:
        lines_world: (n, 2, 3) [m]. segments_px: (n, 2, 2) without noise. landmark_ids: (n,).
        camera, camera_from_world: the truth.
    """

    lines_world: Array
    segments_px: Array
    landmark_ids: NDArray[np.intp]
    camera: Camera
    camera_from_world: Pose

    def __len__(self) -> int:
        return len(self.lines_world)

    def take(self, chosen: NDArray[np.intp] | NDArray[np.bool_]) -> PoseScene:
        """Select some of the lines."""
        return PoseScene(
            self.lines_world[chosen],
            self.segments_px[chosen],
            self.landmark_ids[chosen],
            self.camera,
            self.camera_from_world,
        )


def campus(ahead_m: float = 0.0) -> PoseScene:
    """30 lines of 9 landmarks, 55 to 300 feet ahead: 4 lamp posts, 2 telephone poles, 3 buildings.

    World x right, y ahead, z up; the camera stands ``ahead_m`` along y, 1.2 m high, and looks along y.
    """
    parts = [_post(x, y, 5.0, 1.2) for x, y in ((-6.0, 17.0), (7.0, 24.0), (-9.0, 36.0), (12.0, 48.0))]
    parts += [_post(x, y, 9.0, 2.4) for x, y in ((-4.0, 29.0), (5.0, 62.0))]
    parts += [
        _building(-23.0, 60.0, 16.0, 12.0, 11.0),
        _building(8.0, 75.0, 20.0, 14.0, 16.0),
        _building(-10.0, 91.0, 14.0, 10.0, 20.0),
    ]
    return _project(parts, ahead_m)


def corridor(doors: int = 6) -> PoseScene:
    """A corridor 8 feet wide: 2 x 2 long edges, the far wall, and door frames of 3 lines on both sides.

    World as in :func:`campus`; landmarks are the shell and each door.
    """
    half, top, far = 1.22, 2.6, 20.0
    shell = [[[x, 1.0, z], [x, far, z]] for x in (-half, half) for z in (0.0, top)]
    shell += [[[-half, far, z], [half, far, z]] for z in (0.0, top)]
    parts = [np.array(shell)]
    for i in range(doors):
        side, start = (-half if i % 2 else half), 4.0 + 2.3 * i
        frame = [[start, 0.0, start, 2.1], [start + 0.9, 0.0, start + 0.9, 2.1], [start, 2.1, start + 0.9, 2.1]]
        parts.append(np.array([[[side, a, b], [side, c, d]] for a, b, c, d in frame]))
    return _project(parts)


def fragment(scene: PoseScene, rng: np.random.Generator) -> PoseScene:
    """Keep only a part, 30 to 100 % long, of each segment."""
    share = rng.uniform(0.3, 1.0, len(scene))
    start = rng.uniform(0.0, 1.0 - share)
    a, d = scene.segments_px[:, 0], scene.segments_px[:, 1] - scene.segments_px[:, 0]
    cut = np.stack([a + start[:, None] * d, a + (start + share)[:, None] * d], axis=1)
    return PoseScene(scene.lines_world, cut, scene.landmark_ids, scene.camera, scene.camera_from_world)


def end_noise(segments_px: Array, sigma_px: float, rng: np.random.Generator) -> Array:
    """Segments (n, 2, 2) with Gaussian noise of their ends, across the segments."""
    span = segments_px[:, 1] - segments_px[:, 0]
    unit = span / np.linalg.norm(span, axis=1, keepdims=True)
    across = np.stack([-unit[:, 1], unit[:, 0]], axis=1)
    offsets = rng.normal(0.0, sigma_px, (len(segments_px), 2))
    return np.asarray(segments_px + offsets[..., None] * across[:, None, :])


def rho_theta_noise(
    segments_px: Array, rho_px: float, theta_rad: float, about_px: Array, rng: np.random.Generator
) -> Array:
    """Segments with uniform noise, +-rho and +-theta, of the lines' (rho, theta) about ``about_px`` (2,) or (n, 2)."""
    count = len(segments_px)
    turn = rng.uniform(-theta_rad, theta_rad, count)
    shift = rng.uniform(-rho_px, rho_px, count)
    span = segments_px[:, 1] - segments_px[:, 0]
    unit = span / np.linalg.norm(span, axis=1, keepdims=True)
    across = np.stack([-unit[:, 1], unit[:, 0]], axis=1)
    centre = np.broadcast_to(about_px, (count, 2))
    foot = centre + np.sum((segments_px[:, 0] - centre) * across, axis=1)[:, None] * across
    c, s = np.cos(turn), np.sin(turn)
    turns = np.stack([np.stack([c, -s], axis=1), np.stack([s, c], axis=1)], axis=1)
    moved = np.einsum("nab,neb->nea", turns, segments_px - foot[:, None]) + foot[:, None]
    return np.asarray(moved + shift[:, None, None] * np.einsum("nab,nb->na", turns, across)[:, None])


def wrong_landmarks(
    scene: PoseScene, segments_px: Array, count: int, rng: np.random.Generator
) -> tuple[Array, NDArray[np.bool_]]:
    """Segments in which whole landmarks are shifted until ``count`` lines are wrong, and which lines are."""
    out, wrong = segments_px.copy(), np.zeros(len(scene), bool)
    for name in rng.permutation(np.unique(scene.landmark_ids)):
        rows = np.flatnonzero(scene.landmark_ids == name)[: count - int(wrong.sum())]
        angle, far = rng.uniform(0.0, 2.0 * math.pi), rng.uniform(15.0, 60.0)
        out[rows] += far * np.array([math.cos(angle), math.sin(angle)])
        wrong[rows] = True
        if int(wrong.sum()) >= count:
            break
    return out, wrong


def compute_position_error_ft(found: Pose, truth: Pose) -> Array:
    """Compute the (3,) error of the camera's position in the paper's axes: x up, y left, z ahead [ft]."""
    apart = (found.inverse().translation - truth.inverse().translation) @ truth.rotation.T
    return np.asarray(np.array([-apart[1], -apart[0], apart[2]]) * FEET_PER_M)


def compute_information(scene: PoseScene, sigma_px: float) -> Array:
    """Compute the (6, 6) Fisher information of the lines on the pose's left perturbation, at the truth."""
    lines, truth = build_line_set(scene.lines_world, scene.segments_px, scene.camera, sigma_px), scene.camera_from_world
    slopes = compute_image_jacobian(lines, truth.rotation, truth.translation)[1].reshape(-1, 6) / sigma_px
    return np.asarray(slopes.T @ slopes)


def compute_position_bound_ft(scene: PoseScene, sigma_px: float) -> Array:
    """Compute the Cramér-Rao bound (3,) of the camera's position in the paper's axes [ft]."""
    variance = np.diag(invert_information(compute_information(scene, sigma_px)))[3:]
    return np.asarray(np.sqrt(variance[[1, 0, 2]]) * FEET_PER_M)


def draw_prior(truth: Pose, shift_m: float, turn_rad: float, rng: np.random.Generator) -> Pose:
    """The truth with uniform errors of up to ``shift_m`` and ``turn_rad`` along and about each camera axis."""
    return truth.perturbed(rng.uniform(-turn_rad, turn_rad, 3), rng.uniform(-shift_m, shift_m, 3))


def _post(x: float, y: float, height: float, arm: float) -> Array:
    return np.array([[[x, y, 0.0], [x, y, height]], [[x, y, height], [x + arm, y, height]]])


def _building(x: float, y: float, wide: float, deep: float, high: float) -> Array:
    """The front's two corners and roof line, the side's roof line and corner, and the front's base."""
    side = x + wide if x < 0.0 else x
    return np.array(
        [
            [[x, y, 0.0], [x, y, high]],
            [[x + wide, y, 0.0], [x + wide, y, high]],
            [[x, y, high], [x + wide, y, high]],
            [[x, y, 0.0], [x + wide, y, 0.0]],
            [[side, y, high], [side, y + deep, high]],
            [[side, y + deep, 0.0], [side, y + deep, high]],
        ]
    )


def _project(parts: list[Array], ahead_m: float = 0.0) -> PoseScene:
    """Project all lines, without occlusion."""
    lines = np.concatenate(parts)
    names = np.repeat(np.arange(len(parts)), [len(p) for p in parts])
    ahead = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])
    camera_from_world = Pose(ahead, -ahead @ np.array([0.0, ahead_m, EYE_M]))
    segments, visible = CAMPUS_CAMERA.project_segments(lines, camera_from_world)
    return PoseScene(lines[visible], segments[visible], names[visible], CAMPUS_CAMERA, camera_from_world)
