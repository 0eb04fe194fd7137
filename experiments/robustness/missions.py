"""1,000 missions under nominal and 1,000 under rough conditions: final errors, and how the others end.

Rough (``sim/scenarios/rough-day.toml``): objects are not where the model has them, a fifth of the view is hidden from
the hallway on, the lights go out for two seconds, and the robot is bumped by a metre and 30 degrees.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np

from experiments import drives
from experiments.drives import Driven, End, Trial
from experiments.report import OURS, PAPER, PEER, Cell, Claim, Report, chart, count_kinds
from harvey.campaign.mission_task import Task
from world_models.units import INCH_M
from world_models.words import count

NOMINAL, ROUGH = "lab-to-allens-office", "rough-day"
SEEDS, QUICK_SEEDS = 1_000, 1
MIN_CLEAN_SHARE: Mapping[str, float] = {NOMINAL: 0.995, ROUGH: 0.98}
"""Share of the missions that must be clean."""
DECLARED = ("reached", "lost", "blocked", "failed")


@dataclass(frozen=True, slots=True)
class MissionEnd(End):
    """How a mission of a scenario ended."""

    @property
    def within_inch(self) -> bool:
        """Whether it reached its goal within an inch."""
        return self.is_reached and self.error_m <= INCH_M

    @property
    def is_clean(self) -> bool:
        """Whether it did so without a collision or a false accept."""
        return self.within_inch and not self.contacts and not self.false_accepts


def drive(trial: Trial) -> MissionEnd:
    """Drive a mission of the scenario that the row is named after."""
    return MissionEnd.of(trial, drives.drive_task(Task(trial.row, (), trial.seed)))


def _errors_mm(ends: Sequence[MissionEnd], percent: float | None) -> Cell:
    """A percentile of the errors, or their mean."""
    errors_mm = 1000.0 * np.array([e.error_m for e in ends])
    return float(errors_mm.mean() if percent is None else np.percentile(errors_mm, percent))


FIGURES: Mapping[str, drives.Figure[MissionEnd]] = {
    **drives.pick("missions", "reached"), "<= 1 inch": drives.total(lambda e: e.within_inch),
    "clean": drives.total(lambda e: e.is_clean),
    "otherwise": lambda ends: count_kinds(e.outcome for e in ends if not e.is_reached),
    "mean mm": partial(_errors_mm, percent=None), "99 % mm": partial(_errors_mm, percent=99.0),
    "max mm": partial(_errors_mm, percent=100.0), "collisions": drives.total(lambda e: e.contacts),
    **drives.pick("false accepts", "refuted", "replans", "relocated"), "mean s": drives.mean(lambda e: e.wall_s),
}


def run(quick: bool, seed: int) -> Report:
    """Run seeds ``seed``, ``seed + 1``, ... of both scenarios."""
    seeds = range(seed, seed + (QUICK_SEEDS if quick else SEEDS))
    trials = [Trial(scenario, number) for number in seeds for scenario in (NOMINAL, ROUGH)]
    driven = drives.drive_all("missions", drive, trials, MissionEnd, quick=quick, seed=seed)
    picture = driven.folder / "errors.png"
    _draw(driven, picture)
    return driven.report(
        "Missions under nominal and rough conditions", "scenario", FIGURES,
        notes=(
            "Errors are true distances from the goal. false accepts: milestones verified while the robot was elsewhere;"
            " clean: within an inch, no false accept, no collision.",
            "The paper gives no figures for whole missions, and no peer drives under these conditions.",
            f"Errors as a picture: {picture}",
        ),
        claims=_claims(driven), is_flawed=lambda e: not e.is_clean,
        tell=lambda e: ", ".join([f"{e.outcome}, {1000.0 * e.error_m:.1f} mm", *(
            count(number, what) for number, what in ((e.contacts, "collision"), (e.false_accepts, "false accept"))
            if number)]),
        worst=lambda e: -e.error_m, sides=(), about=f" of each. See one: harvey run {NOMINAL} --seed {seed}.",
    )


def _claims(driven: Driven[MissionEnd]) -> Iterator[Claim]:
    for name, ends in driven.rows.items():
        least = MIN_CLEAN_SHARE[name]
        yield (f"{name}: at least {least:.1%} end within an inch, without collision or false accept",
               sum(e.is_clean for e in ends) >= least * len(ends))
        yield f"{name}: every mission ends in a declared outcome", all(e.outcome in DECLARED for e in ends)
        if name == NOMINAL:
            yield f"{name}: no collision", not any(e.contacts for e in ends)
            yield f"{name}: no false accept", not any(e.false_accepts for e in ends)


def _draw(driven: Driven[MissionEnd], path: Path) -> None:
    with chart(path, "Final errors", "true distance from the goal [mm]", "share of the missions below it") as axes:
        for (name, ends), colour in zip(driven.rows.items(), (OURS, PEER), strict=True):
            errors = np.sort([1000.0 * e.error_m for e in ends])
            axes.step(errors, np.arange(1, len(errors) + 1) / len(errors), where="post", color=colour, label=name)
        axes.axvline(1000.0 * INCH_M, color=PAPER, linestyle="--", label="one inch")
        axes.set_xscale("log")
