"""Matched lines, prepared for the solvers: Plücker coordinates of the model, rays and planes of the image."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from knowledge_sources.methods.arrays import Floats, Indices, Mask
from knowledge_sources.methods.pose.numerics.kernels import NO_LENGTH, NOT_FINITE, LineArrays, prepare_lines
from world_models.camera import Camera

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
        return LineSet(
            self.points[chosen],
            self.directions[chosen],
            self.moments[chosen],
            self.rays[chosen],
            self.normals[chosen],
            self.lengths_px[chosen],
            self.sigma_px[chosen],
            self.focal_px,
        )


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
