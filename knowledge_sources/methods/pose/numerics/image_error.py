"""Distance in pixels of the observed segment ends to the projected infinite model line: the likelihood's residual."""

from __future__ import annotations

import numpy as np

from knowledge_sources.methods.pose.estimate import Array, Mask
from knowledge_sources.methods.pose.line_set import TINY, LineSet
from knowledge_sources.methods.pose.numerics import line_kernels as kernels
from knowledge_sources.methods.pose.numerics.levenberg_marquardt import cross
from knowledge_sources.methods.pose.numerics.line_kernels import FARTHEST

OVERLAP_SLACK_PX = 5.0
"""How far beside the model line's end an observed segment may lie [px]."""


def projection_planes(lines: LineSet, rotation: Array, translation: Array) -> tuple[Array, Array]:
    """Model directions and moments (..., n, 3) in the camera frame; a moment is the plane's normal.

    ``rotation`` (..., 3, 3) and ``translation`` (..., 3) of ``camera_from_world`` may carry leading batch axes.
    """
    turned = np.swapaxes(rotation, -1, -2)
    directions = lines.directions @ turned
    return directions, lines.moments @ turned + cross(translation[..., None, :], directions)


def compute_image_distances(lines: LineSet, rotation: Array, translation: Array) -> Array:
    """(..., n, 2) signed distances of the observed ends to the projected infinite model lines [px]."""
    _, planes = projection_planes(lines, rotation, translation)
    return plane_distances(lines, planes)


def plane_distances(lines: LineSet, planes: Array) -> Array:
    """(..., n, 2) signed distances [px] for the planes' normals (..., n, 3) in the camera frame."""
    reach = _reach(planes, lines.focal_px)
    along = np.matmul(lines.rays, planes[..., None])[..., 0]
    return np.asarray(along / reach[..., None])


def _reach(planes: Array, focal_px: Array) -> Array:
    """Length (...) of the image line's normal; kept off zero, where the line leaves the image plane altogether."""
    squares = planes * planes
    flat = squares[..., 0] / focal_px[0] ** 2 + squares[..., 1] / focal_px[1] ** 2
    return np.asarray(np.sqrt(flat + FARTHEST * np.sum(squares, axis=-1) + TINY**2))


def distance_slopes(lines: LineSet, planes: Array) -> tuple[Array, Array]:
    """Distances (..., n, 2) [px] and their derivatives (..., n, 2, 3) by the plane's normal."""
    inverse_focal2 = np.array([*(1.0 / lines.focal_px**2), 0.0])
    tilt = planes * inverse_focal2
    reach = _reach(planes, lines.focal_px)[..., None]
    distances = np.matmul(lines.rays, planes[..., None])[..., 0] / reach
    slopes = (lines.rays - distances[..., None] * (tilt / reach)[..., None, :]) / reach[..., None]
    return distances, slopes


def compute_image_jacobian(lines: LineSet, rotation: Array, translation: Array) -> tuple[Array, Array]:
    """Distances (..., n, 2) [px] and their derivatives (..., n, 2, 6) by the left perturbation (rotation, translation).

    A turn w moves a plane's normal m by w x m; a shift t by t x d.
    """
    directions, planes = projection_planes(lines, rotation, translation)
    distances, slopes = distance_slopes(lines, planes)
    turn = cross(planes[..., None, :], slopes)
    shift = cross(directions[..., None, :], slopes)
    return distances, np.concatenate([turn, shift], axis=-1)


def aspects(lines: LineSet, rotation: Array, translation: Array) -> tuple[Array, Mask, Mask]:
    """How the lines look from one pose.

    Returns:
        (n, 2) :func:`compute_image_distances`; (n,) which model lines pass both observed ends in front of the camera;
        (n,) which observed segments overlap their model line's extent (an infinite line does not end; a door does).
    """
    seen: tuple[Array, Mask, Mask] = kernels.aspects(
        lines.arrays, np.array(rotation), np.array(translation), OVERLAP_SLACK_PX
    )
    return seen


def find_in_front(lines: LineSet, rotation: Array, translation: Array) -> Mask:
    """(n,) which lines pass both observed ends in front of the camera."""
    return aspects(lines, rotation, translation)[1]


def find_overlapping(lines: LineSet, rotation: Array, translation: Array) -> Mask:
    """(n,) which observed segments overlap their model line's extent."""
    return aspects(lines, rotation, translation)[2]
