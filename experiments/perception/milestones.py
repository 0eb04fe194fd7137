"""Milestones by the thousand: does the judge verify right places, refute wrong ones, and know how sure it may be?"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from itertools import pairwise
from pathlib import Path

import numpy as np

from experiments.chart import OURS, PAPER, PEER, chart
from experiments.perception.milestones_cases import GONE, KINDS, MOST_HIDDEN, ROOMS, SAME, cases, site
from experiments.perception.milestones_picture import draw_case
from experiments.perception.milestones_trials import BLOCK, FLOOR_M, Judged, Trial, judge_trial
from experiments.perception.milestones_trials import Found as FoundCases
from experiments.report import Cell, Report
from experiments.trials import campaign_folder, run_trials
from knowledge_sources.methods.verification.pose_confidence import POSE_CONFIDENCE

FLOORS, EACH = 25, 420
QUICK_FLOORS, QUICK_EACH = 1, 45
FIRST_FLOOR = 10_000
"""Floors with smaller numbers are for calibration."""
MOST_FALSE_ACCEPTS, MOST_FALSE_REJECTS, MOST_OFF = 0.001, 0.01, 0.02
BINS = (0.0, 1e-4, 1e-3, 3e-3, 1e-2, 3e-2, 0.1, 0.3, 0.7, 0.9, 0.99, 1.0)
WORST = 8
COLUMNS = ("places", "cases", "verified", "refuted", "not testable", "wrong accepts", "p of wrong: median", "paper")
Bin = tuple[float, float, float, float, int]
"""Of the stated probability: mean stated, part found wrong, from and to (95 %), cases."""


def run(quick: bool, seed: int) -> Report:
    """Floors ``10000 + 100 seed`` and following."""
    folder = campaign_folder("milestones", seed, quick=quick)
    judged = judged_on(FIRST_FLOOR + 100 * seed, *((QUICK_FLOORS, QUICK_EACH) if quick else (FLOORS, EACH)), folder)
    told = [j for j in judged if not j.is_same]
    right, wrong = [j for j in told if j.kind == "right"], [j for j in told if j.kind != "right"]
    bins = reliability(told)
    _draw_reliability(bins, folder / "reliability.png")
    rates = _draw_roc(right, wrong, folder / "roc.png")
    worst = _worst(told)
    for j in worst:
        _draw_worst(j, folder / "worst")
    report = Report(
        "Milestones on floors that nobody drew", COLUMNS, tuple(_rows(judged, right, wrong)),
        notes=(
            *_notes(judged, told, folder), *rates,
            *(f"stated {mean:.4g}: {found:.4g} were wrong ({low:.4g} to {high:.4g} with 95 %), {n} cases"
              for mean, found, low, high, n in bins),
            *(f"worst: floor {j.floor} case {j.number} ({j.kind}): {j.verdict}, p_false {j.p_false:.2g}; {j.reason}"
              for j in worst),
        ),
        claims=_claims(right, wrong, bins, quick),
    )
    (folder / "table.txt").write_text(report.text() + "\n", encoding="utf-8")
    return report


def judged_on(first_floor: int, floors: int, each: int, folder: Path) -> list[Judged]:
    """Every case of so many floors, in order; what the folder has already is not done again."""
    trials = [Trial(first_floor + k, first, min(BLOCK, each - first))
              for k in range(floors) for first in range(0, each, BLOCK)]
    found = run_trials(judge_trial, trials, FoundCases, folder, "block")
    return [Judged(**table) for block in found for table in block.judged]


def _rows(judged: Sequence[Judged], right: Sequence[Judged], wrong: Sequence[Judged]) -> list[tuple[Cell, ...]]:
    sure = [j for j in right if not j.doubted]
    conditions: tuple[tuple[str, Callable[[Judged], bool]], ...] = (
        ("  nothing but clutter", lambda j: not (j.hidden or j.gone or j.light)),
        ("  part of the view hidden", lambda j: j.hidden > 0.0),
        ("  light changed", lambda j: j.light != 0.0),
        ("  model parts missing", lambda j: j.gone > 0.0),
    )
    same = [j for j in judged if j.is_same]
    return [
        _row("right", sure),
        *(_row(name, [j for j in sure if holds(j)]) for name, holds in conditions),
        *(_row(kind, [j for j in wrong if j.kind == kind and not j.doubted]) for kind in KINDS[1:]),
        _row("right, the twin place as likely", [j for j in right if j.doubted]),
        _row("wrong, the twin place as likely", [j for j in wrong if j.doubted]),
        _row("nobody could tell, but as likely", [j for j in same if j.doubted]),
        _row("nobody could tell, and not doubted", [j for j in same if not j.doubted]),
    ]


def _row(name: str, judged: Sequence[Judged]) -> tuple[Cell, ...]:
    counts = [sum(j.verdict == verdict for j in judged) for verdict in ("verified", "refuted", "not testable")]
    return (name, len(judged), *counts, sum(is_false_accept(j) for j in judged),
            float(np.median([j.p_false for j in judged])) if judged else None, None)


def is_false_accept(judged: Judged) -> bool:
    """Verified, with a pose that is wrong."""
    return judged.verdict == "verified" and judged.is_wrong


def reliability(judged: Sequence[Judged]) -> list[Bin]:
    """(mean stated, found, from, to, cases) of each bin of the stated probability.

    Right and wrong places count the same in all; the interval is Wilson's, on as many cases as the weights leave.
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


def calibration_error(bins: Sequence[Bin]) -> float:
    """Mean distance of what was stated and what was found, by the number of cases."""
    total = sum(n for *_, n in bins)
    return math.fsum(n * abs(stated - found) for stated, found, _, _, n in bins) / max(1, total)


def _claims(
    right: Sequence[Judged], wrong: Sequence[Judged], bins: Sequence[Bin], quick: bool
) -> tuple[tuple[str, bool], ...]:
    accepts, rejects = sum(map(is_false_accept, wrong)), sum(j.verdict == "refuted" for j in right)
    most = max(MOST_FALSE_ACCEPTS * len(wrong), 0.5)
    fewest = MOST_FALSE_REJECTS * len(right)
    claims = [
        (f"false accepts at most {MOST_FALSE_ACCEPTS:.1%}: {accepts} of {len(wrong)}", accepts <= most),
        (f"false rejects at most {MOST_FALSE_REJECTS:.0%}: {rejects} of {len(right)}",
         rejects <= (max(fewest, 2.0) if quick else fewest)),
    ]
    if not quick:
        error = calibration_error(bins)
        claims.append((f"what is stated and what was found differ by {error:.2%} on average, at most {MOST_OFF:.0%}",
                       error <= MOST_OFF))
        claims.append((f"at least 10,000 cases: {len(right) + len(wrong)}", len(right) + len(wrong) >= 10_000))
    return tuple(claims)


def _notes(judged: Sequence[Judged], told: Sequence[Judged], folder: Path) -> list[str]:
    floors = sorted({j.floor for j in judged})
    return [
        f"Floors {floors[0]} to {floors[-1]} of {ROOMS} rooms (sim/made_up/generated_floors.py); every fifth is"
        " symmetric, every fifth has identical doors. None served for calibration.",
        "right: the robot is where the wheels may have left it after a leg, drawn from the covariance that it holds;"
        " the wrong places have the same spread about them. Every building has clutter that the model lacks, every"
        f" second one has lost {GONE:.0%} of the model's things; up to {MOST_HIDDEN:.0%} of the view is hidden in 3 of"
        " 10 cases, and in 5 of 10 the light differs (gain 0.35 to 1.5, colour by 12 %, 30 % across the picture).",
        f"A pose is wrong beyond 3 of its own deviations and {FLOOR_M:.2f} m or 0.6 degrees more. A wrong accept is a"
        " wrong pose verified, a false reject a right place refuted; not testable is neither, and has its column.",
        "the twin place as likely: in a symmetric corridor the robot holds the place across its middle for as likely"
        " (another hypothesis is on the board), and must not verify.",
        f"nobody could tell: the bare model looks otherwise in less than {SAME:.0%} of the picture from the wrong"
        " place. These count in no rate: only where the robot was before speaks against them.",
        f"{len(told)} cases count. Verified up to p_false {POSE_CONFIDENCE.accept:.3g}, refuted from"
        f" {POSE_CONFIDENCE.refute:.3g}; p_false holds where half of the places are wrong. It was fitted by harvey"
        " experiment milestones-calibrate.",
        f"Pictures, every case and this table: {folder}",
    ]


def _worst(judged: Sequence[Judged]) -> list[Judged]:
    """Wrong accepts, then the wrong place that convinced most, then right places refuted."""
    wrong = sorted((j for j in judged if j.is_wrong), key=lambda j: (not is_false_accept(j), j.p_false))
    refuted = sorted((j for j in judged if j.kind == "right" and j.verdict == "refuted"), key=lambda j: -j.p_false)
    return [*wrong[: WORST // 2], *refuted[: WORST // 2]]


def _draw_worst(judged: Judged, folder: Path) -> None:
    robot = site(judged.floor).robot
    case = next(iter(cases(judged.floor, judged.number, 1)))
    draw_case(robot, case, folder / f"floor-{judged.floor}-case-{judged.number}.png")


def _draw_reliability(bins: Sequence[Bin], path: Path) -> None:
    with chart(path, "Is the stated probability true?", "stated probability that the pose is wrong",
               "part that was wrong") as axes:
        stated, found, low, high, n = (np.array(column) for column in zip(*bins, strict=True))
        shown = np.maximum(found, 1e-5)
        axes.errorbar(np.maximum(stated, 1e-5), shown, yerr=[shown - np.maximum(np.minimum(low, shown), 1e-5),
                      np.maximum(high, shown) - shown], fmt="o", color=OURS, label="judge, 95 % interval", capsize=3)
        for x, y, count in zip(stated, shown, n, strict=True):
            axes.annotate(f"{count}", (max(x, 1e-5), y), textcoords="offset points", xytext=(6, -10), fontsize=7)
        axes.plot([1e-5, 1.0], [1e-5, 1.0], color=PAPER, linestyle="--", label="true")
        axes.set_xscale("log")
        axes.set_yscale("log")


def _draw_roc(right: Sequence[Judged], wrong: Sequence[Judged], path: Path) -> list[str]:
    """The judge beside a threshold on the covariance, over the same cases; what each accepts at the wanted rate."""
    lines = []
    with chart(path, "Accepting right places and wrong ones", "wrong places accepted", "right places accepted") as axes:
        scores: tuple[tuple[str, str, Callable[[Judged], float]], ...] = (
            ("probability", OURS, lambda j: j.p_false), ("covariance", PEER, lambda j: j.sigma_m))
        for name, colour, score in scores:
            good, bad = (np.sort([score(j) for j in group if not j.doubted and (j.kind == "right") != j.is_wrong])
                         for group in (right, wrong))
            if not (len(good) and len(bad)):
                continue
            x = np.searchsorted(bad, good, side="right") / len(bad)
            y = np.arange(1, len(good) + 1) / len(good)
            axes.step(np.maximum(x, 1e-4), y, where="post", color=colour, label=f"threshold on the {name}")
            at = float(np.max(y[x <= MOST_FALSE_ACCEPTS], initial=0.0))
            area = 1.0 - float(np.mean(x))
            lines.append(f"threshold on the {name}: {at:.1%} of the right places are accepted where at most"
                         f" {MOST_FALSE_ACCEPTS:.1%} of the wrong ones are; area under the curve {area:.4f}")
        axes.set_xscale("log")
    return lines
