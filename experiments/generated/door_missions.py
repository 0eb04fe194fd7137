"""Missions on generated floors whose doors differ from the model, as files for campaigns."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path

import networkx as nx
import numpy as np
import shapely

from experiments.generated.floors import Floor, generated_floor
from experiments.generated.free_floor import find_free_floor, find_shortest_way, has_way, take_from_floor
from experiments.generated.missions import ROOM_M, ROOMS, draw_ends, draw_heading_deg, draw_rooms, format_mission
from sim.body.collision import Obstacles
from sim.ground_truth.table import TrueDoor
from sim.ground_truth.true_changes import build_leaf
from sim.scenario import Scenario, parse_scenario
from sim.stage import Stage, build_stage
from world_models.building.locales import Doorway
from world_models.building.world import World
from world_models.commands import parse_command
from world_models.frames import Pose2, flattened

CASES = ("another way", "no way", "extra door", "stands open", "opens", "shuts", "ajar", "as filed", "loose leaf")
"""What differs about the doors: shut, with another way or with none; a door that the model lacks; one that stands
open and is closed in the model; one that opens or shuts during the mission; one that is ajar, with another way; a leaf
that stands loose before an open door or behind it, with another way."""
WAY_MARGIN_M = 0.12
"""Free floor beside the robot on a way that counts as one."""
LOOSE_M = 0.2, 0.6
"""So far from its middle a loose leaf stands before an opening, or behind it."""
OPENS_S, SHUTS_S = (20.0, 60.0), (5.0, 25.0)
"""When a door opens, or shuts."""
MAX_DRAWS = 60
MAX_FLOORS, FLOORS_APART = 20, 100_000_000
"""Where a floor has no such mission, one is looked for on another: so far are their seeds apart."""


@dataclass(frozen=True)
class DoorMission:
    """A mission and what differs.

    Attributes:
        path: the scenario's file.
        door: the door that differs; "" where none is.
    """

    path: Path
    door: str


def write_door_mission(folder: Path, seed: int, case: str) -> DoorMission:
    """Write a scenario from one room of a generated floor to another, with the floor's files.

    The same for the same arguments.

    Raises:
        ValueError: nothing that fits was found.
    """
    for number in range(MAX_FLOORS):
        mission = _write_on_floor(folder, seed, seed + number * FLOORS_APART, case)
        if mission is not None:
            return mission
    raise ValueError(f"expected a mission with doors: {case} on {MAX_FLOORS} floors from {seed} on, got none")


def _write_on_floor(folder: Path, seed: int, floor_seed: int, case: str) -> DoorMission | None:
    loops, rng = case not in ("no way", "stands open"), np.random.default_rng([floor_seed, 3, CASES.index(case)])
    floor = generated_floor(floor_seed, ROOMS, open_share=0.6 if case == "stands open" else 1.0, joined=loops)
    if case == "stands open" and not 2 <= len(floor.world.doorways) < ROOMS:
        return None
    files = floor.write(folder)
    stage: Stage | None = None
    for _ in range(MAX_DRAWS):
        ends = draw_ends(floor, draw_rooms(floor, rng), rng)
        text = format_mission(f"A generated floor; doors: {case}.", files, ends, draw_heading_deg(rng))
        try:
            scenario = parse_scenario(text, "doors", folder)
            stage = build_stage(scenario) if stage is None else _move_ends(stage, scenario)
            drawn = _draw_doors(stage, floor, case, rng)
            if drawn is None:
                continue
            build_stage(parse_scenario(text + drawn[1], "doors", folder))
        except ValueError:
            continue
        path = folder / f"doors-{case.replace(' ', '-')}-{seed}.toml"
        path.write_text(text + drawn[1], "utf-8")
        return DoorMission(path, drawn[0])
    return None


def _move_ends(stage: Stage, scenario: Scenario) -> Stage:
    """The stage of a scenario that differs in start and goal alone, with the building that is there already.

    Whether the robot has room there is not checked, as ``build_stage`` does.

    Raises:
        ValueError: another part of the world would have to be built.
    """
    world = stage.world
    start, goal = parse_command(scenario.goal, world)
    parts = [{world.locale(end.locale).parent for end in ends}
             for ends in (parse_command(stage.scenario.goal, world), (start, goal))]
    if parts[0] != parts[1]:
        raise ValueError(f"expected a mission in {parts[0]}, got one in {parts[1]}")
    heading = scenario.arrival.heading_rad if scenario.arrival.matters else 0.0
    start_world = replace(start, heading_rad=scenario.start.heading_rad).in_world(world)
    goal_world = replace(goal, heading_rad=heading).in_world(world)
    return replace(stage, scenario=scenario, start_world=start_world, goal_world=goal_world,
                   put_down_world=start_world, goal_floor_m=world.floor_m(goal.locale))


def _draw_doors(stage: Stage, floor: Floor, case: str, rng: np.random.Generator) -> tuple[str, str] | None:
    """The door that differs, and its part of the scenario's file; None where this mission does not fit."""
    start, goal = stage.start_world, stage.goal_world
    obstacles = stage.building.obstacles
    if min(obstacles.clearance_m(start), obstacles.clearance_m(goal)) < ROOM_M:
        return None
    free = find_free_floor(obstacles, WAY_MARGIN_M)
    if not has_way(free, start, goal):
        return None
    if case == "as filed":
        return "", ""
    if case == "extra door":
        return _draw_extra_door(stage, rng)
    if case == "stands open":
        return _draw_open_door(floor, rng)
    on_way = _list_on_way(stage, free)
    if not on_way:
        return None
    door = on_way[int(rng.integers(len(on_way)))]
    leaf = build_leaf(TrueDoor(name=door.name), door, stage.building.floor_m)
    solid = Obstacles.of_faces(leaf, stage.building.floor_m)
    is_left = has_way(take_from_floor(free, solid, WAY_MARGIN_M), start, goal)
    if is_left != (case != "no way"):
        return None
    if case != "no way" and _is_only_way(stage.world, door, stage):
        return None
    if case == "loose leaf":
        return "", _draw_loose_leaf(stage.world, door, rng)
    when = {"opens": f"until_s = {rng.uniform(*OPENS_S):.1f}\n", "shuts": f"at_s = {rng.uniform(*SHUTS_S):.1f}\n"}
    state = "ajar" if case == "ajar" else "shut"
    swing = ""
    if state == "ajar":
        swing = f'into = "{rng.choice(door.between)}"\nhinge = "{rng.choice(["left", "right"])}"\n'
    return door.name, f'\n[[truth.doors]]\nname = "{door.name}"\nstate = "{state}"\n{swing}{when.get(case, "")}'


def _list_on_way(stage: Stage, free: shapely.Geometry) -> list[Doorway]:
    """The doorways that the shortest way passes through."""
    way = find_shortest_way(free, stage.start_world, stage.goal_world)
    if way is None:
        return []
    steps = np.concatenate([np.linspace(a, b, max(2, int(np.linalg.norm(b - a) / 0.05)))
                            for a, b in pairwise(way)])
    return [d for d in stage.world.doorways
            if np.linalg.norm(steps - d.centre_world, axis=1).min() < 0.5 * d.width_m]


def _is_only_way(world: World, door: Doorway, stage: Stage) -> bool:
    """Whether the rooms where the mission begins and ends are apart without a door."""
    graph = nx.MultiGraph([(*d.between, d.name) for d in world.doorways])
    graph.remove_edge(*door.between, key=door.name)
    ends = [world.locale_at(pose.position) for pose in (stage.start_world, stage.goal_world)]
    return any(end not in graph for end in ends) or not nx.has_path(graph, *ends)


def _draw_extra_door(stage: Stage, rng: np.random.Generator) -> tuple[str, str] | None:
    """A leaf flat on a wall, as of a door that the model lacks."""
    rooms: Sequence[str] = [room for room in stage.world.rooms if room.startswith("corridor")]
    room = str(rng.choice(rooms))
    low, high = (f(stage.world.locale(room).outline, axis=0) for f in (np.min, np.max))
    x, north = float(rng.uniform(low[0] + 1.0, high[0] - 1.0)), bool(rng.integers(2))
    y = float(high[1] - 0.07 if north else low[1] + 0.07)
    at = stage.world.world_from_locale(room).apply(np.array([x, y, 0.0]))[:2]
    if any(np.linalg.norm(d.centre_world - at) < d.width_m + 0.6 for d in stage.world.doorways):
        return None
    heading = math.pi if north else 0.0
    return "", (f'\n[[truth.extra]]\nkind = "door-leaf"\nlocale = "{room}"\nx_m = {x:.4f}\ny_m = {y:.4f}\n'
                f"heading_rad = {heading:.4f}\n")


def _draw_loose_leaf(world: World, door: Doorway, rng: np.random.Generator) -> str:
    """A leaf along the wall that stands in one of the rooms of an open door and hides it."""
    room = str(rng.choice(door.between))
    stands = door.pose_from(room) @ Pose2(-float(rng.uniform(*LOOSE_M)), float(rng.uniform(-0.1, 0.1)), 0.5 * math.pi)
    own = flattened(world.world_from_locale(room)).inverse() @ stands
    return (f'\n[[truth.extra]]\nkind = "door-leaf"\nlocale = "{room}"\nx_m = {own.x_m:.4f}\ny_m = {own.y_m:.4f}\n'
            f"heading_rad = {own.heading_rad:.4f}\n")


def _draw_open_door(floor: Floor, rng: np.random.Generator) -> tuple[str, str] | None:
    """A door that the model has closed, and that stands open."""
    opened = {d.name for d in floor.world.doorways}
    closed = [f"door-{room[5:]}" for room in floor.rooms if f"door-{room[5:]}" not in opened]
    if not closed:
        return None
    name = str(rng.choice(closed))
    return name, f'\n[[truth.doors]]\nname = "{name}"\nstate = "open"\n'
