"""The inner loops of the pose family, compiled: descents on one set of lines, and many subsets at once.

What each computes is said in plain numpy in `image_error` and `plane_error`, and the tests hold the two together.
Jitted functions of this file call only one another: numba's cache looks at a function's own file, so that after a
change in another file, into which it calls, the old result goes on being used, and nothing says so (tried with numba
0.68). Hence one long file, from above to below: the lines made ready, six unknowns, subsets, the floor's three
unknowns, normal equations, algebra.

``lines`` is :attr:`LineSet.arrays`. Rotations R (3, 3) and translations T (3,) are ``camera_from_world``; steps are
left perturbations (turn, shift) (6,).
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numba import njit

TINY = 1e-12
FARTHEST = 1e-16
"""Square of the least share of a plane's normal that counts as lying in the image."""
STEP_END = 1e-8
"""A step whose largest element (rad or m) is below this ends the descent."""
GAIN_END = 1e-12
"""A relative gain below this ends the descent."""

PLANES, IMAGE = 0, 1
"""What a descent minimises: E1 (§6.2.2), with T eliminated, or squared distances in the image over their variance."""

FINE, NOT_FINITE, NO_LENGTH = 0, 1, 2
"""What is wrong with a row of a set of lines."""

compiled = njit(cache=True, error_model="numpy")


@compiled
def prepared(
    model: Any, ends_px: Any, fx: float, fy: float, cx: float, cy: float
) -> tuple[Any, Any, Any, Any, Any, int, int]:
    """Directions, moments (n, 3), rays (n, 2, 3), normals (n, 3) and lengths [px] (n,) of a :class:`LineSet`.

    And what is wrong with which row; of a faulty set only that is meant.
    """
    n = len(model)
    directions, moments, normals = np.zeros((n, 3)), np.zeros((n, 3)), np.zeros((n, 3))
    rays, lengths = np.ones((n, 2, 3)), np.zeros(n)
    for i in range(n):
        size = math.sqrt(_squared_distance(model[i, 0], model[i, 1]))
        for e in range(2):
            rays[i, e, 0], rays[i, e, 1] = (ends_px[i, e, 0] - cx) / fx, (ends_px[i, e, 1] - cy) / fy
        u, v = ends_px[i, 1, 0] - ends_px[i, 0, 0], ends_px[i, 1, 1] - ends_px[i, 0, 1]
        lengths[i] = math.sqrt(u * u + v * v)
        if not math.isfinite(size + lengths[i]):
            return directions, moments, rays, normals, lengths, NOT_FINITE, i
        if size < 1e-9:
            return directions, moments, rays, normals, lengths, NO_LENGTH, i
        for k in range(3):
            directions[i, k] = (model[i, 1, k] - model[i, 0, k]) / size
        moments[i, 0], moments[i, 1], moments[i, 2] = _cross(model[i, 0], directions[i])
        across = _cross(rays[i, 0], rays[i, 1])
        reach = max(math.sqrt(_dot(across, across)), TINY)
        normals[i, 0], normals[i, 1], normals[i, 2] = across[0] / reach, across[1] / reach, across[2] / reach
    return directions, moments, rays, normals, lengths, FINE, -1


@compiled
def descend(
    kind: int, lines: Any, weights: Any, start: Any, prior: Any, information: Any, iterations: int
) -> tuple[Any, Any, Any, float, int]:
    """Levenberg-Marquardt from ``start`` (R, T); the cost never rises. Source: §6.2.2 (Horn's increments), damped.

    Args:
        weights: (n,) of the lines; those of weight 0 do not count.
        prior: (R, T); counts as ``information`` (6, 6) says, which may be all zero.

    Returns:
        R, T, the Gauss-Newton Hessian (6, 6) there, the cost and the steps taken.
    """
    turn, shift = start[0].copy(), start[1].copy()
    if kind == PLANES:
        _best_translation(lines, weights, turn, shift)
    hessian, gradient = np.zeros((6, 6)), np.zeros(6)
    trial_hessian, trial_gradient = np.zeros((6, 6)), np.zeros(6)
    factor, step = np.zeros((6, 6)), np.zeros(6)
    cost = _normal(kind, lines, weights, turn, shift, prior, information, hessian, gradient)
    damping, done = 1e-9, 0
    while done < iterations:
        _damped_step(hessian, gradient, damping, factor, step)
        trial_turn, trial_shift = _moved(step, turn, shift)
        if kind == PLANES:
            _best_translation(lines, weights, trial_turn, trial_shift)
        trial = _normal(
            kind, lines, weights, trial_turn, trial_shift, prior, information, trial_hessian, trial_gradient
        )
        gain = cost - trial
        if not gain >= 0.0:
            damping = max(damping * 30.0, 1e-4)
            if damping > 1e7:
                break
            done += 1
            continue
        turn, shift, cost = trial_turn, trial_shift, trial
        hessian[:], gradient[:] = trial_hessian, trial_gradient
        damping = max(damping * 0.1, 1e-12)
        done += 1
        if np.abs(step).max() < STEP_END or gain <= GAIN_END * cost:
            break
    return turn, shift, hessian, cost, done


@compiled
def compute_squared_distances(lines: Any, turns: Any, shifts: Any) -> Any:
    """(k, n) squared image distance of each line under each of k poses, in units of its variance."""
    _, directions, moments, rays, _, _, sigma, focal = lines
    out = np.empty((len(turns), len(directions)))
    for j in range(len(turns)):
        for i in range(len(directions)):
            _, plane, reach = _plane(directions[i], moments[i], focal, turns[j], shifts[j])
            first, second = _dot(rays[i, 0], plane) / reach, _dot(rays[i, 1], plane) / reach
            out[j, i] = (first * first + second * second) / (sigma[i] * sigma[i])
    return out


@compiled
def aspects(lines: Any, turn: Any, shift: Any, slack_px: float) -> tuple[Any, Any, Any]:
    """How the lines look from a pose.

    Returns:
        signed distances (n, 2) [px] of the observed ends to the projected model lines; (n,) which model lines pass
        both observed ends in front of the camera; (n,) which observed segments overlap their model line's extent.
    """
    points, directions, moments, rays, _, lengths, _, focal = lines
    n = len(points)
    distances, front, over = np.empty((n, 2)), np.empty(n, np.bool_), np.empty(n, np.bool_)
    for i in range(n):
        direction, plane, reach = _plane(directions[i], moments[i], focal, turn, shift)
        start = _apply(turn, shift, points[i, 0])
        size = math.sqrt(_squared_distance(points[i, 0], points[i, 1]))
        low, high, ahead = math.inf, -math.inf, True
        for e in range(2):
            ray = rays[i, e]
            distances[i, e] = _dot(ray, plane) / reach
            across = _cross(ray, direction)
            depth = _dot(plane, across) / max(_dot(across, across), TINY)
            ahead = ahead and depth > 0.0
            along = depth * _dot(ray, direction) - _dot(start, direction)
            low, high = min(low, along), max(high, along)
        slack = slack_px * (high - low) / max(lengths[i], 1.0)
        front[i] = ahead
        over[i] = high > -slack and low < size + slack
    return distances, front, over


@compiled
def explained(lines: Any, prior: Any, least: Any, allowed: float, slack_px: float) -> tuple[Any, ...]:
    """The likeliest pose at the foot of the prior's own basin, if it explains the lines to their noise.

    Args:
        least: (6,) information on each component of a step that the lines must have in every direction.
        allowed: the highest cost at which the lines are explained.

    Returns:
        whether they are, R, T, the covariance (6, 6), cost, steps, and :func:`aspects` there.
    """
    n = len(lines[0])
    turn, shift, hessian, cost, steps = descend(IMAGE, lines, np.ones(n), prior, prior, np.zeros((6, 6)), 30)
    distances, front, over = aspects(lines, turn, shift, slack_px)
    fine = cost <= allowed and 2 * np.sum(front) > n and _is_decided(hessian, least)
    covariance = _inverse(hessian) if fine else hessian
    return fine, _orthonormal(turn), shift, covariance, cost, steps, distances, front, over


@compiled
def explained_from(
    model: Any, ends_px: Any, intrinsics: Any, sigma: Any, prior: Any, least: Any, allowed: float, slack_px: float
) -> tuple[Any, ...]:
    """:func:`prepared` and :func:`explained` in one call; ``intrinsics`` is (fx, fy, cx, cy). Never fine if faulty."""
    fx, fy, cx, cy = intrinsics
    directions, moments, rays, normals, lengths, fault, _ = prepared(model, ends_px, fx, fy, cx, cy)
    lines = model, directions, moments, rays, normals, lengths, sigma, np.array([fx, fy])
    fine, turn, shift, covariance, cost, steps, distances, front, _ = explained(
        lines, prior, least, allowed if fault == FINE else -1.0, slack_px
    )
    return fine, turn, shift, covariance, cost, steps, distances, front


@compiled
def polished(
    lines: Any,
    start: Any,
    prior: Any,
    weak: Any,
    least: Any,
    bound: float,
    slack_px: float,
    least_lines: int,
    rounds: int,
) -> tuple[Any, Any, float]:
    """Alternates inliers and likelihood until they agree; the R, T of least truncated cost on the way, and that cost.

    ``bound`` is of a line's squared distance; the first round lets in what lies within twice as far.
    """
    best_turn, best_shift = start[0].copy(), start[1].copy()
    near = truncated(lines, best_turn, best_shift, 4.0 * bound, slack_px) < 4.0 * bound
    best = truncated(lines, best_turn, best_shift, bound, slack_px).sum()
    turn, shift = best_turn, best_shift
    for _ in range(rounds):
        if np.sum(near) < least_lines:
            break
        weights = np.where(near, 1.0, 0.0)
        turn, shift, hessian, _, _ = descend(IMAGE, lines, weights, (turn, shift), prior, np.zeros((6, 6)), 30)
        if not _is_decided(hessian, least):
            turn, shift, _, _, _ = descend(IMAGE, lines, weights, prior, prior, weak, 30)
        costs = truncated(lines, turn, shift, bound, slack_px)
        if costs.sum() < best:
            best, best_turn, best_shift = costs.sum(), turn, shift
        again = costs < bound
        if np.all(again == near):
            break
        near = again
    return best_turn, best_shift, best


@compiled
def truncated(lines: Any, turn: Any, shift: Any, bound: float, slack_px: float) -> Any:
    """(n,) squared distances over their variance, at most ``bound``.

    That is also what lines behind the camera get, and segments beside their model line's ends.
    """
    sigma = lines[6]
    distances, front, over = aspects(lines, turn, shift, slack_px)
    out = np.full(len(sigma), bound)
    for i in range(len(sigma)):
        if front[i] and over[i]:
            square = (distances[i, 0] ** 2 + distances[i, 1] ** 2) / (sigma[i] * sigma[i])
            out[i] = min(square, bound)
    return out


@compiled
def subset_poses(lines: Any, rows: Any, real: Any, turns: Any, shifts: Any, iterations: int) -> tuple[Any, Any]:
    """E1 by Gauss-Newton on k padded subsets ``rows`` (k, w) with weights ``real``, from (k, 3, 3), (k, 3).

    Hardly damped, so that no subset is singular. Source: §6.2.4, step 2.
    """
    points, _, _, _, normals, _, _, _ = lines
    found_turns, found_shifts = np.empty((len(rows), 3, 3)), np.empty((len(rows), 3))
    hessian, gradient, factor, step = np.zeros((6, 6)), np.zeros(6), np.zeros((6, 6)), np.zeros(6)
    for j in range(len(rows)):
        turn, shift = turns[j].copy(), shifts[j].copy()
        for _ in range(iterations):
            hessian[:] = 0.0
            gradient[:] = 0.0
            for w in range(rows.shape[1]):
                if real[j, w] > 0.0:
                    _add_plane(points[rows[j, w]], normals[rows[j, w]], 1.0, turn, shift, hessian, gradient)
            _mirror(hessian)
            largest = 1e-9
            for a in range(6):
                largest = max(largest, hessian[a, a])
            for a in range(6):
                hessian[a, a] += 1e-9 * largest
            _damped_step(hessian, gradient, 0.0, factor, step)
            turn, shift = _moved(step, turn, shift)
        found_turns[j], found_shifts[j] = turn, shift
    return found_turns, found_shifts


@compiled
def floor_descend(
    lines: Any, weights: Any, start: Any, mean: Any, information: Any, mount: Any, iterations: int
) -> tuple[Any, Any, float, int]:
    """Levenberg-Marquardt on the floor: squared image distances over their variance, and the prior's share.

    Args:
        start, mean: states (x, y, heading) of ``world_from_robot``; information (3, 3) is the prior's about ``mean``.
        mount: R, T of ``camera_from_robot``.

    Returns:
        the state, the Hessian (3, 3) there with the prior's share, the cost and the steps taken.
    """
    state = start.copy()
    hessian, gradient = np.zeros((3, 3)), np.zeros(3)
    trial_hessian, trial_gradient = np.zeros((3, 3)), np.zeros(3)
    factor, step = np.zeros((3, 3)), np.zeros(3)
    cost = _floor_normal(lines, weights, state, mean, information, mount, hessian, gradient)
    damping, done = 1e-9, 0
    while done < iterations:
        _damped_step(hessian, gradient, damping, factor, step)
        trial_state = state + step
        trial = _floor_normal(lines, weights, trial_state, mean, information, mount, trial_hessian, trial_gradient)
        gain = cost - trial
        done += 1
        if not gain >= 0.0:
            damping = max(damping * 30.0, 1e-4)
            if damping > 1e7:
                break
            continue
        state, cost = trial_state, trial
        hessian[:], gradient[:] = trial_hessian, trial_gradient
        damping = max(damping * 0.1, 1e-12)
        if np.abs(step).max() < STEP_END or gain <= GAIN_END * cost:
            break
    return state, hessian, cost, done


@compiled
def floor_pairs(
    lines: Any, pairs: Any, mean: Any, information: Any, mount: Any, longest: Any, iterations: int
) -> Any:
    """States (k, 3) from each pair (k, 2) of lines and the prior, by Gauss-Newton steps of at most ``longest`` (3,)."""
    out, weights = np.empty((len(pairs), 3)), np.zeros(len(lines[0]))
    for j in range(len(pairs)):
        weights[pairs[j, 0]] = weights[pairs[j, 1]] = 1.0
        state = mean.copy()
        for _ in range(iterations):
            _floor_step(lines, weights, state, mean, information, mount, longest)
        weights[pairs[j, 0]] = weights[pairs[j, 1]] = 0.0
        out[j] = state
    return out


@compiled
def floor_polished(
    lines: Any, states: Any, mean: Any, information: Any, mount: Any, longest: Any, bound: float, widening: Any
) -> Any:
    """States (k, 3) moved by Gauss-Newton on each one's own inliers; ``widening`` (r,) of the bound, round by round."""
    out = states.copy()
    for j in range(len(out)):
        for wider in widening:
            near = floor_squares(lines, out[j], mount) <= wider * bound
            _floor_step(lines, np.where(near, 1.0, 0.0), out[j], mean, information, mount, longest)
    return out


@compiled
def floor_costs(lines: Any, states: Any, mean: Any, information: Any, mount: Any, bound: float) -> Any:
    """(k,) squared distances of all lines over their variance, each at most ``bound``, and the prior's share."""
    out = np.empty(len(states))
    for j in range(len(states)):
        away = _away(states[j], mean)
        cost = 0.0
        for a in range(3):
            for b in range(3):
                cost += away[a] * information[a, b] * away[b]
        for square in floor_squares(lines, states[j], mount):
            cost += min(square, bound)
        out[j] = cost
    return out


@compiled
def floor_squares(lines: Any, state: Any, mount: Any) -> Any:
    """(n,) squared image distances over their variance."""
    _, directions, moments, rays, _, _, sigma, focal = lines
    turn, shift = _camera_state(state, mount)
    out = np.empty(len(directions))
    for i in range(len(directions)):
        _, plane, reach = _plane(directions[i], moments[i], focal, turn, shift)
        first, second = _dot(rays[i, 0], plane) / reach, _dot(rays[i, 1], plane) / reach
        out[i] = (first * first + second * second) / (sigma[i] * sigma[i])
    return out


@compiled
def _floor_step(
    lines: Any, weights: Any, state: Any, mean: Any, information: Any, mount: Any, longest: Any
) -> None:
    """One Gauss-Newton step, cut to ``longest``, of ``state`` itself."""
    hessian, gradient, factor, step = np.zeros((3, 3)), np.zeros(3), np.zeros((3, 3)), np.zeros(3)
    _floor_normal(lines, weights, state, mean, information, mount, hessian, gradient)
    _damped_step(hessian, gradient, 0.0, factor, step)
    for a in range(3):
        state[a] += min(max(step[a], -longest[a]), longest[a])


@compiled
def _floor_normal(
    lines: Any, weights: Any, state: Any, mean: Any, information: Any, mount: Any, hessian: Any, gradient: Any
) -> float:
    """As :func:`_normal` in (x, y, heading): of six directions the robot can move in three.

    A step in x or y shifts the camera by the world's axis; a turn goes about the robot's axis, -R z in the camera.
    """
    turn, shift = _camera_state(state, mount)
    full, slope = np.zeros((6, 6)), np.zeros(6)
    nothing = np.zeros((6, 6))
    cost = _normal(IMAGE, lines, weights, turn, shift, (turn, shift), nothing, full, slope)
    moves = np.zeros((6, 3))
    axis = -mount[0][0, 2], -mount[0][1, 2], -mount[0][2, 2]
    about = _cross(mount[1], axis)
    for a in range(3):
        moves[3 + a, 0], moves[3 + a, 1] = -turn[a, 0], -turn[a, 1]
        moves[a, 2], moves[3 + a, 2] = axis[a], about[a]
    away = _away(state, mean)
    for a in range(3):
        pull = 0.0
        for b in range(3):
            pull += information[a, b] * away[b]
        gradient[a] = pull
        cost += away[a] * pull
        for k in range(6):
            gradient[a] += moves[k, a] * slope[k]
        for b in range(3):
            value = information[a, b]
            for k in range(6):
                for m in range(6):
                    value += moves[k, a] * full[k, m] * moves[m, b]
            hessian[a, b] = value
    return cost


@compiled
def _away(state: Any, mean: Any) -> tuple[float, float, float]:
    """From the prior's mean, the heading by the shorter way round."""
    turn = (state[2] - mean[2] + math.pi) % (2.0 * math.pi) - math.pi
    return state[0] - mean[0], state[1] - mean[1], turn


@compiled
def _camera_state(state: Any, mount: Any) -> tuple[Any, Any]:
    """R and T of ``camera_from_world`` for a robot at (x, y, heading)."""
    c, s = math.cos(state[2]), math.sin(state[2])
    turn, shift = np.empty((3, 3)), np.empty(3)
    for a in range(3):
        ahead, left = mount[0][a, 0], mount[0][a, 1]
        turn[a, 0], turn[a, 1], turn[a, 2] = ahead * c - left * s, ahead * s + left * c, mount[0][a, 2]
        shift[a] = mount[1][a] - turn[a, 0] * state[0] - turn[a, 1] * state[1]
    return turn, shift


@compiled
def _normal(
    kind: int,
    lines: Any,
    weights: Any,
    turn: Any,
    shift: Any,
    prior: Any,
    information: Any,
    hessian: Any,
    gradient: Any,
) -> float:
    """Fills J'J and J'r at a pose; returns the cost."""
    points, directions, moments, rays, normals, _, sigma, focal = lines
    hessian[:] = 0.0
    gradient[:] = 0.0
    cost = 0.0
    for i in range(len(points)):
        if weights[i] == 0.0:
            continue
        if kind == PLANES:
            cost += _add_plane(points[i], normals[i], weights[i], turn, shift, hessian, gradient)
        else:
            weight = weights[i] / (sigma[i] * sigma[i])
            cost += _add_image(directions[i], moments[i], rays[i], focal, weight, turn, shift, hessian, gradient)
    _mirror(hessian)
    if information[0, 0] > 0.0:
        cost += _add_prior(prior, information, turn, shift, hessian, gradient)
    return cost


@compiled
def _add_plane(
    ends: Any, normal: Any, weight: float, turn: Any, shift: Any, hessian: Any, gradient: Any
) -> float:
    """A line's two terms n . (R p + T) of E1; derivatives (q x n, n)."""
    cost = 0.0
    for e in range(2):
        q = _apply(turn, shift, ends[e])
        cost += _add_row(_dot(q, normal), _cross(q, normal), normal, weight, hessian, gradient)
    return cost


@compiled
def _add_image(
    model: Any, moment: Any, rays: Any, focal: Any, weight: float, turn: Any, shift: Any, hessian: Any, gradient: Any
) -> float:
    """A segment's two ends: distance to the projected model line, derivatives (m x s, d x s), s by the plane."""
    direction, plane, reach = _plane(model, moment, focal, turn, shift)
    u, v = plane[0] / (focal[0] * focal[0]) / reach, plane[1] / (focal[1] * focal[1]) / reach
    cost = 0.0
    for e in range(2):
        distance = _dot(rays[e], plane) / reach
        slope = (rays[e, 0] - distance * u) / reach, (rays[e, 1] - distance * v) / reach, rays[e, 2] / reach
        cost += _add_row(distance, _cross(plane, slope), _cross(direction, slope), weight, hessian, gradient)
    return cost


@compiled
def _add_row(residual: float, by_turn: Any, by_shift: Any, weight: float, hessian: Any, gradient: Any) -> float:
    """One residual into the upper half of J'J and into J'r; returns its share of the cost."""
    row = by_turn[0], by_turn[1], by_turn[2], by_shift[0], by_shift[1], by_shift[2]
    for a in range(6):
        weighted = weight * row[a]
        gradient[a] += weighted * residual
        for b in range(a, 6):
            hessian[a, b] += weighted * row[b]
    return weight * residual * residual


@compiled
def _mirror(hessian: Any) -> None:
    for a in range(6):
        for b in range(a):
            hessian[a, b] = hessian[b, a]


@compiled
def _add_prior(prior: Any, information: Any, turn: Any, shift: Any, hessian: Any, gradient: Any) -> float:
    """The prior as one more measurement of the left perturbation from it."""
    apart, away = np.empty((3, 3)), np.empty(6)
    for a in range(3):
        for b in range(3):
            apart[a, b] = _dot(turn[a], prior[0][b])
    away[0], away[1], away[2] = _rotation_vector(apart)
    carried = _turned(apart, prior[1])
    for a in range(3):
        away[3 + a] = shift[a] - carried[a]
    cost = 0.0
    for a in range(6):
        pull = 0.0
        for b in range(6):
            hessian[a, b] += information[a, b]
            pull += information[a, b] * away[b]
        gradient[a] += pull
        cost += away[a] * pull
    return cost


@compiled
def _rotation_vector(turn: Any) -> tuple[float, float, float]:
    """Axis times angle of a rotation by less than half a turn."""
    x, y, z = turn[2, 1] - turn[1, 2], turn[0, 2] - turn[2, 0], turn[1, 0] - turn[0, 1]
    sine = 0.5 * math.sqrt(x * x + y * y + z * z)
    angle = math.atan2(sine, 0.5 * (turn[0, 0] + turn[1, 1] + turn[2, 2] - 1.0))
    scale = 0.5 if sine < 1e-9 else 0.5 * angle / sine
    return scale * x, scale * y, scale * z


@compiled
def _best_translation(lines: Any, weights: Any, turn: Any, shift: Any) -> None:
    """Moves T to where E1 is least for this R; what the lines do not say stays."""
    points, _, _, _, normals, _, _, _ = lines
    xx = xy = xz = yy = yz = zz = bx = by = bz = 0.0
    for i in range(len(points)):
        if weights[i] == 0.0:
            continue
        n = normals[i]
        miss = _dot(_apply(turn, shift, points[i, 0]), n) + _dot(_apply(turn, shift, points[i, 1]), n)
        x, y, z = weights[i] * n[0], weights[i] * n[1], weights[i] * n[2]
        bx, by, bz = bx + x * miss, by + y * miss, bz + z * miss
        xx, xy, xz = xx + 2.0 * x * n[0], xy + 2.0 * x * n[1], xz + 2.0 * x * n[2]
        yy, yz, zz = yy + 2.0 * y * n[1], yz + 2.0 * y * n[2], zz + 2.0 * z * n[2]
    size = xx + yy + zz
    minors = yy * zz - yz * yz, xz * yz - xy * zz, xy * yz - xz * yy
    determinant = xx * minors[0] + xy * minors[1] + xz * minors[2]
    if determinant > 1e-6 * size * size * size:
        shift[0] -= (minors[0] * bx + minors[1] * by + minors[2] * bz) / determinant
        shift[1] -= (minors[1] * bx + (xx * zz - xz * xz) * by + (xy * xz - xx * yz) * bz) / determinant
        shift[2] -= (minors[2] * bx + (xy * xz - xx * yz) * by + (xx * yy - xy * xy) * bz) / determinant
        return
    square = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    values, vectors = np.linalg.eigh(square)
    floor = 1e-10 * max(values[2], TINY)
    for k in range(3):
        if values[k] > floor:
            share = (vectors[0, k] * bx + vectors[1, k] * by + vectors[2, k] * bz) / values[k]
            for a in range(3):
                shift[a] -= vectors[a, k] * share


@compiled
def _damped_step(hessian: Any, gradient: Any, damping: float, factor: Any, step: Any) -> None:
    """step = -(H + damping diag H)^-1 g, by Cholesky's factors; what has no information hardly moves."""
    largest = 0.0
    for a in range(len(gradient)):
        largest = max(largest, hessian[a, a])
    floor = 1e-12 * max(largest, 1e-30)
    for a in range(len(gradient)):
        for b in range(a + 1):
            value = hessian[a, b]
            if a == b:
                value += damping * hessian[a, a] + floor
            for k in range(b):
                value -= factor[a, k] * factor[b, k]
            factor[a, b] = math.sqrt(max(value, floor * 1e-3)) if a == b else value / factor[b, b]
    for a in range(len(gradient)):
        value = -gradient[a]
        for k in range(a):
            value -= factor[a, k] * step[k]
        step[a] = value / factor[a, a]
    for a in range(len(gradient) - 1, -1, -1):
        value = step[a]
        for k in range(a + 1, len(gradient)):
            value -= factor[k, a] * step[k]
        step[a] = value / factor[a, a]


@compiled
def _factored(matrix: Any, factor: Any) -> bool:
    """Cholesky's lower factor of a (6, 6) matrix; False where it is not positive definite."""
    for a in range(6):
        for b in range(a + 1):
            value = matrix[a, b]
            for k in range(b):
                value -= factor[a, k] * factor[b, k]
            if a == b:
                if not value > 0.0:
                    return False
                factor[a, b] = math.sqrt(value)
            else:
                factor[a, b] = value / factor[b, b]
    return True


@compiled
def _is_decided(hessian: Any, least: Any) -> bool:
    """Whether there is more information than ``least`` (6,) in every direction."""
    scaled, factor = np.empty((6, 6)), np.zeros((6, 6))
    for a in range(6):
        for b in range(6):
            scaled[a, b] = hessian[a, b] / math.sqrt(least[a] * least[b])
        scaled[a, a] -= 1.0
    return _factored(scaled, factor)


@compiled
def _inverse(matrix: Any) -> Any:
    """Of a positive definite (6, 6) matrix."""
    factor, inverse, out = np.zeros((6, 6)), np.zeros((6, 6)), np.zeros((6, 6))
    _factored(matrix, factor)
    for c in range(6):
        for a in range(c, 6):
            value = 1.0 if a == c else 0.0
            for k in range(c, a):
                value -= factor[a, k] * inverse[k, c]
            inverse[a, c] = value / factor[a, a]
    for a in range(6):
        for b in range(a + 1):
            value = 0.0
            for k in range(a, 6):
                value += inverse[k, a] * inverse[k, b]
            out[a, b] = out[b, a] = value
    return out


@compiled
def _orthonormal(turn: Any) -> Any:
    """The rotation nearest to one that has drifted by rounding: a Newton step, R (3 - R'R) / 2."""
    out = np.empty((3, 3))
    for a in range(3):
        for b in range(3):
            value = 1.5 * turn[a, b]
            for k in range(3):
                gram = turn[0, k] * turn[0, b] + turn[1, k] * turn[1, b] + turn[2, k] * turn[2, b]
                value -= 0.5 * turn[a, k] * gram
            out[a, b] = value
    return out


@compiled
def _moved(step: Any, turn: Any, shift: Any) -> tuple[Any, Any]:
    """The left perturbation of a pose, by Rodrigues' formula."""
    x, y, z = step[0], step[1], step[2]
    angle = math.sqrt(x * x + y * y + z * z)
    first = 1.0 if angle < 1e-6 else math.sin(angle) / angle
    half = 0.5 if angle < 1e-6 else (1.0 - math.cos(angle)) / (angle * angle)
    by = np.empty((3, 3))
    by[0, 0], by[0, 1], by[0, 2] = 1.0 - half * (y * y + z * z), half * x * y - first * z, half * x * z + first * y
    by[1, 0], by[1, 1], by[1, 2] = half * x * y + first * z, 1.0 - half * (x * x + z * z), half * y * z - first * x
    by[2, 0], by[2, 1], by[2, 2] = half * x * z - first * y, half * y * z + first * x, 1.0 - half * (x * x + y * y)
    turned, moved = np.empty((3, 3)), np.empty(3)
    for a in range(3):
        for b in range(3):
            turned[a, b] = by[a, 0] * turn[0, b] + by[a, 1] * turn[1, b] + by[a, 2] * turn[2, b]
        moved[a] = by[a, 0] * shift[0] + by[a, 1] * shift[1] + by[a, 2] * shift[2] + step[3 + a]
    return turned, moved


@compiled
def _plane(model: Any, moment: Any, focal: Any, turn: Any, shift: Any) -> tuple[Any, Any, float]:
    """Direction and moment of a model line in the camera frame, and the length of its image's normal."""
    direction, moved = _turned(turn, model), _turned(turn, moment)
    across = _cross(shift, direction)
    plane = moved[0] + across[0], moved[1] + across[1], moved[2] + across[2]
    u, v = plane[0] / focal[0], plane[1] / focal[1]
    return direction, plane, math.sqrt(u * u + v * v + FARTHEST * _dot(plane, plane) + TINY * TINY)


@compiled
def _apply(turn: Any, shift: Any, point: Any) -> tuple[float, float, float]:
    x, y, z = _turned(turn, point)
    return x + shift[0], y + shift[1], z + shift[2]


@compiled
def _turned(turn: Any, vector: Any) -> tuple[float, float, float]:
    x, y, z = vector[0], vector[1], vector[2]
    return (
        turn[0, 0] * x + turn[0, 1] * y + turn[0, 2] * z,
        turn[1, 0] * x + turn[1, 1] * y + turn[1, 2] * z,
        turn[2, 0] * x + turn[2, 1] * y + turn[2, 2] * z,
    )


@compiled
def _cross(a: Any, b: Any) -> tuple[float, float, float]:
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


@compiled
def _dot(a: Any, b: Any) -> Any:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@compiled
def _squared_distance(a: Any, b: Any) -> Any:
    return (a[0] - b[0]) ** 2 + (a[1] - b[1]) ** 2 + (a[2] - b[2]) ** 2
