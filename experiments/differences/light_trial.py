"""One mission under one kind of light, on a generated floor: how it ended."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

from experiments.generated.door_missions import write_door_mission
from experiments.generated.light import LightKind, draw_light, format_light
from harvey.campaign.campaign import Task, run_task


@dataclass(frozen=True, slots=True)
class LightTrial:
    """A mission.

    Attributes:
        kind: of light.
        floor: seed of the generated floor and mission, of the light, and of all chance.
    """

    kind: LightKind
    floor: int


@dataclass(frozen=True, slots=True)
class LightResult:
    """How a mission ended, in plain types.

    Attributes:
        verified, refuted, not_testable: how many milestones were.
        robot_s: time of the robot.
    """

    kind: str
    floor: int
    outcome: str
    reason: str
    error_m: float
    verified: int
    refuted: int
    not_testable: int
    false_accepts: int
    collisions: int
    relocations: int
    robot_s: float
    wall_s: float


def run_light_mission(trial: LightTrial) -> LightResult:
    """Run the mission of a trial."""
    with TemporaryDirectory() as folder:
        path = write_light_mission(Path(folder), trial)
        r = run_task(Task(str(path), (), trial.floor))
    count = {key: value or 0 for key, value in r.milestones.items()}
    return LightResult(
        trial.kind, trial.floor, r.outcome, r.reason, r.error_m, count["verified"], count["refuted"],
        count["not_testable"], r.false_accepts, r.collisions or 0, r.relocalizations, r.sim_time_s, r.wall_time_s)


def write_light_mission(folder: Path, trial: LightTrial) -> Path:
    """Write the trial's scenario with the files of its floor; the same mission for every kind of light."""
    mission = write_door_mission(folder, trial.floor, "as filed")
    text = mission.path.read_text("utf-8") + format_light(draw_light(trial.kind, trial.floor))
    path = folder / f"light-{trial.kind.replace(' ', '-')}-{trial.floor}.toml"
    path.write_text(text, "utf-8")
    return path
