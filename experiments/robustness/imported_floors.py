"""Plan between any two rooms of different floors of a university, imported from IndoorGML.

Three searches: on the graph that came with the file; on the imported world's doorways, stairs and elevators; and
Harvey's route for wheels, level by level (Figure 9), refined until nothing is left to refine.
"""

from __future__ import annotations

import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations, pairwise
from pathlib import Path

import numpy as np

from experiments.report import Cell, Report
from experiments.shared_data import UNIVERSITY, data_path, describe_absence
from harvey_buildings import NavigationGraph, import_building
from world_models.building.checks import check_world
from world_models.building.passages import drivable_passages
from world_models.building.world import World
from world_models.files.world_files import load_world

MAX_REFINEMENTS = 20
COLUMNS = ("floors", "pairs of rooms", "on the file's graph", "in the imported world", "on wheels",
           "longest m", "most passages")
TITLE = "Plans between the floors of an imported university"


@dataclass(frozen=True, slots=True)
class Pair:
    """Two rooms of different floors.

    Attributes:
        length_m: length of the path on the file's own graph; None if there is none.
        walked: rooms of the path in the imported world, stairs included.
        driven: rooms of Harvey's route for wheels, refined; None if only stairs lead there.
    """

    floors: tuple[str, str]
    rooms: tuple[str, str]
    length_m: float | None
    walked: list[str] | None
    driven: list[str] | None


def run(quick: bool, seed: int) -> Report:
    """Plan between all pairs; nothing is random, so ``quick`` and ``seed`` change nothing."""
    path = data_path(UNIVERSITY)
    if not path.is_file():
        return Report(TITLE, COLUMNS, (), (f"Nothing was tried: {describe_absence(UNIVERSITY)}.",),
                      (("the building is there", False),))
    made = import_building(path)
    with tempfile.TemporaryDirectory() as folder:
        (Path(folder) / "university.toml").write_text(made.text, encoding="utf-8")
        world = load_world(Path(folder) / "university.toml")
        pairs = plan_pairs(world, made.network)
        faults = check_world(world)
    floors = sorted({pair.floors for pair in pairs})
    rows = [_row(" and ".join(both), [pair for pair in pairs if pair.floors == both]) for both in floors]
    return Report(
        TITLE, COLUMNS, (*rows, _row("all", pairs)),
        notes=(
            f"{path.name}: {len(world.rooms)} rooms on {len({f for both in floors for f in both})} floors,"
            f" {len(world.doorways)} doorways, {sum(link.kind == 'stairs' for link in world.links)} stairs,"
            f" {sum(link.kind == 'elevator' for link in world.links)} elevators.",
            "in the imported world: by its own doorways, stairs and elevators. on wheels: Harvey's route level by"
            " level, down to rooms; where only stairs lead there, none is expected.",
            *(f"{pair.rooms[0]} to {pair.rooms[1]}: no path" for pair in pairs if not pair.walked),
        ),
        claims=(
            ("the imported building is a world without faults", not faults),
            ("a plan between any two rooms of different floors, on the graph that came with the file",
             all(pair.length_m is not None for pair in pairs)),
            ("and one by the doorways, stairs and elevators of the imported world", all(p.walked for p in pairs)),
            ("each route on wheels leads from room to adjacent room, by a door or an elevator, to its end",
             all(_is_connected(world, pair) for pair in pairs if pair.driven)),
            ("there is one on wheels exactly where no stairs are needed",
             all((pair.driven is not None) == _reachable_without_stairs(world, *pair.rooms) for pair in pairs)),
        ),
    )


def plan_pairs(world: World, network: NavigationGraph | None) -> list[Pair]:
    """Plan between any two rooms of different floors."""
    pairs = []
    for rooms in combinations(world.rooms, 2):
        a, b = (world.path_of(room)[1] for room in rooms)
        if a != b:
            floors, ends = ((a, b), rooms) if a < b else ((b, a), rooms[::-1])
            pairs.append(Pair(floors, ends, _length_m(network, *ends), world.walk(*ends), refine_route(world, *ends)))
    return pairs


def _length_m(network: NavigationGraph | None, origin: str, destination: str) -> float | None:
    way = network.find_route(origin, destination) if network is not None else None
    if network is None or way is None:
        return None
    return float(np.sum([network.graph.edges[a, b]["length_m"] for a, b in pairwise(way)]))


def refine_route(world: World, origin: str, destination: str, depth: int = 0) -> list[str] | None:
    """Return the rooms of the route for wheels, refined completely; None if there is none."""
    route = world.route(origin, destination)
    if route is None or depth > MAX_REFINEMENTS:
        return None
    rooms = [origin]
    for step in (*route.steps, None):
        end = step.origin if step is not None else destination
        if rooms[-1] != end:
            part = refine_route(world, rooms[-1], end, depth + 1)
            if part is None:
                return None
            rooms += part[1:]
        rooms += [step.destination] if step is not None else []
    return rooms


def _passages(world: World) -> set[frozenset[str]]:
    """Pairs of rooms that are connected for wheels."""
    return {frozenset((a, b)) for _, a, b in drivable_passages((*world.doorways, *world.links))}


def _is_connected(world: World, pair: Pair) -> bool:
    joined, way = _passages(world), pair.driven or []
    return (way[0], way[-1]) == pair.rooms and all(frozenset(both) in joined for both in pairwise(way))


def _reachable_without_stairs(world: World, origin: str, destination: str) -> bool:
    """Whether a flat search, without levels, finds a path for wheels."""
    joined, reached, todo = _passages(world), {origin}, [origin]
    while todo:
        here = todo.pop()
        for both in sorted(joined, key=sorted):
            if here in both and not both <= reached:
                reached |= both
                todo += sorted(both - {here})
    return destination in reached


def _row(name: str, pairs: Sequence[Pair]) -> tuple[Cell, ...]:
    return (
        name, len(pairs), sum(pair.length_m is not None for pair in pairs), sum(bool(pair.walked) for pair in pairs),
        sum(pair.driven is not None for pair in pairs), max((pair.length_m or 0.0 for pair in pairs), default=0.0),
        max((len(pair.walked or [""]) - 1 for pair in pairs), default=0),
    )
