"""How a camera may stand elsewhere than believed: in all six unknowns, or in the three of a robot on a floor.

The matcher is the same for both; what differs is said here.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from dataclasses import dataclass
from functools import lru_cache
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray
from scipy.stats import norm, qmc

from world_models.frames import Pose, Pose2, frozen, wrap_angle

Array = NDArray[np.float64]
Widths = tuple[float, ...]

GRID_SIGMAS = 2.0
"""So many deviations to either side of a floor's prior there are starts."""
GRID_PX = 20.0
"""And about so far apart in the picture, that the loss may draw what lies between two of them to one."""
GRID_SIDE = 3
"""And so many to a side of an axis, at the most."""
STARTS = 128
"""Starts spread over a prior in space, beside the prior itself."""


@dataclass(frozen=True, slots=True, eq=False)
class PoseParameters(ABC):
    """A prior in d unknowns, and how they move the camera.

    Attributes:
        prior: ``camera_from_world``.
        information: (d, d) of the unknowns about the prior. root: (d, d), times deviations of one: steps.
        first_widths: of the loss [px], to first order round the prior.
        later_widths: then round each finalist; between the groups the pairs are looked at anew.
    """

    prior: Pose
    information: Array
    root: Array
    first_widths: ClassVar[Widths]
    later_widths: ClassVar[tuple[Widths, ...]]

    @abstractmethod
    def starts(self, reach_px: Array) -> Array:
        """(s, d) where to start from, in deviations, given how far one along each axis moves the picture (d,) [px]."""

    @abstractmethod
    def basis(self, pose: Pose) -> Array:
        """(6, d) left perturbation (turn, shift) of a pose by a unit of each unknown."""

    @abstractmethod
    def moved(self, pose: Pose, step: Array) -> Pose:
        """The pose after a step (d,)."""

    @abstractmethod
    def away(self, pose: Pose) -> Array:
        """(d,) the step that takes the prior to a pose."""


@dataclass(frozen=True, slots=True, eq=False)
class CameraParameters(PoseParameters):
    """All six: a step is a left perturbation (turn, shift)."""

    first_widths = (16.0, 12.0, 8.0, 6.0)
    later_widths = ((6.0,), (4.0,), (3.0,), (2.0,))

    def starts(self, reach_px: Array) -> Array:
        return _spread()

    def basis(self, pose: Pose) -> Array:
        return np.eye(6)

    def moved(self, pose: Pose, step: Array) -> Pose:
        return pose.perturbed(step[:3], step[3:])

    def away(self, pose: Pose) -> Array:
        apart = pose @ self.prior.inverse()
        return np.concatenate([apart.rotation_vector, apart.translation])


@dataclass(frozen=True, slots=True, eq=False)
class FloorParameters(PoseParameters):
    """A robot that carries the camera on ``mount``, ``camera_from_robot``: a step is one of (x, y, heading), world.

    ``turning`` (6,) is the left perturbation of the camera, by a radian that the robot turns to the left.
    """

    mount: Pose
    turning: Array
    first_widths = (16.0, 12.0, 8.0)
    later_widths = ((6.0, 4.0, 3.0, 2.0),)

    def starts(self, reach_px: Array) -> Array:
        return _grid(tuple(min(round(GRID_SIGMAS * reach / GRID_PX + 0.25), GRID_SIDE) for reach in reach_px.tolist()))

    def robot(self, pose: Pose) -> Pose2:
        """``world_from_robot`` of a camera pose."""
        turn, shift = pose.rotation.T, pose.rotation.T @ (self.mount.translation - pose.translation)
        forward = turn @ self.mount.rotation[:, 0]
        return Pose2(shift[0], shift[1], math.atan2(forward[1], forward[0]))

    def basis(self, pose: Pose) -> Array:
        """The robot's turn to the left turns the world clockwise about its axis, seen from the camera."""
        basis = np.zeros((6, 3))
        basis[3:, :2] = -pose.rotation[:, :2]
        basis[:, 2] = self.turning
        return basis

    def moved(self, pose: Pose, step: Array) -> Pose:
        at = self.robot(pose)
        c, s = math.cos(at.heading_rad + step[2]), math.sin(at.heading_rad + step[2])
        turn = self.mount.rotation @ np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]])
        return Pose(turn, self.mount.translation - turn @ np.array([at.x_m + step[0], at.y_m + step[1], 0.0]))

    def away(self, pose: Pose) -> Array:
        a, b = self.robot(pose), self.robot(self.prior)
        return np.array([a.x_m - b.x_m, a.y_m - b.y_m, wrap_angle(a.heading_rad - b.heading_rad)])


def build_camera_parameters(prior: Pose, covariance: Any) -> CameraParameters:
    """``covariance`` (6, 6) of the prior's left perturbation. Raises ValueError for another shape."""
    spread = np.asarray(covariance, float)
    if spread.shape != (6, 6):
        raise ValueError(f"expected a prior_covariance of shape (6, 6), got {spread.shape}")
    return CameraParameters(prior, np.linalg.inv(spread), np.linalg.cholesky(spread))


def build_floor_parameters(mount: Pose, prior: Pose2, covariance: Any) -> FloorParameters:
    """``covariance`` (3, 3) of ``prior``, ``world_from_robot``. Raises ValueError for another shape."""
    spread = np.asarray(covariance, float)
    if spread.shape != (3, 3):
        raise ValueError(f"expected a prior_covariance of shape (3, 3), got {spread.shape}")
    axis = -mount.rotation[:, 2]
    turning = np.concatenate([axis, np.cross(mount.translation, axis)])
    seen = mount @ prior.lifted().inverse()
    return FloorParameters(seen, np.linalg.inv(spread), np.linalg.cholesky(spread), mount, turning)


@lru_cache(maxsize=(GRID_SIDE + 1) ** 3)
def _grid(sides: tuple[int, ...]) -> Array:
    """(s, 3) every combination of so many steps to either side of each axis."""
    axes = [GRID_SIGMAS * np.arange(-side, side + 1) / max(side, 1) for side in sides]
    return frozen(np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, len(axes)))


@lru_cache(maxsize=1)
def _spread() -> Array:
    """(s, 6) none, and an even spread of the normal law (Halton's sequence, the same at every call)."""
    spread = norm.ppf(qmc.Halton(6, scramble=False).random(STARTS + 1)[1:])
    return frozen(np.concatenate([np.zeros((1, 6)), spread]))
