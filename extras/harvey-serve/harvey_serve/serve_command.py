"""``harvey serve``: drive a mission in the simulator and show it on a page in the browser, or show one that goes on."""

from __future__ import annotations

import math
import time
from argparse import ArgumentParser, Namespace
from pathlib import Path
from typing import TYPE_CHECKING

from harvey.commands.command import CliCommand, parse_pairs, parse_seeds
from harvey.errors import BadInput
from logs.run_directory import RUNS, check_vacant, make_room

if TYPE_CHECKING:
    from harvey.campaign.mission_task import Task

PORT = 8750


def _arguments(parser: ArgumentParser) -> None:
    parser.add_argument("scenario", metavar="SCENARIO|RUN", help="a name from harvey list, or a TOML file, to drive;"
                        " or the folder of a run that another command is driving, to watch")
    parser.add_argument("--port", metavar="N", type=int, default=PORT, help=f"0 for any that is free ({PORT})")
    parser.add_argument("--host", metavar="ADDRESS", default="127.0.0.1",
                        help="the address of this machine on which it listens; 0.0.0.0 lets every machine of the"
                             " network watch (127.0.0.1)")
    parser.add_argument("--seed", metavar="N", default="0", help="seed of all random numbers (0)")
    parser.add_argument("--speed", metavar="X", type=float, default=1.0,
                        help="how many times as fast as the robot's own time it may go; 0: as fast as it computes (1)")
    parser.add_argument("--paused", action="store_true", help="begin paused, so that a page can be opened first")
    parser.add_argument("--out", metavar="DIR", help="directory for the run's files (runs/SCENARIO-SEED, or the"
                        " first of runs/SCENARIO-SEED-2, -3 ... that is free)")
    parser.add_argument("--set", metavar="KEY=VALUE", action="append", default=[], dest="settings",
                        help="change a setting, as harvey run does; may be repeated")


def _run(args: Namespace) -> int:
    from harvey.campaign.mission_task import Task

    if not (math.isfinite(args.speed) and args.speed >= 0.0):
        raise BadInput(f"--speed: expected a number that is not below 0, got {args.speed}")
    if Path(args.scenario).is_dir():
        return _follow(Path(args.scenario), args)
    seeds = parse_seeds(args.seed)
    if len(seeds) > 1:
        raise BadInput(f"--seed: expected one seed, got {len(seeds)}")
    wanted = Path(args.out) if args.out else _find_free(RUNS / f"{Path(args.scenario).stem}-{seeds[0]}")
    if (wanted / "journal.jsonl").exists():  # what was told on its page cannot be said again
        raise BadInput(f"--out {wanted}: expected a directory without a run, got one with a run")
    task = Task(args.scenario, parse_pairs(args.settings), seeds[0], check_vacant(wanted))
    task.load()  # what is wrong with it is said first
    return _serve(task, args, wanted)


def _find_free(path: Path) -> Path:
    """The same where no run is there, else the first beside it without: ``runs/try-2``."""
    names = (path, *(path.with_name(f"{path.name}-{number}") for number in range(2, 10_000)))
    return next((there for there in names if not (there / "journal.jsonl").exists()), path)


def _serve(task: Task, args: Namespace, wanted: Path) -> int:
    from harvey.campaign.summary import format_result
    from harvey.simulation.simulated_run import build_head, run_mission
    from harvey_serve.live_page import open_page
    from harvey_serve.run_gate import Gate
    from harvey_serve.server import bind
    from logs.explain.story import first_lines

    listening = bind(args.host, args.port)
    stage = task.stage()
    head = build_head(stage, task.seed, task.body, task.agent_settings)
    world, gate = head.load_world(), Gate(args.speed)
    if args.paused:
        gate.order("pause")
    out = make_room(wanted, stage.scenario.name, task.seed)
    title = f"{stage.scenario.name}, seed {task.seed}"
    with open_page(listening, world, head.model(world).lens, title, gate=gate, part=stage.part) as page:
        result = run_mission(stage, task.seed, out=out, sinks=(page.live,), head=head, tell=page.teller.tell,
                             around=lambda body, _is_replayed: page.guard(body))
        page.live.end(f"{result.outcome}: {result.reason}; harvey report {out} tells all of it")
    print(format_result(result, out, first_lines(out)))
    return 0 if result.outcome == "reached" else 1


def _follow(path: Path, args: Namespace) -> int:
    from harvey_serve.follow import Follower, how_it_ended
    from harvey_serve.live_page import open_page
    from harvey_serve.server import bind
    from logs.run_directory import RunDirectory
    from logs.run_head import RunHead

    run = RunDirectory(path)
    head = RunHead.read(run.path)
    if ended := how_it_ended(run):
        raise BadInput(f"{path}: expected a run that goes on, got one that has ended ({ended}): harvey report {path}")
    world = head.load_world()
    listening = bind(args.host, args.port)
    with open_page(listening, world, head.model(world).lens, f"{head.name}, seed {head.seed}") as page:
        ended = Follower(run, page.live).follow(time.sleep)
    print(ended)
    return 0 if ended.startswith("reached") else 1


COMMAND = CliCommand(
    "serve", "drive a mission in the simulator, and show it on a page meanwhile; or show a run that goes on",
    (
        ("harvey serve lab-to-allens-office", "prints the page's address; open it in a browser"),
        ("harvey serve hallway-kidnap --seed 3 --paused", "waits until somebody presses Resume"),
        ("harvey serve lab-to-allens-office --speed 4 --port 0", "four times as fast, on any free port"),
        ("harvey serve runs/mission-drive", "only watch a run that harvey drive or harvey run is driving"),
    ),
    _arguments, _run,
    "The page shows the camera's picture, the plan with the belief and its ellipse, candidates, milestones and the\n"
    "last decisions with what they rest on. Who has the first address, with the token, can also tell the robot\n"
    "what to do ('Go to the library'), pause, resume and stop; who has the second can only watch. A stop ends the run\n"
    "as the stop key of a robot does: its files are whole. harvey drive --serve does the same for a robot.\n"
    "Exit code 0: the goal was reached; 1: it was not, or the run was stopped; 2: the input cannot be used.",
)
