"""Real photographs of a corridor: line coverage, and pose recovery from perturbed poses."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from experiments.paper.pose_peer import NOT_INSTALLED, Peer
from experiments.perception.photographs import (
    MAX_ERROR_RAD,
    MAX_ERROR_STEPS,
    Attempt,
    Corridor,
    Perturbation,
    Trial,
    draw_attempt,
    load_corridor,
    run_attempt,
    select_visible,
)
from experiments.perception.rivals import MIN_LINE_LENGTH_PX
from experiments.report import Cell, Claim, Report
from experiments.shared_data import CORRIDOR, describe_absence
from experiments.trials import campaign_folder, judge_rare, judge_share, run_trials
from knowledge_sources.methods.features import find_lines
from knowledge_sources.methods.verification import compute_coverage

Array = NDArray[np.float64]

TITLE = "Real photographs of a corridor: line coverage, and recovery from perturbed poses"
COLUMNS = ("what", "paper's method", "peer", "ours")
COVER_PX, COVER_RAD = 1.5, 0.12
OFFSET_PX = 8.0
"""Sideways shift of the model for coverage by chance."""
MIN_COVERED, MIN_RECOVERED, MAX_FALSE_ACCEPTS = 0.95, 0.95, 0.005
PERTURBATIONS = (
    Perturbation("off by up to 0.5 step and 3 deg", 1.0, True, 100, 2),
    Perturbation("off by 0.5 step and 3 deg", 1.0, False, 50, 1),
    Perturbation("off by 1 step and 6 deg", 2.0, False, 25, 1),
)
"""The first has all claims; the others are harder than required."""
FALSE_ACCEPTS_DRAWN = 3


def run(quick: bool, seed: int, seeds: int | None = None) -> Report:
    """Measure line coverage, then pose recovery; ``seeds`` per frame instead of each test's own."""
    data = load_corridor()
    if data is None:
        return Report(TITLE, COLUMNS, (), (f"Nothing was measured: {describe_absence(CORRIDOR)}.",))
    covered = _measure_coverage(data)
    rows: list[tuple[Cell, ...]] = [
        ("model length covered, edges searched near it", None, covered["given"], covered["focused"]),
        ("model length covered, whole picture", None, covered["given"], covered["whole"]),
        (f"the same, model shifted by {OFFSET_PX:.0f} px (chance)", None, covered["given beside"], covered["beside"]),
    ]
    claims: list[Claim] = [
        ("own segments cover at least 95 % of the model's length", covered["focused"] >= MIN_COVERED)]
    folder = campaign_folder("corridor", seed, quick=quick)
    attempts = [
        Attempt(test, frame, (seed, number, frame, k))
        for number, test in enumerate(PERTURBATIONS) for frame in range(len(data.frames))
        for k in range(seeds or (test.quick_seeds if quick else test.seeds))
    ]
    found = list(zip(attempts, run_trials(run_attempt, attempts, Trial, folder), strict=True))
    for test in PERTURBATIONS:
        trials = [trial for attempt, trial in found if attempt.test == test]
        rows += _rows(test, trials)
        if test.scale <= 1.0:
            recovered = sum(t.recovered for t in trials)
            claims.append((f"{test.name}: at least 95 % are recovered: {recovered} of {len(trials)}",
                           judge_share(recovered, len(trials), MIN_RECOVERED)))
        wrong = sum(t.is_false_accept for t in trials)
        claims.append((f"{test.name}: at most 0.5 % wrong and verified: {wrong} of {len(trials)}",
                       judge_rare(wrong, len(trials), MAX_FALSE_ACCEPTS)))
    _draw(data, found, folder)
    return Report(TITLE, COLUMNS, tuple(rows), _notes(data, seed, folder), tuple(claims))


def _draw(data: Corridor, found: Sequence[tuple[Attempt, Trial]], folder: Path) -> None:
    """Draw each frame's first attempt, and the first that were wrong and verified."""
    for number in range(len(data.frames)):
        first = next(attempt for attempt, _ in found if attempt.frame == number)
        draw_attempt(data, first, folder / f"frame-{number}.png")
    wrong = [attempt for attempt, trial in found if trial.is_false_accept][:FALSE_ACCEPTS_DRAWN]
    for number, attempt in enumerate(wrong):
        draw_attempt(data, attempt, folder / f"false-accept-{number}.png")


def _measure_coverage(data: Corridor) -> dict[str, float]:
    """Share of the visible model length that has segments within 1.5 px, over all frames."""
    shares: dict[str, list[float]] = {name: [] for name in ("focused", "whole", "beside", "given", "given beside")}
    for frame in data.frames:
        model = select_visible(data.model_lines, frame, frame.camera_from_world)[1]
        span = model[:, 1] - model[:, 0]
        across = np.stack([-span[:, 1], span[:, 0]], axis=1) / np.linalg.norm(span, axis=1, keepdims=True)
        beside = model + OFFSET_PX * across[:, None]
        focused = find_lines(frame.image, model).segments_px
        shares["focused"].append(_compute_coverage(model, focused))
        shares["whole"].append(_compute_coverage(model, find_lines(frame.image).segments_px))
        shares["beside"].append(_compute_coverage(beside, focused))
        shares["given"].append(_compute_coverage(model, frame.segments_px))
        shares["given beside"].append(_compute_coverage(beside, frame.segments_px))
    return {name: float(np.mean(values)) for name, values in shares.items()}


def _compute_coverage(model: Array, segments: Array) -> float:
    lengths = np.linalg.norm(model[:, 1] - model[:, 0], axis=1)
    return float(np.sum(compute_coverage(model, segments, COVER_PX, COVER_RAD) * lengths) / np.sum(lengths))


def _rows(test: Perturbation, trials: Sequence[Trial]) -> list[tuple[Cell, ...]]:
    recovered = [t for t in trials if t.recovered]
    theirs = f"{np.mean([t.peer_recovered for t in trials]):.1%}" if Peer.find() else NOT_INSTALLED
    papers = f"{np.mean([t.paper_recovered for t in trials]):.1%}"
    median = tuple(float(np.median([getattr(t, name) for t in trials])) for name in ("shift_steps", "turn_rad"))
    missed = len(trials) - len(recovered)
    known = f"{missed - sum(1 for t in trials if t.is_false_accept)} of {missed}"
    return [
        (f"{test.name}: recovered", papers, theirs, f"{len(recovered) / len(trials):.1%} of {len(trials)}"),
        (f"{test.name}: median error", None, None, f"{median[0]:.4f} step, {math.degrees(median[1]):.3f} deg"),
        (f"{test.name}: recovered and verified", None, None,
         f"{np.mean([t.recovered and t.is_verified for t in trials]):.1%}"),
        (f"{test.name}: failures not verified", None, None, known),
        (f"{test.name}: wrong and verified", None, None, f"{np.mean([t.is_false_accept for t in trials]):.2%}"),
    ]


def _notes(data: Corridor, seed: int, folder: Path) -> tuple[str, ...]:
    return (
        f"{len(data.frames)} frames of the Oxford VGG corridor, {len(data.model_lines)} model lines; a step is"
        f" {data.step:.3f} of the survey's units. Seed {seed}. Directions of shift and turn are uniform on the sphere,"
        " sizes uniform where the row says 'up to'. The reference poses are the publishers', and have errors too.",
        f"Covered: a segment within {COVER_PX} px and {COVER_RAD} rad of a projected model line of"
        f" {MIN_LINE_LENGTH_PX:.0f} px or more, at the reference pose. Peer there: the"
        " publishers' own segments.",
        f"Recovered: within {MAX_ERROR_STEPS} step and {math.degrees(MAX_ERROR_RAD):.1f} degrees. All from our own"
        " segments; the prior's standard deviation per axis is half of 0.5 step and 3 degrees, in every test.",
        "Ours: match in six unknowns, truncated R and T, project again, find edges in 6 px bands, match, Med R and T;"
        " then all of it again from the pose found, which must be confirmed or is replaced by one that explains more."
        " Verified: agreement of the whole picture's segments beyond chance (a contrario), two thirds of the visible"
        " length, and 3 standard deviations of the pose within the bounds.",
        "Chosen on these same frames, with other seeds: the two thirds (at half, a pose 1.5 steps and 9 degrees off was"
        " verified; at the right pose about 80 % are covered); that the residuals scale the covariance (with the"
        " assumed noise, right poses were not testable); that a pose must be confirmed (without, one of 150 in the"
        " hardest test was wrong and verified).",
        "Paper's method: §6 once through, rigid 2D match at 30 px and 0.3 rad, Med R and T. Peer for poses: PoseLib's"
        " LO-RANSAC on our pairs; it gives no verdict. Wrong and verified: not recovered, but verified.",
        f"Pictures of the model over the photographs: {folder}/frame-*.png.",
    )
