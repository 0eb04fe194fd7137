"""Missions on generated floors of identical rooms: the robot is told in which it is, and that may be another one."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from sim.made_up.drivable import is_drivable
from sim.made_up.generated_floors import generated_floor
from sim.scenario import parse_scenario
from sim.stage import build_stage
from world_models.units import FOOT_M

MIN_ROOMS, MAX_ROOMS = 5, 40
MARGIN_FT = 3.0
"""Start and goal are as far from the walls of their rooms."""
MAX_DRAWS = 200


@dataclass(frozen=True, slots=True)
class TwinMission:
    """A mission: its file, the room that is told, the room where the robot is put down, and the number of rooms."""

    path: Path
    told: str
    true: str
    rooms: int


def write_twin_mission(folder: Path, seed: int, *, is_told_right: bool, rooms: int | None = None) -> TwinMission:
    """Write a scenario from one of identical rooms to another, with the floor's files.

    Where it is told wrong the robot is put down in a twin of the told room: at the same place of it, so that both look
    alike from there. The same for the same arguments; start and goal do not depend on ``is_told_right``.

    Args:
        rooms: number of rooms; drawn from 5 to 40 where it is not given.

    Raises:
        ValueError: nothing that fits was found.
    """
    rng = np.random.default_rng([seed, 7])
    drawn = round(math.exp(rng.uniform(math.log(MIN_ROOMS), math.log(MAX_ROOMS))))
    floor = generated_floor(seed, rooms or drawn, open_share=1.0, identical=True)
    world, details = floor.write(folder)
    for _ in range(MAX_DRAWS):
        told, goal = (str(room) for room in rng.choice(floor.rooms, 2, replace=False))
        alike = [r for r in floor.rooms if r != told and _side(r) == _side(told)]
        twin = str(rng.choice(alike))
        places = [_draw_place(floor.world.locale(room).outline, rng) for room in (told, goal)]
        heading_deg = math.degrees(rng.uniform(-math.pi, math.pi))
        start, end = (f"({room} ({x:.2f},{y:.2f},0))" for room, (x, y) in zip((told, goal), places, strict=True))
        text = (f'description = "A floor of {rooms or drawn} identical rooms."\n'
                f'world = "{world.name}"\ndetails = ["{details.name}"]\ngoal = "(ptrans {start} {end})"\n\n'
                f"[start]\nheading_deg = {heading_deg:.1f}\nput_down_sigma_m = 0.02\nput_down_sigma_deg = 1.0\n")
        if not is_told_right:
            x, y = places[0]
            text += (f'\n[truth.start]\nlocale = "{twin}"\nx_m = {x * FOOT_M:.4f}\ny_m = {y * FOOT_M:.4f}\n'
                     f"heading_deg = {heading_deg:.1f}\n")
        try:
            stage = build_stage(parse_scenario(text, "twins", folder))
        except ValueError:
            continue
        if is_drivable(stage.building.obstacles, stage.put_down_world, stage.goal_world):
            path = folder / f"twins-{seed}.toml"
            path.write_text(text, "utf-8")
            return TwinMission(path, told, told if is_told_right else twin, rooms or drawn)
    raise ValueError(f"expected a mission on floor {seed}, got none in {MAX_DRAWS} draws")


def _side(room: str) -> str:
    """The side of the corridor on which a room lies: those on the same side are alike without being turned."""
    return room.split("-")[2]


def _draw_place(outline: np.ndarray, rng: np.random.Generator) -> tuple[float, float]:
    x, y = rng.uniform(outline.min(axis=0) + MARGIN_FT * FOOT_M, outline.max(axis=0) - MARGIN_FT * FOOT_M)
    return float(x) / FOOT_M, float(y) / FOOT_M
