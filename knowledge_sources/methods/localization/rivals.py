"""Rivals of a pose: other poses within the whole prior that explain a picture comparably well.

Looked for are the poses to which motions lead that map the model onto itself (:mod:`self_motions`), each refined by the
segments there. One search serves a camera with six unknowns and a robot on the floor.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from knowledge_sources.methods.arrays import Floats, Indices
from knowledge_sources.methods.localization.self_motions import find_self_motions, is_within_prior
from knowledge_sources.methods.matching.pose_parameters import PoseParameters
from knowledge_sources.methods.matching.pose_starts import refine_pose
from knowledge_sources.methods.verification.pose_score import PoseScore, compute_pose_score
from knowledge_sources.settings import DEFAULT, Settings
from world_models.camera import Camera
from world_models.frames import Pose

LinesAt = Callable[[Pose], Floats]
"""Gives the model lines (m, 2, 3) [m, world] that are visible from a pose."""


@dataclass(frozen=True, slots=True, eq=False)
class Rival:
    """Another pose that explains the picture.

    Attributes:
        camera_from_world: the pose.
        lead: log likelihood ratio of the pose in question to this one; negative where this one is better.
        shift_m, turn_rad: how far the camera is away, and turned.
        shared: number of lines that agree at both poses; own: at the pose in question only.
    """

    camera_from_world: Pose
    lead: float
    shift_m: float
    turn_rad: float
    shared: int
    own: int

    def sentence(self) -> str:
        """The rival in words."""
        away = f"{100.0 * self.shift_m:.0f} cm and {np.degrees(self.turn_rad):.1f} deg away"
        return f"a pose {away} explains {self.shared} of the same lines; {self.own} agree here only"


def find_rivals(
    lines_at: LinesAt, segments_px: Floats, camera: Camera, parameters: PoseParameters, pose: Pose, chance: float, *,
    same_m: float, same_rad: float, settings: Settings = DEFAULT,
) -> list[Rival]:
    """Find poses within the prior, distinct from ``pose``, to which a self-motion of the model leads; best first.

    Args:
        segments_px: (k, 2, 2) of the whole picture.
        parameters: the prior and its unknowns.
        chance: probability that a line is found at a wrong pose.
        same_m, same_rad: poses nearer than both are the same.
    """
    tuning, lines = settings.localization, lines_at(pose)
    motions = find_self_motions(lines, camera, pose, parameters, settings)
    if not motions:
        return []
    own = _score(lines, segments_px, camera, pose, chance, settings)
    scored = [(_score(lines_at(other), segments_px, camera, other, chance, settings).log_likelihood, number, other)
              for number, (other, _) in enumerate(motions)]
    found: list[Rival] = []
    for _, _, other in sorted(scored, key=lambda s: (-s[0], s[1]))[: tuning.rival_max_refined]:
        there = refine_near(lines_at(other), segments_px, camera, parameters, other, settings)
        shift, turn = measure_apart(pose, there)
        is_same = shift <= same_m and turn <= same_rad
        if is_same or not is_within_prior(parameters, there, tuning.rival_reach_sigmas):
            continue
        score = _score(lines_at(there), segments_px, camera, there, chance, settings)
        both, only = _compare(own, score, lines, lines_at(there), settings)
        found.append(Rival(there, own.log_likelihood - score.log_likelihood, shift, turn, both, only))
    return sorted(found, key=lambda rival: rival.lead)


def refine_near(
    lines_world: Floats, segments_px: Floats, camera: Camera, parameters: PoseParameters, pose: Pose,
    settings: Settings = DEFAULT,
) -> Pose:
    """The pose near ``pose`` at which lines (m, 2, 3) fit segments (k, 2, 2): reweighted least squares."""
    widths = settings.localization.rival_widths_px
    return refine_pose(lines_world, segments_px, camera, parameters, pose, widths, settings.matching)


def measure_apart(pose: Pose, other: Pose) -> tuple[float, float]:
    """How far two cameras are apart [m], and turned [rad]."""
    shift = float(np.linalg.norm(pose.inverse().translation - other.inverse().translation))
    return shift, pose.angle_to(other)


def _score(
    lines: Floats, segments_px: Floats, camera: Camera, pose: Pose, chance: float, settings: Settings
) -> PoseScore:
    projected, visible = camera.project_segments(lines, pose)
    short = np.linalg.norm(projected[:, 1] - projected[:, 0], axis=1) < settings.localization.camera_min_line_length_px
    projected[~visible | short] = np.nan
    return compute_pose_score(projected, segments_px, chance, settings.verification)


def _compare(own: PoseScore, other: PoseScore, lines: Floats, there: Floats, settings: Settings) -> tuple[int, int]:
    """Numbers of lines that agree at both poses, and at the first only."""
    least = settings.verification.min_covered_fraction
    at_own, at_other = _count_groups(own, least), _count_groups(other, least)
    if lines.shape == there.shape and np.array_equal(lines, there):
        agree = (np.nan_to_num(own.coverage) >= least, np.nan_to_num(other.coverage) >= least)
        both = len(np.unique(own.groups[agree[0] & agree[1]]))
        return both, at_own - both
    return min(at_own, at_other), max(at_own - at_other, 0)


def _count_groups(score: PoseScore, least: float) -> int:
    groups: Indices = score.groups[np.nan_to_num(score.coverage) >= least]
    return len(np.unique(groups))
