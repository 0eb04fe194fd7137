"""Distance in pixels of the observed segment ends to the projected infinite model line: the likelihood's residual.

In numpy, for batches, tests and experiments; the solvers use the same in `kernels`.
"""

from __future__ import annotations

import numpy as np

from knowledge_sources.methods.arrays import Floats, Mask
from knowledge_sources.methods.pose.line_set import LineSet
from knowledge_sources.methods.pose.numerics import kernels
from knowledge_sources.methods.pose.numerics.kernels import MIN_IMAGE_PART, TINY
from knowledge_sources.methods.pose.numerics.levenberg_marquardt import cross


def compute_image_distances(lines: LineSet, rotation: Floats, translation: Floats) -> Floats:
    """(..., n, 2) signed distances of the observed ends to the projected infinite model lines [px].

    ``rotation`` (..., 3, 3) and ``translation`` (..., 3) [m] of ``camera_from_world`` may have leading batch axes.
    """
    _, planes = _project_planes(lines, rotation, translation)
    along = np.matmul(lines.rays, planes[..., None])[..., 0]
    return np.asarray(along / _compute_reach(planes, lines.focal_px)[..., None])


def compute_image_jacobian(lines: LineSet, rotation: Floats, translation: Floats) -> tuple[Floats, Floats]:
    """Distances (..., n, 2) [px] and their derivatives (..., n, 2, 6) by the left perturbation (rotation, translation).

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


def find_in_front(lines: LineSet, rotation: Floats, translation: Floats) -> Mask:
    """(n,) which lines pass both observed ends in front of the camera."""
    return measure_lines(lines, rotation, translation)[1]


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
