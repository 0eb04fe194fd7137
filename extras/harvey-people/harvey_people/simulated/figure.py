"""A figure: a person of six boxes with clothes, whose legs and arms swing as the person walks."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from sim.body.collision import MAX_HEIGHT_M, MIN_HEIGHT_M
from world_models.building.geometry.faces import Face, Finish, build_region
from world_models.building.geometry.solids import SIDES, Box
from world_models.frames import Pose2

Floats = NDArray[np.float64]
HIP_M, SHOULDER_M = 0.86, 1.42
"""Heights of a person of 1.72 m about which legs and arms swing."""
STANDARD_M = 1.72
STRIDE_M, STRIDE_S = 0.50, 0.60
"""Two steps are so long, and longer by the second at each metre a second: 1.2 m at 1.2 m/s."""
ARM_SWING = 0.6
"""An arm swings by this part of a leg's swing."""
SKIN, HAIR = (0.72, 0.56, 0.46), (0.20, 0.14, 0.10)
COATS = ((0.55, 0.12, 0.14), (0.14, 0.22, 0.45), (0.20, 0.36, 0.22), (0.78, 0.76, 0.70), (0.16, 0.16, 0.18),
         (0.62, 0.46, 0.18))
TROUSERS = ((0.14, 0.15, 0.20), (0.24, 0.28, 0.38), (0.40, 0.34, 0.26), (0.30, 0.30, 0.31))


@dataclass(frozen=True, eq=False)
class Figure:
    """A person's body: x ahead, y to the left, z up [m].

    Attributes:
        name: as contacts tell it, "people/anna".
        locale: to which its faces belong.
        boxes: left leg, right leg, trunk, left arm, right arm, head.
        pivots_m: height about which each swings.
        swings: of each, relative to the left leg's swing.
    """

    name: str
    locale: str
    boxes: tuple[Box, ...]
    pivots_m: tuple[float, ...]
    swings: tuple[float, ...] = (1.0, -1.0, 0.0, -ARM_SWING, ARM_SWING, 0.0)

    @staticmethod
    def draw(name: str, locale: str, rng: np.random.Generator) -> Figure:
        """A person of some height in some clothes."""
        scale = float(np.clip(rng.normal(1.0, 0.045), 0.9, 1.12))
        coat = Finish(COATS[int(rng.integers(len(COATS)))], "carpet" if rng.random() < 0.5 else "plain", 0.04)
        trousers = Finish(TROUSERS[int(rng.integers(len(TROUSERS)))])

        def box(x: float, y0: float, y1: float, z0: float, z1: float, finish: Finish) -> Box:
            return Box((-x * scale, x * scale), (y0 * scale, y1 * scale), (z0 * scale, z1 * scale), finish)

        legs = [box(0.09, y - 0.075, y + 0.075, 0.0, HIP_M, trousers) for y in (0.095, -0.095)]
        arms = [box(0.055, y - 0.05, y + 0.05, 0.78, SHOULDER_M, coat) for y in (0.25, -0.25)]
        trunk = box(0.12, -0.19, 0.19, HIP_M - 0.06, 1.46, coat)
        head = box(0.10, -0.08, 0.08, 1.47, STANDARD_M, Finish(SKIN if rng.random() < 0.7 else HAIR))
        hip, shoulder = HIP_M * scale, SHOULDER_M * scale
        return Figure(name, locale, (*legs, trunk, *arms, head), (hip, hip, 0.0, shoulder, shoulder, 0.0))

    def corners(self, pose: Pose2, walked_m: float, speed_m_per_s: float) -> Floats:
        """(6, 6, 4, 3) the corners of each side of each box, in the world over the floor [m].

        Args:
            walked_m: how far the person has come: where in the stride.
        """
        swing = self.swing_rad(walked_m, speed_m_per_s)
        turned = [_swing(sides, part * swing, pivot)
                  for sides, part, pivot in zip(self._sides, self.swings, self.pivots_m, strict=True)]
        points = np.stack(turned)
        points[..., 2] -= points[:2, ..., 2].min()  # the lower foot is on the floor
        c, s = math.cos(pose.heading_rad), math.sin(pose.heading_rad)
        points[..., :2] = points[..., :2] @ np.array([[c, s], [-s, c]]) + pose.position
        return points

    @cached_property
    def _sides(self) -> list[Floats]:
        """(6, 4, 3) of each box, upright."""
        return [np.stack([box.side(side) for side in SIDES]) for box in self.boxes]

    def swing_rad(self, walked_m: float, speed_m_per_s: float) -> float:
        """The left leg's angle ahead of upright, so that the foot on the floor stays where it is."""
        stride_m = STRIDE_M + STRIDE_S * speed_m_per_s
        reach = min(0.6, stride_m / 4.0 / self.pivots_m[0]) if speed_m_per_s > 0.0 else 0.0
        return math.asin(reach * 2.0 / math.pi * math.asin(math.sin(math.tau * walked_m / stride_m)))

    def faces(self, corners: Floats, floor_m: float) -> tuple[Face, ...]:
        """What is drawn of it on the floor of this height [m]."""
        found = []
        for number, box in enumerate(self.boxes):
            for side, (axis, end) in enumerate(SIDES):
                name = f"{self.name}/{number}/{'xyz'[axis]}{'-+'[end]}"
                polygon = corners[number, side] + (0.0, 0.0, floor_m)
                found.append(Face(name, self.locale, polygon, front=(build_region(name, polygon, box.finish),)))
        return tuple(found)


def outline(corners: Floats, heading_rad: float) -> Floats:
    """(n, 2, 2) what is solid of a figure: for each box that is as high as a robot its rectangle on the floor."""
    ahead = np.array([math.cos(heading_rad), math.sin(heading_rad)])
    axes = np.stack([ahead, [-ahead[1], ahead[0]]], axis=1)
    boxes = corners.reshape(len(corners), -1, 3)
    solid = boxes[(boxes[..., 2].min(axis=1) < MAX_HEIGHT_M) & (boxes[..., 2].max(axis=1) > MIN_HEIGHT_M)]
    own = solid[..., :2] @ axes
    (x0, y0), (x1, y1) = own.min(axis=1).T, own.max(axis=1).T
    ring = np.array([[x0, y0], [x1, y0], [x1, y1], [x0, y1]]).transpose(2, 0, 1)
    segments = np.stack([ring, np.roll(ring, -1, axis=1)], axis=2).reshape(-1, 2, 2)
    return np.asarray(segments @ axes.T)


def _swing(sides: Floats, angle_rad: float, pivot_m: float) -> Floats:
    """Sides (6, 4, 3) turned about the level line across at a height; positive brings what is below ahead."""
    c, s = math.cos(angle_rad), math.sin(angle_rad)
    x, up = sides[..., 0], sides[..., 2] - pivot_m
    return np.stack([c * x - s * up, sides[..., 1], s * x + c * up + pivot_m], axis=-1)
