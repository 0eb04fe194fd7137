"""Missions on generated floors with clutter on or beside the way, as files for campaigns."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np

from sim.made_up.clutter import KEPT_FREE_M, ClutterMaker
from sim.made_up.generated_floors import generated_floor
from sim.scenario import parse_scenario
from sim.stage import build_stage
from world_models.building.world import World
from world_models.entries.location import Place
from world_models.units import FOOT_M

MARGIN_FT = 2.5
"""Start and goal are as far from the walls of their rooms."""
MAX_DRAWS = 100


def write_cluttered_mission(
    folder: Path, seed: int, *, leaves_way: bool = True, rooms: int = 6, count: int | None = None
) -> Path:
    """Write a scenario from one room of a generated floor to another, with the floor's files; returns its path.

    The same for the same arguments. ``leaves_way`` and ``count`` are those of
    :meth:`~sim.made_up.clutter.ClutterMaker.draw`; all doors of the floor are open.

    Raises:
        ValueError: nothing that fits was found.
    """
    floor, rng = generated_floor(seed, rooms, open_share=1.0), np.random.default_rng([seed, 2])
    world, details = floor.write(folder)
    for _ in range(MAX_DRAWS):
        ends = [_draw_place(floor.world, str(room), rng) for room in rng.choice(floor.rooms, 2, replace=False)]
        goal = " ".join(f"({end.locale} ({end.x_m / FOOT_M:.2f},{end.y_m / FOOT_M:.2f},0))" for end in ends)
        text = (f'description = "From room to room on a cluttered floor; {"a" if leaves_way else "no"} way is left."\n'
                f'world = "{world.name}"\ndetails = ["{details.name}"]\ngoal = "(ptrans {goal})"\n\n[start]\n'
                f"heading_deg = {math.degrees(rng.uniform(-math.pi, math.pi)):.1f}\n"
                "put_down_sigma_m = 0.02\nput_down_sigma_deg = 1.0\n")
        try:
            stage = build_stage(parse_scenario(text, "cluttered", folder))
            if stage.building.obstacles.clearance_m(stage.goal_world) < KEPT_FREE_M / 2.0:
                continue
            clutter = ClutterMaker(stage).draw(seed, leaves_way=leaves_way, count=count)
        except ValueError:
            continue
        path = folder / f"cluttered-{seed}.toml"
        path.write_text(text + clutter.text, "utf-8")
        return path
    raise ValueError(f"expected a mission on floor {seed}, got none in {MAX_DRAWS} draws")


def _draw_place(world: World, room: str, rng: np.random.Generator) -> Place:
    outline = world.locale(room).outline
    margin_m = MARGIN_FT * FOOT_M
    x, y = rng.uniform(outline.min(axis=0) + margin_m, outline.max(axis=0) - margin_m)
    return Place(room, float(x), float(y))
