"""One mission on a floor whose doors are otherwise than the model says: how it ended, and what it held of the doors."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

from blackboard.change import Change
from blackboard.journal import Decision
from experiments.generated.door_missions import DoorCase, write_door_mission
from harvey.campaign.campaign import Task, run_task
from sim.scenario import load_scenario
from world_models.entries.door_state import DoorState


@dataclass(frozen=True, slots=True)
class DoorTrial:
    """A mission.

    Attributes:
        case: what is otherwise about the doors.
        floor: seed of the generated floor, and of all chance.
    """

    case: DoorCase
    floor: int


@dataclass(frozen=True, slots=True)
class DoorResult:
    """How a mission ended, in plain types.

    Attributes:
        door: the door that is otherwise; "" where none is.
        is_found: whether that was ever held to be shut or ajar.
        false_states: what was held of doors and is not so.
        robot_s: time of the robot.
    """

    case: str
    floor: int
    door: str
    outcome: str
    reason: str
    error_m: float
    is_found: bool
    false_states: list[str]
    false_accepts: int
    collisions: int
    relocations: int
    robot_s: float
    wall_s: float


def run_door_mission(trial: DoorTrial) -> DoorResult:
    """Run the mission of a trial."""
    states: dict[tuple[str, str], float] = {}

    def note(decision: Decision) -> None:
        for change in decision.made:
            _note_state(change, states)

    with TemporaryDirectory() as folder:
        mission = write_door_mission(Path(folder), trial.floor, trial.case)
        scenario = load_scenario(mission.path)
        r = run_task(Task(str(mission.path), (), trial.floor), sinks=[note])
    wrong = []
    for (door, state), seen_s in sorted(states.items()):
        true = {d.state for d in scenario.truth.doors if d.name == door and d.at_s <= seen_s < d.until_s} or {"open"}
        if (state == "open") != (true == {"open"}):
            wrong.append(f"{door} is {state} at {seen_s:.1f} s")
    return DoorResult(
        trial.case, trial.floor, mission.door, r.outcome, r.reason, r.error_m,
        any(door == mission.door and state != "open" for door, state in states), wrong, r.false_accepts,
        r.collisions or 0, r.relocalizations, r.sim_time_s, r.wall_time_s)


def _note_state(change: Change, states: dict[tuple[str, str], float]) -> None:
    """Note the door and its state, with when it was seen, where that is certain."""
    value = change.entry.value
    if isinstance(value, DoorState) and value.state != "unknown":
        states.setdefault((value.door, value.state), value.seen_s)
