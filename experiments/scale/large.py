"""A mission's processor time by the number of rooms, where the robot is put down in another room than it was told.

It is lost at once, and looks for itself on a floor of so many like rooms; then it drives to its goal.
"""

from __future__ import annotations

import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

from experiments import drives
from experiments.drives import Driven, GoalEnd, Trial
from experiments.generated.missions import write_large_mission
from experiments.report import Claim, Report
from harvey.campaign.mission_task import Task
from logs.run_head import load_known_world

MAX_CPU_S: Mapping[str, float] = {"58 rooms": 15.0, "99 rooms": 20.0}
"""Processor time that a mission may cost on the mean."""
MISSIONS, QUICK_MISSIONS = 20, 1
MIN_REACHED = 0.95


@dataclass(frozen=True, slots=True)
class LargeEnd(GoalEnd):
    """How a mission ended, and its processor time [s], without reading the building.

    The first mission of a process compiles what is not compiled yet.
    """

    cpu_s: float


def drive(trial: Trial) -> LargeEnd:
    """Drive the mission of a trial."""
    with TemporaryDirectory() as folder:
        path = write_large_mission(Path(folder), trial.seed, int(trial.row.partition(" ")[0]))
        task = Task(str(path), (), trial.seed)
        load_known_world(task.stage().scenario.world)
        began_s = time.process_time()
        driven = drives.drive_task(task)
        return LargeEnd.of(trial, driven, cpu_s=time.process_time() - began_s)


FIGURES: Mapping[str, drives.Figure[LargeEnd]] = {
    **drives.pick("missions"), "reached": drives.total(lambda e: e.is_right),
    "wrong and confident": drives.total(lambda e: e.is_wrong), **drives.pick("false accepts", "relocated"),
    "mean processor s": drives.mean(lambda e: e.cpu_s), "most": lambda ends: max(e.cpu_s for e in ends),
}


def run(quick: bool, seed: int, missions: int | None = None) -> Report:
    """Drive so many missions on floors of each size."""
    first, each = drives.first_seed(seed), missions or (QUICK_MISSIONS if quick else MISSIONS)
    trials = [Trial(row, first + k) for row in MAX_CPU_S for k in range(each)]
    driven = drives.drive_all("large", drive, trials, LargeEnd, quick=quick, seed=seed, missions=missions)
    return driven.report(
        "Missions that begin lost in large buildings", "building", FIGURES,
        notes=(
            "All rooms are as wide, all doors alike and open. Processor time of the whole mission with its simulator,"
            " without reading the building; other load on the machine makes it longer.",
            f"The paper gives no figures; {drives.NO_PEER}",
        ),
        claims=_claims(driven), is_flawed=lambda e: not e.is_right or e.cpu_s > MAX_CPU_S[e.row],
        tell=lambda e: f"{e.outcome}: {e.reason}; {e.cpu_s:.1f} s", worst=lambda e: -e.cpu_s,
    )


def _claims(driven: Driven[LargeEnd]) -> Iterator[Claim]:
    for row, ends in driven.rows.items():
        yield drives.claim_share(f"{row}: at least {MIN_REACHED:.0%} reach", lambda e: e.is_right, ends, MIN_REACHED)
        yield _claim_time(row, ends)
    yield drives.claim_none("wrong and confident", driven.ends, lambda e: e.is_wrong)
    yield drives.claim_none("no milestone is accepted at a wrong place", driven.ends)


def _claim_time(row: str, ends: Sequence[LargeEnd]) -> Claim:
    mean_s = sum(e.cpu_s for e in ends) / len(ends)
    return f"{row}: at most {MAX_CPU_S[row]:g} s of processor time a mission, on the mean: {mean_s:.1f} s", \
        mean_s <= MAX_CPU_S[row]
