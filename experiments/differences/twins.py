"""Missions on floors of identical rooms: does it use what it was told, and notice where that is wrong?

The robot is told the room at the start, right with probability 0.98. Otherwise it is put down in another room that
looks the same, at the same place of it.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

import numpy as np

from experiments.bounds import at_least, at_most
from experiments.differences.twins_trial import TwinResult, TwinTrial, run_twin_mission
from experiments.report import Cell, Report
from experiments.trials import RESULTS, campaign_folder, run_trials

MISSIONS, QUICK_MISSIONS = 3_000, 4
FIRST_SEED, SEEDS_APART = 1_000_000, 10_000
"""Seeds below 100,000 are for development: constants were chosen on some of them."""
P_TOLD_RIGHT = 0.98
MIN_REACHED, MIN_NOTICED, MAX_WRONG = 0.99, 0.90, 0.001
WORST_SHOWN = 6
COLUMNS = ("told", "paper", "peer", "missions", "reached", "proves at least", "noticed", "wrong and confident",
           "proves at most", "believed by odds", "relocated", "robot's mean s", "mean CPU s")


def run(quick: bool, seed: int, missions: int | None = None) -> Report:
    """Drive so many missions, of seeds 1,000,000 + 10,000 ``seed`` + 0, 1, ....; the small version one told wrong."""
    number = missions or (QUICK_MISSIONS if quick else MISSIONS)
    first = FIRST_SEED + SEEDS_APART * seed
    trials = [TwinTrial(first + k, _is_told_right(first + k) if not quick else k > 0) for k in range(number)]
    folder = campaign_folder(f"twins-{missions}" if missions else "twins", seed, quick=quick)
    ends = run_trials(run_twin_mission, trials, TwinResult, folder, "mission")
    right = [end for end in ends if end.is_told_right]
    wrong = [end for end in ends if not end.is_told_right]
    report = Report(
        "Missions on floors of 5 to 40 identical rooms", COLUMNS,
        tuple(_row(name, e) for name, e in (("right", right), ("wrong", wrong)) if e),
        notes=(
            f"Seeds {first} to {first + number - 1}; no constant was chosen on them. Bounds are one-sided, of 95 %, by"
            " Clopper and Pearson.",
            "reached: the goal, and in truth. noticed: it doubted its place, and does not end as reached elsewhere."
            " wrong and confident: it ends as reached, and is elsewhere. believed by odds: times that a place was"
            " believed by what was told or tracked, of several that look alike.",
            "Paper and peers have no such missions: the paper's robot always knows where it begins.",
            *_worst("told right, missions to look at", [e for e in right if not e.is_right]),
            *_worst("told wrong, missions to look at", [e for e in wrong if not e.is_noticed]),
            f"One line per mission: {folder / RESULTS}",
        ),
        claims=tuple(_claims(right, wrong, quick=quick)),
    )
    (folder / "table.txt").write_text(report.text() + "\n", encoding="utf-8")
    return report


def _is_told_right(seed: int) -> bool:
    return bool(np.random.default_rng([seed, 11]).random() < P_TOLD_RIGHT)


def _row(name: str, ends: Sequence[TwinResult]) -> tuple[Cell, ...]:
    reached, wrong = sum(e.is_right for e in ends), sum(e.is_wrong for e in ends)
    return (
        name, None, None, len(ends), reached, f"{at_least(reached, len(ends)):.1%}", sum(e.is_noticed for e in ends),
        wrong, f"{at_most(wrong, len(ends)):.2%}", sum(e.by_odds for e in ends), sum(e.relocations for e in ends),
        math.fsum(e.robot_s for e in ends) / len(ends), math.fsum(e.wall_s for e in ends) / len(ends),
    )


def _claims(right: Sequence[TwinResult], wrong: Sequence[TwinResult], *, quick: bool) -> Iterator[tuple[str, bool]]:
    if right:
        reached = sum(e.is_right for e in right)
        yield (f"told right: at least {MIN_REACHED:.0%} reach: {reached} of {len(right)}, so at least"
               f" {at_least(reached, len(right)):.1%}", reached >= MIN_REACHED * len(right))
    if wrong and not quick:
        noticed = sum(e.is_noticed for e in wrong)
        yield (f"told wrong: at least {MIN_NOTICED:.0%} notice: {noticed} of {len(wrong)}, so at least"
               f" {at_least(noticed, len(wrong)):.1%}", noticed >= MIN_NOTICED * len(wrong))
    ends = [*right, *wrong]
    confident = sum(e.is_wrong for e in ends)
    yield (f"wrong and confident: at most {MAX_WRONG:.1%}: {confident} of {len(ends)}, so at most"
           f" {at_most(confident, len(ends)):.2%}", confident <= MAX_WRONG * len(ends))


def _worst(what: str, ends: Sequence[TwinResult]) -> list[str]:
    """Name the missions to look at."""
    told = "; ".join(f"{e.seed} ({e.rooms} rooms, {e.outcome}: {e.reason})" for e in ends[:WORST_SHOWN])
    return [f"{what}: {told}"] if told else []
