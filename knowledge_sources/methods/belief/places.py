"""A place against its aliases: what was believed before the look, and what the picture says of both.

The belief is one of two: the robot is where its covariance says, or it is elsewhere, and then at any place that looks
the same. So an alias far outside the covariance is as likely as the belief is wrong, however alike it looks; one inside
is distinguished by the picture alone.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from knowledge_sources.methods.arrays import Floats
from world_models.frames import Pose2

MAX_CAMERA_CHI2 = 30.0  # squared distance from what was believed beyond which a picture is no evidence
SLIP_SIGMA_M = 0.1  # standard deviation that a tracked position has beyond its covariance: it may have slipped
SLIP_SIGMA_RAD = math.radians(3.0)  # standard deviation that a tracked heading has beyond its covariance
MAX_SLIP_CHI2 = 21.1
"""Largest squared distance of a place from its prior or tracked pose that is still that place, in
deviations; three unknowns, 99.99 %."""
MIN_P_BELIEVED = 0.97  # smallest probability of a place that is believed where no look within reach tells more


CHI2_95 = 7.815
"""Of three unknowns: 95 % lie within. Up to it a pose is where it was believed."""
SURVEY_M, SURVEY_RAD = 0.015, math.radians(0.5)
"""Standard deviations of a place by other walls than those it was believed by, though the model is called exact."""
MOST_ALIASES = 100
"""No room has so many places at which it repeats itself or a picture fits."""


def compute_chi2(one: Pose2, other: Pose2, covariance: Floats) -> float:
    """The squared distance of two poses in standard deviations of a covariance (3, 3)."""
    off = one.minus(other)
    return float(off @ np.linalg.solve(covariance + 1e-12 * np.eye(3), off))


@dataclass(frozen=True, slots=True, eq=False)
class BelievedPlace:
    """Where the robot was believed to be before a look.

    Attributes:
        pose, covariance: world; (3, 3) over (x, y, heading).
        p_there: probability that it is there at all, and not at another place that looks the same.
    """

    pose: Pose2
    covariance: Floats
    p_there: float

    def compute_p_wrong(self, pose: Pose2) -> float:
        """The probability that a pose that was solved for is wrong, before its picture is weighed.

        What is believed supports a pose within its covariance, and contradicts as much one outside: there either the
        belief is wrong or the pose is, as where a wall is not where the model has it.
        """
        chi2 = compute_chi2(pose, self.pose, self.covariance + np.diag(np.square([SURVEY_M, SURVEY_M, SURVEY_RAD])))
        within = math.exp(-0.5 * min(max(chi2 - CHI2_95, 0.0), 1400.0))
        return (1.0 - self.p_there) * within + self.p_there * (1.0 - within)


def compute_p_aliases(believed: BelievedPlace, here: Pose2, aliases: Sequence[tuple[Pose2, float]]) -> float:
    """The probability that the robot is at any of the aliases, and not here.

    How far this pose is from the believed one does not support an alias: elsewhere it would be off in the same way, as
    by a camera that is mounted differently.

    Args:
        believed: with the covariance of the belief and of ``here`` together.
        here: the pose in question, world.
        aliases: the pose of each, world, and by how much the picture is likelier there than here [log].
    """
    if not aliases:
        return 0.0
    share = (1.0 - believed.p_there) / (1 + len(aliases))
    own_chi2, odds = compute_chi2(here, believed.pose, believed.covariance), list[float]()
    for pose, ratio in aliases:
        farther = max(compute_chi2(pose, believed.pose, believed.covariance) - own_chi2, 0.0)
        odds.append((believed.p_there * math.exp(-0.5 * min(farther, 1400.0)) + share) * math.exp(ratio))
    against = math.fsum(odds)
    return against / (believed.p_there + share + against)


def bound_p_aliases(believed: BelievedPlace, here: Pose2, apart: tuple[float, float], most_log_ratio: float) -> float:
    """The most that :func:`compute_p_aliases` can be, whatever the aliases: so those that do not matter are not sought.

    ``apart``: each is farther from here than by so much of the way [m], or of a turn [rad].
    """
    off, covariance = here.minus(believed.pose), believed.covariance + 1e-12 * np.eye(3)
    way_m, turn_rad = max(apart[0] - math.hypot(off[0], off[1]), 0.0), max(apart[1] - abs(off[2]), 0.0)
    chi2 = min(way_m**2 / float(np.linalg.eigvalsh(covariance[:2, :2])[-1]), turn_rad**2 / float(covariance[2, 2]))
    farther = max(chi2 - compute_chi2(here, believed.pose, believed.covariance), 0.0)
    near = MOST_ALIASES * believed.p_there * math.exp(-0.5 * min(farther, 1400.0))
    against = (near + 1.0 - believed.p_there) * math.exp(most_log_ratio)
    return against / (believed.p_there + against)
