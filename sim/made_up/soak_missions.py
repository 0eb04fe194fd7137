"""Errands of a robot that works in one building day after day: it is sent on on its way, in another light each day."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from sim.made_up.lights import LIGHT_KINDS, draw_light, format_light

ROOMS = ("the robot laboratory", "Allen's office", "the conference room", "the graduate office", "the library",
         "the terminal room", "the machine room", "the mail room")
"""Of the Research Center, as one calls them."""
HALL_FT = (8.0, 84.0)
"""Where along the hallway it starts."""
ERRANDS = (3, 8)
"""It is sent elsewhere so many times on a mission."""
FIRST_S, BETWEEN_S = (3.0, 9.0), (15.0, 75.0)
"""After so long it is sent elsewhere first, and then again."""
SAG_DEG_PER_DAY, MOST_SAG_DEG = 0.02, 0.6
"""By how much the camera looks lower each day than it is believed to."""


def write_soak_mission(folder: Path, day: int, seed: int) -> Path:
    """Write the scenario of a mission on some day; the same for the same arguments."""
    rng = np.random.default_rng([seed, day, 17])
    goals = _draw_goals(rng, int(rng.integers(*ERRANDS, endpoint=True)))
    times = np.cumsum([rng.uniform(*FIRST_S), *rng.uniform(*BETWEEN_S, len(goals) - 2)])
    told = "".join(f'\n[[told]]\nat_s = {when:.1f}\ngoal = "Go to {goal}"\n'
                   for when, goal in zip(times.tolist(), goals[1:], strict=True))
    start = rng.uniform(*HALL_FT)
    far = max(HALL_FT, key=lambda end: abs(end - start))
    text = (f'description = "Errands, day {day}."\nworld = "research_center"\ndetails = ["research_center_details"]\n'
            f'goal = "(ptrans (hallway ({start:.1f},4,0)) (hallway ({far:.1f},4,0)))"\n\n'
            f"[start]\nheading_deg = {rng.choice([0.0, 180.0])}\nput_down_sigma_m = 0.02\nput_down_sigma_deg = 1.0\n"
            f"\n[truth.camera]\ntilt_deg = {min(MOST_SAG_DEG, SAG_DEG_PER_DAY * day):.2f}\n"
            f"\n[limits]\nmax_path_m = 1000.0\nmax_cycles = 50000\n{told}")
    path = folder / f"soak-{day}-{seed}.toml"
    path.write_text(text + format_light(draw_light(LIGHT_KINDS[day % len(LIGHT_KINDS)], day)), "utf-8")
    return path


def _draw_goals(rng: np.random.Generator, count: int) -> list[str]:
    """One room after another, none twice in a row; first the hallway's end, which the scenario has as its goal."""
    goals = [""]
    while len(goals) <= count:
        room = str(rng.choice(ROOMS))
        if room != goals[-1]:
            goals.append(room)
    return goals
