"""A library of recorded runs: short missions that many tests read, each driven once a session, when one first asks.

Nobody writes into them: a test that changes a run copies it. In the end it is seen whether they are as they were made.
"""

from __future__ import annotations

import fcntl
import shutil
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path

from experiments.generated.missions import HALLWAY, OFFICE, fault
from harvey.agent import build_agent
from harvey.campaign.mission_task import Task
from harvey.runner.replay import open_originals, replay
from harvey.simulation.simulated_run import build_head, run_mission
from logs.run_directory import RunDirectory
from logs.run_head import RunHead
from sim.scenario import parse_scenario
from sim.stage import Stage, build_stage
from two_doors import two_doors

BUMP = OFFICE + fault("bump", "allens-office", 3.0, left_m=0.3, turn_deg=10.0)
HARD_BUMP = OFFICE + fault("bump", "allens-office", 3.0, left_m=0.3, turn_deg=40.0)
KIDNAP = OFFICE + fault("kidnap", "allens-office", 3.0, distance_m=0.8, turn_deg=30.0)
FAULTY = (
    HALLWAY
    + fault("bump", "hallway", 5.0, left_m=0.3, turn_deg=10.0)
    + fault("kidnap", "hallway", 12.0, forward_m=0.8, turn_deg=15.0)
    + fault("camera_unplugged", "", 2.0, duration_s=10.0)
)
TOLD = ((2.0, "study/bookshelf-1", "gone"), (3.0, "north-door", "shut"))
"""When [s], of what, and how it is: on the way to one door the robot is told that it is shut."""


@dataclass(frozen=True)
class Recipe:
    """How a run of the library is made: its stage from a folder, its seed, and how it ends."""

    stage: Callable[[Path], Stage]
    seed: int
    outcome: str = "reached"


def build_office() -> Stage:
    """Across Allen's office, on pixels."""
    return build_stage(parse_scenario(OFFICE, "across-allens-office"))


def _of_text(text: str, name: str) -> Callable[[Path], Stage]:
    return lambda _folder: build_stage(parse_scenario(text, name))


RECIPES: Mapping[str, Recipe] = {
    "office": Recipe(lambda _folder: build_office(), 3),
    "kidnap": Recipe(_of_text(KIDNAP, "kidnapped"), 0),
    "bump": Recipe(_of_text(BUMP, "bumped"), 0),
    "other bump": Recipe(_of_text(BUMP, "bumped"), 1),
    "hard bump": Recipe(_of_text(HARD_BUMP, "bump-in-allens-office"), 3),
    "hallway": Recipe(_of_text(FAULTY, "faulty"), 0),
    "two doors": Recipe(lambda folder: two_doors(folder, TOLD), 3),
    "box": Recipe(lambda _folder: Task("box-in-the-way", (("limits.max_cycles", "200"),), 0).stage(), 0, "failed"),
    "shut door": Recipe(lambda _folder: Task("shut-door", (("limits.max_cycles", "300"),), 0).stage(), 0, "failed"),
}
"""In the hallway it is unplugged, pushed aside and kidnapped; bumped hard it is lost, and asks for every room."""

Recorded = Callable[[str], RunDirectory]


class Library:
    """The runs of a session, in a folder that its workers share."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        folder.mkdir(exist_ok=True)

    def __call__(self, name: str) -> RunDirectory:
        """A run; it is driven now where nobody has yet."""
        own = self._folder / name.replace(" ", "-")
        own.mkdir(exist_ok=True)
        run, made = RunDirectory(own / "run"), own / "made"
        with (own / "lock").open("w") as lock:
            fcntl.flock(lock, fcntl.LOCK_EX)
            if not made.exists():
                recipe = RECIPES[name]
                stage = recipe.stage(own)
                result = run_mission(stage, recipe.seed, out=run.path, head=build_head(stage, recipe.seed))
                assert result.outcome == recipe.outcome, f"{name}: {result.reason}"
                made.write_text(_describe(run), "utf-8")
        return run

    def list_changed(self) -> list[str]:
        """The names of the runs that are not as they were made."""
        return [made.parent.name for made in sorted(self._folder.glob("*/made"))
                if made.read_text("utf-8") != _describe(RunDirectory(made.parent / "run"))]


def cut_off(whole: RunDirectory, to: Path, decisions: int, *, tail: int = 40) -> RunDirectory:
    """A run as a crash leaves it: so many decisions, and ``tail`` bytes of the next."""
    run = RunDirectory(to)
    to.mkdir()
    for name in ("run.json", "camera.mjpeg"):
        shutil.copy(whole.path / name, to / name)
    lines = whole.journal.read_bytes().splitlines(keepends=True)
    run.journal.write_bytes(b"".join(lines[:decisions]) + b"".join(lines[decisions:])[:tail])
    return run


def is_decided_again(run: RunDirectory) -> bool:
    """Whether the whole journal, crashes included, comes out again byte for byte."""
    agent = build_agent(RunHead.read(run.path))
    return all(told.same for told in replay(run, open_originals(run, agent.store), agent.scheduler()))


def _describe(run: RunDirectory) -> str:
    files = sorted(run.path.iterdir())
    return "\n".join(f"{file.name} {file.stat().st_size} {file.stat().st_mtime_ns}" for file in files)
