"""Matched lines, prepared for the solvers, and the distance of their observed ends to the projected model lines.

The distance in pixels to the projected infinite model line is the likelihood's residual. It stands here in numpy, for
batches and derivatives; the solvers use the same in `kernels`.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from knowledge_sources.methods.arrays import Floats, Indices, Mask
from knowledge_sources.methods.pose import kernels
from knowledge_sources.methods.pose.kernels import (
    MIN_IMAGE_PART,
    NO_LENGTH,
    NOT_FINITE,
    TINY,
    LineArrays,
    prepare_lines,
)
from world_models.camera import Camera

MAX_BESIDE_PX = 5.0  # how far beyond the end of its model line an observed segment may lie
OUTLIER_SIGMAS = 3.0  # a line further than this many standard deviations from its model line is an outlier (§6.2.4)


LandmarkIds = Sequence[Any] | NDArray[Any] | None
"""A hashable name for each line, or none at all."""


@dataclass(frozen=True, slots=True, eq=False)
class LineSet:
    """n model lines, each with the image segment matched to it. Source: §6.2.1, Figure 14.

    Attributes:
        points: (n, 2, 3) ends p of the model lines [m, world].
        directions: (n, 3) unit d [world].
        moments: (n, 3) p x d [m, world].
        rays: (n, 2, 3) directions, z = 1, to the observed ends (lens distortion removed) [camera].
        normals: (n, 3) unit normals n of the observed projection planes [camera]; zero if the segment has no length.
        lengths_px: (n,) of the observed segments.
        sigma_px: (n,) standard deviation of an observed end, across the line.
        focal_px: (2,) fx, fy.
    """

    points: Floats
    directions: Floats
    moments: Floats
    rays: Floats
    normals: Floats
    lengths_px: Floats
    sigma_px: Floats
    focal_px: Floats

    def __len__(self) -> int:
        return len(self.points)

    @property
    def arrays(self) -> LineArrays:
        """All of them in this order, as the compiled functions take them."""
        return (self.points, self.directions, self.moments, self.rays, self.normals, self.lengths_px, self.sigma_px,
                self.focal_px)

    def take(self, chosen: Mask | Indices) -> LineSet:
        """The lines named by a mask or by indices."""
        points, directions, moments, rays, normals, lengths_px, sigma_px = (a[chosen] for a in self.arrays[:-1])
        return LineSet(points, directions, moments, rays, normals, lengths_px, sigma_px, self.focal_px)


def build_line_set(model_lines_world: Any, segments_px: Any, camera: Camera, sigma_px: Any) -> LineSet:
    """Check the shapes and prepare the lines.

    Args:
        model_lines_world: (n, 2, 3) [m]. segments_px: (n, 2, 2) as the lens shows them.
        sigma_px: of the segment ends across the line, one number or (n,).

    Raises:
        ValueError: a wrong shape, a value that is not finite, a model line without length or a sigma that is not > 0.
    """
    model, segments = check_matched_arrays(model_lines_world, segments_px)
    directions, moments, rays, normals, lengths, fault, row = prepare_lines(
        model, camera.undistort(segments), camera.fx, camera.fy, camera.cx, camera.cy
    )
    if fault == NOT_FINITE:
        name = "segments_px" if np.all(np.isfinite(model[row])) else "model_lines_world"
        raise ValueError(f"expected finite {name}, got a value that is not in row {row}")
    if fault == NO_LENGTH:
        raise ValueError(f"expected model lines with a length, got none in row {row}")
    sigma = check_sigma(sigma_px, len(model))
    return LineSet(model, directions, moments, rays, normals, lengths, sigma, np.array([camera.fx, camera.fy]))


def check_matched_arrays(model_lines_world: Any, segments_px: Any) -> tuple[Floats, Floats]:
    """Copies (n, 2, 3) and (n, 2, 2). Raises ValueError where the shapes are wrong or do not match."""
    model = _check_shape(model_lines_world, "model_lines_world", (2, 3))
    segments = _check_shape(segments_px, "segments_px", (2, 2))
    if len(model) != len(segments):
        raise ValueError(f"expected one segment a model line, got {len(model)} lines and {len(segments)} segments")
    return model, segments


def group_by_landmark(landmark_ids: LandmarkIds, n: int) -> list[Indices]:
    """Indices of the lines of each landmark, in order of first appearance; one line a group without ids."""
    check_landmarks(landmark_ids, n)
    if landmark_ids is None:
        return [np.array([i]) for i in range(n)]
    groups: dict[Any, list[int]] = {}
    for i, name in enumerate(landmark_ids):
        groups.setdefault(name, []).append(i)
    return [np.array(rows) for rows in groups.values()]


def check_landmarks(landmark_ids: LandmarkIds, n: int) -> None:
    """Raises ValueError unless there are none or one a line."""
    if landmark_ids is not None and len(landmark_ids) != n:
        raise ValueError(f"expected {n} landmark ids, one a line, got {len(landmark_ids)}")


def check_sigma(sigma_px: Any, n: int) -> Floats:
    """A standard deviation a row, (n,), from one number or n. Raises ValueError unless all are > 0 and finite."""
    if isinstance(sigma_px, float) and 0.0 < sigma_px < math.inf:
        same = np.empty(n)
        same.fill(sigma_px)
        return same
    sigma = np.asarray(sigma_px, float)
    if sigma.shape not in ((), (n,)) or not np.all(np.isfinite(sigma)) or np.any(sigma <= 0):
        raise ValueError(f"expected sigma_px > 0, one number or {n}, got {sigma_px!r}")
    return np.full(n, sigma) if sigma.shape == () else np.array(sigma)


def _check_shape(values: Any, name: str, row: tuple[int, ...]) -> Floats:
    array = np.asarray(values, float)
    if array.size == 0:
        array = array.reshape(0, *row)
    if array.shape[1:] != row:
        raise ValueError(f"expected {name} of shape (n, {row[0]}, {row[1]}), got {array.shape}")
    return np.array(array, order="C")


def compute_image_jacobian(lines: LineSet, rotation: Floats, translation: Floats) -> tuple[Floats, Floats]:
    """Distances (..., n, 2) [px] and their derivatives (..., n, 2, 6) by the left perturbation (rotation, translation).

    ``rotation`` (..., 3, 3) and ``translation`` (..., 3) [m] of ``camera_from_world`` may have leading batch axes.
    A turn w moves a plane's normal m by w x m; a shift t moves it by t x d, d the model line's direction.
    """
    directions, planes = _project_planes(lines, rotation, translation)
    distances, slopes = compute_distance_slopes(lines, planes)
    turn = cross(planes[..., None, :], slopes)
    shift = cross(directions[..., None, :], slopes)
    return distances, np.concatenate([turn, shift], axis=-1)


def compute_distance_slopes(lines: LineSet, planes: Floats) -> tuple[Floats, Floats]:
    """Distances (..., n, 2) [px] and their derivatives (..., n, 2, 3) by the plane's normal (..., n, 3) [camera]."""
    inverse_focal2 = np.array([*(1.0 / lines.focal_px**2), 0.0])
    tilt = planes * inverse_focal2
    reach = _compute_reach(planes, lines.focal_px)[..., None]
    distances = np.matmul(lines.rays, planes[..., None])[..., 0] / reach
    slopes = (lines.rays - distances[..., None] * (tilt / reach)[..., None, :]) / reach[..., None]
    return distances, slopes


def compute_normals_px(lines: LineSet, rotation: Floats, translation: Floats) -> Floats:
    """(n, 2) unit normals of the projected model lines in the picture."""
    _, planes = _project_planes(lines, rotation, translation)
    return np.asarray(planes[:, :2] / lines.focal_px / _compute_reach(planes, lines.focal_px)[:, None])


def compute_squared_distances(lines: LineSet, rotations: Floats, translations: Floats) -> Floats:
    """(k, n), or (n,) for one pose, squared image distance of each line, over its variance."""
    many = kernels.compute_squared_distances(
        lines.arrays, np.array(rotations).reshape(-1, 3, 3), np.array(translations).reshape(-1, 3)
    )
    return np.asarray(many if rotations.ndim == 3 else many[0])


def measure_lines(
    lines: LineSet, rotation: Floats, translation: Floats, max_beside_px: float = 0.0
) -> tuple[Floats, Mask, Mask]:
    """Residuals of the lines at a pose, and two checks that an infinite line does not make.

    Returns:
        (n, 2) signed distances [px] of the observed ends to the projected model lines; (n,) which model lines pass
        both observed ends in front of the camera; (n,) which observed segments overlap their model line's extent, or
        lie beside it by at most ``max_beside_px`` (an infinite line does not end; a door does).
    """
    measured: tuple[Floats, Mask, Mask] = kernels.measure_lines(
        lines.arrays, np.array(rotation), np.array(translation), max_beside_px
    )
    return measured


def _project_planes(lines: LineSet, rotation: Floats, translation: Floats) -> tuple[Floats, Floats]:
    """Model directions and moments (..., n, 3) in the camera frame; a moment is the projection plane's normal."""
    turned = np.swapaxes(rotation, -1, -2)
    directions = lines.directions @ turned
    return directions, lines.moments @ turned + cross(translation[..., None, :], directions)


def _compute_reach(planes: Floats, focal_px: Floats) -> Floats:
    """Length (...) of the image line's normal; kept off zero, where the line leaves the image plane altogether."""
    squares = planes * planes
    flat = squares[..., 0] / focal_px[0] ** 2 + squares[..., 1] / focal_px[1] ** 2
    return np.asarray(np.sqrt(flat + MIN_IMAGE_PART * np.sum(squares, axis=-1) + TINY**2))


def cross(a: Floats, b: Floats) -> Floats:
    """a x b over the last axis, broadcast; faster than ``np.cross`` on small batches."""
    return np.stack(
        [
            a[..., 1] * b[..., 2] - a[..., 2] * b[..., 1],
            a[..., 2] * b[..., 0] - a[..., 0] * b[..., 2],
            a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0],
        ],
        axis=-1,
    )


def invert_information(hessian: Floats) -> Floats:
    """Inverse of a positive semi-definite matrix; directions without information get a huge but finite variance."""
    values, vectors = np.linalg.eigh(0.5 * (hessian + hessian.T))
    floor = max(float(values[-1]) * 1e-15, 1e-12)
    return np.asarray((vectors / np.maximum(values, floor)) @ vectors.T)
