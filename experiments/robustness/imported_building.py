"""A house that others have drawn (IFC) is imported, checked and driven in: missions between its rooms.

Missions are "Go from ROOM to ROOM", between rooms that a robot on wheels can stand in and get to without stairs. They
run in worker processes; what is done is kept, so that the experiment may be cut off and goes on where it was.
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from experiments.building_files import DUPLEX, building_file, where_it_should_be
from experiments.report import Cell, Report
from experiments.trials import found_by_all
from harvey.campaign.campaign import Task, run_task
from harvey.run_files.run_directory import RUNS
from world_models.building.checks import check_world
from world_models.building.outlines import distance_to_border
from world_models.building.world import World
from world_models.commands import find_open_point
from world_models.files.importers import import_building
from world_models.files.world_files import load_world

if TYPE_CHECKING:
    from harvey.runner.result import MissionResult

MISSIONS, QUICK_MISSIONS = 50, 2
LEAST = 0.96
"""This part of the missions must reach their goals: 48 of 50."""
NEAR_M = 0.05
"""A mission that says that it reached its goal must truly be this near to it."""
STANDING_M = 0.4
"""A room must have a place with so much room on all sides for a robot to be put down in it."""
DECLARED = ("lost", "blocked", "failed")
SCENARIO = """\
# {name} of harvey experiment imported-building; again: harvey run THIS_FILE --seed {seed}
world = "house.toml"
goal = "Go from {origin} to {destination}"

[start]
heading_deg = {heading_deg:.1f}
put_down_sigma_m = 0.03
put_down_sigma_deg = 2.0
"""
COLUMNS = ("rooms that hang together", "missions", "reached", "otherwise", "mean mm", "max mm", "collisions", "wrong",
           "replans", "relocated", "path m", "mean s")


@dataclass(frozen=True, slots=True)
class Errand:
    """One mission: from room to room, the robot put down with this heading in the first room's frame."""

    number: int
    origin: str
    destination: str
    heading_deg: float


def run(quick: bool, seed: int) -> Report:
    """Import, check, drive."""
    from harvey.runner.result import MissionResult

    path, title = building_file(DUPLEX), "Missions between the rooms of an imported house"
    if find_spec("ifcopenshell") is None or not path.is_file():
        lacking = where_it_should_be(DUPLEX) if find_spec("ifcopenshell") else \
            "ifcopenshell is not installed: .venv/bin/pip install '.[ifc]'"
        return Report(title, COLUMNS, (), (f"Nothing was tried: {lacking}.",), (("the house is there", False),))
    text = import_building(path).text
    folder = RUNS / "imported-building" / f"{'quick' if quick else 'full'}-{seed}-{_digest(text)}"
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "house.toml").write_text(text, encoding="utf-8")
    world = load_world(folder / "house.toml")
    errands = list(drawn(world, QUICK_MISSIONS if quick else MISSIONS, seed))
    ends = found_by_all(run_task, [_task(errand, folder, seed) for errand in errands], MissionResult, folder, "mission")
    groups = _groups(world)
    rows = [_row(name, chosen) for name, rooms in groups.items()
            if (chosen := [end for errand, end in zip(errands, ends, strict=True) if errand.origin in rooms])]
    return Report(
        title, COLUMNS, (*rows, _row("all", ends)),
        notes=(
            f"{path.name}: {len(world.rooms)} rooms, {len(world.doorways)} open doorways. Rooms that a robot can be put"
            f" down in: {sum(map(len, groups.values()))}; any two of one row can be reached from each other on wheels.",
            f"Rooms and headings are drawn with seed {seed}; mission N has seed {seed} + N. Errors are true distances.",
            f"Each is a scenario of its own: {folder}/mission-N.toml.",
            *(_told(errand, end, seed) for errand, end in zip(errands, ends, strict=True)
              if not _arrived(end) or end.collisions),
        ),
        claims=(
            ("the imported house is a world without faults", not check_world(world)),
            (f"at least {_least(len(ends))} of {len(ends)} missions reach their goals, and truly are within"
             f" {1000.0 * NEAR_M:.0f} mm of them", sum(map(_arrived, ends)) >= _least(len(ends))),
            ("every other one ends in a declared outcome", all(_arrived(r) or _declared(r) for r in ends)),
        ),
    )


def drawn(world: World, count: int, seed: int) -> Iterator[Errand]:
    """So many pairs of different rooms of one group, each room as likely as any other, and headings."""
    groups = list(_groups(world).values())
    rooms = [(room, group) for group in groups for room in group]
    rng = np.random.default_rng(seed)
    for number in range(count):
        origin, group = rooms[int(rng.integers(len(rooms)))]
        others = [room for room in group if room != origin]
        yield Errand(number, origin, others[int(rng.integers(len(others)))], float(rng.uniform(-180.0, 180.0)))


def _groups(world: World) -> Mapping[str, tuple[str, ...]]:
    """Rooms in which a robot can stand, two or more that can be reached from each other."""
    left = [room for room in world.rooms if _room_m(world, room) >= STANDING_M]
    groups: dict[str, tuple[str, ...]] = {}
    while left:
        group = tuple(room for room in left if world.route(left[0], room) is not None)
        left = [room for room in left if room not in group]
        if len(group) > 1:
            groups[", ".join(group)] = group
    return groups


def _room_m(world: World, room: str) -> float:
    """How far the middle of a room is from its walls and from what stands in it [m]."""
    middle = find_open_point(world, room).in_world(world).position
    return min(distance_to_border(middle, border) for border in (world.outline(room), *world.obstacles(room)))


def _task(errand: Errand, folder: Path, seed: int) -> Task:
    path = folder / f"mission-{errand.number}.toml"
    path.write_text(SCENARIO.format(name=path.stem, seed=seed + errand.number, origin=errand.origin,
                                    destination=errand.destination, heading_deg=errand.heading_deg), encoding="utf-8")
    return Task(str(path), (), seed + errand.number)


def _arrived(result: MissionResult) -> bool:
    return result.outcome == "reached" and result.error_m <= NEAR_M


def _declared(result: MissionResult) -> bool:
    """Whether somebody on the board, or a limit, said how it ended; an expert that raised is no such thing."""
    return result.outcome in DECLARED and " raised " not in result.reason


def _least(count: int) -> int:
    return int(np.ceil(LEAST * count - 1e-9))


def _row(name: str, results: Sequence[MissionResult]) -> tuple[Cell, ...]:
    errors_mm = [1000.0 * r.error_m for r in results if _arrived(r)]
    others = sorted({r.outcome for r in results if not _arrived(r)})
    return (
        name, len(results), len(errors_mm),
        ", ".join(f"{sum(1 for r in results if not _arrived(r) and r.outcome == kind)} {kind}" for kind in others)
        or None,
        float(np.mean(errors_mm)) if errors_mm else None, max(errors_mm, default=None),
        sum(r.collisions or 0 for r in results), sum(r.false_accepts for r in results),
        sum(r.replans for r in results), sum(r.relocalizations for r in results),
        float(np.sum([r.path_length_m for r in results])), float(np.mean([r.wall_time_s for r in results])),
    )


def _told(errand: Errand, result: MissionResult, seed: int) -> str:
    return (f"mission-{errand.number} (seed {seed + errand.number}), {errand.origin} to {errand.destination}:"
            f" {result.outcome} ({result.reason}), {1000.0 * result.error_m:.0f} mm from its goal,"
            f" {result.collisions} collisions.")


def _digest(text: str) -> str:
    return hashlib.sha256(text.encode()).hexdigest()[:8]
