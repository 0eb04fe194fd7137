"""Structures that repeat themselves: is a pose one repetition off ever verified, and how many right ones are?"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from experiments.perception.locate_camera import (
    CAMERA_MAX_P_FALSE,
    CAMERA_MIN_COVERAGE,
    CameraFix,
    CameraSearch,
    PoseVerdict,
    locate_camera,
)
from experiments.perception.repeats_scenes import CAMERA, KINDS, MAX_PITCHES, RepeatScene, draw_scene, to_line_segments
from experiments.perception.rivals import find_self_motions
from experiments.report import Cell, Claim, Report
from experiments.trials import RESULTS, at_least, at_most, campaign_folder, judge_rare, judge_share, run_trials
from knowledge_sources.methods.matching import build_camera_parameters
from world_models.frames import Pose

TOLERANCE_PITCHES, TOLERANCE_RAD = 0.25, 0.03
"""A pose further off is wrong."""
GRID_PITCHES, GRID_REACH, GRID_RAD = 0.5, 2.0, 0.01
"""Step and reach of the exhaustive search in pitches, and by how much a start may be turned."""


@dataclass(frozen=True, slots=True)
class Case:
    """A structure and the seed of its picture and prior."""

    kind: str
    seed: int


@dataclass(frozen=True, slots=True)
class CaseResult:
    """What was said of a case.

    Attributes:
        is_right: whether the pose is, whatever the verdict.
        is_unique: whether the picture shows enough, and an exhaustive search finds no pose that explains as much.
        lead, needed: of the pose found, where a rival was.
    """

    verdict: str
    is_right: bool
    is_unique: bool
    reason: str
    lead: float | None
    needed: float | None

    @property
    def is_silently_wrong(self) -> bool:
        """Wrong, and verified."""
        return self.verdict == PoseVerdict.VERIFIED.value and not self.is_right

    @property
    def is_verified(self) -> bool:
        """Right, and verified."""
        return self.verdict == PoseVerdict.VERIFIED.value and self.is_right


def run_case(case: Case) -> CaseResult:
    """Locate the camera, and search exhaustively."""
    scene = draw_scene(case.kind, case.seed)
    fix, is_right = locate(scene)
    if fix is None:
        return CaseResult(PoseVerdict.NOT_TESTABLE.value, False, is_unique(scene), "no match", None, None)
    lead, needed = (None, None) if fix.rival is None else (fix.rival.lead, fix.rival.needed)
    return CaseResult(fix.verdict.value, is_right, is_unique(scene), fix.reason, lead, needed)


def locate(scene: RepeatScene) -> tuple[CameraFix | None, bool]:
    """Our answer, and whether it is right."""
    tolerance_m = TOLERANCE_PITCHES * scene.pitch
    fix = locate_camera(
        scene.model, None, CAMERA, scene.prior, scene.covariance, tolerance_m=tolerance_m, tolerance_rad=TOLERANCE_RAD,
        rng=np.random.default_rng(0), segments=to_line_segments(scene.segments_px))
    return fix, fix is not None and _build_search(scene).is_same(fix.camera_from_world, scene.truth)


def is_unique(scene: RepeatScene) -> bool:
    """Whether the true pose is told from every other on a grid about it, half a pitch wide, to two pitches."""
    search = _build_search(scene)
    agreement, coverage = search.measure_agreement(scene.truth)
    if coverage < CAMERA_MIN_COVERAGE or agreement.p_false > CAMERA_MAX_P_FALSE / CLEAR_CHANCE:
        return False
    axis = scene.pitch * np.arange(-GRID_REACH, GRID_REACH + GRID_PITCHES, GRID_PITCHES)
    grid = np.stack(np.meshgrid(axis, axis, axis, indexing="ij"), axis=-1).reshape(-1, 3)
    sizes = np.linalg.norm(grid, axis=1) / scene.pitch
    away = grid[(sizes <= GRID_REACH) & (sizes > GRID_PITCHES)]
    starts = [Pose(scene.truth.rotation, scene.truth.translation - scene.truth.rotation @ by) for by in away]
    starts += find_self_motions(scene.model, CAMERA, scene.truth)[0]  # what a grid of shifts alone does not reach
    spread = np.diag(np.repeat([GRID_RAD, GRID_PITCHES / 2.0 * scene.pitch], 3) ** 2)
    rivals = search.find_rivals(scene.truth, agreement.chance, starts, spread)
    return not rivals or rivals[0].lead >= CLEAR * rivals[0].needed


def _build_search(scene: RepeatScene) -> CameraSearch:
    return CameraSearch(
        build_camera_parameters(scene.prior, scene.covariance), scene.model, None, CAMERA, scene.covariance,
        scene.segments_px, TOLERANCE_PITCHES * scene.pitch, TOLERANCE_RAD, np.random.default_rng(0))


CLEAR, CLEAR_CHANCE = 1.25, 10.0
"""By how many times what is asked of a verified pose the true one leads, and is less by chance, to be called unique."""
TITLE = "Structures that repeat themselves: poses verified rightly and wrongly"
COLUMNS = ("structures", "cases", "wrong and verified", "unique", "of these verified", "verified", "not testable",
           "refuted though right")
FIRST_SEED = 100_000
"""Seeds below are free for choosing constants."""
FULL, QUICK = 4000, 16
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
    unique = [r for r in found if r.is_unique]
    return (
        name, len(found), sum(r.is_silently_wrong for r in found), len(unique),
        sum(r.is_verified for r in unique), sum(r.is_verified for r in found),
        sum(r.verdict == PoseVerdict.NOT_TESTABLE.value for r in found),
        sum(_is_refuted_though_right(r) for r in found))


def _claims(found: Sequence[CaseResult], *, quick: bool) -> tuple[Claim, ...]:
    """What must hold; few cases cannot show how many unique ones are verified."""
    wrong, unique = sum(r.is_silently_wrong for r in found), [r for r in found if r.is_unique]
    refuted, verified = sum(_is_refuted_though_right(r) for r in found), sum(r.is_verified for r in unique)
    claims: list[Claim] = [
        (f"silently wrong at most 0.1%: {wrong} of {len(found)}, with 95 % confidence below"
         f" {at_most(wrong, len(found)):.2%}", judge_rare(wrong, len(found), MAX_WRONG)),
        (f"no right pose is refuted: {refuted} of {len(found)}", judge_rare(refuted, len(found), 0.0))]
    if not quick and unique:
        claims.append((f"of the unique ones at least 98% are verified: {verified} of {len(unique)}, with 95 %"
                       f" confidence above {at_least(verified, len(unique)):.1%}",
                       judge_share(verified, len(unique), MIN_VERIFIED)))
    return tuple(claims)


def _notes(seed: int, results: str) -> tuple[str, ...]:
    return (
        "Stairs, shelves, colonnades, window fronts, tiled floors and rows of doors with pitches of 0.25 to 3 m, with"
        " up to six rectangles on them that do not repeat, as lines; 8 % of the lines are missed, the others are in one"
        " to three pieces with 0.3 px of noise, among up to 120 segments of clutter. The prior is off by up to"
        f" {MAX_PITCHES:.0f} pitches. Flights are like photographs: 10 to 40 % missed, steps hidden, the model has a"
        " part of the flight or more than is seen and is wrong by a part in 250, the prior is off by up to two stairs,"
        " whatever it says (0.1 m to 1.5 stairs). Boxes have nine edges, and do not repeat."
        f" Seeds from {FIRST_SEED * (seed + 1)} on; constants were chosen on seeds below {FIRST_SEED}. No pictures are"
        " rendered.",
        f"Wrong: more than {TOLERANCE_PITCHES} pitches off.",
        "Unique: two thirds of the model's length are found at the true pose, by chance at most a"
        f" {CLEAR_CHANCE:g}th as often as is asked, and it leads every other pose of a grid of half a pitch, to two"
        f" pitches, and of the model's own repetition, each refined, by {CLEAR:g} times what is asked of one."
        " It shares the likelihood with ours; the grid it does not.",
        f"One line per case: {results}",
    )


def _is_refuted_though_right(result: CaseResult) -> bool:
    return result.verdict == PoseVerdict.REFUTED.value and result.is_right
