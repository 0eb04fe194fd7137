"""A soak: errands in one building day after day, as the light changes and the camera sags. What breaks first?

A mission is some minutes of errands: the robot is sent elsewhere before it arrives. A day has ``A_DAY`` missions under
one light; each is put down anew, and told nothing of the days before.
"""

from __future__ import annotations

import math
import os
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

from experiments.generated.light import LIGHT_KINDS, MOST_SAG_DEG, SAG_DEG_PER_DAY, write_soak_mission
from experiments.report import Cell, Report
from experiments.scale.agenda_memory import resident_bytes
from experiments.trials import RESULTS, at_most, campaign_folder, run_trials
from harvey.campaign.campaign import Task, run_task

MISSIONS, QUICK_MISSIONS, A_DAY = 20_000, 2, 10
FIRST_SEED, SEEDS_APART = 1_000_000, 100_000
"""Seeds below 100,000 are for development."""
MIN_REACHED, MAX_MB_PER_MISSION = 0.99, 0.5
WORST_SHOWN = 6
MB = 1e6
COLUMNS = ("light", "paper", "peer", "missions", "km", "reached", "milestones", "refuted", "accepted wrongly",
           "proves at most", "lost and found", "contacts", "robot's hours", "CPU hours")


@dataclass(frozen=True, slots=True)
class SoakTrial:
    """A mission: the seed of its errands and of all chance, and its day."""

    seed: int
    day: int


@dataclass(frozen=True, slots=True)
class SoakResult:
    """How a mission ended, in plain types.

    Attributes:
        memory_mb: of the process that ran it, after it.
        process: that process.
    """

    seed: int
    day: int
    outcome: str
    reason: str
    error_m: float
    path_m: float
    verified: int
    refuted: int
    not_testable: int
    false_accepts: int
    relocations: int
    contacts: int
    robot_s: float
    wall_s: float
    memory_mb: float
    process: int


def run_soak_mission(trial: SoakTrial) -> SoakResult:
    """Run the mission of a trial."""
    with TemporaryDirectory() as folder:
        r = run_task(Task(str(write_soak_mission(Path(folder), trial.day, trial.seed)), (), trial.seed))
    count = {key: value or 0 for key, value in r.milestones.items()}
    return SoakResult(
        trial.seed, trial.day, r.outcome, r.reason, r.error_m, r.path_length_m, count["verified"], count["refuted"],
        count["not_testable"], r.false_accepts, r.relocalizations, r.collisions or 0, r.sim_time_s, r.wall_time_s,
        resident_bytes() / MB, os.getpid())


def run(quick: bool, seed: int, missions: int | None = None) -> Report:
    """Drive so many missions, of seeds 1,000,000 + 100,000 ``seed`` + 0, 1, ....; ``A_DAY`` a day."""
    number = missions or (QUICK_MISSIONS if quick else MISSIONS)
    first = FIRST_SEED + SEEDS_APART * seed
    folder = campaign_folder(f"soak-{missions}" if missions else "soak", seed, quick=quick)
    ends = run_trials(run_soak_mission, [SoakTrial(first + k, k // A_DAY) for k in range(number)], SoakResult, folder,
                      "mission")
    by_light = {kind: [end for end in ends if LIGHT_KINDS[end.day % len(LIGHT_KINDS)] == kind] for kind in LIGHT_KINDS}
    rows = [_row(kind, some) for kind, some in by_light.items() if some]
    if len(rows) > 1:
        rows.append(_row("all", ends))
    growth = _find_growth_mb(ends)
    report = Report(
        "Errands in one building, day after day", COLUMNS, tuple(rows),
        notes=(
            f"Seeds {first} to {first + number - 1}, {A_DAY} a day; no constant was chosen on them. The camera looks"
            f" {SAG_DEG_PER_DAY:g} degrees lower each day than believed, up to {MOST_SAG_DEG:g}. Bounds are one-sided,"
            " of 95 %, by Clopper and Pearson.",
            f"The memory of a process grows by at most {growth:.2f} MB a mission." if math.isfinite(growth) else
            "No process ran enough missions to tell how its memory grows.",
            "Ended otherwise than reached: " + (", ".join(f"{n} {kind}" for kind, n in Counter(
                end.outcome for end in ends if end.outcome != "reached").most_common()) or "none"),
            *_worst([end for end in ends if end.outcome != "reached" or end.false_accepts]),
            "The paper drove for minutes, not days; peers publish no such figures.",
            f"One line per mission: {folder / RESULTS}",
        ),
        claims=tuple(_claims(ends, growth, quick=quick)),
    )
    (folder / "table.txt").write_text(report.text() + "\n", encoding="utf-8")
    return report


def _row(name: str, ends: Sequence[SoakResult]) -> tuple[Cell, ...]:
    judged = sum(e.verified for e in ends)
    wrong = sum(e.false_accepts for e in ends)
    return (
        name, None, None, len(ends), math.fsum(e.path_m for e in ends) / 1e3, sum(e.outcome == "reached" for e in ends),
        judged, sum(e.refuted for e in ends), wrong, f"{at_most(wrong, judged):.2%}" if judged else None,
        sum(e.relocations for e in ends), sum(e.contacts for e in ends), math.fsum(e.robot_s for e in ends) / 3600.0,
        math.fsum(e.wall_s for e in ends) / 3600.0)


def _find_growth_mb(ends: Sequence[SoakResult]) -> float:
    """By how much a process grows with a mission, once it has run ``A_DAY``: the worst; NaN where none ran more."""
    found = []
    for process in sorted({end.process for end in ends}):
        sizes = [end.memory_mb for end in ends if end.process == process][A_DAY:]
        if len(sizes) > A_DAY:
            half = len(sizes) // 2
            found.append((math.fsum(sizes[-half:]) - math.fsum(sizes[:half])) / half / (len(sizes) - half))
    return max(found, default=math.nan)


def _worst(ends: Sequence[SoakResult]) -> list[str]:
    """Name the missions to look at."""
    told = "; ".join(f"{e.seed} of day {e.day} ({e.outcome}: {e.reason})" for e in ends[:WORST_SHOWN])
    return [f"missions to look at: {told}"] if told else []


def _claims(ends: Sequence[SoakResult], growth_mb: float, *, quick: bool) -> Iterator[tuple[str, bool]]:
    wrong, judged = sum(e.false_accepts for e in ends), sum(e.verified for e in ends)
    yield (f"no milestone is accepted wrongly: {wrong} of {judged}"
           + (f", so at most {at_most(wrong, judged):.2%}" if judged else ""), wrong == 0)
    if quick:
        return
    reached = sum(e.outcome == "reached" for e in ends)
    yield f"at least {MIN_REACHED:.0%} reach: {reached} of {len(ends)}", reached >= MIN_REACHED * len(ends)
    if math.isfinite(growth_mb):
        yield (f"a process grows by at most {MAX_MB_PER_MISSION:g} MB a mission: {growth_mb:.2f}",
               growth_mb <= MAX_MB_PER_MISSION)
