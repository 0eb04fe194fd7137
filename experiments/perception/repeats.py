"""Structures that repeat themselves: is a pose one repetition off ever verified, and how many right ones are?"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from experiments.perception.locate_camera import RIVAL_MIN_LEAD, CameraFix, PoseVerdict, locate_camera
from experiments.perception.repeats_scenes import CAMERA, KINDS, MAX_PITCHES, RepeatScene, draw_scene, to_line_segments
from experiments.perception.rivals import (
    CAMERA_MIN_LINE_LENGTH_PX,
    RIVAL_REACH_SIGMAS,
    compute_pose_score,
    measure_apart,
    refine_near,
)
from experiments.report import Cell, Report
from experiments.trials import RESULTS, at_least, at_most, campaign_folder, run_trials
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


TITLE = "Structures that repeat themselves: poses verified rightly and wrongly"
COLUMNS = ("structures", "cases", "wrong, no search", "wrong, ours", "unique", "verified of unique", "not testable",
           "of these name a rival", "refuted though right")
FIRST_SEED = 100_000
"""Seeds below are free for choosing constants."""
FULL, QUICK = 5000, 12
MAX_WRONG, MIN_VERIFIED = 1e-3, 0.98


def run(quick: bool, seed: int, missions: int | None = None) -> Report:
    """Draw cases of each kind in turn; ``missions``: how many cases."""
    count = missions or (QUICK if quick else FULL)
    kinds = list(KINDS)
    cases = [Case(kinds[n % len(kinds)], FIRST_SEED * (seed + 1) + n) for n in range(count)]
    folder = campaign_folder("repeats", seed, quick=quick)
    found = run_trials(run_case, cases, CaseResult, folder, "case")
    rows = [_row(kind, [r for c, r in zip(cases, found, strict=True) if c.kind == kind]) for kind in kinds]
    return Report(TITLE, COLUMNS, (*rows, _row("all", found)), _notes(seed, f"{folder}/{RESULTS}"),
                  _claims(found, quick=quick))


def _row(name: str, found: Sequence[CaseResult]) -> tuple[Cell, ...]:
    unique, untestable = [r for r in found if r.is_unique], [r for r in found if _is(r, PoseVerdict.NOT_TESTABLE)]
    return (
        name, len(found), _count(r.was_silently_wrong for r in found), _count(r.is_silently_wrong for r in found),
        len(unique), _count(_is_verified(r) for r in unique), len(untestable),
        _count(r.names_rival for r in untestable),
        _count(_is(r, PoseVerdict.REFUTED) and r.is_right for r in found))


def _claims(found: Sequence[CaseResult], *, quick: bool) -> tuple[tuple[str, bool], ...]:
    """What must hold; few cases cannot show how many unique ones are verified."""
    wrong, unique = _count(r.is_silently_wrong for r in found), [r for r in found if r.is_unique]
    verified = _count(_is_verified(r) for r in unique)
    claims = [(f"silently wrong at most 0.1%: {wrong} of {len(found)}, with 95 % confidence below"
               f" {at_most(wrong, len(found)):.2%}", wrong <= MAX_WRONG * len(found))]
    if not quick and unique:
        claims.append((f"of the unique ones at least 98% are verified: {verified} of {len(unique)}, with 95 %"
                       f" confidence above {at_least(verified, len(unique)):.1%}",
                       verified >= MIN_VERIFIED * len(unique)))
    return tuple(claims)


def _notes(seed: int, results: str) -> tuple[str, ...]:
    return (
        "Stairs, shelves, colonnades, window fronts, tiled floors and rows of doors with pitches of 0.25 to 3 m, with"
        " up to six rectangles on them that do not repeat, as lines; 8 % of the lines are missed, the others are in one"
        " to three pieces with 0.3 px of noise, among up to 120 segments of clutter. The prior is off by up to"
        f" {MAX_PITCHES:.0f} pitches. Seeds from {FIRST_SEED * (seed + 1)} on; constants were chosen on seeds below"
        f" {FIRST_SEED}. No pictures are rendered.",
        f"Wrong: verified, and more than {TOLERANCE_PITCHES} pitches off. No search: the same without a search for"
        " rivals, as it was before.",
        f"Unique: no other pose on a grid of half a pitch, each refined, comes within"
        f" {RIVAL_MIN_LEAD:g} of the true pose's log likelihood. It shares the likelihood with"
        " ours, not the search.",
        f"One line per case: {results}",
    )


def _is_verified(result: CaseResult) -> bool:
    return _is(result, PoseVerdict.VERIFIED) and result.is_right


def _is(result: CaseResult, verdict: PoseVerdict) -> bool:
    return result.verdict == verdict.value


def _count(held: Iterable[bool]) -> int:
    return sum(1 for h in held if h)
