"""ROS maps traced into worlds: rooms and doorways against the truth, and missions between the traced rooms.

The plans are those of a public benchmark of room segmentation (Bormann et al., "Room segmentation: survey,
implementation, and analysis", ICRA 2016), drawn by others. The floors are generated ones of seeds from JUDGED_SEED on,
drawn with their furniture as a noisy scanner draws them, at a random angle. Missions take the traced world for the
building.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from experiments.generated.floors import generated_floor
from experiments.report import Cell, Report, count_kinds
from experiments.shared_data import MAP_PLANS, data_path, describe_absence
from experiments.trials import at_least, campaign_folder, run_trials
from harvey.campaign.mission_task import run_task
from harvey_buildings import import_building
from harvey_buildings.experiments.imported_building import Trip, draw_trips, write_trip
from harvey_buildings.experiments.rosmaps_scores import (
    MapTruth,
    correlate_rooms,
    count_found,
    draw_beside,
    draw_rooms,
    read_truth,
)
from harvey_buildings.experiments.scanned_map import ScanNoise, write_floor_map
from world_models.building.checks import check_world
from world_models.building.world import World
from world_models.files.world_files import load_world

if TYPE_CHECKING:
    from harvey.runner.result import MissionResult

JUDGED_SEED = 100_000
FLOORS, MISSIONS, QUICK_FLOORS, QUICK_MISSIONS = 10, 50, 1, 1
MIN_EMPTY, MIN_FURNISHED, MIN_GENERATED, MIN_DOORS = 0.95, 0.92, 0.90, 0.93
LEAST = {"empty": MIN_EMPTY, "furnished": MIN_FURNISHED, "generated": MIN_GENERATED}
MAX_ERROR_M = 0.10
ENDS = (("", "empty"), ("_trashbins", "empty"), ("_furnitures", "furnished"), ("_furnitures_trashbins", "furnished"))
QUICK_ENDS = ENDS[::2]
"""The ends of the plans' names, and what stands in them: empty, bins, furniture, both. Bins alone count as empty."""
CELL_M = 0.05
YAML = ("image: {image}\nresolution: 0.05\norigin: [0.0, 0.0, 0.0]\nnegate: 0\noccupied_thresh: 0.65\n"
        "free_thresh: 0.196\n")
COLUMNS = ("map", "true rooms", "traced", "Matthews correlation", "weighted by area", "doorways", "found", "not true",
           "faults")


@dataclass(frozen=True, slots=True)
class Score:
    """How one map was traced; ``kind`` is empty, furnished or generated; ``extra``: openings at no true doorway;
    ``picture``: the file with its true rooms beside the traced ones."""

    name: str
    kind: str
    rooms: int
    traced: int
    correlation: float
    weighted: float
    doorways: int
    found: int
    extra: int
    faults: int
    picture: Path

    @property
    def stays_below(self) -> bool:
        """Whether the map alone has less than is claimed of all of its kind."""
        return self.correlation < LEAST[self.kind] or self.found < MIN_DOORS * self.doorways


def run(quick: bool, seed: int, missions: int | None = None) -> Report:
    """Trace the plans and the generated floors, and drive so many missions (MISSIONS)."""
    from harvey.runner.result import MissionResult

    folder = campaign_folder("rosmaps", seed, quick=quick)
    scores = list(_score_plans(folder, QUICK_ENDS if quick else ENDS))
    floors = list(_trace_floors(folder, QUICK_FLOORS if quick else FLOORS, seed))
    scores += [score for _, _, score in floors]
    trips = list(_draw(floors, missions or (QUICK_MISSIONS if quick else MISSIONS), seed))
    tasks = [write_trip(trip, world.relative_to(folder), folder, seed) for world, trip in trips]
    ends = run_trials(run_task, tasks, MissionResult, folder, "mission")
    arrived = [end for end in ends if _has_arrived(end)]
    worst_mm = max((1000.0 * end.error_m for end in arrived), default=0.0)
    plans = "" if data_path(MAP_PLANS).is_dir() else f"No plan was traced: {describe_absence(MAP_PLANS)}."
    return Report(
        "ROS maps traced into worlds", COLUMNS,
        (*(_row(score) for score in scores), *(_mean_row(kind, scores) for kind in _kinds(scores))),
        notes=tuple(note for note in (
            plans,
            "Matthews correlation: of the cells of each true room and of the traced room paired with it, mean over the"
            " rooms. A doorway is found where an opening between two traced rooms is within 0.5 m of it; not true:"
            " openings at no true doorway, most of them where a corridor is parted.",
            *(f"{kind}: {_doors(kind, scores)}" for kind in _kinds(scores)),
            *(f"{score.name} stays below: correlation {score.correlation:.3f}, {score.found} of {score.doorways} doors;"
              f" {score.picture}: true rooms and doorways on the left, traced ones on the right"
              for score in scores if score.stays_below),
            f"Missions between rooms of the traced floors (seeds from {JUDGED_SEED}): {len(arrived)} of {len(ends)}"
            f" reached within {100.0 * MAX_ERROR_M:.0f} cm, at least {at_least(len(arrived), len(ends)):.1%} (95 %);"
            f" farthest {worst_mm:.0f} mm; otherwise: "
            f"{count_kinds(end.outcome for end in ends if not _has_arrived(end)) or 'none'}. The traced world is the"
            " building there: what the tracing gets wrong of the floor is in the table, not in the missions.",
        ) if note),
        claims=tuple(_claims(scores, ends)),
    )


def _claims(scores: Sequence[Score], ends: Sequence[MissionResult]) -> Iterator[tuple[str, bool]]:
    yield "each traced world has no faults", all(score.faults == 0 for score in scores)
    for kind, least in LEAST.items():
        chosen = [score for score in scores if score.kind == kind]
        if not chosen:
            continue
        yield (f"{kind} maps: the rooms' Matthews correlation is {least:.2f} or more in the mean",
               float(np.mean([score.correlation for score in chosen])) >= least)
        found, of = _count(chosen)
        yield f"{kind} maps: at least {MIN_DOORS:.0%} of the doorways are found", found >= MIN_DOORS * of
    yield (f"each mission between traced rooms reaches its goal within {100.0 * MAX_ERROR_M:.0f} cm",
           all(map(_has_arrived, ends)))


def _score_plans(folder: Path, ends: Sequence[tuple[str, str]]) -> Iterator[Score]:
    """Trace each plan that is there, by the ends of their names."""
    plans = data_path(MAP_PLANS)
    for divided in sorted(plans.glob("*_gt_segmentation.png")):
        name = divided.name.removesuffix("_gt_segmentation.png")
        truth = read_truth(plans / f"{name}.png", divided, CELL_M)
        for end, kind in ends:
            picture = plans / f"{name}{end}.png"
            if picture.is_file():
                file = folder / f"{picture.stem}.yaml"
                file.write_text(YAML.format(image=picture.resolve()), encoding="utf-8")
                yield _score(file, picture.stem, kind, truth)[1]


def _trace_floors(folder: Path, count: int, seed: int) -> Iterator[tuple[Path, World, Score]]:
    """The traced floors: world file, world, score."""
    for number in range(JUDGED_SEED + seed, JUDGED_SEED + seed + count):
        floor, rng = generated_floor(number, rooms=8, open_share=1.0).world, np.random.default_rng([number, 7])
        noise = ScanNoise(turn_rad=float(rng.uniform(-0.7, 0.7)))
        where = folder / f"floor-{number}"
        file = write_floor_map(where, floor, noise, rng)
        low = np.concatenate([floor.outline(room) for room in floor.rooms]).min(axis=0) - 1.0
        size = np.concatenate([floor.outline(room) for room in floor.rooms]).max(axis=0) + 1.0 - low
        columns, rows = (int(n) for n in np.ceil(size / CELL_M))
        truth = MapTruth(draw_rooms({room: floor.outline(room) - low for room in floor.rooms}, (rows, columns), CELL_M),
                         np.array([door.centre_world - low for door in floor.doorways]))
        world, score = _score(file, f"floor {number}", "generated", truth, low)
        yield where / "map.toml", world, score


def _score(file: Path, name: str, kind: str, truth: MapTruth, low: np.ndarray | None = None) -> tuple[World, Score]:
    target = file.with_suffix(".toml")
    target.write_text(import_building(file).text, encoding="utf-8")
    world = load_world(target)
    corner = np.zeros(2) if low is None else low
    traced = draw_rooms({room: world.outline(room) - corner for room in world.rooms}, truth.rooms.shape, CELL_M)
    correlation, weighted = correlate_rooms(truth.rooms, traced)
    openings = [door.centre_world - corner for door in world.doorways]
    found = count_found(truth.doorways, openings)
    rooms = len(np.unique(truth.rooms[truth.rooms > 0]))
    score = Score(name, kind, rooms, len(world.rooms), correlation, weighted, len(truth.doorways), found,
                  len(openings) - found, len(check_world(world)), target.with_suffix(".below.png"))
    if score.stays_below:
        draw_beside(truth, MapTruth(traced, np.array(openings).reshape(-1, 2)), CELL_M, score.picture)
    return world, score


def _draw(floors: Sequence[tuple[Path, World, Score]], count: int, seed: int) -> Iterator[tuple[Path, Trip]]:
    """Trips, the same number on each floor."""
    for number in range(count):
        path, world, _ = floors[number % len(floors)]
        for trip in draw_trips(world, 1, seed + number):
            yield path, Trip(number, trip.origin, trip.destination, trip.heading_deg)


def _has_arrived(end: MissionResult) -> bool:
    return end.outcome == "reached" and end.error_m <= MAX_ERROR_M


def _kinds(scores: Sequence[Score]) -> tuple[str, ...]:
    return tuple(dict.fromkeys(score.kind for score in scores))


def _count(scores: Sequence[Score]) -> tuple[int, int]:
    return sum(score.found for score in scores), sum(score.doorways for score in scores)


def _doors(kind: str, scores: Sequence[Score]) -> str:
    found, of = _count([score for score in scores if score.kind == kind])
    return f"{found} of {of} doorways found, at least {at_least(found, of):.1%} (95 %)"


def _row(score: Score) -> tuple[Cell, ...]:
    return (score.name, score.rooms, score.traced, score.correlation, score.weighted, score.doorways, score.found,
            score.extra, score.faults)


def _mean_row(kind: str, scores: Sequence[Score]) -> tuple[Cell, ...]:
    chosen = [score for score in scores if score.kind == kind]
    found, of = _count(chosen)
    return (f"all {kind}", sum(s.rooms for s in chosen), sum(s.traced for s in chosen),
            float(np.mean([s.correlation for s in chosen])), float(np.mean([s.weighted for s in chosen])), of, found,
            sum(s.extra for s in chosen), sum(s.faults for s in chosen))
