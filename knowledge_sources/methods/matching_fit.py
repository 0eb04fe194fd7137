"""Closed-form best fit of a 2D model to the data lines paired with it (§6.1.2)."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

Array = NDArray[np.float64]

NEWTON_STEPS = 4


@dataclass(frozen=True, slots=True)
class Similarity2:
    """Moves the model onto the data: ``p_data = scale R(rotation) (p_model - centre) + centre + shift``.

    Attributes:
        rotation_rad: from u towards v.
        shift_px: (u, v).
        scale: 1 unless scale was fitted.
        centre_px: the point that only the shift moves.
    """

    rotation_rad: float
    shift_px: tuple[float, float]
    scale: float
    centre_px: tuple[float, float]

    def apply(self, points_px: Array) -> Array:
        """Model points (..., 2) moved to the data."""
        c, s = math.cos(self.rotation_rad), math.sin(self.rotation_rad)
        turned = (np.asarray(points_px, float) - self.centre_px) @ np.array([[c, s], [-s, c]])
        return np.asarray(self.scale * turned + self.centre_px + self.shift_px)


@dataclass(frozen=True, slots=True, eq=False)
class Fits:
    """Best fits of k states: ``errors`` (k,) E_fit at the optimum, ``placements`` (k, 5) (cos, sin, T_u, T_v, s)."""

    errors: Array
    placements: Array


def best_fits(forms: Array, with_scale: bool, start: Array) -> Fits:
    """Minimise k quadratic forms (k, 5, 5) over R, T and, if asked, s: T and s by elimination, then R.

    Source: §6.1.2, E_fit = sum_i (l_i / 2) sum over both ends (n_i . (R p_i + T) - s rho_i)^2, each bracket linear
    in (cos, sin, T_u, T_v, s), so that a state is the sum of its pairs' forms.
    With scale the rest is x'Qx on the unit circle, tan 2 phi = 2 Q12 / (Q11 - Q22): the second-order equation.
    Without, a linear term is left and the minimum is a root of a quartic; a few Newton steps from the turn of
    ``start`` (5,) or (k, 5) find it.
    """
    turns = np.empty(len(forms))
    turns[:] = np.arctan2(start[..., 1], start[..., 0])
    errors, placements = _fits(np.ascontiguousarray(forms), with_scale, turns)
    return Fits(errors, placements)


@njit(cache=True, error_model="numpy")
def _fits(forms: Any, with_scale: bool, turns: Any) -> tuple[Any, Any]:
    errors, placements = np.empty(len(forms)), np.empty((len(forms), 5))
    back, q = np.empty((2, 3)), np.empty((3, 3))
    for k in range(len(forms)):
        _without_shift(forms[k], back, q)
        scale = 1.0
        if with_scale:
            c, s, scale = _circle_with_scale(q)
        else:
            c, s = _circle(q, turns[k])
        rest = (c, s, scale)
        error = 0.0
        for a in range(3):
            for b in range(3):
                error += rest[a] * q[a, b] * rest[b]
        errors[k] = max(error, 0.0)
        placements[k, 0], placements[k, 1], placements[k, 4] = c, s, scale
        for t in range(2):
            placements[k, 2 + t] = -(back[t, 0] * c + back[t, 1] * s + back[t, 2] * scale)
    return errors, placements


@njit(cache=True, error_model="numpy")
def _without_shift(form: Any, back: Any, reduced: Any) -> None:
    """Eliminate T: ``reduced`` (3, 3) in (cos, sin, s) and ``back`` (2, 3) with T = -back @ (cos, sin, s)."""
    a, b, d = form[2, 2], form[2, 3], form[3, 3]
    determinant = a * d - b * b
    kept = (0, 1, 4)
    for j in range(3):
        u, v = form[2, kept[j]], form[3, kept[j]]
        back[0, j], back[1, j] = (d * u - b * v) / determinant, (a * v - b * u) / determinant
    for i in range(3):
        for j in range(3):
            across = form[2, kept[i]] * back[0, j] + form[3, kept[i]] * back[1, j]
            reduced[i, j] = form[kept[i], kept[j]] - across


@njit(cache=True, error_model="numpy")
def _circle_with_scale(q: Any) -> tuple[float, float, float]:
    """Eliminate s from (3, 3), then the smaller root of the second-order equation."""
    pull = (q[0, 2] / q[2, 2], q[1, 2] / q[2, 2])
    xx, xy, yy = q[0, 0] - q[0, 2] * pull[0], q[0, 1] - q[0, 2] * pull[1], q[1, 1] - q[1, 2] * pull[1]
    turn = 0.5 * math.atan2(2.0 * xy, xx - yy) + 0.5 * math.pi
    c, s = math.cos(turn), math.sin(turn)
    if c < 0.0:
        c, s = -c, -s
    return c, s, -(pull[0] * c + pull[1] * s)


@njit(cache=True, error_model="numpy")
def _circle(q: Any, turn: float) -> tuple[float, float]:
    """Newton on the turn for x'Ax + 2 b'x, x = (cos, sin), with s = 1."""
    a, b, d, e, f = q[0, 0], q[0, 1], q[1, 1], q[0, 2], q[1, 2]
    for _ in range(NEWTON_STEPS):
        c, s = math.cos(turn), math.sin(turn)
        slope = (d - a) * s * c + b * (c * c - s * s) - e * s + f * c
        bend = (d - a) * (c * c - s * s) - 4.0 * b * s * c - e * c - f * s
        if bend > 1e-12:
            turn -= min(max(slope / bend, -0.5), 0.5)
    return math.cos(turn), math.sin(turn)
