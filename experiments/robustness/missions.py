"""1,000 missions under nominal and 1,000 under rough conditions: final errors, and how the others end.

Rough (``sim/scenarios/rough-day.toml``): objects are not where the model has them, a fifth of the view is hidden from
the hallway on, the lights go out for two seconds, and the robot is bumped by a metre and 30 degrees.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from experiments.report import OURS, PAPER, PEER, Cell, Report, chart, count_kinds
from experiments.trials import RESULTS, campaign_folder, run_trials
from harvey.campaign.campaign import Task, run_task
from world_models.units import INCH_M
from world_models.words import count

NOMINAL, ROUGH = "lab-to-allens-office", "rough-day"
SCENARIOS = (NOMINAL, ROUGH)
SEEDS, QUICK_SEEDS = 1_000, 1
MIN_CLEAN_SHARE: Mapping[str, float] = {NOMINAL: 0.995, ROUGH: 0.98}
"""Share of the missions that must be clean."""
DECLARED = ("reached", "lost", "blocked", "failed")
WORST_SHOWN = 5
COLUMNS = ("scenario", "missions", "reached", "<= 1 inch", "clean", "otherwise", "mean mm", "99 % mm", "max mm",
           "collisions", "false accepts", "refuted", "replans", "relocated", "mean s")


@dataclass(frozen=True, slots=True)
class MissionEnd:
    """How a mission ended: the part of its result that is reported."""

    scenario: str
    seed: int
    outcome: str
    reason: str
    error_m: float
    collisions: int
    false_accepts: int
    refuted: int
    replans: int
    relocations: int
    wall_s: float

    @property
    def within_inch(self) -> bool:
        """Whether it reached its goal within an inch."""
        return self.outcome == "reached" and self.error_m <= INCH_M

    @property
    def is_clean(self) -> bool:
        """Whether it did so without a collision or a false accept."""
        return self.within_inch and not self.collisions and not self.false_accepts


def run(quick: bool, seed: int) -> Report:
    """Run seeds ``seed``, ``seed + 1``, ... of both scenarios."""
    count = QUICK_SEEDS if quick else SEEDS
    tasks = [Task(scenario, (), seed + k) for k in range(count) for scenario in SCENARIOS]
    folder = campaign_folder("missions", seed, quick=quick)
    ends = run_trials(run_mission, tasks, MissionEnd, folder, "mission")
    by_scenario = {name: [e for e in ends if e.scenario == name] for name in SCENARIOS}
    picture = folder / "errors.png"
    _draw(by_scenario, picture)
    report = Report(
        "Missions under nominal and rough conditions", COLUMNS,
        tuple(_row(name, ended) for name, ended in by_scenario.items()),
        notes=(
            f"Seeds {seed} to {seed + count - 1} of each; errors are true distances from the goal. false accepts:"
            " milestones verified while the robot was elsewhere; clean: within an inch, no false accept, no collision.",
            "The paper gives no figures for whole missions, and no peer drives under these conditions.",
            *(line for name, ended in by_scenario.items() for line in _worst(name, ended)),
            f"Errors as a picture: {picture}; one line per mission: {folder / RESULTS}",
        ),
        claims=tuple(claim for name, ended in by_scenario.items() for claim in _claims(name, ended)),
    )
    (folder / "table.txt").write_text(report.text() + "\n", encoding="utf-8")
    return report


def run_mission(task: Task) -> MissionEnd:
    """Run one mission and keep only how it ended."""
    r = run_task(task)
    return MissionEnd(
        task.scenario, task.seed, r.outcome, r.reason, r.error_m, r.collisions or 0, r.false_accepts,
        r.milestones["refuted"] or 0, r.replans, r.relocalizations, r.wall_time_s,
    )


def _row(name: str, ended: Sequence[MissionEnd]) -> tuple[Cell, ...]:
    errors_mm = 1000.0 * np.array([e.error_m for e in ended])
    return (
        name, len(ended), sum(e.outcome == "reached" for e in ended), sum(e.within_inch for e in ended),
        sum(e.is_clean for e in ended),
        count_kinds(e.outcome for e in ended if e.outcome != "reached"),
        float(errors_mm.mean()), float(np.percentile(errors_mm, 99.0)), float(errors_mm.max()),
        sum(e.collisions for e in ended), sum(e.false_accepts for e in ended), sum(e.refuted for e in ended),
        sum(e.replans for e in ended), sum(e.relocations for e in ended),
        math.fsum(e.wall_s for e in ended) / len(ended),
    )


def _worst(name: str, ended: Sequence[MissionEnd]) -> list[str]:
    """Name the seeds to look at, and how to."""
    worst = sorted(ended, key=lambda e: (e.is_clean, -e.error_m))[:WORST_SHOWN]
    seeds = ", ".join(f"{e.seed} ({e.outcome}, {1000.0 * e.error_m:.1f} mm{_flaws(e)})" for e in worst)
    return [f"{name}, worst seeds: {seeds}. See one: harvey run {name} --seed {worst[0].seed}"]


def _flaws(ended: MissionEnd) -> str:
    """Collisions and false accepts, if any."""
    return "".join(f", {count(number, what)}" for number, what in
                   ((ended.collisions, "collision"), (ended.false_accepts, "false accept")) if number)


def _claims(name: str, ended: Sequence[MissionEnd]) -> list[tuple[str, bool]]:
    least = MIN_CLEAN_SHARE[name]
    claims = [(f"{name}: at least {least:.1%} end within an inch, without collision or false accept",
               sum(e.is_clean for e in ended) >= least * len(ended)),
              (f"{name}: every mission ends in a declared outcome", all(e.outcome in DECLARED for e in ended))]
    if name == NOMINAL:
        claims += [(f"{name}: no collision", not any(e.collisions for e in ended)),
                   (f"{name}: no false accept", not any(e.false_accepts for e in ended))]
    return claims


def _draw(by_scenario: Mapping[str, list[MissionEnd]], path: Path) -> None:
    with chart(path, "Final errors", "true distance from the goal [mm]", "share of the missions below it") as axes:
        for (name, ended), colour in zip(by_scenario.items(), (OURS, PEER), strict=True):
            errors = np.sort([1000.0 * e.error_m for e in ended])
            axes.step(errors, np.arange(1, len(errors) + 1) / len(errors), where="post", color=colour, label=name)
        axes.axvline(1000.0 * INCH_M, color=PAPER, linestyle="--", label="one inch")
        axes.set_xscale("log")
