"""A thousand missions on a good day and a thousand on a bad one: how near they come, and how the others end.

The bad day (``sim/scenarios/rough-day.toml``): things stand elsewhere than in the model, a fifth of the view is hidden
from the hallway on, the lights go out for two seconds, and the robot is bumped by a metre and 30 degrees.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from experiments.chart import OURS, PAPER, PEER, chart
from experiments.report import Cell, Report
from experiments.trials import campaign_folder, found_by_all
from harvey.campaign.campaign import Task, run_task
from harvey.units import INCH_M, count

GOOD, BAD = "lab-to-allens-office", "rough-day"
SCENARIOS = (GOOD, BAD)
SEEDS, QUICK_SEEDS = 1_000, 1
WANTED: Mapping[str, float] = {GOOD: 0.995, BAD: 0.98}
"""Parts of the missions that must be clean."""
DECLARED = ("reached", "lost", "blocked", "failed")
WORST = 5
COLUMNS = ("scenario", "missions", "reached", "<= 1 inch", "clean", "otherwise", "mean mm", "99 % mm", "max mm",
           "collisions", "wrong", "refuted", "replans", "relocated", "mean s")


@dataclass(frozen=True, slots=True)
class Ended:
    """How a mission ended: what of its result is told."""

    scenario: str
    seed: int
    outcome: str
    reason: str
    error_m: float
    collisions: int
    wrong: int
    refuted: int
    replans: int
    relocations: int
    wall_s: float

    @property
    def is_good(self) -> bool:
        """Within an inch, and so declared."""
        return self.outcome == "reached" and self.error_m <= INCH_M

    @property
    def is_clean(self) -> bool:
        """So, and nothing was touched or accepted wrongly on the way."""
        return self.is_good and not self.collisions and not self.wrong


def run(quick: bool, seed: int) -> Report:
    """Seeds ``seed``, ``seed + 1``, ... of both scenarios."""
    count = QUICK_SEEDS if quick else SEEDS
    tasks = [Task(scenario, (), seed + k) for k in range(count) for scenario in SCENARIOS]
    folder = campaign_folder("missions", seed, quick=quick)
    found = found_by_all(driven, tasks, Ended, folder, "mission")
    by_scenario = {name: [e for e in found if e.scenario == name] for name in SCENARIOS}
    picture = folder / "errors.png"
    _draw(by_scenario, picture)
    report = Report(
        "Missions by the thousand", COLUMNS, tuple(_row(name, ended) for name, ended in by_scenario.items()),
        notes=(
            f"Seeds {seed} to {seed + count - 1} of each; errors are true distances from the goal. wrong: milestones"
            " that were accepted while the robot was elsewhere; clean: within an inch, without those and collisions.",
            "The paper gives no figures for whole missions, and no peer drives by these rules.",
            *(line for name, ended in by_scenario.items() for line in _worst(name, ended)),
            f"Errors as a picture: {picture}; every mission in a line: {folder / 'found.jsonl'}",
        ),
        claims=tuple(claim for name, ended in by_scenario.items() for claim in _claims(name, ended)),
    )
    (folder / "table.txt").write_text(report.text() + "\n", encoding="utf-8")
    return report


def driven(task: Task) -> Ended:
    """One mission, of which nothing is kept but how it ended."""
    r = run_task(task)
    return Ended(
        task.scenario, task.seed, r.outcome, r.reason, r.error_m, r.collisions or 0, r.false_accepts,
        r.milestones["refuted"] or 0, r.replans, r.relocalizations, r.wall_time_s,
    )


def _row(name: str, ended: Sequence[Ended]) -> tuple[Cell, ...]:
    errors_mm = 1000.0 * np.array([e.error_m for e in ended])
    others = sorted({e.outcome for e in ended} - {"reached"})
    return (
        name, len(ended), sum(e.outcome == "reached" for e in ended), sum(e.is_good for e in ended),
        sum(e.is_clean for e in ended),
        ", ".join(f"{sum(e.outcome == kind for e in ended)} {kind}" for kind in others) or None,
        float(errors_mm.mean()), float(np.percentile(errors_mm, 99.0)), float(errors_mm.max()),
        sum(e.collisions for e in ended), sum(e.wrong for e in ended), sum(e.refuted for e in ended),
        sum(e.replans for e in ended), sum(e.relocations for e in ended),
        math.fsum(e.wall_s for e in ended) / len(ended),
    )


def _worst(name: str, ended: Sequence[Ended]) -> list[str]:
    """The seeds to look at, and how."""
    worst = sorted(ended, key=lambda e: (e.is_clean, -e.error_m))[:WORST]
    told = ", ".join(f"{e.seed} ({e.outcome}, {1000.0 * e.error_m:.1f} mm{_spoilt(e)})" for e in worst)
    return [f"{name}, worst seeds: {told}. See one: harvey run {name} --seed {worst[0].seed}"]


def _spoilt(ended: Ended) -> str:
    """What keeps it from being clean beside how it ended."""
    return "".join(f", {count(number, what)}" for number, what in
                   ((ended.collisions, "collision"), (ended.wrong, "wrong accept")) if number)


def _claims(name: str, ended: Sequence[Ended]) -> list[tuple[str, bool]]:
    wanted = WANTED[name]
    claims = [(f"{name}: at least {wanted:.1%} end within an inch, with no collision and nothing accepted wrongly",
               sum(e.is_clean for e in ended) >= wanted * len(ended)),
              (f"{name}: every mission ends in a declared outcome", all(e.outcome in DECLARED for e in ended))]
    if name == GOOD:
        claims += [(f"{name}: no collision", not any(e.collisions for e in ended)),
                   (f"{name}: no milestone is accepted wrongly", not any(e.wrong for e in ended))]
    return claims


def _draw(by_scenario: Mapping[str, list[Ended]], path: Path) -> None:
    with chart(path, "Final errors", "true distance from the goal [mm]", "part of the missions below it") as axes:
        for (name, ended), colour in zip(by_scenario.items(), (OURS, PEER), strict=True):
            errors = np.sort([1000.0 * e.error_m for e in ended])
            axes.step(errors, np.arange(1, len(errors) + 1) / len(errors), where="post", color=colour, label=name)
        axes.axvline(1000.0 * INCH_M, color=PAPER, linestyle="--", label="one inch")
        axes.set_xscale("log")
