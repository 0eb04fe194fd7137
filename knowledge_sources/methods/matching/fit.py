"""Best fits of a model to the data lines paired with it: in closed form in the image (§6.1.2), or a step of a pose."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from knowledge_sources.methods.arrays import Floats
from knowledge_sources.methods.matching.kernels import RIGID, SCALED, STEP, compute_fits


@dataclass(frozen=True, slots=True)
class Similarity2:
    """A motion of the model onto the data: ``p_data = scale R(rotation) (p_model - centre) + centre + shift``.

    Attributes:
        rotation_rad: from u towards v.
        shift_px: (u, v).
        scale: 1 unless scale was fitted.
        centre_px: the centre of the rotation.
    """

    rotation_rad: float
    shift_px: tuple[float, float]
    scale: float
    centre_px: tuple[float, float]

    def apply(self, points_px: Floats) -> Floats:
        """Model points (..., 2) moved to the data."""
        c, s = math.cos(self.rotation_rad), math.sin(self.rotation_rad)
        turned = (np.asarray(points_px, float) - self.centre_px) @ np.array([[c, s], [-s, c]])
        return np.asarray(self.scale * turned + self.centre_px + self.shift_px)


@dataclass(frozen=True, slots=True, eq=False)
class Fits:
    """Best fits of k states.

    Attributes:
        errors: (k,) E_fit at the minimum.
        placements: (k, 5) (cos, sin, T_u, T_v, s), or the steps (k, d) of a pose.
    """

    errors: Floats
    placements: Floats


class Fitting(NamedTuple):
    """How states are fitted: RIGID, SCALED or STEP, and the turn [rad] that a rigid fit starts from."""

    kind: int
    turn_rad: float

    @staticmethod
    def in_image(with_scale: bool, start: Floats) -> Fitting:
        """As :func:`compute_best_fits`, from the turn of a placement (5,)."""
        return Fitting(SCALED if with_scale else RIGID, math.atan2(start[1], start[0]))

    def fit(self, forms: Floats) -> Fits:
        """The best fits of k forms (k, d, d)."""
        return Fits(*compute_fits(np.ascontiguousarray(forms), self.kind, np.full(len(forms), self.turn_rad)))


POSE_STEP = Fitting(STEP, 0.0)
"""As :func:`compute_step_fits`."""


def compute_best_fits(forms: Floats, with_scale: bool, start: Floats) -> Fits:
    """Minimise k quadratic forms (k, 5, 5) over R, T and, if asked, s: T and s by elimination, then R.

    Source: §6.1.2, E_fit = sum_i (l_i / 2) sum over both ends (n_i . (R p_i + T) - s rho_i)^2, each bracket linear
    in (cos, sin, T_u, T_v, s), so that a state is the sum of its pairs' forms.
    With scale the rest is x'Qx on the unit circle, tan 2 phi = 2 Q12 / (Q11 - Q22): the second-order equation.
    Without scale a linear term is left, and the minimum is a root of a quartic, which Newton's method finds from the
    turn of ``start`` (5,) or (k, 5).
    """
    turns = np.empty(len(forms))
    turns[:] = np.arctan2(start[..., 1], start[..., 0])
    return Fits(*compute_fits(np.ascontiguousarray(forms), SCALED if with_scale else RIGID, turns))


def compute_step_fits(forms: Floats) -> Fits:
    """Minimise k forms (k, d + 1, d + 1) over the first d of (step, 1); ``placements`` are the steps (k, d)."""
    return POSE_STEP.fit(forms)
