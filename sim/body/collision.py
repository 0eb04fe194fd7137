"""Collision of a round robot with everything solid between just above the floor and the robot's top."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from sim.render.mesh import FaceLike
from world_models.frames import Pose2

MIN_HEIGHT_M, MAX_HEIGHT_M = 0.05, 1.3
"""Band above the floor that the robot takes up: carpets are below it, lintels above [m]."""

ROBOT_RADIUS_M = 0.35
"""Of the Denning platform [m]."""


@dataclass(frozen=True, eq=False)
class Obstacles:
    """Everything solid, as segments (n, 2, 2) on the floor plane [m], world frame."""

    segments_world: NDArray[np.float64]

    @staticmethod
    def of_faces(faces: Iterable[FaceLike], floor_m: float = 0.0) -> Obstacles:
        """The outline on the floor of every region's part within the height band: what is drawn is solid."""
        floor = np.array([0.0, 0.0, floor_m])
        polygons = [_cut_to_band(np.asarray(r.polygon_world, float) - floor)
                    for f in faces for r in (*f.front, *f.back)]
        parts = [_floor_edges(polygon) for polygon in polygons if len(polygon) > 1]
        segments = np.concatenate(parts) if parts else np.zeros((0, 2, 2))
        return Obstacles(np.unique(np.round(segments, 6), axis=0))

    def with_faces(self, faces: Sequence[FaceLike], floor_m: float = 0.0) -> Obstacles:
        """These and what is solid of more faces."""
        more = Obstacles.of_faces(faces, floor_m).segments_world
        return Obstacles(np.concatenate([self.segments_world, more])) if len(more) else self

    def clearance_m(self, pose: Pose2, radius_m: float = ROBOT_RADIUS_M) -> float:
        """Distance from the robot's rim to the nearest obstacle; negative where they overlap [m]."""
        if not len(self.segments_world):
            return float("inf")
        gap = self._gaps(pose)
        return float(np.sqrt(np.min(np.einsum("ij,ij->i", gap, gap)))) - radius_m

    def nearest_direction_rad(self, pose: Pose2) -> float:
        """The direction of the nearest obstacle from the robot's heading, counter-clockwise; 0 where there is none."""
        if not len(self.segments_world):
            return 0.0
        gap = self._gaps(pose)
        x, y = -gap[np.argmin(np.einsum("ij,ij->i", gap, gap))]
        return math.remainder(math.atan2(y, x) - pose.heading_rad, math.tau)

    def _gaps(self, pose: Pose2) -> NDArray[np.float64]:
        """(n, 2) from the nearest point of each segment to the robot."""
        start, along, length2 = self._lines
        to_robot = pose.position - start
        t = np.minimum(np.maximum(np.einsum("ij,ij->i", to_robot, along) / length2, 0.0), 1.0)
        return np.asarray(to_robot - t[:, None] * along)

    @cached_property
    def _lines(self) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
        """Starts (n, 2), directions (n, 2) and squared lengths (n,) of the segments."""
        start = np.ascontiguousarray(self.segments_world[:, 0])
        along = self.segments_world[:, 1] - start
        return start, along, np.maximum(np.einsum("ij,ij->i", along, along), 1e-18)

    def blocks(self, before: Pose2, after: Pose2) -> bool:
        """Whether a small step ends in a contact. A step away from what is touched already is free."""
        clearance = self.clearance_m(after)
        return clearance < 0.0 and clearance < self.clearance_m(before)


def _cut_to_band(polygon: NDArray[np.float64]) -> NDArray[np.float64]:
    """The part of a polygon (k, 3) within the height band."""
    for sign, level in ((1.0, MIN_HEIGHT_M), (-1.0, -MAX_HEIGHT_M)):
        polygon = _clip(polygon, sign * polygon[:, 2] - level) if len(polygon) else polygon
    return polygon


def _clip(polygon: NDArray[np.float64], inside: NDArray[np.float64]) -> NDArray[np.float64]:
    """Sutherland-Hodgman clipping: keep where ``inside`` (k,), linear over the polygon, is not negative."""
    if inside.min() >= 0.0 or inside.max() < 0.0:  # as most are
        return polygon if inside[0] >= 0.0 else polygon[:0]
    out = []
    for i in range(len(polygon)):
        j = (i + 1) % len(polygon)
        if inside[i] >= 0:
            out.append(polygon[i])
        if (inside[i] >= 0) != (inside[j] >= 0):
            out.append(polygon[i] + inside[i] / (inside[i] - inside[j]) * (polygon[j] - polygon[i]))
    return np.array(out).reshape(-1, 3)


def _floor_edges(polygon: NDArray[np.float64]) -> NDArray[np.float64]:
    """The edges (k, 2, 2) of a polygon on the floor plane; one segment for an upright polygon."""
    flat = polygon[:, :2]
    spread = flat - flat[0]
    far = spread[np.argmax(np.einsum("ij,ij->i", spread, spread))]
    length = float(np.hypot(far[0], far[1]))
    if length < 1e-9:
        return np.zeros((0, 2, 2))
    direction = far / length
    if np.abs(spread @ np.array([-direction[1], direction[0]])).max() < 1e-6:
        along = spread @ direction
        return np.array([[flat[np.argmin(along)], flat[np.argmax(along)]]])
    return np.stack([flat, np.roll(flat, -1, axis=0)], axis=1)
