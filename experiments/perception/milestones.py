"""The milestone judge on right and wrong places: false accepts, false rejects, and whether its probability is true."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from itertools import pairwise
from pathlib import Path

import numpy as np

from experiments.perception.milestones_cases import (
    KINDS,
    MAX_HIDDEN_SHARE,
    MIN_DIFFERENCE,
    MISSING_SHARE,
    ROOMS,
)
from experiments.perception.milestones_trials import (
    BLOCK,
    MARGIN_M,
    JudgedCase,
    Trial,
    TrialResult,
    judge_trial,
)
from experiments.report import Cell, Claim, Report
from experiments.trials import campaign_folder, judge_rare, run_trials
from knowledge_sources.methods.verification import POSE_CONFIDENCE

FLOORS, EACH = 25, 210
QUICK_FLOORS, QUICK_EACH = 1, 30
"""Each floor is painted as the model says, and textured as it does not."""
FIRST_FLOOR = 10_000
"""Floors with smaller numbers are for calibration."""
MAX_FALSE_ACCEPTS, MAX_FALSE_REJECTS, MAX_CALIBRATION_ERROR = 0.001, 0.01, 0.02
BINS = (0.0, 1e-4, 1e-3, 3e-3, 1e-2, 3e-2, 0.1, 0.3, 0.7, 0.9, 0.99, 1.0)
WORST_SHOWN = 8
COLUMNS = ("places", "cases", "verified", "refuted", "not testable", "false accepts", "median p of wrong", "paper")
Bin = tuple[float, float, float, float, int]
"""Bin of the stated probability: mean stated, share that was wrong, its 95 % interval, cases."""


def run(quick: bool, seed: int) -> Report:
    """Judge cases on floors ``10000 + 100 seed`` and following."""
    folder = campaign_folder("milestones", seed, quick=quick)
    judged = judge_floors(FIRST_FLOOR + 100 * seed, *((QUICK_FLOORS, QUICK_EACH) if quick else (FLOORS, EACH)), folder)
    counted = [j for j in judged if not j.is_same]
    right, wrong = [j for j in counted if j.kind == "right"], [j for j in counted if j.kind != "right"]
    bins = compute_reliability(counted)
    report = Report(
        "The milestone judge on generated floors", COLUMNS, tuple(_rows(judged, right, wrong)),
        notes=(
            *_notes(judged, counted, folder), *_compare_scores(right, wrong),
            *(f"stated {mean:.4g}: {found:.4g} were wrong (95 % interval {low:.4g} to {high:.4g}), {n} cases"
              for mean, found, low, high, n in bins),
            *(f"worst: floor {j.floor} case {j.number} ({j.kind}): {j.verdict}, p_false {j.p_false:.2g}; {j.reason}"
              for j in _worst(counted)),
        ),
        claims=_claims(right, wrong, bins, quick),
    )
    (folder / "table.txt").write_text(report.text() + "\n", encoding="utf-8")
    return report


def judge_floors(first_floor: int, floors: int, each: int, folder: Path) -> list[JudgedCase]:
    """Judge the cases of some floors, painted and textured, in order; those that the folder has are kept."""
    trials = [Trial(first_floor + k, first, min(BLOCK, each - first), is_textured)
              for is_textured in (False, True) for k in range(floors) for first in range(0, each, BLOCK)]
    results = run_trials(judge_trial, trials, TrialResult, folder, "block")
    return [JudgedCase(**table) for block in results for table in block.judged]


def _rows(
    judged: Sequence[JudgedCase], right: Sequence[JudgedCase], wrong: Sequence[JudgedCase]
) -> list[tuple[Cell, ...]]:
    sure = [j for j in right if not j.doubted]
    conditions: tuple[tuple[str, Callable[[JudgedCase], bool]], ...] = (
        ("  clutter only", lambda j: not (j.hidden or j.missing or j.light)),
        ("  part of the view hidden", lambda j: j.hidden > 0.0),
        ("  light changed", lambda j: j.light != 0.0),
        ("  parts of the model missing", lambda j: j.missing > 0.0),
        ("  painted as the model says", lambda j: not j.textured),
        ("  textured, and nothing said of it", lambda j: j.textured),
    )
    same = [j for j in judged if j.is_same]
    return [
        _row("right", sure),
        *(_row(name, [j for j in sure if holds(j)]) for name, holds in conditions),
        *(_row(kind, [j for j in wrong if j.kind == kind and not j.doubted]) for kind in KINDS[1:]),
        _row("right, alias as likely", [j for j in right if j.doubted]),
        _row("wrong, alias as likely", [j for j in wrong if j.doubted]),
        _row("indistinguishable, alias as likely", [j for j in same if j.doubted]),
        _row("indistinguishable, no alias", [j for j in same if not j.doubted]),
    ]


def _row(name: str, judged: Sequence[JudgedCase]) -> tuple[Cell, ...]:
    counts = [sum(j.verdict == verdict for j in judged) for verdict in ("verified", "refuted", "not testable")]
    return (name, len(judged), *counts, sum(is_false_accept(j) for j in judged),
            float(np.median([j.p_false for j in judged])) if judged else None, None)


def is_false_accept(judged: JudgedCase) -> bool:
    """Whether a wrong pose was verified."""
    return judged.verdict == "verified" and judged.is_wrong


def compute_reliability(judged: Sequence[JudgedCase]) -> list[Bin]:
    """Compute (mean stated, share wrong, interval, cases) of each bin of the stated probability.

    Right and wrong places have the same total weight; the interval is Wilson's, with the effective number of cases.
    """
    p, wrong = np.array([j.p_false for j in judged]), np.array([j.is_wrong for j in judged])
    weight = np.where(wrong, 0.5 / max(1, wrong.sum()), 0.5 / max(1, (~wrong).sum()))
    out = []
    for low, high in pairwise(BINS):
        here = (p >= low) & ((p < high) | (high == 1.0))
        if here.any():
            w = weight[here]
            share, n = float(np.sum(w[wrong[here]]) / w.sum()), float(w.sum() ** 2 / np.sum(w**2))
            mid, half = _wilson(share, n)
            out.append((float(np.average(p[here], weights=w)), share, max(0.0, mid - half), min(1.0, mid + half),
                        int(here.sum())))
    return out


def _wilson(share: float, n: float, z: float = 1.96) -> tuple[float, float]:
    spread = 1.0 + z * z / n
    return ((share + z * z / (2 * n)) / spread,
            z / spread * math.sqrt(share * (1.0 - share) / n + z * z / (4 * n * n)))


def compute_calibration_error(bins: Sequence[Bin]) -> float:
    """Compute the mean difference of stated and found probability, weighted by the number of cases."""
    total = sum(n for *_, n in bins)
    return math.fsum(n * abs(stated - found) for stated, found, _, _, n in bins) / max(1, total)


def _claims(
    right: Sequence[JudgedCase], wrong: Sequence[JudgedCase], bins: Sequence[Bin], quick: bool
) -> tuple[Claim, ...]:
    accepts, rejects = sum(map(is_false_accept, wrong)), sum(j.verdict == "refuted" for j in right)
    fewest = MAX_FALSE_REJECTS * len(right)
    claims: list[Claim] = [
        (f"false accepts at most {MAX_FALSE_ACCEPTS:.1%}: {accepts} of {len(wrong)}",
         judge_rare(accepts, len(wrong), MAX_FALSE_ACCEPTS)),
        (f"false rejects at most {MAX_FALSE_REJECTS:.0%}: {rejects} of {len(right)}",
         rejects <= (max(fewest, 2.0) if quick else fewest)),
    ]
    if not quick:
        error = compute_calibration_error(bins)
        claims.append((f"stated and found probability differ by {error:.2%} on average, at most"
                       f" {MAX_CALIBRATION_ERROR:.0%}",
                       error <= MAX_CALIBRATION_ERROR))
        claims.append((f"at least 10,000 cases: {len(right) + len(wrong)}", len(right) + len(wrong) >= 10_000))
    return tuple(claims)


def _notes(judged: Sequence[JudgedCase], counted: Sequence[JudgedCase], folder: Path) -> list[str]:
    floors = sorted({j.floor for j in judged})
    return [
        f"Floors {floors[0]} to {floors[-1]} of {ROOMS} rooms (experiments/generated/floors.py); every fifth is"
        " symmetric, every fifth has identical doors. Half of the cases are in buildings with bricks, tiles, planks and"
        " the like on walls, floors and ceilings, of which the model says as little as of colours. None was used for"
        " calibration.",
        "right: the true pose is drawn from the covariance of the believed one; the wrong places have the same"
        " covariance. Every building has clutter that the model lacks, every second one lacks"
        f" {MISSING_SHARE:.0%} of the model's things; up to {MAX_HIDDEN_SHARE:.0%} of the view is hidden in 3 of 10"
        " cases, and in 5 of 10 the light differs (gain 0.35 to 1.5, colour by 12 %, 30 % across the frame).",
        f"A pose is wrong if its error exceeds 3 of its standard deviations plus {MARGIN_M:.2f} m or 0.6 degrees. A"
        " false accept is a wrong pose verified, a false reject a right place refuted; not testable is neither.",
        "alias as likely: in a symmetric corridor the mirrored place is as likely (it is a second hypothesis on the"
        " board), and the judge must not verify.",
        f"indistinguishable: from the wrong place the bare model differs in less than {MIN_DIFFERENCE:.0%} of the"
        " frame. These count in no rate: only the robot's past speaks against them.",
        f"{len(counted)} cases count. Verified up to p_false {POSE_CONFIDENCE.accept:.3g}, refuted from"
        f" {POSE_CONFIDENCE.refute:.3g}; p_false assumes that half of the places are wrong. It was fitted by harvey"
        " experiment milestones-calibrate.",
        f"Every case and this table: {folder}",
    ]


def _worst(judged: Sequence[JudgedCase]) -> list[JudgedCase]:
    """Select false accepts, then wrong places with the smallest p_false, then right places refuted."""
    wrong = sorted((j for j in judged if j.is_wrong), key=lambda j: (not is_false_accept(j), j.p_false))
    refuted = sorted((j for j in judged if j.kind == "right" and j.verdict == "refuted"), key=lambda j: -j.p_false)
    return [*wrong[: WORST_SHOWN // 2], *refuted[: WORST_SHOWN // 2]]


def _compare_scores(right: Sequence[JudgedCase], wrong: Sequence[JudgedCase]) -> Iterator[str]:
    """How well thresholds on the stated probability and on the covariance tell right places from wrong ones."""
    scores: tuple[tuple[str, Callable[[JudgedCase], float]], ...] = (
        ("probability", lambda j: j.p_false), ("covariance", lambda j: j.sigma_m))
    for name, score in scores:
        good, bad = (np.sort([score(j) for j in group if not j.doubted and (j.kind == "right") != j.is_wrong])
                     for group in (right, wrong))
        if not (len(good) and len(bad)):
            continue
        accepted = np.searchsorted(bad, good, side="right") / len(bad)
        part = np.arange(1, len(good) + 1) / len(good)
        most = float(np.max(part[accepted <= MAX_FALSE_ACCEPTS], initial=0.0))
        yield (f"threshold on the {name}: {most:.1%} of the right places are accepted where at most"
               f" {MAX_FALSE_ACCEPTS:.1%} of the wrong ones are; area under the curve {1.0 - np.mean(accepted):.4f}")
