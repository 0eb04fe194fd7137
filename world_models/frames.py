"""Coordinate frames and rigid transforms: all SE(3) and SE(2) code.

Coordinate frames (all right-handed, metres and radians):

* world   x east, y north, z up; the frame of the root locale.
* locale  x, y, z of one locale (§3.4); each locale has its own.
* robot   x forward, y left, z up, origin on the floor below the turning axis.
* camera  x right, y down, z forward, origin at the optical centre.

A transform is named ``target_from_source`` so that adjacent names cancel in a product:
``camera_from_world = camera_from_robot @ robot_from_world``.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray


def frozen(array: Any, shape: tuple[int | None, ...] | None = None) -> NDArray[np.float64]:
    """A read-only float64 copy of ``array``; ``None`` in ``shape`` matches any length.

    Raises:
        ValueError: the shape is not the one expected (both are named).
    """
    out = np.array(array, dtype=np.float64)
    if shape is not None and out.shape != shape and (
        out.ndim != len(shape) or any(w is not None and w != g for w, g in zip(shape, out.shape, strict=True))
    ):
        raise ValueError(f"expected an array of shape {shape}, got {out.shape}")
    out.setflags(write=False)
    return out


def wrap_angle(angle_rad: float) -> float:
    """The same angle in (-pi, pi]."""
    wrapped = math.remainder(angle_rad, 2.0 * math.pi)
    return math.pi if wrapped == -math.pi else wrapped


def _rotations() -> Any:
    """scipy's rotations, loaded when first used: a recorded run is explained without them."""
    from scipy.spatial.transform import Rotation

    return Rotation


@dataclass(frozen=True, eq=False)
class Pose:
    """A rigid transform ``target_from_source`` in SE(3): ``p_target = rotation @ p_source + translation``.

    Attributes:
        rotation: (3, 3) proper rotation.
        translation: (3,) [m].
    """

    rotation: NDArray[np.float64]
    translation: NDArray[np.float64]

    def __post_init__(self) -> None:
        object.__setattr__(self, "rotation", frozen(self.rotation, (3, 3)))
        object.__setattr__(self, "translation", frozen(self.translation, (3,)))

    @staticmethod
    def identity() -> Pose:
        return Pose(np.eye(3), np.zeros(3))

    @staticmethod
    def from_rotation_vector(rotation_vector_rad: Any, translation: Any) -> Pose:
        """From an axis-angle vector (3,) [rad] and a translation (3,) [m]."""
        return Pose(_rotations().from_rotvec(np.asarray(rotation_vector_rad, float)).as_matrix(), translation)

    def __matmul__(self, other: Pose) -> Pose:
        return Pose(self.rotation @ other.rotation, self.rotation @ other.translation + self.translation)

    def inverse(self) -> Pose:
        return Pose(self.rotation.T, -self.rotation.T @ self.translation)

    def apply(self, points: Any) -> NDArray[np.float64]:
        """Transform points (..., 3) [m] from the source frame into the target frame."""
        return np.asarray(points, float) @ self.rotation.T + self.translation

    def perturbed(self, rotation_vector_rad: Any, translation: Any) -> Pose:
        """Left perturbation ``exp(w) R, exp(w) T + t``, the increment of §6.2.2's iteration."""
        return Pose.from_rotation_vector(rotation_vector_rad, translation) @ self

    @cached_property
    def rotation_vector(self) -> NDArray[np.float64]:
        """Axis-angle vector (3,) [rad]."""
        return frozen(_rotations().from_matrix(self.rotation).as_rotvec())

    def angle_to(self, other: Pose) -> float:
        """Rotation angle between two poses [rad]."""
        return float(np.linalg.norm(_rotations().from_matrix(self.rotation.T @ other.rotation).as_rotvec()))


@dataclass(frozen=True, slots=True)
class Pose2:
    """A pose on the floor: ``target_from_robot`` in SE(2).

    Attributes:
        x_m, y_m: position of the robot in the target frame [m].
        heading_rad: direction of the robot's x axis, counter-clockwise from the target's x axis [rad].
    """

    x_m: float
    y_m: float
    heading_rad: float

    def __post_init__(self) -> None:
        if not type(self.x_m) is type(self.y_m) is type(self.heading_rad) is float:  # most are made of floats
            for name in ("x_m", "y_m", "heading_rad"):
                object.__setattr__(self, name, float(getattr(self, name)))

    @property
    def position(self) -> NDArray[np.float64]:
        """(2,) [m]."""
        return np.array([self.x_m, self.y_m])

    @property
    def vector(self) -> NDArray[np.float64]:
        """(3,) x [m], y [m], heading [rad]."""
        return np.array([self.x_m, self.y_m, self.heading_rad])

    def minus(self, other: Pose2) -> NDArray[np.float64]:
        """(3,) this vector less another's, the heading by the shorter way round."""
        return np.array([self.x_m - other.x_m, self.y_m - other.y_m, wrap_angle(self.heading_rad - other.heading_rad)])

    def __matmul__(self, other: Pose2) -> Pose2:
        c, s = math.cos(self.heading_rad), math.sin(self.heading_rad)
        return Pose2(
            self.x_m + c * other.x_m - s * other.y_m,
            self.y_m + s * other.x_m + c * other.y_m,
            wrap_angle(self.heading_rad + other.heading_rad),
        )

    def apply(self, points: Any) -> NDArray[np.float64]:
        """Transform points (..., 2) [m] from the robot's frame into the target frame."""
        c, s = math.cos(self.heading_rad), math.sin(self.heading_rad)
        turned: NDArray[np.float64] = np.asarray(points, float) @ np.array([[c, s], [-s, c]])
        return turned + self.position

    def inverse(self) -> Pose2:
        c, s = math.cos(self.heading_rad), math.sin(self.heading_rad)
        return Pose2(-c * self.x_m - s * self.y_m, s * self.x_m - c * self.y_m, wrap_angle(-self.heading_rad))

    def lifted(self, z_m: float = 0.0) -> Pose:
        """The same pose in SE(3), standing on the plane z = ``z_m``."""
        c, s = math.cos(self.heading_rad), math.sin(self.heading_rad)
        rotation = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
        return Pose(rotation, np.array([self.x_m, self.y_m, z_m]))

    def distance_to(self, other: Pose2) -> float:
        """Distance on the floor [m]."""
        return math.hypot(self.x_m - other.x_m, self.y_m - other.y_m)


def flattened(pose: Pose) -> Pose2:
    """The floor pose of an SE(3) pose whose z axis is up; tilt is dropped."""
    r, t = pose.rotation, pose.translation
    return Pose2(float(t[0]), float(t[1]), math.atan2(r[1, 0], r[0, 0]))
