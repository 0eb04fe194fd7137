"""A soak: errands in one building day after day, as the light changes and the camera sags. What breaks first?

A mission is some minutes of errands: the robot is sent elsewhere before it arrives. A day has ``A_DAY`` missions under
one light; each is put down again, and told nothing of the days before.
"""

from __future__ import annotations

import math
import os
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory

from experiments import drives
from experiments.drives import End, Trial
from experiments.generated.light import LIGHT_KINDS, MOST_SAG_DEG, SAG_DEG_PER_DAY, write_soak_mission
from experiments.report import Cell, Claim, Report
from experiments.scale.agenda_memory import resident_bytes
from experiments.trials import at_most, judge_rare
from harvey.campaign.mission_task import Task

MISSIONS, QUICK_MISSIONS, A_DAY = 20_000, 2, 10
SEEDS_APART = 100_000
MIN_REACHED, MAX_MB_PER_MISSION = 0.99, 0.5
MB = 1e6


@dataclass(frozen=True, slots=True)
class SoakEnd(End):
    """How a mission ended, and how large the process that drove it was after it."""

    memory_mb: float
    process: int


def find_day(seed: int) -> int:
    """The day of a mission, by its seed."""
    return seed % SEEDS_APART // A_DAY


def make_trial(seed: int) -> Trial:
    """The mission of a seed, in the row of its day's light."""
    return Trial(LIGHT_KINDS[find_day(seed) % len(LIGHT_KINDS)], seed)


def drive(trial: Trial) -> SoakEnd:
    """Drive the mission of a trial."""
    with TemporaryDirectory() as folder:
        path = write_soak_mission(Path(folder), find_day(trial.seed), trial.seed)
        driven = drives.drive_task(Task(str(path), (), trial.seed))
    return SoakEnd.of(trial, driven, memory_mb=resident_bytes() / MB, process=os.getpid())


def _wrong_at_most(ends: Sequence[SoakEnd]) -> Cell:
    judged = sum(e.verified for e in ends)
    return f"{at_most(sum(e.false_accepts for e in ends), judged):.2%}" if judged else None


FIGURES: Mapping[str, drives.Figure[SoakEnd]] = {
    **drives.pick("missions"), "km": lambda ends: math.fsum(e.path_m for e in ends) / 1e3, **drives.pick("reached"),
    "milestones": drives.total(lambda e: e.verified), **drives.pick("refuted"),
    "accepted wrongly": drives.total(lambda e: e.false_accepts), "proves at most": _wrong_at_most,
    "lost and found": drives.total(lambda e: e.relocations), **drives.pick("contacts"),
    "robot's hours": lambda ends: math.fsum(e.robot_s for e in ends) / 3600.0,
    "CPU hours": lambda ends: math.fsum(e.wall_s for e in ends) / 3600.0,
}


def run(quick: bool, seed: int, missions: int | None = None) -> Report:
    """Drive so many missions, of seeds 1,000,000 + 100,000 ``seed`` + 0, 1, ....; ``A_DAY`` a day."""
    first = drives.first_seed(seed, apart=SEEDS_APART)
    trials = [make_trial(first + k) for k in range(missions or (QUICK_MISSIONS if quick else MISSIONS))]
    driven = drives.drive_all("soak", drive, trials, SoakEnd, quick=quick, seed=seed, missions=missions,
                              rows=LIGHT_KINDS)
    ends = sorted(driven.ends, key=lambda e: e.seed)
    growth = _find_growth_mb(ends)
    if len(driven.rows) > 1:
        driven = replace(driven, rows={**driven.rows, "all": ends})
    otherwise = Counter(end.outcome for end in ends if not end.is_reached).most_common()
    return driven.report(
        "Errands in one building, day after day", "light", FIGURES,
        notes=(
            f"{A_DAY} missions a day. The camera looks {SAG_DEG_PER_DAY:g} degrees lower each day than believed, up to"
            f" {MOST_SAG_DEG:g}.",
            f"The memory of a process grows by at most {growth:.2f} MB a mission." if math.isfinite(growth) else
            "No process ran enough missions to tell how its memory grows.",
            f"Ended differently than reached: {', '.join(f'{n} {kind}' for kind, n in otherwise) or 'none'}",
            "The paper drove for minutes, not days; peers publish no such figures.",
        ),
        claims=_claims(ends, growth, quick=quick), is_flawed=lambda e: not e.is_reached or e.false_accepts > 0,
        tell=lambda e: f"day {find_day(e.seed)}, {e.outcome}: {e.reason}",
    )


def _find_growth_mb(ends: Sequence[SoakEnd]) -> float:
    """By how much a process grows with a mission, once it has run ``A_DAY``: the worst; NaN where none ran more."""
    found = []
    for process in sorted({end.process for end in ends}):
        sizes = [end.memory_mb for end in ends if end.process == process][A_DAY:]
        if len(sizes) > A_DAY:
            half = len(sizes) // 2
            found.append((math.fsum(sizes[-half:]) - math.fsum(sizes[:half])) / half / (len(sizes) - half))
    return max(found, default=math.nan)


def _claims(ends: Sequence[SoakEnd], growth_mb: float, *, quick: bool) -> Iterator[Claim]:
    wrong, judged = sum(e.false_accepts for e in ends), sum(e.verified for e in ends)
    yield (f"no milestone is accepted wrongly: {wrong} of {judged}"
           + (f", so at most {at_most(wrong, judged):.2%}" if judged else ""), judge_rare(wrong, judged, 0.0))
    if quick:
        return
    yield drives.claim_share(f"at least {MIN_REACHED:.0%} reach", lambda e: e.is_reached, ends, MIN_REACHED)
    if math.isfinite(growth_mb):
        yield (f"a process grows by at most {MAX_MB_PER_MISSION:g} MB a mission: {growth_mb:.2f}",
               growth_mb <= MAX_MB_PER_MISSION)
