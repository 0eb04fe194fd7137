"""A place against its rivals: what was believed before the look, and what the picture says of both.

The belief is one of two: the robot is where its covariance says, or it is elsewhere, and then at any place that looks
the same. So a rival far outside the covariance is as likely as the belief is wrong, however alike it looks; one inside
is told apart by the picture alone.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from knowledge_sources.methods.arrays import Floats
from world_models.frames import Pose2


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

    def compute_chi2(self, pose: Pose2) -> float:
        """The squared distance of a pose from the believed one, in standard deviations."""
        off = pose.minus(self.pose)
        return float(off @ np.linalg.solve(self.covariance + 1e-9 * np.eye(3), off))


def compute_p_rivals(believed: BelievedPlace, here: Pose2, rivals: Sequence[tuple[Pose2, float]]) -> float:
    """The probability that the robot is at any of the rival places, and not here.

    How far this pose is from the believed one does not speak for a rival: elsewhere it would be off in the same way, as
    by a camera that is mounted otherwise.

    Args:
        believed: with the covariance of the belief and of ``here`` together.
        here: the pose in question, world.
        rivals: the pose of each, world, and by how much the picture is likelier there than here [log].
    """
    if not rivals:
        return 0.0
    share = (1.0 - believed.p_there) / (1 + len(rivals))
    own_chi2, odds = believed.compute_chi2(here), list[float]()
    for pose, ratio in rivals:
        farther = max(believed.compute_chi2(pose) - own_chi2, 0.0)
        odds.append((believed.p_there * math.exp(-0.5 * min(farther, 1400.0)) + share) * math.exp(ratio))
    against = math.fsum(odds)
    return against / (believed.p_there + share + against)
