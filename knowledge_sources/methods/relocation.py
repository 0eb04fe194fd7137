"""Where could the robot be? Poses of a region that explain the segments of one picture, each refined and verified."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from knowledge_sources.methods.chamfer import ChamferMaps, chamfer_maps, chamfer_score, sample_lines
from knowledge_sources.methods.lines import SIGMA_ACROSS_PX
from knowledge_sources.methods.matching_floor import match_on_floor
from knowledge_sources.methods.pose import planar_from_lines
from knowledge_sources.methods.verification import Verification, verify
from world_models.camera import Camera
from world_models.frames import Pose2, wrap_angle
from world_models.robot import RobotModel
from world_models.visibility import visible_lines

Floats = NDArray[np.float64]
STEP_M = 0.25
STEP_RAD = math.radians(2.5)
LOOK_ROUND_M = 0.5
"""What is visible is computed on a grid of this and taken over for the poses around."""
WIDE = Camera.from_field_of_view(math.radians(125.0), 512, 512)
APART_M, APART_RAD = 0.3, math.radians(6.0)
"""Candidates nearer to each other than this are one."""
FINALISTS = 8
ROUNDS = (
    np.diag([0.2**2, 0.2**2, math.radians(4.0) ** 2]),
    np.diag([0.03**2, 0.03**2, math.radians(0.5) ** 2]),
)
"""How far off a candidate may be before each of the two rounds of matching that refine it: covariances (3, 3)."""


@dataclass(frozen=True, slots=True, eq=False)
class Candidate:
    """A pose that may be the robot's, and the evidence for it."""

    world_from_robot: Pose2
    covariance: Floats
    evidence: Verification


@dataclass(frozen=True, slots=True)
class Region:
    """Where to look.

    Attributes:
        locale: the room.
        centre: of the search; radius_m, turn_rad: how far from it.
    """

    locale: str
    centre: Pose2
    radius_m: float
    turn_rad: float


def candidates(robot: RobotModel, segments_px: Floats, region: Region) -> tuple[Candidate, ...]:
    """Verified poses of a region, the best first, distinct from each other."""
    maps = chamfer_maps(segments_px, robot.camera.width, robot.camera.height)
    refined = [c for pose in _finalists(robot, maps, region) if (c := _refined(robot, segments_px, pose)) is not None]
    refined.sort(key=lambda c: (-c.evidence.agreement.accounted * c.evidence.coverage))
    return tuple(_distinct(refined))


def _finalists(robot: RobotModel, maps: ChamferMaps, region: Region) -> list[Pose2]:
    scored = sorted(_scored(robot, maps, region), key=lambda s: -s[0])
    chosen: list[Pose2] = []
    for _, pose in scored:
        if all(_are_apart(pose, other) for other in chosen):
            chosen.append(pose)
            if len(chosen) == FINALISTS:
                break
    return chosen


def _scored(robot: RobotModel, maps: ChamferMaps, region: Region) -> Iterator[tuple[float, Pose2]]:
    seen: dict[tuple[int, int], tuple[Floats, Floats]] = {}
    turns = np.arange(-math.floor(region.turn_rad / STEP_RAD), math.floor(region.turn_rad / STEP_RAD) + 1) * STEP_RAD
    for x, y in _places(robot, region):
        cell = (round(x / LOOK_ROUND_M), round(y / LOOK_ROUND_M))
        if cell not in seen:
            seen[cell] = sample_lines(_lines_round(robot, x, y))
        for turn in turns:
            pose = Pose2(x, y, wrap_angle(region.centre.heading_rad + float(turn)))
            yield chamfer_score(maps, robot.camera, robot.camera_from_world(pose), *seen[cell]), pose


def _places(robot: RobotModel, region: Region) -> Iterator[tuple[float, float]]:
    """Points of a grid in the region that lie in its room."""
    room = robot.world.locale(region.locale)
    locale_from_world = robot.world.world_from_locale(region.locale).inverse()
    n = math.floor(region.radius_m / STEP_M)
    for i in range(-n, n + 1):
        for j in range(-n, n + 1):
            x, y = region.centre.x_m + i * STEP_M, region.centre.y_m + j * STEP_M
            own = locale_from_world.apply([x, y, 0.0])[:2]
            if math.hypot(i * STEP_M, j * STEP_M) <= region.radius_m and room.contains(own, -0.2):
                yield x, y


def _lines_round(robot: RobotModel, x: float, y: float) -> Floats:
    """Model lines (n, 2, 3) visible from a place in any direction."""
    pieces = [
        visible_lines(
            robot.world, WIDE, robot.camera_from_world(Pose2(x, y, k * 2.0 * math.pi / 3.0)), min_length_px=5.0,
            min_contrast=0.05, max_distance_m=15.0,
        ).lines_world
        for k in range(3)
    ]
    return np.concatenate(pieces)


def _refined(robot: RobotModel, segments_px: Floats, pose: Pose2) -> Candidate | None:
    """Match, solve, and again from nearer; None where the picture does not bear it out, or the model shows nothing."""
    covariance = ROUNDS[0]
    for spread in ROUNDS:
        lines = visible_lines(robot.world, robot.camera, robot.camera_from_world(pose), min_length_px=12.0,
                              min_contrast=0.05, max_distance_m=15.0)
        if not len(lines.lines_world):
            return None
        found = match_on_floor(
            lines.lines_world, segments_px, robot.camera, robot.mount.camera_from_robot, pose, spread
        )
        if len(found.pairs) < 3:
            return None
        model, data = found.pairs[:, 0], found.pairs[:, 1]
        fix = planar_from_lines(
            lines.lines_world[model], segments_px[data], robot.camera, robot.mount.camera_from_robot,
            found.world_from_robot, prior_covariance=ROUNDS[0], landmark_ids=list(lines.landmark[model]),
            sigma_px=SIGMA_ACROSS_PX,
        )
        pose, covariance = fix.world_from_robot, np.asarray(fix.covariance)
    lines = visible_lines(robot.world, robot.camera, robot.camera_from_world(pose), min_length_px=12.0,
                          min_contrast=0.05, max_distance_m=15.0)
    evidence = verify(robot, lines.lines_world, segments_px, pose)
    return Candidate(pose, covariance, evidence) if evidence.holds else None


def _distinct(ranked: Sequence[Candidate]) -> Iterator[Candidate]:
    kept: list[Candidate] = []
    for candidate in ranked:
        if all(_are_apart(candidate.world_from_robot, k.world_from_robot) for k in kept):
            kept.append(candidate)
            yield candidate


def _are_apart(a: Pose2, b: Pose2) -> bool:
    return a.distance_to(b) > APART_M or abs(wrap_angle(a.heading_rad - b.heading_rad)) > APART_RAD
