"""The inner loops of the pose solvers, compiled by numba.

The tests compare the residuals and derivatives with plain numpy and with finite differences. The file is long because
compiled functions must only call functions of their own file: numba's cache checks a function's own file, so that after
a change in another one the old machine code would be used without a warning (numba 0.68). In this order: line
preparation, minimisation, six unknowns, subsets, three unknowns on the floor from lines and from points, normal
equations, linear algebra.

``lines`` is :attr:`LineSet.arrays`. Rotations R (3, 3) and translations T (3,) [m] are ``camera_from_world``; a step is
a left perturbation (rotation [rad], translation [m]) (6,). A state on the floor is (x [m], y [m], heading [rad]) of
``world_from_robot``.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
from numba import njit

from knowledge_sources.methods.arrays import Floats, Indices, Mask
from world_models.compiled import compiled

RigidMotion = tuple[Floats, Floats]
"""R, T."""
LineArrays = tuple[Floats, Floats, Floats, Floats, Floats, Floats, Floats, Floats]
"""Points (n, 2, 3), directions, moments (n, 3), rays (n, 2, 3), normals (n, 3), lengths, sigmas (n,), focal (2,)."""
PoseProblem = tuple[int, LineArrays, Floats, RigidMotion, Floats]
"""What is minimised, lines, their weights (n,), the prior and its information (6, 6)."""
FloorArrays = tuple[LineArrays, Floats, Floats, RigidMotion]
"""Lines, the prior's mean (3,) and information (3, 3), the mount ``camera_from_robot``."""
PointArrays = tuple[Floats, Floats, Floats, Floats, Floats, Floats, RigidMotion]
"""Points (n, 3), observed (n, 2), sigmas (n,), focal (2,), the prior's mean and information, the mount."""
Vector = Floats | tuple[float, float, float]

TINY = 1e-12
"""Keeps denominators from zero."""
MIN_IMAGE_PART = 1e-16
"""Squared part of a projection plane's normal that counts as lying in the image; keeps a denominator from zero."""
MIN_STEP, MIN_POINT_STEP = 1e-8, 1e-10
"""A step whose largest element (rad or m) is below this ends a minimisation: rounding, no setting."""
MIN_RELATIVE_GAIN = 1e-12
"""A relative gain below this ends a minimisation: rounding, no setting."""

PLANES, IMAGE = 0, 1
"""What is minimised: E1 (§6.2.2), with T eliminated; or squared distances in the image over their variance."""

FINE, NOT_FINITE, NO_LENGTH = 0, 1, 2
"""What is wrong with a row of a set of lines."""


@compiled
def prepare_lines(
    model: Floats, ends_px: Floats, fx: float, fy: float, cx: float, cy: float
) -> tuple[Floats, Floats, Floats, Floats, Floats, int, int]:
    """Directions, moments (n, 3), rays (n, 2, 3), normals (n, 3) and lengths [px] (n,) of a :class:`LineSet`.

    Also FINE, or what is wrong and in which row; the arrays of a faulty set are incomplete.
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


def _build_minimiser(
    linearise: Callable[..., float], move: Callable[..., Any], unknowns: int, min_step: float
) -> Any:
    """Levenberg-Marquardt on one kind of problem; the cost never rises. Source: §6.2.2 (Horn's increments), damped.

    Args:
        linearise: (problem, state, hessian, gradient), fills the normal equations (J'J, J'r) and returns the cost.
        move: (problem, state, step), the state a step (unknowns,) further.

    Returns:
        (problem, state, iterations), which returns the state, its Gauss-Newton Hessian, its cost and the steps taken.
        It is compiled with its caller, and cached there.
    """

    @njit(error_model="numpy")
    def minimise(problem: Any, state: Any, iterations: int) -> tuple[Any, Floats, float, int]:
        hessian, gradient = np.zeros((unknowns, unknowns)), np.zeros(unknowns)
        trial_hessian, trial_gradient = np.zeros((unknowns, unknowns)), np.zeros(unknowns)
        factor, step = np.zeros((unknowns, unknowns)), np.zeros(unknowns)
        cost = linearise(problem, state, hessian, gradient)
        damping, done = 1e-9, 0
        while done < iterations:
            _solve_damped(hessian, gradient, damping, factor, step)
            trial_state = move(problem, state, step)
            trial = linearise(problem, trial_state, trial_hessian, trial_gradient)
            gain = cost - trial
            if not gain >= 0.0:
                damping = max(damping * 30.0, 1e-4)
                if damping > 1e7:
                    break
                done += 1
                continue
            state, cost = trial_state, trial
            hessian[:], gradient[:] = trial_hessian, trial_gradient
            damping = max(damping * 0.1, 1e-12)
            done += 1
            if np.abs(step).max() < min_step or gain <= MIN_RELATIVE_GAIN * cost:
                break
        return state, hessian, cost, done

    return minimise


@compiled
def minimise_pose(
    kind: int, lines: LineArrays, weights: Floats, start: RigidMotion, prior: RigidMotion, information: Floats,
    iterations: int,
) -> tuple[Floats, Floats, Floats, float, int]:
    """The pose (six unknowns) of least cost, by Levenberg-Marquardt from ``start``.

    Args:
        kind: PLANES or IMAGE.
        weights: (n,) of the lines; a line of weight 0 does not count.
        prior: counts as one more measurement with ``information`` (6, 6); all zero: no prior.

    Returns:
        R, T, the Gauss-Newton Hessian (6, 6) there, the cost and the steps taken.
    """
    rotation, translation = start[0].copy(), start[1].copy()
    if kind == PLANES:
        _minimise_translation(lines, weights, rotation, translation)
    problem = kind, lines, weights, prior, information
    state, hessian, cost, done = _minimise_pose(problem, (rotation, translation), iterations)
    return state[0], state[1], hessian, cost, done


@compiled
def _move_pose(problem: PoseProblem, state: RigidMotion, step: Floats) -> RigidMotion:
    """E1 is quadratic in T: after each step T is eliminated exactly."""
    rotation, translation = _perturb(step, state[0], state[1])
    if problem[0] == PLANES:
        _minimise_translation(problem[1], problem[2], rotation, translation)
    return rotation, translation


@compiled
def compute_squared_distances(lines: LineArrays, rotations: Floats, translations: Floats) -> Floats:
    """(k, n) squared image distance of each line under each of k poses, over its variance."""
    _, directions, moments, rays, _, _, sigma, focal = lines
    out = np.empty((len(rotations), len(directions)))
    for j in range(len(rotations)):
        for i in range(len(directions)):
            _, plane, reach = _project_line(directions[i], moments[i], focal, rotations[j], translations[j])
            first, second = _dot(rays[i, 0], plane) / reach, _dot(rays[i, 1], plane) / reach
            out[j, i] = (first * first + second * second) / (sigma[i] * sigma[i])
    return out


@compiled
def measure_lines(
    lines: LineArrays, rotation: Floats, translation: Floats, max_beside_px: float
) -> tuple[Floats, Mask, Mask]:
    """Residuals of the lines at a pose, and two checks that an infinite line does not make.

    Returns:
        signed distances (n, 2) [px] of the observed ends to the projected model lines; (n,) which model lines pass
        both observed ends in front of the camera; (n,) which observed segments overlap their model line's extent, or
        lie beside it by at most ``max_beside_px``.
    """
    points, directions, moments, rays, _, lengths, _, focal = lines
    n = len(points)
    distances, front, over = np.empty((n, 2)), np.empty(n, np.bool_), np.empty(n, np.bool_)
    for i in range(n):
        direction, plane, reach = _project_line(directions[i], moments[i], focal, rotation, translation)
        start = _transform(rotation, translation, points[i, 0])
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
        slack = max_beside_px * (high - low) / max(lengths[i], 1.0)
        front[i] = ahead
        over[i] = high > -slack and low < size + slack
    return distances, front, over


@compiled
def solve_subsets(
    lines: LineArrays, rows: Indices, real: Floats, rotations: Floats, translations: Floats, iterations: int
) -> RigidMotion:
    """Poses (k, 3, 3), (k, 3) of least E1 on k subsets, by Gauss-Newton. Source: §6.2.4, step 2.

    Hardly damped, so that no subset is singular.

    Args:
        rows: (k, w) lines of each subset, padded. real: (k, w), 0 on the padding.
        rotations, translations: (k, 3, 3), (k, 3) starts.
    """
    points, _, _, _, normals, _, _, _ = lines
    found_rotations, found_translations = np.empty((len(rows), 3, 3)), np.empty((len(rows), 3))
    hessian, gradient, factor, step = np.zeros((6, 6)), np.zeros(6), np.zeros((6, 6)), np.zeros(6)
    for j in range(len(rows)):
        rotation, translation = rotations[j].copy(), translations[j].copy()
        for _ in range(iterations):
            hessian[:] = 0.0
            gradient[:] = 0.0
            for w in range(rows.shape[1]):
                if real[j, w] > 0.0:
                    i = rows[j, w]
                    _add_plane_terms(points[i], normals[i], 1.0, rotation, translation, hessian, gradient)
            _mirror_upper(hessian)
            largest = 1e-9
            for a in range(6):
                largest = max(largest, hessian[a, a])
            for a in range(6):
                hessian[a, a] += 1e-9 * largest
            _solve_damped(hessian, gradient, 0.0, factor, step)
            rotation, translation = _perturb(step, rotation, translation)
        found_rotations[j], found_translations[j] = rotation, translation
    return found_rotations, found_translations


@compiled
def minimise_floor_pose(
    floor: FloorArrays, weights: Floats, start: Floats, iterations: int
) -> tuple[Floats, Floats, float, int]:
    """The state of least squared image distances over their variance, with the prior's share.

    ``weights`` (n,) are those of the lines, ``start`` is a state (3,).

    Returns:
        the state, the Hessian (3, 3) there with the prior's share, the cost and the steps taken.
    """
    end: tuple[Floats, Floats, float, int] = _minimise_lines_on_floor((floor, weights), start.copy(), iterations)
    return end


@compiled
def solve_floor_pairs(floor: FloorArrays, pairs: Indices, max_step: Floats, iterations: int) -> Floats:
    """States (k, 3) from each pair (k, 2) of lines and the prior, by Gauss-Newton steps up to ``max_step`` (3,)."""
    lines, mean, _, _ = floor
    out, weights = np.empty((len(pairs), 3)), np.zeros(len(lines[0]))
    for j in range(len(pairs)):
        weights[pairs[j, 0]] = weights[pairs[j, 1]] = 1.0
        state = mean.copy()
        for _ in range(iterations):
            _step_on_floor(floor, weights, state, max_step)
        weights[pairs[j, 0]] = weights[pairs[j, 1]] = 0.0
        out[j] = state
    return out


@compiled
def refine_floor_states(
    floor: FloorArrays, states: Floats, max_step: Floats, bound: float, widenings: Floats
) -> Floats:
    """States (k, 3) moved by one Gauss-Newton step a round on each one's own inliers.

    ``widenings`` (r,) multiply the squared ``bound`` on inliers, round by round.
    """
    out = states.copy()
    for j in range(len(out)):
        for wider in widenings:
            near = compute_floor_squares(floor, out[j]) <= wider * bound
            _step_on_floor(floor, np.where(near, 1.0, 0.0), out[j], max_step)
    return out


@compiled
def compute_floor_costs(floor: FloorArrays, states: Floats, bound: float) -> Floats:
    """(k,) truncated loss: squared distances over their variance, each at most ``bound``, and the prior's share."""
    _, mean, information, _ = floor
    out = np.empty(len(states))
    for j in range(len(states)):
        apart = _subtract_prior(states[j], mean)
        cost = 0.0
        for a in range(3):
            for b in range(3):
                cost += apart[a] * information[a, b] * apart[b]
        for square in compute_floor_squares(floor, states[j]):
            cost += min(square, bound)
        out[j] = cost
    return out


@compiled
def compute_floor_squares(floor: FloorArrays, state: Floats) -> Floats:
    """(n,) squared image distances over their variance."""
    rotation, translation = _compute_camera_pose(state, floor[3])
    many = compute_squared_distances(floor[0], rotation.reshape(1, 3, 3), translation.reshape(1, 3))
    squares: Floats = many[0]
    return squares


@compiled
def _step_on_floor(floor: FloorArrays, weights: Floats, state: Floats, max_step: Floats) -> None:
    """Move ``state`` itself by one Gauss-Newton step, each element limited to ``max_step``."""
    hessian, gradient, factor, step = np.zeros((3, 3)), np.zeros(3), np.zeros((3, 3)), np.zeros(3)
    _linearise_floor((floor, weights), state, hessian, gradient)
    _solve_damped(hessian, gradient, 0.0, factor, step)
    for a in range(3):
        state[a] += min(max(step[a], -max_step[a]), max_step[a])


@compiled
def _move_on_floor(problem: Any, state: Floats, step: Floats) -> Floats:
    return state + step


@compiled
def _linearise_floor(
    problem: tuple[FloorArrays, Floats], state: Floats, hessian: Floats, gradient: Floats
) -> float:
    """Normal equations in (x, y, heading): the robot can move in three of the camera's six directions.

    A step in x or y shifts the camera along the world's axis; a turn is about the robot's axis, -R z in the camera.
    """
    (lines, mean, information, mount), weights = problem
    camera = _compute_camera_pose(state, mount)
    rotation = camera[0]
    full, slope, nothing = np.zeros((6, 6)), np.zeros(6), np.zeros((6, 6))
    cost = _linearise_pose((IMAGE, lines, weights, camera, nothing), camera, full, slope)
    moves = np.zeros((6, 3))
    axis = -mount[0][0, 2], -mount[0][1, 2], -mount[0][2, 2]
    about = _cross(mount[1], axis)
    for a in range(3):
        moves[3 + a, 0], moves[3 + a, 1] = -rotation[a, 0], -rotation[a, 1]
        moves[a, 2], moves[3 + a, 2] = axis[a], about[a]
    apart = _subtract_prior(state, mean)
    for a in range(3):
        pull = 0.0
        for b in range(3):
            pull += information[a, b] * apart[b]
        gradient[a] = pull
        cost += apart[a] * pull
        for k in range(6):
            gradient[a] += moves[k, a] * slope[k]
        for b in range(3):
            value = information[a, b]
            for k in range(6):
                for m in range(6):
                    value += moves[k, a] * full[k, m] * moves[m, b]
            hessian[a, b] = value
    return cost


_minimise_lines_on_floor = _build_minimiser(_linearise_floor, _move_on_floor, 3, MIN_STEP)


@compiled
def _subtract_prior(state: Floats, mean: Floats) -> tuple[float, float, float]:
    """State minus the prior's mean, the heading by the shorter way round."""
    turn = (state[2] - mean[2] + math.pi) % (2.0 * math.pi) - math.pi
    return state[0] - mean[0], state[1] - mean[1], turn


@compiled
def _compute_camera_pose(state: Floats, mount: RigidMotion) -> RigidMotion:
    """``camera_from_world`` of a robot at (x, y, heading)."""
    c, s = math.cos(state[2]), math.sin(state[2])
    rotation, translation = np.empty((3, 3)), np.empty(3)
    for a in range(3):
        ahead, left = mount[0][a, 0], mount[0][a, 1]
        rotation[a, 0], rotation[a, 1], rotation[a, 2] = ahead * c - left * s, ahead * s + left * c, mount[0][a, 2]
        translation[a] = mount[1][a] - rotation[a, 0] * state[0] - rotation[a, 1] * state[1]
    return rotation, translation


@compiled
def minimise_points(
    points: PointArrays, start: Floats, chosen: Mask, huber: float, near_m: float, iterations: int
) -> tuple[Floats, Floats, float, int]:
    """The state of least Huber loss over tracked points, with the prior's share.

    Args:
        points: observed ones are relative to the principal point, without distortion. start: a state (3,).
        chosen: (n,) which points count; those nearer than ``near_m`` in depth do not.
        huber: deviation beyond which a point pulls with a constant force.

    Returns:
        the state, the Hessian (3, 3) there, the loss and the steps taken.
    """
    problem = points, chosen, huber, near_m
    end: tuple[Floats, Floats, float, int] = _minimise_points(problem, start.copy(), iterations)
    return end


@compiled
def project_points(points: PointArrays, state: Floats) -> tuple[Floats, Floats, Floats]:
    """Depths (n,) [m], residuals (n, 2) and derivatives (n, 2, 3) by the state, both in standard deviations."""
    world, observed, sigma, focal, _, _, mount = points
    n = len(world)
    depths, residuals, slopes = np.empty(n), np.empty((n, 2)), np.empty((n, 2, 3))
    c, s = math.cos(state[2]), math.sin(state[2])
    rotation = mount[0]
    for i in range(n):
        x, y = world[i, 0] - state[0], world[i, 1] - state[1]
        robot = c * x + s * y, c * y - s * x, world[i, 2]
        p = np.empty(3)
        moves = np.empty((3, 3))
        for a in range(3):
            ahead, left = rotation[a, 0], rotation[a, 1]
            p[a] = ahead * robot[0] + left * robot[1] + rotation[a, 2] * robot[2] + mount[1][a]
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
def _linearise_points(problem: Any, state: Floats, hessian: Floats, gradient: Floats) -> float:
    """Normal equations of Huber's loss on each point's distance (iteratively reweighted), with the prior's share."""
    points, chosen, huber, near_m = problem
    _, _, _, _, mean, information, _ = points
    depths, residuals, slopes = project_points(points, state)
    apart = _subtract_prior(state, mean)
    cost = 0.0
    for a in range(3):
        gradient[a] = 0.0
        for b in range(3):
            hessian[a, b] = information[a, b]
            gradient[a] += information[a, b] * apart[b]
        cost += apart[a] * gradient[a]
    for i in range(len(depths)):
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


_minimise_points = _build_minimiser(_linearise_points, _move_on_floor, 3, MIN_POINT_STEP)


@compiled
def _linearise_pose(problem: PoseProblem, pose: RigidMotion, hessian: Floats, gradient: Floats) -> float:
    """Fill J'J (6, 6) and J'r (6,) at a pose; return the cost."""
    kind, lines, weights, prior, information = problem
    rotation, translation = pose
    points, directions, moments, rays, normals, _, sigma, focal = lines
    hessian[:] = 0.0
    gradient[:] = 0.0
    cost = 0.0
    for i in range(len(points)):
        if weights[i] == 0.0:
            continue
        if kind == PLANES:
            cost += _add_plane_terms(points[i], normals[i], weights[i], rotation, translation, hessian, gradient)
        else:
            weight = weights[i] / (sigma[i] * sigma[i])
            cost += _add_image_terms(
                directions[i], moments[i], rays[i], focal, weight, rotation, translation, hessian, gradient
            )
    _mirror_upper(hessian)
    if information[0, 0] > 0.0:
        cost += _add_prior(prior, information, rotation, translation, hessian, gradient)
    return cost


_minimise_pose = _build_minimiser(_linearise_pose, _move_pose, 6, MIN_STEP)


@compiled
def _add_plane_terms(
    ends: Floats, normal: Floats, weight: float, rotation: Floats, translation: Floats, hessian: Floats,
    gradient: Floats,
) -> float:
    """A line's two terms n . q of E1, q = R p + T, with derivatives (q x n, n)."""
    cost = 0.0
    for e in range(2):
        q, slope = _transform(rotation, translation, ends[e]), (normal[0], normal[1], normal[2])
        cost += _add_row(_dot(q, normal), _cross(q, slope), slope, weight, hessian, gradient)
    return cost


@compiled
def _add_image_terms(
    model: Floats, moment: Floats, rays: Floats, focal: Floats, weight: float, rotation: Floats, translation: Floats,
    hessian: Floats, gradient: Floats,
) -> float:
    """A segment's two ends: distance to the projected model line; derivatives (m x s, d x s), s that by the plane m."""
    direction, plane, reach = _project_line(model, moment, focal, rotation, translation)
    u, v = plane[0] / (focal[0] * focal[0]) / reach, plane[1] / (focal[1] * focal[1]) / reach
    cost = 0.0
    for e in range(2):
        distance = _dot(rays[e], plane) / reach
        slope = (rays[e, 0] - distance * u) / reach, (rays[e, 1] - distance * v) / reach, rays[e, 2] / reach
        cost += _add_row(distance, _cross(plane, slope), _cross(direction, slope), weight, hessian, gradient)
    return cost


@compiled
def _add_row(
    residual: float, by_rotation: Vector, by_translation: Vector, weight: float, hessian: Floats, gradient: Floats
) -> float:
    """Add one residual to the upper half of J'J and to J'r; return its share of the cost."""
    row = by_rotation[0], by_rotation[1], by_rotation[2], by_translation[0], by_translation[1], by_translation[2]
    for a in range(6):
        weighted = weight * row[a]
        gradient[a] += weighted * residual
        for b in range(a, 6):
            hessian[a, b] += weighted * row[b]
    return weight * residual * residual


@compiled
def _mirror_upper(hessian: Floats) -> None:
    for a in range(6):
        for b in range(a):
            hessian[a, b] = hessian[b, a]


@compiled
def _add_prior(
    prior: RigidMotion, information: Floats, rotation: Floats, translation: Floats, hessian: Floats, gradient: Floats
) -> float:
    """Add the prior as one more measurement: the left perturbation from it."""
    apart, away = np.empty((3, 3)), np.empty(6)
    for a in range(3):
        for b in range(3):
            apart[a, b] = _dot(rotation[a], prior[0][b])
    away[0], away[1], away[2] = _rotation_vector(apart)
    carried = _rotate(apart, prior[1])
    for a in range(3):
        away[3 + a] = translation[a] - carried[a]
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
def _rotation_vector(rotation: Floats) -> tuple[float, float, float]:
    """Axis times angle of a rotation by less than half a turn."""
    x, y, z = rotation[2, 1] - rotation[1, 2], rotation[0, 2] - rotation[2, 0], rotation[1, 0] - rotation[0, 1]
    sine = 0.5 * math.sqrt(x * x + y * y + z * z)
    angle = math.atan2(sine, 0.5 * (rotation[0, 0] + rotation[1, 1] + rotation[2, 2] - 1.0))
    scale = 0.5 if sine < 1e-9 else 0.5 * angle / sine
    return scale * x, scale * y, scale * z


@compiled
def _minimise_translation(lines: LineArrays, weights: Floats, rotation: Floats, translation: Floats) -> None:
    """Move T itself to where E1 is least for this R; directions that the lines leave open stay."""
    points, _, _, _, normals, _, _, _ = lines
    xx = xy = xz = yy = yz = zz = bx = by = bz = 0.0
    for i in range(len(points)):
        if weights[i] == 0.0:
            continue
        n = normals[i]
        first = _transform(rotation, translation, points[i, 0])
        miss = _dot(first, n) + _dot(_transform(rotation, translation, points[i, 1]), n)
        x, y, z = weights[i] * n[0], weights[i] * n[1], weights[i] * n[2]
        bx, by, bz = bx + x * miss, by + y * miss, bz + z * miss
        xx, xy, xz = xx + 2.0 * x * n[0], xy + 2.0 * x * n[1], xz + 2.0 * x * n[2]
        yy, yz, zz = yy + 2.0 * y * n[1], yz + 2.0 * y * n[2], zz + 2.0 * z * n[2]
    size = xx + yy + zz
    minors = yy * zz - yz * yz, xz * yz - xy * zz, xy * yz - xz * yy
    determinant = xx * minors[0] + xy * minors[1] + xz * minors[2]
    if determinant > 1e-6 * size * size * size:
        translation[0] -= (minors[0] * bx + minors[1] * by + minors[2] * bz) / determinant
        translation[1] -= (minors[1] * bx + (xx * zz - xz * xz) * by + (xy * xz - xx * yz) * bz) / determinant
        translation[2] -= (minors[2] * bx + (xy * xz - xx * yz) * by + (xx * yy - xy * xy) * bz) / determinant
        return
    square = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    values, vectors = np.linalg.eigh(square)
    floor = 1e-10 * max(values[2], TINY)
    for k in range(3):
        if values[k] > floor:
            share = (vectors[0, k] * bx + vectors[1, k] * by + vectors[2, k] * bz) / values[k]
            for a in range(3):
                translation[a] -= vectors[a, k] * share


@compiled
def _solve_damped(hessian: Floats, gradient: Floats, damping: float, factor: Floats, step: Floats) -> None:
    """Fill step = -(H + damping diag H)^-1 g, by Cholesky; directions without information hardly move."""
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
def _perturb(step: Floats, rotation: Floats, translation: Floats) -> RigidMotion:
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
            turned[a, b] = by[a, 0] * rotation[0, b] + by[a, 1] * rotation[1, b] + by[a, 2] * rotation[2, b]
        moved[a] = by[a, 0] * translation[0] + by[a, 1] * translation[1] + by[a, 2] * translation[2] + step[3 + a]
    return turned, moved


@compiled
def _project_line(
    model: Floats, moment: Floats, focal: Floats, rotation: Floats, translation: Floats
) -> tuple[Vector, Vector, float]:
    """Direction and moment of a model line in the camera frame, and the length of its image line's normal."""
    direction, moved = _rotate(rotation, model), _rotate(rotation, moment)
    across = _cross(translation, direction)
    plane = moved[0] + across[0], moved[1] + across[1], moved[2] + across[2]
    u, v = plane[0] / focal[0], plane[1] / focal[1]
    return direction, plane, math.sqrt(u * u + v * v + MIN_IMAGE_PART * _dot(plane, plane) + TINY * TINY)


@compiled
def _transform(rotation: Floats, translation: Floats, point: Vector) -> tuple[float, float, float]:
    x, y, z = _rotate(rotation, point)
    return x + translation[0], y + translation[1], z + translation[2]


@compiled
def _rotate(rotation: Floats, vector: Vector) -> tuple[float, float, float]:
    x, y, z = vector[0], vector[1], vector[2]
    return (
        rotation[0, 0] * x + rotation[0, 1] * y + rotation[0, 2] * z,
        rotation[1, 0] * x + rotation[1, 1] * y + rotation[1, 2] * z,
        rotation[2, 0] * x + rotation[2, 1] * y + rotation[2, 2] * z,
    )


@compiled
def _cross(a: Vector, b: Vector) -> tuple[float, float, float]:
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


@compiled
def _dot(a: Vector, b: Vector) -> float:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@compiled
def _squared_distance(a: Vector, b: Vector) -> float:
    return (a[0] - b[0]) ** 2 + (a[1] - b[1]) ** 2 + (a[2] - b[2]) ** 2
