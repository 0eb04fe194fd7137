"""Generated buildings that their models describe wrongly, with several missions in each, to be surveyed."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path

import numpy as np

from experiments.generated.floors import generated_floor
from experiments.generated.missions import draw_ends, draw_heading_deg, format_mission, is_drivable
from sim.ground_truth.inexact import TrueInexact
from sim.scenario import parse_scenario
from sim.stage import build_stage

ROOMS = 4
"""Of a building."""
MAX_DRAWS = 200


def write_missions(folder: Path, seed: int, truth: TrueInexact, count: int, stated_m: float) -> list[Path]:
    """Write a generated floor and missions in it, in the one true building that differs from the floor; their paths.

    Each mission is the same whatever their count.

    Args:
        truth: how inexact the model is; its seed is replaced by ``seed``.
        stated_m: how well the model is known, as its file states.

    Raises:
        ValueError: no mission that fits was found.
    """
    folder.mkdir(parents=True, exist_ok=True)
    floor = generated_floor(seed, ROOMS, open_share=1.0)
    world, details = floor.write(folder)
    world.write_text(f"sigma_cm = {100.0 * stated_m:g}\n{world.read_text('utf-8')}", "utf-8")
    told = {key: value for key, value in asdict(truth).items() if key != "seed" and value}
    table = "\n".join(["\n[truth.inexact]", *(f"{key} = {value:g}" for key, value in told.items()), f"seed = {seed}\n"])
    paths: list[Path] = []
    for number in range(count):
        rng = np.random.default_rng([seed, 17, number])
        for _ in range(MAX_DRAWS):
            rooms = [str(room) for room in rng.choice(floor.rooms, 2, replace=False)]
            text = format_mission(f"A generated floor, wrong by {100.0 * truth.sigma_m:g} cm.", (world, details),
                                  draw_ends(floor, rooms, rng), draw_heading_deg(rng))
            try:
                stages = [build_stage(parse_scenario(text + more, "wrong", folder)) for more in ("", table)]
            except ValueError:
                continue
            if all(is_drivable(s.building.obstacles, s.start_world, s.goal_world) for s in stages):
                path = folder / f"mission-{number}.toml"
                path.write_text(text + table, "utf-8")
                paths.append(path)
                break
        else:
            raise ValueError(f"expected a mission on floor {seed}, got none in {MAX_DRAWS} draws")
    return paths
