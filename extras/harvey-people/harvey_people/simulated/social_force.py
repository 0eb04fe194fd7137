"""Social force: how people walk among people, walls and a robot.

Helbing and Molnár, "Social force model for pedestrian dynamics", Physical Review E 51 (1995): its equations, and its
constants. The attraction between people and to things is left out, and so are the fluctuations.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
RELAXATION_S = 0.5
"""tau: in which a person comes to the wanted speed."""
V0_M2_PER_S2, SIGMA_M = 2.1, 0.3
"""Of the repulsion between people."""
STEP_S = 2.0
"""Delta t: how far ahead the other's step is seen, by time."""
U0_M2_PER_S2, WALL_M = 10.0, 0.2
"""Of the repulsion by walls."""
SIGHT_RAD, BEHIND = math.radians(100.0), 0.5
"""Half the angle of sight, and what counts of a force from outside it."""
TOP_SPEED = 1.3
"""The greatest speed, of the wanted one."""


def drive(velocity: Floats, wanted_m_per_s: float, towards: Floats) -> Floats:
    """(2,) the acceleration to the wanted velocity [m/s^2]; ``towards`` (2,) is a unit vector."""
    return np.asarray((wanted_m_per_s * towards - velocity) / RELAXATION_S)


def repulse(from_other: Floats, other_velocity: Floats) -> Floats:
    """(2,) the acceleration by another person: its potential falls with ellipses along that one's next step.

    Args:
        from_other: (2,) from the other to this person [m].
    """
    step = STEP_S * other_velocity
    axis = _semi_axis(from_other, step)
    nudge = 1e-4
    gradient = np.array([_potential(from_other + along, step) - _potential(from_other - along, step)
                         for along in nudge * np.eye(2)]) / (2.0 * nudge)
    return np.asarray(-gradient) if axis > 1e-9 else np.zeros(2)


def _potential(from_other: Floats, step: Floats) -> float:
    return V0_M2_PER_S2 * math.exp(-_semi_axis(from_other, step) / SIGMA_M)


def _semi_axis(from_other: Floats, step: Floats) -> float:
    """b, half the minor axis of the ellipse with foci at the other and at the end of its step [m]."""
    sum_m = float(np.hypot(*from_other)) + float(np.hypot(*(from_other - step)))
    return 0.5 * math.sqrt(max(0.0, sum_m**2 - float(step @ step)))


def repulse_wall(from_wall: Floats) -> Floats:
    """(2,) the acceleration by the nearest point of a wall; ``from_wall`` (2,) leads from it to the person [m]."""
    away_m = max(1e-6, float(np.hypot(*from_wall)))
    return np.asarray(U0_M2_PER_S2 / WALL_M * math.exp(-away_m / WALL_M) * from_wall / away_m)


def weigh_by_sight(force: Floats, towards: Floats) -> Floats:
    """(2,) what a force counts to a person who looks along ``towards``: less from behind."""
    is_seen = towards @ -force >= math.cos(SIGHT_RAD) * float(np.hypot(*force))
    return force if is_seen else BEHIND * force
