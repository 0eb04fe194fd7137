"""What the three levels of perceptual servoing do (Figure 2): missions with each of them switched off.

Three claims of the paper's §2 and §5 are put to the test: with all levels every mission arrives; without the action
level the robot ends further off, or not at all; a robot that is carried away needs the goal level.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Sequence
from typing import TYPE_CHECKING

from experiments.report import Cell, Report
from harvey.campaign.campaign import Task, run_all
from harvey.campaign.progress import counted
from harvey.units import INCH_M

if TYPE_CHECKING:
    from harvey.simulation.referee import MissionResult

SCENARIOS = ("lab-to-allens-office", "hallway-kidnap")
LEVELS: tuple[tuple[str, tuple[str, ...]], ...] = (
    ("all on", ()),
    ("action off", ("action",)),
    ("plan off", ("plan",)),
    ("goal off", ("goal",)),
    ("all off", ("action", "plan", "goal")),
)
SEEDS, QUICK_SEEDS = 20, 2
COLUMNS = ("scenario", "levels", "reached", "<= 1 inch", "otherwise", "mean mm", "max mm", "strayed mm",
           "collisions", "wrong", "replans", "relocated")


def run(quick: bool, seed: int) -> Report:
    """Every scenario with every setting, over seeds ``seed``, ``seed + 1``, ..."""
    seeds = range(seed, seed + (QUICK_SEEDS if quick else SEEDS))
    tasks = [task for scenario in SCENARIOS for _, off in LEVELS for task in _tasks(scenario, off, seeds)]
    results = dict(counted(run_all(tasks), len(tasks), sys.stderr))
    rows = [_row(scenario, name, [results[task] for task in _tasks(scenario, off, seeds)])
            for scenario in SCENARIOS for name, off in LEVELS]
    return Report(
        "Missions with levels of perceptual servoing switched off", COLUMNS, tuple(rows),
        notes=(
            f"{len(seeds)} missions a row, seeds {seeds[0]} to {seeds[-1]}; errors are true distances from the goal.",
            "strayed: the furthest that any robot truly was from the line of the leg that it was driving.",
            "wrong: milestones that were accepted while the robot was elsewhere.",
            "The same seed has the same noise in every row. The paper gives no figures for whole missions.",
        ),
        claims=_claims(results, seeds),
    )


def _tasks(scenario: str, off: Sequence[str], seeds: Sequence[int]) -> list[Task]:
    settings = tuple((f"servo.{level}", "off") for level in off)
    return [Task(scenario, settings, seed) for seed in seeds]


def _row(scenario: str, name: str, results: Sequence[MissionResult]) -> tuple[Cell, ...]:
    errors_m = [r.final_error_m for r in results]
    others = sorted({r.outcome for r in results} - {"reached"})
    reached = [r for r in results if r.outcome == "reached"]
    return (
        scenario, name, len(reached), sum(1 for r in reached if r.final_error_m <= INCH_M),
        ", ".join(f"{sum(1 for r in results if r.outcome == kind)} {kind}" for kind in others) or None,
        1000.0 * math.fsum(errors_m) / len(errors_m), 1000.0 * max(errors_m),
        1000.0 * max(r.max_cross_track_m for r in results),
        sum(r.collisions for r in results), sum(r.milestones["false_accepts"] for r in results),
        sum(r.replans for r in results), sum(r.relocalizations for r in results),
    )


def _claims(results: dict[Task, MissionResult], seeds: Sequence[int]) -> tuple[tuple[str, bool], ...]:
    def good(scenario: str, off: Sequence[str]) -> int:
        """Missions that arrived within an inch."""
        done = (results[task] for task in _tasks(scenario, off, seeds))
        return sum(1 for r in done if r.outcome == "reached" and r.final_error_m <= INCH_M)

    def worst(scenario: str, off: Sequence[str], what: str) -> float:
        return max(float(getattr(results[task], what)) for task in _tasks(scenario, off, seeds))

    claims = [(f"{s}: with all levels on, every mission arrives within an inch", good(s, ()) == len(seeds))
              for s in SCENARIOS]
    claims += [(f"{s}: with all levels off fewer do", good(s, LEVELS[-1][1]) < good(s, ())) for s in SCENARIOS]
    claims += [(f"{s}: without the goal level fewer do", good(s, ("goal",)) < good(s, ())) for s in SCENARIOS]
    main = SCENARIOS[0]
    claims.append((f"{main}: without the action level it strays more than twice as far from its legs",
                   worst(main, ("action",), "max_cross_track_m") > 2.0 * worst(main, (), "max_cross_track_m")))
    claims.append((f"{main}: without the plan level it ends further off, or not at all",
                   worst(main, ("plan",), "final_error_m") > 2.0 * worst(main, (), "final_error_m")))
    return tuple(claims)
