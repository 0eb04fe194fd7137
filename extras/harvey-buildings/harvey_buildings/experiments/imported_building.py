"""Import a house from IFC, check it, and drive missions between its rooms.

Missions are "Go from ROOM to ROOM", between rooms that a robot on wheels can stand in and reach without stairs. They
run in worker processes; results are kept, so that an interrupted experiment continues where it was.
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from experiments.report import Cell, Report, count_kinds
from experiments.shared_data import DUPLEX, data_path, describe_absence
from experiments.trials import campaign_folder, run_trials
from harvey.campaign.mission_task import Task, run_task
from harvey_buildings import import_building
from world_models.building.checks import check_world
from world_models.building.geometry.outlines import distance_to_border
from world_models.building.world import World
from world_models.commands import find_open_point
from world_models.files.world_files import load_world

if TYPE_CHECKING:
    from harvey.runner.result import MissionResult

MISSIONS, QUICK_MISSIONS = 50, 2
MIN_REACHED_SHARE = 0.96
"""Share of the missions that must reach their goals: 48 of 50."""
MAX_ERROR_M = 0.05
"""Largest true distance from its goal at which a mission counts as reached."""
MIN_CLEARANCE_M = 0.4
"""Free space on all sides at which a robot can be put down in a room."""
DECLARED = ("lost", "blocked", "failed")
SCENARIO = """\
# Of an experiment; again: harvey run THIS_FILE --seed {seed}
world = "{world}"
goal = "Go from {origin} to {destination}"

[start]
heading_deg = {heading_deg:.1f}
put_down_sigma_m = 0.03
put_down_sigma_deg = 2.0
"""
COLUMNS = ("connected rooms", "missions", "reached", "otherwise", "mean mm", "max mm", "collisions", "false accepts",
           "replans", "relocated", "path m", "mean s")


@dataclass(frozen=True, slots=True)
class Trip:
    """One mission: from room to room, starting with this heading in the first room's frame."""

    number: int
    origin: str
    destination: str
    heading_deg: float


def run(quick: bool, seed: int) -> Report:
    """Import, check, and drive."""
    from harvey.runner.result import MissionResult

    path, title = data_path(DUPLEX), "Missions between the rooms of an imported house"
    if find_spec("ifcopenshell") is None or not path.is_file():
        lacking = describe_absence(DUPLEX) if find_spec("ifcopenshell") else \
            "ifcopenshell is not installed: .venv/bin/pip install ifcopenshell"
        return Report(title, COLUMNS, (), (f"Nothing was tried: {lacking}.",), (("the house is there", False),))
    text = import_building(path).text
    folder = campaign_folder("imported-building", seed, quick=quick) / _digest(text)
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "house.toml").write_text(text, encoding="utf-8")
    world = load_world(folder / "house.toml")
    trips = list(draw_trips(world, QUICK_MISSIONS if quick else MISSIONS, seed))
    tasks = [write_trip(trip, Path("house.toml"), folder, seed) for trip in trips]
    ends = run_trials(run_task, tasks, MissionResult, folder, "mission")
    groups = _groups(world)
    rows = [_row(name, chosen) for name, rooms in groups.items()
            if (chosen := [end for trip, end in zip(trips, ends, strict=True) if trip.origin in rooms])]
    return Report(
        title, COLUMNS, (*rows, _row("all", ends)),
        notes=(
            f"{path.name}: {len(world.rooms)} rooms, {len(world.doorways)} open doorways. Rooms that a robot can be put"
            f" down in: {sum(map(len, groups.values()))}; any two of one row can be reached from each other on wheels.",
            f"Rooms and headings are drawn with seed {seed}; mission N has seed {seed} + N. Errors are true distances.",
            f"Each mission is a scenario file: {folder}/mission-N.toml.",
            *(_describe(trip, end, seed) for trip, end in zip(trips, ends, strict=True)
              if not _has_arrived(end) or end.collisions),
        ),
        claims=(
            ("the imported house is a world without faults", not check_world(world)),
            (f"at least {_min_goals(len(ends))} of {len(ends)} missions reach their goals, and truly are within"
             f" {1000.0 * MAX_ERROR_M:.0f} mm of them", sum(map(_has_arrived, ends)) >= _min_goals(len(ends))),
            ("every other one ends in a declared outcome", all(_has_arrived(r) or _is_declared(r) for r in ends)),
        ),
    )


def draw_trips(world: World, count: int, seed: int) -> Iterator[Trip]:
    """Draw pairs of different rooms of one group, each room equally likely, with headings."""
    groups = list(_groups(world).values())
    rooms = [(room, group) for group in groups for room in group]
    rng = np.random.default_rng(seed)
    for number in range(count):
        origin, group = rooms[int(rng.integers(len(rooms)))]
        others = [room for room in group if room != origin]
        yield Trip(number, origin, others[int(rng.integers(len(others)))], float(rng.uniform(-180.0, 180.0)))


def _groups(world: World) -> Mapping[str, tuple[str, ...]]:
    """Group the rooms in which a robot can stand by whether they can be reached from each other."""
    left = [room for room in world.rooms if _clearance_m(world, room) >= MIN_CLEARANCE_M]
    groups: dict[str, tuple[str, ...]] = {}
    while left:
        group = tuple(room for room in left if world.route(left[0], room) is not None)
        left = [room for room in left if room not in group]
        if len(group) > 1:
            groups[", ".join(group)] = group
    return groups


def _clearance_m(world: World, room: str) -> float:
    """Distance of a room's middle from its walls and from the things in it [m]."""
    middle = find_open_point(world, room).in_world(world).position
    return min(distance_to_border(middle, border) for border in (world.outline(room), *world.obstacles(room)))


def write_trip(trip: Trip, world: Path, folder: Path, seed: int) -> Task:
    """Write a trip as a scenario, ``mission-N.toml`` beside its world's file, with a seed of its own."""
    path = folder / f"mission-{trip.number}.toml"
    path.write_text(SCENARIO.format(seed=seed + trip.number, world=world.as_posix(), origin=trip.origin,
                                    destination=trip.destination, heading_deg=trip.heading_deg), encoding="utf-8")
    return Task(str(path), (), seed + trip.number)


def _has_arrived(result: MissionResult) -> bool:
    return result.outcome == "reached" and result.error_m <= MAX_ERROR_M


def _is_declared(result: MissionResult) -> bool:
    """Whether it ended in a declared outcome, and not because a knowledge source raised an exception."""
    return result.outcome in DECLARED and " raised " not in result.reason


def _min_goals(count: int) -> int:
    return int(np.ceil(MIN_REACHED_SHARE * count - 1e-9))


def _row(name: str, results: Sequence[MissionResult]) -> tuple[Cell, ...]:
    errors_mm = [1000.0 * r.error_m for r in results if _has_arrived(r)]
    return (
        name, len(results), len(errors_mm),
        count_kinds(r.outcome for r in results if not _has_arrived(r)),
        float(np.mean(errors_mm)) if errors_mm else None, max(errors_mm, default=None),
        sum(r.collisions or 0 for r in results), sum(r.false_accepts for r in results),
        sum(r.replans for r in results), sum(r.relocalizations for r in results),
        float(np.sum([r.path_length_m for r in results])), float(np.mean([r.wall_time_s for r in results])),
    )


def _describe(trip: Trip, result: MissionResult, seed: int) -> str:
    return (f"mission-{trip.number} (seed {seed + trip.number}), {trip.origin} to {trip.destination}:"
            f" {result.outcome} ({result.reason}), {1000.0 * result.error_m:.0f} mm from its goal,"
            f" {result.collisions} collisions.")


def _digest(text: str) -> str:
    return hashlib.sha256(text.encode()).hexdigest()[:8]
