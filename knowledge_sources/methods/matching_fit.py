"""Closed-form best fit of a 2D model to the data lines paired with it (§6.1.2)."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
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
    reduced, back = _without_shift(forms)
    if with_scale:
        cosines, sines, scales = _circle_with_scale(reduced)
    else:
        cosines, sines = _circle(reduced, np.arctan2(start[..., 1], start[..., 0]))
        scales = np.ones_like(cosines)
    rest = np.stack([cosines, sines, scales], axis=-1)
    errors = np.einsum("ka,kab,kb->k", rest, reduced, rest)
    shifts = -np.einsum("kta,ka->kt", back, rest)
    return Fits(np.maximum(errors, 0.0), np.concatenate([rest[:, :2], shifts, rest[:, 2:]], axis=1))


def _without_shift(forms: Array) -> tuple[Array, Array]:
    """Eliminate T: the (k, 3, 3) form in (cos, sin, s) and (k, 2, 3) with T = -back @ (cos, sin, s)."""
    keep = np.array([0, 1, 4])
    a, b, d = forms[:, 2, 2], forms[:, 2, 3], forms[:, 3, 3]
    determinant = a * d - b * b
    inverse = np.stack([d, -b, -b, a], axis=-1).reshape(-1, 2, 2) / determinant[:, None, None]
    across = forms[:, 2:4][:, :, keep]
    back = inverse @ across
    return forms[:, keep][:, :, keep] - np.swapaxes(across, 1, 2) @ back, back


def _circle_with_scale(q: Array) -> tuple[Array, Array, Array]:
    """Eliminate s from (k, 3, 3), then the smaller root of the second-order equation."""
    pull = q[:, :2, 2] / q[:, 2, 2][:, None]
    rest = q[:, :2, :2] - q[:, :2, 2][:, :, None] * pull[:, None, :]
    double = 0.5 * np.arctan2(2.0 * rest[:, 0, 1], rest[:, 0, 0] - rest[:, 1, 1]) + 0.5 * np.pi
    cosines, sines = np.cos(double), np.sin(double)
    sign = np.where(cosines < 0.0, -1.0, 1.0)
    cosines, sines = cosines * sign, sines * sign
    return cosines, sines, -(pull[:, 0] * cosines + pull[:, 1] * sines)


def _circle(q: Array, start: Array) -> tuple[Array, Array]:
    """Newton on the turn for x'Ax + 2 b'x, x = (cos, sin), with s = 1."""
    a, b, d = q[:, 0, 0], q[:, 0, 1], q[:, 1, 1]
    e, f = q[:, 0, 2], q[:, 1, 2]
    turn = np.broadcast_to(start, a.shape)
    for _ in range(NEWTON_STEPS):
        c, s = np.cos(turn), np.sin(turn)
        slope = (d - a) * s * c + b * (c * c - s * s) - e * s + f * c
        bend = (d - a) * (c * c - s * s) - 4.0 * b * s * c - e * c - f * s
        turn = turn - np.clip(slope / np.where(bend > 1e-12, bend, np.inf), -0.5, 0.5)
    return np.cos(turn), np.sin(turn)
