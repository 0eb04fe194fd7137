"""What was seen while nobody knew where: several looks from one spot and near it, composed by the motions between."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from knowledge_sources.methods.features.manhattan import find_level_direction
from world_models.camera import Camera
from world_models.frames import Pose, Pose2

Floats = NDArray[np.float64]
RIGHT = 0.5 * math.pi
SEEN_RAD = math.radians(0.3)
"""How well level lines tell a turn."""
MOST_OFF_RAD = math.radians(20.0)
"""Motions say better than this which of four directions is meant."""


@dataclass(frozen=True, slots=True, eq=False)
class CameraView:
    """One look.

    Attributes:
        segments_px: (n, 2, 2) what was seen.
        now_from_then: where the robot was, from where it is now.
        spread: (3, 3) covariance of that over (x, y, heading).
    """

    segments_px: Floats
    now_from_then: Pose2
    covariance: Floats

    def then(self, world_from_now: Pose2) -> Pose2:
        """Where the robot was, if it is there now."""
        return world_from_now @ self.now_from_then


def align_headings(glances: Sequence[CameraView], camera: Camera, camera_from_robot: Pose) -> tuple[CameraView, ...]:
    """The glances, in the order they were taken, with the turns between them corrected by the level lines they show.

    Wheels err by a fortieth of a turn; but lines at right angles are seen to a tenth of a degree, and it is known from
    the wheels which of the four directions is which. The last glance is where the robot is now. If it shows no level
    lines, the others are set straight by the last one that does, and are known from now no better than that one is.
    """
    told = _told(glances, camera, camera_from_robot)
    if len(told) < 2:
        return tuple(glances)
    surest = max(told)
    axis, spread = told[surest], float(glances[surest].covariance[2, 2]) + SEEN_RAD**2
    out, off_later = [glances[-1]], 0.0
    for k in range(len(glances) - 2, -1, -1):
        glance, off = glances[k], math.remainder(axis - told[k], RIGHT) if k in told else math.inf
        if abs(off) < MOST_OFF_RAD and k != surest:
            glance = replace(glance, covariance=_known_turn(glance.covariance, spread))
        else:
            off = off_later
        pose = _before(glance, glances[k + 1], out[-1].now_from_then, off_later - off)
        out.append(replace(glance, now_from_then=pose))
        off_later = off
    return tuple(reversed(out))


def _told(glances: Sequence[CameraView], camera: Camera, camera_from_robot: Pose) -> dict[int, float]:
    """By the number of each glance that shows level lines: their direction from now, modulo a right angle [rad]."""
    seen = [find_level_direction(g.segments_px, camera, camera_from_robot) for g in glances]
    return {k: d + g.now_from_then.heading_rad for k, (g, d) in enumerate(zip(glances, seen, strict=True))
            if d is not None}


def _before(glance: CameraView, later: CameraView, now_from_later: Pose2, more_rad: float) -> Pose2:
    """Where a glance was taken if the robot turned by so much more before it went on to the later one."""
    step = Pose2(0.0, 0.0, more_rad) @ glance.now_from_then.inverse() @ later.now_from_then
    return now_from_later @ step.inverse()


def _known_turn(spread: Floats, seen: float) -> Floats:
    """The covariance (3, 3) once the turn is known from what is seen with the variance ``seen``."""
    out = np.zeros((3, 3))
    out[:2, :2], out[2, 2] = spread[:2, :2], min(float(spread[2, 2]), seen)
    return out


def propagate_pose(now_from_then: Pose2, covariance: Floats, step: Pose2, spread: Floats) -> tuple[Pose2, Floats]:
    """Where the robot was, and its covariance (3, 3), from where it is after one more step with its spread (3, 3)."""
    after = step.inverse() @ now_from_then
    c, s = math.cos(step.heading_rad), math.sin(step.heading_rad)
    turn = np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]])
    lever = np.eye(3)
    lever[0, 2], lever[1, 2] = after.y_m, -after.x_m  # what a heading of the step does to a place before it
    return after, np.asarray(turn @ covariance @ turn.T + lever @ turn @ spread @ turn.T @ lever.T)
