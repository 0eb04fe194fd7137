"""What was seen while nobody knew where: several looks from one spot and near it, composed by the motions between."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from knowledge_sources.methods.manhattan import level_direction
from world_models.camera import Camera
from world_models.frames import Pose, Pose2, wrap_angle

Floats = NDArray[np.float64]
RIGHT = 0.5 * math.pi
SEEN_RAD = math.radians(0.3)
"""How well level lines tell a turn."""
MOST_OFF_RAD = math.radians(20.0)
"""Motions say better than this which of four directions is meant."""


@dataclass(frozen=True, slots=True, eq=False)
class Glance:
    """One look.

    Attributes:
        segments_px: (n, 2, 2) what was seen.
        now_from_then: where the robot was, from where it is now.
        spread: (3, 3) covariance of that over (x, y, heading).
    """

    segments_px: Floats
    now_from_then: Pose2
    spread: Floats

    def then(self, world_from_now: Pose2) -> Pose2:
        """Where the robot was, if it is there now."""
        return world_from_now @ self.now_from_then


def squared(glances: Sequence[Glance], camera: Camera, camera_from_robot: Pose) -> tuple[Glance, ...]:
    """The glances with the turns between them corrected by the level lines that they show.

    Wheels err by a fortieth of a turn; but lines at right angles are seen to a tenth of a degree, and it is known from
    the wheels which of the four directions is which. The last glance is where the robot is now.
    """
    seen = [level_direction(g.segments_px, camera, camera_from_robot) for g in glances]
    now = seen[-1]
    if now is None:
        return tuple(glances)
    out = []
    for glance, direction in zip(glances[:-1], seen[:-1], strict=True):
        if direction is not None:
            pose = glance.now_from_then
            off = math.remainder(now - direction - pose.heading_rad, RIGHT)
            if abs(off) < MOST_OFF_RAD:
                turned = Pose2(pose.x_m, pose.y_m, wrap_angle(pose.heading_rad + off))
                glance = replace(glance, now_from_then=turned, spread=_known_turn(glance.spread))
        out.append(glance)
    return (*out, glances[-1])


def _known_turn(spread: Floats) -> Floats:
    """The covariance (3, 3) once the turn is known from what is seen."""
    out = np.zeros((3, 3))
    out[:2, :2], out[2, 2] = spread[:2, :2], min(float(spread[2, 2]), SEEN_RAD**2)
    return out


def moved(now_from_then: Pose2, covariance: Floats, step: Pose2, spread: Floats) -> tuple[Pose2, Floats]:
    """Where the robot was, and its covariance (3, 3), from where it is after one more step with its spread (3, 3)."""
    after = step.inverse() @ now_from_then
    c, s = math.cos(step.heading_rad), math.sin(step.heading_rad)
    turn = np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]])
    lever = np.eye(3)
    lever[0, 2], lever[1, 2] = after.y_m, -after.x_m  # what a heading of the step does to a place before it
    return after, np.asarray(turn @ covariance @ turn.T + lever @ turn @ spread @ turn.T @ lever.T)
