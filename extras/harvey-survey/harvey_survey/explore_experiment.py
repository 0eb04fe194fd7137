"""Explorations of unknown floors: how like the truth is the model, and do fresh robots find their way in it?

The explorer has camera and wheels; the building is the simulator's. The models are laid into the world by the start
alone. Each of the missions afterwards is by a robot that knows the explored model and nothing else, put down at a place
of it, in the building as it is.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from experiments.report import Report
from experiments.trials import campaign_folder, judge_rare, judge_share, run_trials
from harvey.agent import build_agent
from harvey.runner.result import MissionResult
from harvey.simulation.simulated_run import SimulatedRun, build_head
from harvey_survey.explore_command import build_explored_stage, build_explorer
from harvey_survey.explore_floors import (
    Likeness,
    compare_models,
    lay_into_world,
    match_rooms,
    sample_floor,
    write_bare_floor,
)
from harvey_survey.explorer import ExploringStopped
from harvey_survey.learnt_world import write_learnt_world
from harvey_survey.seen_floor import cell_of
from logs.run_recorder import RunRecorder
from sim.scenario import parse_scenario
from sim.stage import build_stage
from world_models.building.world import World
from world_models.files.world_files import load_world
from world_models.frames import Pose2
from world_models.units import FOOT_M

FLOORS, MISSIONS = 20, 10
QUICK_FLOORS, QUICK_MISSIONS = 1, 3
ROOMS = (4, 10)
FIRST_SEED = 610_000
"""The floors of seeds 7001, 7009 and 600000 are those by which the explorer was made."""
MARGIN_M = 0.8
"""Start and goal are so far from the walls."""
NEAR_M, WALL_M, ANGLE_DEG, HOME_M, SOFT_M_PER_S = 0.05, 0.03, 1.0, 0.1, 0.1


@dataclass(frozen=True, slots=True)
class ExploreCase:
    """A floor to explore, and how many missions follow."""

    seed: int
    rooms: int
    missions: int
    folder: str


@dataclass(frozen=True, slots=True)
class Explored:
    """How an exploration ended, and the missions after it.

    Attributes:
        stopped: why it stopped; "": it came home. home_m: how far from the start it truly stands then.
        likeness: of the model to the truth.
        floor_seen: which share of the floor of all rooms it saw.
        stands, path_m, robot_s: what it took. contacts, contact_m_per_s: what it touched, and how fast.
        outcomes, errors_m: of the missions: how each ended, and how far from its goal; -1 where there was no model.
    """

    seed: int
    stopped: str
    home_m: float
    likeness: Likeness
    floor_seen: float
    stands: int
    path_m: float
    robot_s: float
    contacts: int
    contact_m_per_s: float
    outcomes: list[str]
    errors_m: list[float]

    @staticmethod
    def of_record(record: Mapping[str, Any]) -> Explored:
        return Explored(**{**record, "likeness": Likeness(**record["likeness"])})


def explore_floor(case: ExploreCase) -> Explored:
    """Explore a drawn floor, compare, and drive in the model."""
    folder = Path(case.folder) / f"floor-{case.seed}"
    folder.mkdir(parents=True, exist_ok=True)
    file = write_bare_floor(folder, case.seed, case.rooms)
    true, rng = load_world(file), np.random.default_rng([case.seed, 11])
    room = str(rng.choice(true.rooms))
    stage = build_explored_stage(file, room, _draw_place(true, room, rng), float(rng.uniform(0.0, 360.0)))
    body = stage.body(case.seed)
    start, explorer, stopped = body.truth.world_from_robot, build_explorer(stage, body), ""
    try:
        explorer.explore()
    except ExploringStopped as error:
        stopped = str(error)
    truth = body.truth
    learnt = folder / f"learnt-{case.seed}.toml"
    learnt.write_text(write_learnt_world(explorer.map, learnt.stem), "utf-8")
    laid = lay_into_world(learnt, start, explorer.start_rad)
    model = load_world(laid)
    axes_from_world = (start @ Pose2(0.0, 0.0, -explorer.start_rad)).inverse()
    seen = explorer.floor.seen
    points = axes_from_world.apply(sample_floor(true))
    share = float(np.mean([seen[cell_of(point)] for point in points]))
    drives = case.missions if len(match_rooms(true, model)) > 1 else 0
    ends = [_drive(file, true, laid, model, rng, case.seed + k) for k in range(drives)]
    none = case.missions - drives  # in a model without two rooms nobody gets anywhere
    return Explored(
        case.seed, stopped, truth.world_from_robot.distance_to(start), compare_models(true, model), share,
        len(explorer.map.stands), truth.path_m, truth.time_s, truth.collisions, truth.contact_m_per_s,
        [end.outcome for end in ends] + ["no model"] * none, [end.error_m for end in ends] + [-1.0] * none)


def _draw_place(world: World, room: str, rng: np.random.Generator) -> tuple[float, float]:
    outline = world.locale(room).outline
    x, y = rng.uniform(outline.min(axis=0) + MARGIN_M, outline.max(axis=0) - MARGIN_M)
    return float(x), float(y)


def _drive(file: Path, true: World, laid: Path, model: World, rng: np.random.Generator, seed: int) -> MissionResult:
    """A mission by a robot that knows the model, from room to room of it, in the building as it is."""
    pairs = match_rooms(true, model)
    names = [str(name) for name in rng.choice(sorted(pairs), 2, replace=False)]
    places = {name: _draw_place(true, name, rng) for name in names}
    heading = float(rng.uniform(0.0, 360.0))
    own: dict[str, Sequence[float]] = {}
    for name, (x, y) in places.items():
        world = true.world_from_locale(name).apply([x, y, 0.0])
        own[name] = model.world_from_locale(pairs[name]).inverse().apply(world)[:2].tolist()
    turn = np.degrees(np.arctan2(*model.world_from_locale(pairs[names[0]]).rotation[1::-1, 0]))
    mission = _mission(file, names, [places[name] for name in names], heading)
    stage = build_stage(parse_scenario(mission, "explored", file.parent))
    inside, ways = [pairs[name] for name in names], [own[name] for name in names]
    text = _mission(laid, inside, ways, (heading - float(turn)) % 360.0)
    knows = build_head(replace(stage, scenario=parse_scenario(text, "explored", file.parent)), seed)
    agent = build_agent(knows)
    with SimulatedRun(stage, knows, agent, RunRecorder(None, knows, agent.world, agent.robot)) as run:
        return run.drive(None)


def _mission(world: Path, rooms: Sequence[str], places: Sequence[Sequence[float]], heading_deg: float) -> str:
    ends = [f"({room} ({x / FOOT_M:.5f},{y / FOOT_M:.5f},0))"
            for room, (x, y) in zip(rooms, places, strict=True)]
    return (f'world = "{world.resolve()}"\ngoal = "(ptrans {ends[0]} {ends[1]})"\n[start]\n'
            f"heading_deg = {heading_deg:.5f}\nput_down_sigma_m = 0.02\nput_down_sigma_deg = 1.0\n")


def run(quick: bool, seed: int, missions: int | None = None) -> Report:
    """Explore 20 floors of 4 to 10 rooms, with 10 missions in each model, or so many; quick: one of 4 rooms, with 3."""
    floors, each = (QUICK_FLOORS, QUICK_MISSIONS) if quick else (FLOORS, MISSIONS)
    folder, first = campaign_folder("explore", seed, quick=quick), FIRST_SEED + 1000 * seed
    low, high = ROOMS
    cases = [ExploreCase(first + k, low + k % (high - low + 1), each if missions is None else missions, str(folder))
             for k in range(floors)]
    return report(run_trials(explore_floor, cases, Explored, folder, "floor"))


def report(ends: Sequence[Explored]) -> Report:
    """The table and the claims of some explorations."""

    def total(name: str) -> int:
        return sum(int(getattr(end.likeness, name)) for end in ends)

    def join(part: Callable[[Explored], Sequence[float]]) -> list[float]:
        return [value for end in ends for value in part(end)]

    walls = join(lambda end: end.likeness.walls_m)
    wall_m = float(np.median(walls)) if walls else float("inf")
    angle = float(np.median([end.likeness.angle_deg for end in ends]))
    precision, recall = (total(a) / max(1, total(b)) for a, b in (("own_right", "own_corners"),
                                                                   ("true_found", "true_corners")))
    f1 = 2.0 * precision * recall / max(precision + recall, 1e-9)
    fast = sum(end.contacts for end in ends if end.contact_m_per_s > SOFT_M_PER_S)
    home = sum(not end.stopped and end.home_m <= HOME_M for end in ends)
    errors, outcomes = join(lambda end: end.errors_m), [one for end in ends for one in end.outcomes]
    near = sum(o == "reached" and e <= NEAR_M for o, e in zip(outcomes, errors, strict=True))
    wrong = sum(o == "reached" and e > 0.3 for o, e in zip(outcomes, errors, strict=True))
    rows = [(f"floor {e.seed}", f"{e.likeness.found_rooms}/{e.likeness.rooms}",
             f"{e.likeness.found_doors}/{e.likeness.doors}", f"{e.floor_seen:.0%}",
             100.0 * float(np.median(e.likeness.walls_m)) if e.likeness.walls_m else None,
             e.contacts, 100.0 * e.home_m, e.path_m, e.robot_s, e.stands,
             f"{sum(o == 'reached' for o in e.outcomes)}/{len(e.outcomes)}", e.stopped) for e in ends]
    floor = float(np.mean([end.floor_seen for end in ends]))
    return Report(
        "Unknown floors explored, and missions in the models",
        ("floor", "rooms", "doorways", "floor seen", "walls off cm", "contacts", "home cm", "path m", "robot s",
         "stands", "missions reached", "stopped"), tuple(rows),
        notes=("Rooms are bare of furniture and doors open. A room counts whose outline shares 70 % with the true one,"
               " a doorway within 30 cm, a corner within 10 cm. All errors are from the start: drift counts.",),
        claims=(
            (f"at least 99 % of rooms: {total('found_rooms')} of {total('rooms')}",
             judge_share(total("found_rooms"), total("rooms"), 0.99)),
            (f"every doorway: {total('found_doors')} of {total('doors')}, {total('false_doors')} too many",
             total("found_doors") == total("doors") and not total("false_doors")),
            (f"at least 95 % of the floor: {floor:.1%}", floor >= 0.95),
            (f"walls within {100 * WALL_M:g} cm, {ANGLE_DEG:g} degree (median): {100 * wall_m:.1f} cm, {angle:.2f}",
             wall_m <= WALL_M and angle <= ANGLE_DEG),
            (f"corners: F1 at least 95 % at 10 cm: {f1:.1%}", f1 >= 0.95),
            (f"no contact above {SOFT_M_PER_S:g} m/s: {fast}", fast == 0),
            (f"home within {100 * HOME_M:g} cm: {home} of {len(ends)}", home == len(ends)),
            (f"missions: at least 95 % within {100 * NEAR_M:g} cm: {near} of {len(errors)}",
             judge_share(near, len(errors), 0.95)),
            (f"missions: none says that it is there and is elsewhere: {wrong} of {len(errors)}",
             judge_rare(wrong, len(errors), 0.01)),
        ),
        is_small=len(ends) < FLOORS,
    )
