"""Missions on generated floors that their model describes by centimetres wrongly, as files for campaigns."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np

from sim.differences.inexact import TrueInexact
from sim.made_up.drivable import is_drivable
from sim.made_up.generated_floors import generated_floor
from sim.scenario import parse_scenario
from sim.stage import build_stage
from world_models.building.world import World
from world_models.units import FOOT_M

ROOMS = 6
MARGIN_FT = 2.5
"""Start and goal are as far from the walls of their rooms."""
MAX_DRAWS = 100
WHEELS_WORSE = (
    "[actuator]\nturn_scale_sigma = 0.06\nturn_sigma_deg = 0.3\nskitter_sigma_m = 0.009\n"
    "curvature_low_per_m = 0.0135\ncurvature_high_per_m = 0.0435\ncurvature_sigma_per_m = 0.0045\n"
    "shortfall_low = 0.12\nshortfall_high = 0.18\ndistance_sigma = 0.009\n")
"""Three times the errors of the wheels that the robot believes in."""


def write_inexact_mission(
    folder: Path, seed: int, truth: TrueInexact, *, stated_m: float = 0.0, more: str = "", rooms: int = ROOMS
) -> Path:
    """Write a scenario from one room of a generated floor to another, with the floor's files; returns its path.

    The same for the same arguments; start and goal do not depend on how far the walls are displaced as long as there
    is a way.

    Args:
        truth: how inexact the model is; its seed is replaced by ``seed``.
        stated_m: the standard deviation that the world file states.
        more: further tables of the scenario.

    Raises:
        ValueError: nothing that fits was found.
    """
    floor, rng = generated_floor(seed, rooms, open_share=1.0), np.random.default_rng([seed, 5])
    world, details = floor.write(folder)
    if stated_m:
        world.write_text(f"sigma_cm = {100.0 * stated_m:g}\n{world.read_text('utf-8')}", "utf-8")
    table = (f"\n[truth.inexact]\nsigma_m = {truth.sigma_m:g}\nmissing = {truth.missing:g}\nextra = {truth.extra:g}\n"
             f"seed = {seed}\n") if truth.sigma_m or truth.missing or truth.extra else ""
    for _ in range(MAX_DRAWS):
        ends = [_draw_place(floor.world, str(room), rng) for room in rng.choice(floor.rooms, 2, replace=False)]
        text = (f'description = "A generated floor, inexact by {100.0 * truth.sigma_m:g} cm."\n'
                f'world = "{world.name}"\ndetails = ["{details.name}"]\ngoal = "(ptrans {" ".join(ends)})"\n\n[start]\n'
                f"heading_deg = {math.degrees(rng.uniform(-math.pi, math.pi)):.1f}\n"
                f"put_down_sigma_m = 0.02\nput_down_sigma_deg = 1.0\n{table}{more}")
        try:
            stage = build_stage(parse_scenario(text, "inexact", folder))
        except ValueError:
            continue
        if is_drivable(stage.building.obstacles, stage.start_world, stage.goal_world):
            path = folder / f"inexact-{seed}.toml"
            path.write_text(text, "utf-8")
            return path
    raise ValueError(f"expected a mission on floor {seed}, got none in {MAX_DRAWS} draws")


def _draw_place(world: World, room: str, rng: np.random.Generator) -> str:
    outline, margin_m = world.locale(room).outline, MARGIN_FT * FOOT_M
    x, y = rng.uniform(outline.min(axis=0) + margin_m, outline.max(axis=0) - margin_m)
    return f"({room} ({x / FOOT_M:.2f},{y / FOOT_M:.2f},0))"
