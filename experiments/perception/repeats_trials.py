"""One case of repeated structure: our answer with and without a search for rivals, and an exhaustive search."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from experiments.perception.locate_camera import RIVAL_MIN_LEAD, CameraFix, PoseVerdict, locate_camera
from experiments.perception.repeats_scenes import CAMERA, MAX_PITCHES, RepeatScene, draw_scene, to_line_segments
from experiments.perception.rivals import (
    CAMERA_MIN_LINE_LENGTH_PX,
    RIVAL_REACH_SIGMAS,
    compute_pose_score,
    measure_apart,
    refine_near,
)
from knowledge_sources.methods.matching.pose_pairs import build_camera_parameters
from world_models.frames import Pose

Array = NDArray[np.float64]

TOLERANCE_PITCHES, TOLERANCE_RAD = 0.25, 0.03
"""A pose further off is wrong."""
GRID_PITCHES = 0.5
CHANCE = 0.2
"""That a line is found at a wrong pose, for the exhaustive search."""


@dataclass(frozen=True, slots=True)
class Case:
    """A structure and the seed of its picture and prior."""

    kind: str
    seed: int


@dataclass(frozen=True, slots=True)
class CaseResult:
    """What was said of a case.

    Attributes:
        verdict, is_right: with the search; verdict_before, was_right: without it.
        names_rival: whether a verdict other than "verified" names a rival.
        is_unique: whether an exhaustive search finds no other pose that explains comparably much.
        lead: by how much the right pose leads the best other one of the exhaustive search, in log likelihood.
    """

    verdict: str
    is_right: bool
    names_rival: bool
    reason: str
    verdict_before: str
    was_right: bool
    is_unique: bool
    lead: float

    @property
    def is_silently_wrong(self) -> bool:
        """Wrong, and verified."""
        return self.verdict == PoseVerdict.VERIFIED.value and not self.is_right

    @property
    def was_silently_wrong(self) -> bool:
        """The same without the search."""
        return self.verdict_before == PoseVerdict.VERIFIED.value and not self.was_right


def run_case(case: Case) -> CaseResult:
    """Locate the camera with and without the search for rivals, and search exhaustively."""
    scene = draw_scene(case.kind, case.seed)
    (fix, is_right), (before, was_right) = locate(scene), locate(scene, with_rivals=False)
    lead = search_exhaustively(scene)
    nothing = PoseVerdict.NOT_TESTABLE.value
    return CaseResult(
        verdict=nothing if fix is None else fix.verdict.value, is_right=is_right,
        names_rival=fix is not None and fix.rival is not None, reason="no match" if fix is None else fix.reason,
        verdict_before=nothing if before is None else before.verdict.value, was_right=was_right,
        is_unique=lead >= RIVAL_MIN_LEAD, lead=lead)


def locate(scene: RepeatScene, *, with_rivals: bool = True) -> tuple[CameraFix | None, bool]:
    """Our answer, and whether it is right."""
    tolerance_m = TOLERANCE_PITCHES * scene.pitch
    fix = locate_camera(
        scene.model, None, CAMERA, scene.prior, scene.covariance, tolerance_m=tolerance_m, tolerance_rad=TOLERANCE_RAD,
        rng=np.random.default_rng(0), segments=to_line_segments(scene.segments_px), with_rivals=with_rivals)
    if fix is None:
        return None, False
    shift, turn = measure_apart(scene.truth, fix.camera_from_world)
    return fix, shift <= tolerance_m and turn <= TOLERANCE_RAD


def search_exhaustively(scene: RepeatScene) -> float:
    """By how much the right pose leads any other, started from a grid about it: half a pitch, within the prior."""
    parameters = build_camera_parameters(scene.prior, scene.covariance)
    reach, step = RIVAL_REACH_SIGMAS, GRID_PITCHES * scene.pitch

    def refine(pose: Pose) -> tuple[Pose, float]:
        there = refine_near(scene.model, scene.segments_px, CAMERA, parameters, pose)
        return there, _score(scene, there)

    own = refine(scene.truth)[1]
    count = round(MAX_PITCHES / GRID_PITCHES)
    axis = step * np.arange(-count, count + 1)
    grid = np.stack(np.meshgrid(axis, axis, axis, indexing="ij"), axis=-1).reshape(-1, 3)
    best = -np.inf
    for away in grid[np.linalg.norm(grid, axis=1) <= MAX_PITCHES * scene.pitch]:
        start = Pose(scene.truth.rotation, scene.truth.translation - scene.truth.rotation @ away)
        unknowns = parameters.compute_step(start)
        if unknowns @ parameters.information @ unknowns > reach**2 or _score(scene, start) < 0.0:
            continue
        there, score = refine(start)
        shift, turn = measure_apart(scene.truth, there)
        if shift > 2.0 * TOLERANCE_PITCHES * scene.pitch or turn > 2.0 * TOLERANCE_RAD:
            best = max(best, score)
    return float(own - best)


def _score(scene: RepeatScene, pose: Pose) -> float:
    projected, visible = CAMERA.project_segments(scene.model, pose)
    short = np.linalg.norm(projected[:, 1] - projected[:, 0], axis=1) < CAMERA_MIN_LINE_LENGTH_PX
    projected[~visible | short] = np.nan
    return compute_pose_score(projected, scene.segments_px, CHANCE).log_likelihood
