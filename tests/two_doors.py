"""Two rooms with two doors between them, and short missions from one to the other on which somebody tells the robot."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from sim.scenario import parse_scenario
from sim.stage import Stage, build_stage

WORLD = """
name = "two-doors"
units = "feet"
include = ["standard"]

[defaults]
kind = "office"

[locales]
study = { at = [0, 0], size = [14, 18], walls = ["sage", "cream", "sand", "sky"], things = [
  ["bookshelf", "west", 5.0], ["picture", "north", 7.0], ["notice-board", "south", 7.5], ["table", [6, 9]],
  ["picture", "east", 9.0] ] }
parlour = { at = [14.5, 0], size = [14, 18], walls = ["sky", "sand", "cream", "sage"], things = [
  ["rack", "east", 4.5], ["picture", "north", 5.5], ["notice-board", "east", 12.0], ["window", "south", 9] ] }

[doors]
north-door = { between = ["study", "parlour"], wall = "east", along = 14.0, open = true, frame = "navy" }
south-door = { between = ["study", "parlour"], wall = "east", along = 4.0, open = true, frame = "teal" }
"""

Telling = tuple[float, str, str]
"""When [s], of what, and how it is."""

START = (11.0, 13.5)
GOAL = (4.0, 12.0)


def two_doors(
    folder: Path, told: Sequence[Telling] = (), *, start: tuple[float, float] = START, goal: tuple[float, float] = GOAL,
    heading_deg: float = 60.0, more: str = "",
) -> Stage:
    """The building of a mission from the study to the parlour.

    Args:
        folder: where the world file is written.
        start, goal: places in the two rooms [ft]; more: tables of the scenario.
    """
    world = folder / "two_doors.toml"
    if not world.exists():
        world.write_text(WORLD)
    tellings = "".join(f'\n[[told]]\nat_s = {at_s}\nwhat = "{what}"\nstate = "{state}"\n' for at_s, what, state in told)
    text = f"""
description = "From the study to the parlour."
world = "{world}"
goal = "(ptrans (study ({start[0]},{start[1]},0)) (parlour ({goal[0]},{goal[1]},0)))"
[start]
heading_deg = {heading_deg}
put_down_sigma_m = 0.02
put_down_sigma_deg = 1.0
[limits]
max_cycles = 3000
{more}{tellings}"""
    return build_stage(parse_scenario(text, "two-doors"))
