"""Levenberg-Marquardt in numpy, for objectives that are not compiled, and the small algebra of the solvers.

The compiled one (`kernels`) stays beside it: its own Cholesky and LAPACK's solver differ in the last bit.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Generic, TypeVar

import numpy as np

from knowledge_sources.methods.arrays import Floats

State = TypeVar("State")

MIN_STEP = 1e-10
"""A step whose largest element (rad or m) is below this ends a minimisation: rounding, no setting."""
MIN_RELATIVE_GAIN = 1e-12
"""A relative gain below this ends a minimisation: rounding, no setting."""


@dataclass(frozen=True, slots=True, eq=False)
class NormalEquations:
    """Normal equations at a state: ``cost``, ``hessian`` (k, k) ~ J'J and ``gradient`` (k,) = J'r."""

    cost: float
    hessian: Floats
    gradient: Floats


@dataclass(frozen=True, slots=True, eq=False)
class Minimum(Generic[State]):
    """Where a minimisation ended: the state, its normal equations and the steps it took."""

    state: State
    normal: NormalEquations
    iterations: int


def minimise(
    state: State,
    linearise: Callable[[State], NormalEquations],
    retract: Callable[[State, Floats], State],
    iterations: int,
) -> Minimum[State]:
    """Levenberg-Marquardt from ``state``; the cost never rises. Source: §6.2.2 (Horn's increments), with damping.

    Args:
        retract: (state, step), the state a step (k,) further.
    """
    here = linearise(state)
    damping = 1e-9
    for done in range(iterations):
        step = _solve_damped(here, damping)
        trial = retract(state, step)
        there = linearise(trial)
        gain = here.cost - there.cost
        if not gain >= 0.0:
            damping = max(damping * 30.0, 1e-4)
            if damping > 1e7:
                return Minimum(state, here, done)
            continue
        state, here, damping = trial, there, max(damping * 0.1, 1e-12)
        if np.abs(step).max() < MIN_STEP or gain <= MIN_RELATIVE_GAIN * here.cost:
            return Minimum(state, here, done + 1)
    return Minimum(state, here, iterations)


def build_normal_equations(residuals: Floats, jacobian: Floats) -> NormalEquations:
    """From whitened residuals (...) and their derivatives (..., k)."""
    r = residuals.ravel()
    j = jacobian.reshape(r.size, jacobian.shape[-1])
    return NormalEquations(float(r @ r), j.T @ j, j.T @ r)


def compute_rotations(vectors_rad: Floats) -> Floats:
    """Rotation matrices (..., 3, 3) of axis-angle vectors (..., 3), by Rodrigues' formula."""
    x, y, z = vectors_rad[..., 0], vectors_rad[..., 1], vectors_rad[..., 2]
    zero = np.zeros_like(x)
    skew = np.stack([zero, -z, y, z, zero, -x, -y, x, zero], axis=-1).reshape(*vectors_rad.shape[:-1], 3, 3)
    angle = np.sqrt(x * x + y * y + z * z)[..., None, None]
    small = angle < 1e-6
    safe = np.where(small, 1.0, angle)
    first = np.where(small, 1.0, np.sin(safe) / safe)
    second = np.where(small, 0.5, (1.0 - np.cos(safe)) / safe**2)
    return np.asarray(np.eye(3) + first * skew + second * (skew @ skew))


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


def orthonormalise(rotation: Floats) -> Floats:
    """The rotation nearest to an almost orthonormal matrix (3, 3)."""
    u, _, vt = np.linalg.svd(rotation)
    return np.asarray(u @ vt)


def invert_information(hessian: Floats) -> Floats:
    """Inverse of a positive semi-definite matrix; directions without information get a huge but finite variance."""
    values, vectors = np.linalg.eigh(0.5 * (hessian + hessian.T))
    floor = max(float(values[-1]) * 1e-15, 1e-12)
    return np.asarray((vectors / np.maximum(values, floor)) @ vectors.T)


def _solve_damped(normal: NormalEquations, damping: float) -> Floats:
    diagonal = np.diag(normal.hessian)
    floor = 1e-12 * max(float(diagonal.max(initial=0.0)), 1e-30)
    damped = normal.hessian + np.diag(damping * diagonal + floor)
    return np.asarray(-np.linalg.solve(damped, normal.gradient))
