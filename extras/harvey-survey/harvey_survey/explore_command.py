"""``harvey explore``: a world file of a building of which the robot was told nothing."""

from __future__ import annotations

from argparse import ArgumentParser, Namespace
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from harvey.commands.command import CliCommand
from harvey.commands.world_command import find_file, load_file
from harvey.errors import BadInput

if TYPE_CHECKING:
    from harvey_survey.explorer import Explorer
    from sim.body.simulated_body import SimulatedBody
    from sim.stage import Stage


EXAMPLE = "runs/experiments/explore/quick-0/floor-610000/bare-610000.toml"


def format_explored(world: Path, ends: Sequence[tuple[str, float, float]], heading_deg: float) -> str:
    """A scenario from one place to another: room, x and y [m, the room's frame]."""
    from world_models.units import FOOT_M

    goal = " ".join(f"({room} ({x / FOOT_M:.5f},{y / FOOT_M:.5f},0))" for room, x, y in ends)
    return f'world = "{world.resolve()}"\ngoal = "(ptrans {goal})"\n[start]\nheading_deg = {heading_deg:.4f}\n'


def build_explored_stage(
    world: Path, ends: Sequence[tuple[str, float, float]], heading_deg: float, more: str = ""
) -> Stage:
    """The simulator's building with a robot put down at the first of two places. Raises BadInput."""
    from sim.scenario import ScenarioError, parse_scenario
    from sim.stage import build_stage

    try:
        return build_stage(parse_scenario(format_explored(world, ends, heading_deg) + more, "explore", world.parent))
    except (ScenarioError, ValueError) as error:
        raise BadInput(str(error)) from None


def build_explorer(stage: Stage, body: SimulatedBody, tell_steps: bool = False) -> Explorer:
    """An explorer with a scenario's camera and wheels; it is told neither the building nor where it is."""
    from harvey_survey.explorer import Explorer
    from sim.body.collision import ROBOT_RADIUS_M
    from world_models.actuator import ActuatorModel

    seen = stage.scenario.camera
    tell = (lambda text: print(text, flush=True)) if tell_steps else (lambda _text: None)
    return Explorer(body, seen.camera, seen.mount, ActuatorModel(), ROBOT_RADIUS_M, tell)


def _arguments(parser: ArgumentParser) -> None:
    parser.add_argument("--world", metavar="FILE", required=True,
                        help="the building as it is: for the simulator alone, the robot is told nothing of it")
    parser.add_argument("--start", metavar="ROOM", required=True, help="the room in which it is put down")
    parser.add_argument("--at", metavar=("X", "Y"), type=float, nargs=2,
                        help="where in that room [m, from its south-west corner] (its middle)")
    parser.add_argument("--heading", metavar="DEG", type=float, default=0.0, help="to where it looks then (0: east)")
    parser.add_argument("--seed", metavar="N", type=int, default=0, help="of the errors of wheels and camera (0)")
    parser.add_argument("--out", metavar="FILE", required=True, help="the world file to write (.toml)")
    parser.add_argument("--plan", metavar="FILE", help="draw it there (.png)")


def _run(args: Namespace) -> int:
    from harvey.commands.plan_picture import draw_plan
    from harvey_survey.explorer import ExploringStopped
    from harvey_survey.learnt_world import write_learnt_world
    from world_models.files.world_files import load_world

    out, world = Path(args.out), load_file(args.world, [])
    if out.suffix != ".toml":
        raise BadInput(f"--out: expected a name that ends in .toml, got {args.out!r}")
    if args.start not in world.rooms:
        raise BadInput(f"--start: expected a room of {args.world}: {', '.join(world.rooms)}, got {args.start!r}")
    outline = world.locale(args.start).outline
    x_m, y_m = args.at or (0.5 * (outline.min(axis=0) + outline.max(axis=0))).tolist()
    stage = build_explored_stage(find_file(args.world), [(args.start, x_m, y_m)] * 2, args.heading)
    body = stage.body(args.seed)
    explorer = build_explorer(stage, body, tell_steps=True)
    stopped = ""
    try:
        explorer.explore()
    except ExploringStopped as error:
        stopped = str(error)
    if not explorer.map.rooms:
        raise BadInput(f"nothing was explored: {stopped}")
    try:
        out.write_text(write_learnt_world(explorer.map, out.stem), encoding="utf-8")
        if args.plan is not None:
            draw_plan(load_world(out), Path(args.plan))
    except OSError as error:
        raise BadInput(f"{error.filename}: expected a file to write to, got: {error.strerror}") from None
    print(explorer.summary(stopped))
    print(f"{out}: harvey world check {out} shows it; a mission drives in it as in any")
    return 1 if stopped else 0


EXPLORE = CliCommand(
    "explore", "a world file of a building of which the robot is told nothing",
    (("harvey experiment explore --quick", "draws a bare floor, in runs/experiments/explore; how well it is explored"),
     (f"harvey explore --world {EXAMPLE} --start room-0-north-0 --out mine.toml", "look round, drive, home"),
     ("harvey world check mine.toml", "what it has found")),
    _arguments, _run,
    details="""
It looks round and finds the feet of walls, uprights and the floor; a doorway is where floor is seen behind a wall. Then
it goes where most is not known: floor of the room that it has not seen, what is behind a doorway. It moves only over
floor that it has seen, and comes home by the map that it has made. What it writes is a world file: rooms, doorways,
boards on walls with their colours. Its origin is the start, its axes are those of the building.

Today it is for bare rooms with open doors: it takes rooms for rectangles with walls along two directions, and does not
see what stands in them; in two_ways it touches a table. A shut door is a piece of wall. The first example draws such a
floor; its doorways are not always all found. When it touches something it stops, writes what it knows, exit code 1.
""")
