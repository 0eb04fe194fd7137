"""What the robot can run into: everything solid of the building between just above the floor and the robot's top."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sim.render.mesh import FaceLike
from world_models.frames import Pose2

LOW_M, HIGH_M = 0.05, 1.3
"""Only what reaches into this band above the floor is in the way (carpets and lintels are not)."""

ROBOT_RADIUS_M = 0.35
"""The Denning platform's."""


@dataclass(frozen=True, eq=False)
class Obstacles:
    """Everything solid, as segments (n, 2, 2) on the floor [m, world]."""

    segments_world: NDArray[np.float64]

    @staticmethod
    def of_faces(faces: Iterable[FaceLike], floor_m: float = 0.0) -> Obstacles:
        """What is drawn is what is solid: the outline on the floor of each region's part within the band above it."""
        floor = np.array([0.0, 0.0, floor_m])
        polygons = [_within_band(np.asarray(r.polygon_world, float) - floor)
                    for f in faces for r in (*f.front, *f.back)]
        parts = [_outline(polygon) for polygon in polygons if len(polygon) > 1]
        segments = np.concatenate(parts) if parts else np.zeros((0, 2, 2))
        return Obstacles(np.unique(np.round(segments, 6), axis=0))

    def clearance_m(self, pose: Pose2, radius_m: float = ROBOT_RADIUS_M) -> float:
        """Room between the robot's rim and the nearest obstacle; negative when they overlap [m]."""
        if not len(self.segments_world):
            return float("inf")
        start = self.segments_world[:, 0]
        along = self.segments_world[:, 1] - start
        length2 = np.maximum(np.einsum("ij,ij->i", along, along), 1e-18)
        to_robot = pose.position - start
        t = np.clip(np.einsum("ij,ij->i", to_robot, along) / length2, 0.0, 1.0)
        gap = to_robot - t[:, None] * along
        return float(np.sqrt(np.min(np.einsum("ij,ij->i", gap, gap)))) - radius_m

    def blocks(self, before: Pose2, after: Pose2) -> bool:
        """Whether a small step runs into something; a step away from what is touched is free."""
        room = self.clearance_m(after)
        return room < 0.0 and room < self.clearance_m(before)


def _within_band(polygon: NDArray[np.float64]) -> NDArray[np.float64]:
    """The part of a polygon (k, 3) between the band's heights."""
    for sign, level in ((1.0, LOW_M), (-1.0, -HIGH_M)):
        polygon = _cut(polygon, sign * polygon[:, 2] - level) if len(polygon) else polygon
    return polygon


def _cut(polygon: NDArray[np.float64], inside: NDArray[np.float64]) -> NDArray[np.float64]:
    """Sutherland-Hodgman: keep where ``inside`` (k,), linear over the polygon, is not negative."""
    out = []
    for i in range(len(polygon)):
        j = (i + 1) % len(polygon)
        if inside[i] >= 0:
            out.append(polygon[i])
        if (inside[i] >= 0) != (inside[j] >= 0):
            out.append(polygon[i] + inside[i] / (inside[i] - inside[j]) * (polygon[j] - polygon[i]))
    return np.array(out).reshape(-1, 3)


def _outline(polygon: NDArray[np.float64]) -> NDArray[np.float64]:
    """The edges (k, 2, 2) on the floor; one segment for an upright polygon."""
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
