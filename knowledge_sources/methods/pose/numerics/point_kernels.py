"""The inner loop of a floor pose from points, compiled: Levenberg-Marquardt on Huber's loss."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numba import njit

STEP_END = 1e-10
GAIN_END = 1e-12
compiled = njit(cache=True, error_model="numpy")


@compiled
def descend(
    points: Any, observed: Any, sigma: Any, focal: Any, mount: Any, mean: Any, information: Any, near_m: float,
    start: Any, chosen: Any, huber: float, iterations: int,
) -> tuple[Any, Any, float]:
    """The state (x, y, heading) of least loss from ``start``, the Hessian (3, 3) there and the loss.

    Args:
        points: (n, 3) [m, world]. observed: (n, 2) undistorted, from the principal point. sigma: (n,) [px].
        mount: R, T of ``camera_from_robot``. mean, information: the prior. chosen: (n,) which points count.
    """
    state = start.copy()
    hessian, gradient = np.zeros((3, 3)), np.zeros(3)
    new_hessian, new_gradient, step = np.zeros((3, 3)), np.zeros(3), np.zeros(3)
    data = points, observed, sigma, focal, mount, mean, information, near_m, chosen, huber
    cost = _normal(data, state, hessian, gradient)
    damping, done = 1e-9, 0
    while done < iterations:
        _solve(hessian, gradient, damping, step)
        trial_state = state + step
        trial = _normal(data, trial_state, new_hessian, new_gradient)
        gain = cost - trial
        done += 1
        if not gain >= 0.0:
            damping = max(damping * 30.0, 1e-4)
            if damping > 1e7:
                break
            continue
        state, cost = trial_state, trial
        hessian[:], gradient[:] = new_hessian, new_gradient
        damping = max(damping * 0.1, 1e-12)
        if np.abs(step).max() < STEP_END or gain <= GAIN_END * cost:
            break
    return state, hessian, cost


@compiled
def seen(points: Any, observed: Any, sigma: Any, focal: Any, mount: Any, state: Any) -> tuple[Any, Any, Any]:
    """Depths (n,), residuals (n, 2) and derivatives (n, 2, 3), both in standard deviations."""
    n = len(points)
    depths, residuals, slopes = np.empty(n), np.empty((n, 2)), np.empty((n, 2, 3))
    c, s = math.cos(state[2]), math.sin(state[2])
    turn = mount[0]
    for i in range(n):
        x, y = points[i, 0] - state[0], points[i, 1] - state[1]
        robot = c * x + s * y, c * y - s * x, points[i, 2]
        p = np.empty(3)
        moves = np.empty((3, 3))
        for a in range(3):
            ahead, left = turn[a, 0], turn[a, 1]
            p[a] = ahead * robot[0] + left * robot[1] + turn[a, 2] * robot[2] + mount[1][a]
            moves[a, 0], moves[a, 1] = -(ahead * c - left * s), -(ahead * s + left * c)
            moves[a, 2] = ahead * robot[1] - left * robot[0]
        depths[i] = p[2]
        z = max(p[2], 1e-9)
        for a in range(2):
            image = p[a] / z
            residuals[i, a] = (image * focal[a] - observed[i, a]) / sigma[i]
            for k in range(3):
                slopes[i, a, k] = focal[a] * (moves[a, k] - image * moves[2, k]) / z / sigma[i]
    return depths, residuals, slopes


@compiled
def _normal(data: Any, state: Any, hessian: Any, gradient: Any) -> float:
    """Normal equations of Huber's loss on each point's distance, with the prior's share; returns the loss."""
    points, observed, sigma, focal, mount, mean, information, near_m, chosen, huber = data
    depths, residuals, slopes = seen(points, observed, sigma, focal, mount, state)
    away = state - mean
    away[2] = (away[2] + math.pi) % (2.0 * math.pi) - math.pi
    cost = 0.0
    for a in range(3):
        gradient[a] = 0.0
        for b in range(3):
            hessian[a, b] = information[a, b]
            gradient[a] += information[a, b] * away[b]
        cost += away[a] * gradient[a]
    for i in range(len(points)):
        if not chosen[i] or depths[i] <= near_m:
            continue
        size = math.hypot(residuals[i, 0], residuals[i, 1])
        weight = huber / max(size, huber)
        cost += size * size if size <= huber else 2.0 * huber * size - huber * huber
        for e in range(2):
            for a in range(3):
                gradient[a] += weight * slopes[i, e, a] * residuals[i, e]
                for b in range(3):
                    hessian[a, b] += weight * slopes[i, e, a] * slopes[i, e, b]
    return cost


@compiled
def _solve(hessian: Any, gradient: Any, damping: float, step: Any) -> None:
    """step = -(H + damping diag H)^-1 g, by Cholesky's factors."""
    largest = max(hessian[0, 0], hessian[1, 1], hessian[2, 2], 1e-30)
    factor = np.zeros((3, 3))
    for a in range(3):
        for b in range(a + 1):
            value = hessian[a, b]
            if a == b:
                value += damping * hessian[a, a] + 1e-12 * largest
            for k in range(b):
                value -= factor[a, k] * factor[b, k]
            factor[a, b] = math.sqrt(max(value, 1e-15 * largest)) if a == b else value / factor[b, b]
    for a in range(3):
        value = -gradient[a]
        for k in range(a):
            value -= factor[a, k] * step[k]
        step[a] = value / factor[a, a]
    for a in range(2, -1, -1):
        value = step[a]
        for k in range(a + 1, 3):
            value -= factor[k, a] * step[k]
        step[a] = value / factor[a, a]
