"""Made-up light: kinds of it, each drawn at random within what buildings and cameras have; days of errands in it."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np

LIGHT_KINDS = ("flat", "lamps", "half the lamps off", "dim", "sun", "glossy floor", "glass", "coloured walls",
               "slow camera", "all at once")
"""flat: no ``[light]``, the same everywhere. lamps: panels in every room, auto exposure. The others have them too. dim:
1 to 6 % of their light. sun: daylight, and hard patches of sun. coloured walls: other colours than the model's, tinted
lamps, and a white balance. slow camera: exposure and white balance lag by 1 to 3 s, with half the lamps off."""
Values = dict[str, float | list[float]]


def draw_light(kind: str, seed: int) -> Values | None:
    """The settings of ``[light]``, the same for the same arguments; None for flat light."""
    if kind == "flat":
        return None
    rng = np.random.default_rng([seed, 5, LIGHT_KINDS.index(kind)])
    values: Values = {"seed": int(rng.integers(10**6)), "lamps": rng.uniform(0.5, 1.2),
                      "lamp_spacing_m": rng.uniform(1.8, 3.2), "exposure_lag_s": rng.uniform(0.2, 0.6)}
    for part in (kind,) if kind != "all at once" else LIGHT_KINDS:
        values |= _draw_part(part, rng)
    if kind == "all at once" and rng.random() < 0.7:
        values["lamps"] = rng.uniform(0.3, 1.2)  # mostly not dim: there is daylight
    return {key: [round(v, 3) for v in value] if isinstance(value, list) else round(value, 4)
            for key, value in values.items()}


def _draw_part(kind: str, rng: np.random.Generator) -> Values:
    if kind == "half the lamps off":
        return {"lamps_off": rng.uniform(0.3, 0.7)}
    if kind == "dim":
        return {"lamps": rng.uniform(0.01, 0.06)}
    if kind == "sun":
        return {"sky": rng.uniform(1.0, 6.0), "sun": rng.uniform(4.0, 12.0),
                "sun_azimuth_rad": rng.uniform(0.0, math.tau), "sun_elevation_rad": rng.uniform(0.2, 0.9)}
    if kind == "glossy floor":
        return {"floor_gloss": rng.uniform(0.5, 1.0)}
    if kind == "glass":
        return {"glass": rng.uniform(0.5, 1.0)}
    if kind == "coloured walls":
        warm = rng.uniform(-0.3, 0.3)
        return {"wall_colours": rng.uniform(0.4, 1.0), "lamp_colour": [1.0 + warm, 1.0, 1.0 - warm],
                "white_balance_lag_s": rng.uniform(0.3, 1.0)}
    if kind == "slow camera":
        return {"lamps_off": 0.5, "exposure_lag_s": rng.uniform(1.0, 3.0), "white_balance_lag_s": rng.uniform(1.0, 3.0),
                "vignetting": rng.uniform(0.2, 0.6)}
    return {}


def format_light(values: Values | None) -> str:
    """The ``[light]`` table of a scenario's file; nothing for flat light."""
    return "\n[light]\n" + "".join(f"{key} = {value}\n" for key, value in values.items()) if values else ""


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
