"""Missions under random light and materials, against the same missions under light that is the same everywhere.

Lamps of which some are off, dimness, daylight with hard patches of sun, shiny floors, reflecting panes, walls of other
colours than the model's, cameras that adapt slowly: what does each of them cost?
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from tempfile import TemporaryDirectory

from experiments import drives
from experiments.drives import End, Trial
from experiments.generated.door_missions import write_door_mission
from experiments.generated.light import LIGHT_KINDS, draw_light, format_light
from experiments.report import Cell, Report
from harvey.campaign.mission_task import Task

FLAT = "flat"
MISSIONS = 1_000
QUICK_KINDS = (FLAT, "lamps", "sun")
MIN_REACHED = 0.995


def drive(trial: Trial) -> End:
    """Drive the mission of a trial."""
    with TemporaryDirectory() as folder:
        return End.of(trial, drives.drive_task(Task(str(write_light_mission(Path(folder), trial)), (), trial.seed)))


def write_light_mission(folder: Path, trial: Trial) -> Path:
    """Write the trial's scenario with the files of its floor; the same mission for every kind of light."""
    path = write_door_mission(folder, trial.seed, "as filed").path
    path.write_text(path.read_text("utf-8") + format_light(draw_light(trial.row, trial.seed)), "utf-8")
    return path


def run(quick: bool, seed: int, missions: int | None = None) -> Report:
    """Drive so many missions, as many of each kind of light, on floors 1,200,000 + 10,000 ``seed`` + 0, 1, ...."""
    kinds = QUICK_KINDS if quick else LIGHT_KINDS
    floors = 1 if quick and not missions else math.ceil((missions or MISSIONS) / len(kinds))
    trials = [Trial(kind, drives.first_seed(seed, 1_200_000) + k) for k in range(floors) for kind in kinds]
    driven = drives.drive_all("light", drive, trials, End, quick=quick, seed=seed, missions=missions)
    flat = {end.seed: end.robot_s for end in driven.rows[FLAT] if end.is_reached}

    def over_flat(ends: Sequence[End]) -> Cell:
        """The robot's time over that under flat light, on the floors where both reached."""
        pairs = [(e.robot_s, flat[e.seed]) for e in ends if e.is_reached and e.seed in flat]
        return f"{math.fsum(a for a, _ in pairs) / math.fsum(b for _, b in pairs) if pairs else math.nan:.2f}"

    figures: Mapping[str, drives.Figure[End]] = {
        **drives.pick("missions", "reached", "proves at least"), "mean mm": _mean_mm,
        **drives.pick("verified", "refuted", "not testable", "relocated", "contacts", "false accepts",
                      "robot's mean s"), "over flat": over_flat, **drives.pick("mean CPU s"),
    }
    lit = [end for kind, ends in driven.rows.items() if kind != FLAT for end in ends]
    return driven.report(
        "Missions under light", "light", figures,
        notes=(
            "The same missions under each light. flat: a building without lamps and shadows, as all other experiments"
            " have it. over flat: the robot's time over that of the same missions under flat light, where both reach."
            " verified, refuted, not testable: sums of milestones. false accepts: milestones verified while the robot"
            " was elsewhere.",
            f"The paper's light is not told, and {drives.NO_PEER}",
        ),
        claims=(
            drives.claim_share(f"at least {MIN_REACHED:.1%} of the missions under light reach", lambda e: e.is_reached,
                               lit, MIN_REACHED),
            drives.claim_none("no milestone is accepted at a wrong place under light", lit),
        ),
        is_flawed=lambda e: not e.is_reached or e.false_accepts > 0,
    )


def _mean_mm(ends: Sequence[End]) -> Cell:
    """The mean error of those that reached."""
    reached = [end.error_m for end in ends if end.is_reached]
    return 1000.0 * math.fsum(reached) / len(reached) if reached else math.nan
