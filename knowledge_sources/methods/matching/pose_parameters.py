"""The unknowns of a camera pose near a prior: all six, or the three of a robot on the floor.

The matcher is the same for both; the two classes say how the unknowns move the camera and where to start.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from dataclasses import dataclass
from functools import lru_cache
from typing import Any, ClassVar

import numpy as np
from scipy.special import ndtri

from knowledge_sources.methods.arrays import Floats
from knowledge_sources.settings.matching import MatchingSettings
from world_models.frames import Pose, Pose2, frozen, wrap_angle

Widths = tuple[float, ...]


@dataclass(frozen=True, slots=True, eq=False)
class PoseParameters(ABC):
    """A prior in d unknowns, and how they move the camera.

    Attributes:
        prior: ``camera_from_world``.
        information: (d, d) inverse covariance of the unknowns about the prior.
        root: (d, d) a factor of the covariance: times standard normal deviates it gives steps.
        widths_per_linearisation: when a pose is refined, the pairs are linearised anew after this many widths.
    """

    prior: Pose
    information: Floats
    root: Floats
    widths_per_linearisation: ClassVar[int]

    @abstractmethod
    def list_starts(self, reach_px: Floats, settings: MatchingSettings) -> Floats:
        """(s, d) starts, in deviations, given how far one along each axis moves the picture (d,) [px]."""

    @abstractmethod
    def get_widths(self, settings: MatchingSettings) -> Widths:
        """Widths of the loss [px] by which starts are refined, to first order about the prior."""

    @abstractmethod
    def compute_basis(self, pose: Pose) -> Floats:
        """(6, d) left perturbation (rotation, translation) of a pose by a unit of each unknown."""

    @abstractmethod
    def move(self, pose: Pose, step: Floats) -> Pose:
        """The pose after a step (d,)."""

    @abstractmethod
    def compute_step(self, pose: Pose) -> Floats:
        """(d,) the step that takes the prior to a pose."""


@dataclass(frozen=True, slots=True, eq=False)
class CameraParameters(PoseParameters):
    """All six unknowns: a step is a left perturbation (rotation [rad], translation [m])."""

    widths_per_linearisation = 1

    def list_starts(self, reach_px: Floats, settings: MatchingSettings) -> Floats:
        return _spread_normal(settings.space_starts)

    def get_widths(self, settings: MatchingSettings) -> Widths:
        return settings.space_widths_px

    def compute_basis(self, pose: Pose) -> Floats:
        return np.eye(6)

    def move(self, pose: Pose, step: Floats) -> Pose:
        return pose.perturbed(step[:3], step[3:])

    def compute_step(self, pose: Pose) -> Floats:
        apart = pose @ self.prior.inverse()
        return np.concatenate([apart.rotation_vector, apart.translation])


@dataclass(frozen=True, slots=True, eq=False)
class FloorParameters(PoseParameters):
    """A robot that carries the camera: a step is one of (x [m], y [m], heading [rad]) in the world.

    Attributes:
        mount: ``camera_from_robot``.
        turning: (6,) left perturbation of the camera by a radian that the robot turns to the left.
    """

    mount: Pose
    turning: Floats
    widths_per_linearisation = 4

    def list_starts(self, reach_px: Floats, settings: MatchingSettings) -> Floats:
        steps = (round(settings.grid_sigmas * reach / settings.grid_px + 0.25) for reach in reach_px.tolist())
        return _build_grid(tuple(min(count, settings.max_grid_steps) for count in steps), settings.grid_sigmas)

    def get_widths(self, settings: MatchingSettings) -> Widths:
        return settings.floor_widths_px

    def compute_robot_pose(self, pose: Pose) -> Pose2:
        """``world_from_robot`` of a camera pose."""
        turn, shift = pose.rotation.T, pose.rotation.T @ (self.mount.translation - pose.translation)
        forward = turn @ self.mount.rotation[:, 0]
        return Pose2(shift[0], shift[1], math.atan2(forward[1], forward[0]))

    def compute_basis(self, pose: Pose) -> Floats:
        basis = np.zeros((6, 3))
        basis[3:, :2] = -pose.rotation[:, :2]
        basis[:, 2] = self.turning
        return basis

    def move(self, pose: Pose, step: Floats) -> Pose:
        at = self.compute_robot_pose(pose)
        c, s = math.cos(at.heading_rad + step[2]), math.sin(at.heading_rad + step[2])
        turn = self.mount.rotation @ np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]])
        return Pose(turn, self.mount.translation - turn @ np.array([at.x_m + step[0], at.y_m + step[1], 0.0]))

    def compute_step(self, pose: Pose) -> Floats:
        a, b = self.compute_robot_pose(pose), self.compute_robot_pose(self.prior)
        return np.array([a.x_m - b.x_m, a.y_m - b.y_m, wrap_angle(a.heading_rad - b.heading_rad)])


def build_camera_parameters(prior: Pose, covariance: Any) -> CameraParameters:
    """From ``covariance`` (6, 6) of the prior's left perturbation. Raises ValueError for another shape."""
    spread = np.asarray(covariance, float)
    if spread.shape != (6, 6):
        raise ValueError(f"expected a prior_covariance of shape (6, 6), got {spread.shape}")
    return CameraParameters(prior, np.linalg.inv(spread), np.linalg.cholesky(spread))


def build_floor_parameters(mount: Pose, prior: Pose2, covariance: Any) -> FloorParameters:
    """From ``covariance`` (3, 3) of ``prior``, ``world_from_robot``. Raises ValueError for another shape."""
    spread = np.asarray(covariance, float)
    if spread.shape != (3, 3):
        raise ValueError(f"expected a prior_covariance of shape (3, 3), got {spread.shape}")
    # The robot's turn to the left turns the world clockwise about the robot's axis, as the camera sees it.
    axis = -mount.rotation[:, 2]
    turning = np.concatenate([axis, np.cross(mount.translation, axis)])
    camera_from_world = mount @ prior.lifted().inverse()
    return FloorParameters(camera_from_world, np.linalg.inv(spread), np.linalg.cholesky(spread), mount, turning)


@lru_cache(maxsize=64)
def _build_grid(steps: tuple[int, ...], sigmas: float) -> Floats:
    """(s, 3) every combination of so many steps to either side of each axis, which reach ``sigmas``."""
    axes = [sigmas * np.arange(-count, count + 1) / max(count, 1) for count in steps]
    return frozen(np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, len(axes)))


@lru_cache(maxsize=4)
def _spread_normal(count: int) -> Floats:
    """(count + 1, 6) zero, and an even spread of the normal law (Halton's sequence, the same at every call)."""
    bases = 2, 3, 5, 7, 11, 13  # the first primes, one for each of the six unknowns
    spread = ndtri(np.stack([_reflect_digits(count, base) for base in bases], axis=1))
    return frozen(np.concatenate([np.zeros((1, 6)), spread]))


def _reflect_digits(count: int, base: int) -> Floats:
    """(count,) of van der Corput's sequence without its 0, as scipy.stats.qmc, whose import takes a quarter second."""
    rest, part, out = np.arange(1, count + 1), 1.0, np.zeros(count)
    while rest.any():
        part /= base
        out += part * (rest % base)
        rest //= base
    return out
