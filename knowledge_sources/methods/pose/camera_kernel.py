"""The inner loop of the pose with the camera's own state, compiled: distances of line ends, and their derivatives.

The model is that of :func:`world_models.camera.move_camera` and :class:`world_models.camera.CameraMount`; the laws
compare both, and the derivatives with differences.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from knowledge_sources.methods.arrays import Floats

UNKNOWNS = 10
"""x [m], y [m], heading [rad] of the robot, then :data:`world_models.camera.CAMERA_UNKNOWNS`."""
HEADING, TILT, ROLL, YAW, HEIGHT, FOCAL, CX, CY = range(2, UNKNOWNS)
MOVING = 7
"""So many of the first unknowns move the lines before the camera."""
TINY = 1e-12


@njit(cache=True, error_model="numpy")
def measure_lines(
    model: Floats, segments: Floats, lens: Floats, mount: Floats, state: Floats
) -> tuple[Floats, Floats]:  # pragma: no cover
    """Distances (n, 2) [px] of the segments' ends from the projected infinite model lines, and (n, 2, 10) derivatives.

    Those by the yaw are 0: it is not estimated.

    Args:
        model: (n, 2, 3) [m, world]. segments: (n, 2, 2) [px].
        lens: (4,) fx, fy, cx, cy. mount: (5,) height, forward [m], tilt, roll, yaw [rad]; both before the step.
        state: (10,).
    """
    distances, slopes = np.zeros((len(model), 2)), np.zeros((len(model), 2, UNKNOWNS))
    grown = 1.0 + state[FOCAL]
    fx, fy, cx, cy = lens[0] * grown, lens[1] * grown, lens[2] + state[CX], lens[3] + state[CY]
    ends, moved = np.zeros((2, 3)), np.zeros((2, MOVING, 3))
    for i in range(len(model)):
        for k in range(2):
            _place(model[i, k], mount, state, ends[k], moved[k])
        normal = _cross(ends[0], ends[1])
        a, b = normal[0] / fx, normal[1] / fy
        c = normal[2] - cx * a - cy * b
        reach = math.hypot(a, b) + TINY
        for k in range(2):
            distances[i, k] = (segments[i, k, 0] * a + segments[i, k, 1] * b + c) / reach
        for u in range(UNKNOWNS):
            if u == YAW:
                continue
            da, db, dc = 0.0, 0.0, 0.0
            if u < MOVING:
                one, other = _cross(moved[0, u], ends[1]), _cross(ends[0], moved[1, u])
                da, db = (one[0] + other[0]) / fx, (one[1] + other[1]) / fy
                dc = one[2] + other[2] - cx * da - cy * db
            elif u == FOCAL:
                da, db = -a / grown, -b / grown
                dc = -cx * da - cy * db
            else:
                dc = -a if u == CX else -b
            grows = (a * da + b * db) / reach
            for k in range(2):
                away = segments[i, k, 0] * da + segments[i, k, 1] * db + dc
                slopes[i, k, u] = (away - distances[i, k] * grows) / reach
    return distances, slopes


@njit(cache=True, error_model="numpy")
def _place(point: Floats, mount: Floats, state: Floats, there: Floats, moved: Floats) -> None:  # pragma: no cover
    """Write a world point in the camera's frame, and its derivatives (7, 3) by what moves the camera."""
    c, s = math.cos(state[HEADING]), math.sin(state[HEADING])
    dx, dy = point[0] - state[0], point[1] - state[1]
    ahead, left = c * dx + s * dy, c * dy - s * dx
    turned = mount[2] + state[TILT], mount[3] + state[ROLL], mount[4] + state[YAW]
    x, y, z = _turn(ahead - mount[1], left, point[2] - mount[0] - state[HEIGHT], turned)
    there[0], there[1], there[2] = x, y, z
    moved[0, 0], moved[0, 1], moved[0, 2] = _turn(-c, s, 0.0, turned)
    moved[1, 0], moved[1, 1], moved[1, 2] = _turn(-s, -c, 0.0, turned)
    moved[HEADING, 0], moved[HEADING, 1], moved[HEADING, 2] = _turn(left, -ahead, 0.0, turned)
    moved[HEIGHT, 0], moved[HEIGHT, 1], moved[HEIGHT, 2] = _turn(0.0, 0.0, -1.0, turned)
    cr, sr = math.cos(turned[1]), math.sin(turned[1])
    down = sr * x + cr * y  # before the roll; the tilt turns it and the depth about the camera's right side
    moved[TILT, 0], moved[TILT, 1], moved[TILT, 2] = -sr * z, -cr * z, down
    moved[ROLL, 0], moved[ROLL, 1], moved[ROLL, 2] = y, -x, 0.0


@njit(cache=True, error_model="numpy")
def _turn(
    ahead: float, left: float, up: float, turned: tuple[float, float, float]
) -> tuple[float, float, float]:  # pragma: no cover
    """A vector of the robot's frame in the camera's (right, down, forward), by tilt, roll and yaw [rad]."""
    ct, st = math.cos(turned[0]), math.sin(turned[0])
    cr, sr = math.cos(turned[1]), math.sin(turned[1])
    cy, sy = math.cos(turned[2]), math.sin(turned[2])
    front, side = cy * ahead + sy * left, cy * left - sy * ahead
    right, down = -side, -st * front - ct * up
    return cr * right + sr * down, cr * down - sr * right, ct * front - st * up


@njit(cache=True, error_model="numpy")
def _cross(a: Floats, b: Floats) -> tuple[float, float, float]:  # pragma: no cover
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]
