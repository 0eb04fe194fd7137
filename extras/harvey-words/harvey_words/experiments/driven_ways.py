"""``harvey experiment driven-ways``: a robot is told a way, and drives it by its camera in the simulator."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from blackboard import Decision
from experiments import drives
from experiments.drives import Trial
from experiments.report import Report
from harvey.campaign.mission_task import Task
from harvey_words.directions.directions import write_directions
from harvey_words.experiments.told_routes import Told, tell_rooms
from harvey_words.following.word_map import WordMap
from world_models.entries import Goal
from world_models.files.world_files import WORLDS, load_world

MISSIONS, QUICK_MISSIONS = 100, 10
AT_GOAL_M = 0.5
"""True distance from the last goal within which a mission ended at it."""
TOLD, DIRECTIONS = "told by the generator", "directions"


@dataclass(frozen=True, slots=True)
class WayEnd(drives.End):
    """How a mission ended.

    Attributes:
        told_to: the room to which the words lead; drove_to: that of the last goal, "" for none.
    """

    told_to: str
    drove_to: str

    @property
    def is_there(self) -> bool:
        return self.outcome == "reached" and self.drove_to == self.told_to and self.error_m <= AT_GOAL_M

    @property
    def is_asked(self) -> bool:
        """Whether it did not drive, since the words were not sure."""
        return "not understood" in self.reason


def draw_way(trial: Trial) -> tuple[str, Told]:
    """A world, and a way in it."""
    rng = np.random.default_rng([trial.seed, 64])
    centre = "research-center" if trial.row != DIRECTIONS or rng.random() < 0.7 else "two-ways"
    plan = WordMap(load_world(WORLDS / f"{centre.replace('-', '_')}.toml"))
    rooms = sorted(name for name, area in plan.areas.items() if not area.is_hall)
    while True:
        if trial.row == DIRECTIONS:
            start, end = (str(room) for room in rng.choice(rooms, 2, replace=False))
            return centre, Told(start, end, write_directions(plan, start, end).text)
        if (way := tell_rooms(plan, rng)) is not None and way.end in rooms:
            return centre, way


def drive(trial: Trial) -> WayEnd:
    """Drive the way of a trial; the mission's own goal is another place, which the words replace."""
    world, told = draw_way(trial)
    goals: list[str] = []

    def note(decision: Decision) -> None:
        goals.extend(change.entry.value.destination.locale for change in decision.made
                     if isinstance(change.entry.value, Goal))

    with TemporaryDirectory() as folder:
        path = Path(folder) / "way.toml"
        path.write_text(f'world = "{world.replace("-", "_")}"\ngoal = "Go from {told.start} to {told.start}"\n'
                        f'task = "{told.text}"\nstart.put_down_sigma_m = 0.03\n', encoding="utf-8")
        driven = drives.drive_task(Task(str(path), (), trial.seed), note)
    return WayEnd.of(trial, driven, told_to=told.end, drove_to=goals[-1] if goals else "")


FIGURES: Mapping[str, drives.Figure[WayEnd]] = {
    **drives.pick("missions"), "reached": drives.total(lambda end: end.is_there),
    "asked": drives.total(lambda end: end.is_asked),
    "elsewhere": drives.total(lambda end: end.outcome == "reached" and not end.is_there),
    **drives.pick("robot's mean s", "mean CPU s"),
}


def run(quick: bool, seed: int, missions: int | None = None) -> Report:
    """Drive so many ways, a row after the other."""
    first, rows = drives.first_seed(seed), [TOLD, DIRECTIONS]
    trials = [Trial(rows[k % len(rows)], first + k)
              for k in range(missions or (QUICK_MISSIONS if quick else MISSIONS))]
    driven = drives.drive_all("driven-ways", drive, trials, WayEnd, quick=quick, seed=seed, missions=missions,
                              rows=rows)
    understood = [end for end in driven.ends if not end.is_asked]
    return driven.report(
        "Ways that are told in words, and driven", "told", FIGURES, notes=NOTES, is_flawed=lambda end: not end.is_there,
        claims=(
            drives.claim_share("of the ways that were understood, 97% are driven to their end",
                               lambda end: end.is_there, understood, 0.97),
            drives.claim_none("no mission says that it is there, and is elsewhere", driven.ends,
                              lambda end: end.outcome == "reached" and not end.is_there)))


NOTES = (
    "reached: the last goal is the room to which the words lead, and the robot is there in truth; asked: it did not"
    " drive, as the words were not sure. What the words name on the way is a goal before the last, each verified.",
)
