"""``harvey run``, ``demo`` and ``campaign``: missions in the simulator: one, one to show, or many."""

from __future__ import annotations

import os
import sys
import webbrowser
from argparse import ArgumentParser, Namespace, RawDescriptionHelpFormatter
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from harvey.campaign.workers import choose_workers, count_processors, find_cluster
from harvey.commands.command import CliCommand, add_worker_arguments, parse_pairs, parse_seeds, parse_workers, whole
from harvey.errors import BadInput, Terminated
from logs.run_directory import RUNS, RunDirectory, check_vacant

if TYPE_CHECKING:
    from harvey.campaign.mission_task import Keep, Task


def _add_run_arguments(parser: ArgumentParser) -> None:
    parser.add_argument("scenario", metavar="SCENARIO", nargs="?", default="",
                        help="a name from harvey list, or a TOML file")
    parser.add_argument("--random", metavar="N", type=whole,
                        help="instead of its goal N missions between random places, of this seed and those after it")
    parser.add_argument("--world", metavar="FILE",
                        help="with --random, in place of a scenario: the building, a world file or a name")
    parser.add_argument("--seed", metavar="N", default="0",
                        help="seed of all random numbers: 3, 0..19 or 1,4,9; one run for each (0)")
    parser.add_argument("--out", metavar="DIR",
                        help="directory for the run's files (runs/SCENARIO-SEED; for several seeds a directory for each"
                             " in it); an older run of the same scenario and seed there is deleted, any other is moved"
                             " to DIR-older-1")
    parser.add_argument("--set", metavar="KEY=VALUE", action="append", default=[], dest="settings",
                        help="change a setting of the scenario, as servo.action=off, or a number of harvey settings,"
                             " as plan.max_leg_m=2; camera.tilt_deg, wheels.reach and the like change what the robot"
                             " believes of itself, not what is true; may be repeated")
    parser.add_argument("--tell", metavar="TEXT",
                        help='what to do from where it starts, instead of its goal, as "Fetch the book"; needs'
                             " harvey-words; --set task=TEXT says the same")
    parser.add_argument("--body", metavar="BODY", default="simulated",
                        help="how the simulated body is reached: simulated, or over an emulated serial line as"
                             " serial:denning; with harvey-bases serial:p2os or serial:create2 (simulated)")
    parser.add_argument("--go-on", action="store_true",
                        help="keep the runs that are there already; one that was cut off is resumed, of several seeds"
                             " it is driven again, so that the results are as if nothing had been")
    add_worker_arguments(parser)
    parser.add_argument("--keep", choices=("all", "failures", "none"), default="all",
                        help="of several seeds: whose run directories stay, all, those that do not reach the goal, or"
                             " none; the results stay in any case (all)")
    parser.add_argument("--check", action="store_true", help="do not drive; list the milestones to come")
    parser.add_argument("--sync", action="store_true",
                        help="force the journal and each picture onto the disk before anything follows from them, as"
                             " harvey drive and --body serial:BASE do; else a power cut may take the last seconds")
    parser.add_argument("--no-recording", action="store_false", dest="recording",
                        help="draw none: a tenth faster, and half the room; harvey repair draws it once it is wanted")
    parser.add_argument("--live", action="store_true", help="send the recording to an open viewer as well")
    parser.add_argument("--trace", action="store_true",
                        help="print a line for each cycle: who acted, woken by what, what came of it")


def _run_run(args: Namespace) -> int:
    workers, seeds, settings = parse_workers(args), parse_seeds(args.seed), parse_pairs(args.settings)
    from harvey.campaign.mission_task import Task
    from harvey.simulation.serial_body import body_kind

    settings = settings if args.tell is None else (*settings, ("task", args.tell))

    body = body_kind(args.body)
    if args.random is not None:
        args.scenario, seeds, drawn = _draw_missions(args, seeds, settings)
    else:
        if args.world is not None or not args.scenario:
            raise BadInput("expected a SCENARIO, or --random N with --world FILE")
        drawn = [settings] * len(seeds)
    many = len(seeds) > 1 or args.random is not None
    tasks = tuple(
        Task(args.scenario, pairs, seed, _out(args, seed, many), body, args.go_on, args.sync, args.recording)
        for seed, pairs in zip(seeds, drawn, strict=True))
    if args.check:
        if also := [name for name in ("live", "trace", "go_on", "tell") if getattr(args, name)]:
            raise BadInput(f"--check: expected it without --{also[0].replace('_', '-')}, because nothing is driven")
        return _check(tasks[0])
    if len(tasks) == 1:
        for name, value, usual in (("--keep", args.keep, "all"), ("--workers", args.workers, None),
                                   ("--cluster", args.cluster, None)):
            if value != usual:
                raise BadInput(f"{name}: expected several seeds, as --seed 0..19, got one")
        return _one(tasks[0], args)
    if args.trace or args.live:
        raise BadInput(f"--{'live' if args.live else 'trace'}: expected one seed, got {len(tasks)}")
    with choose_workers(workers):
        return _several(tasks, args.keep)


def _draw_missions(
    args: Namespace, seeds: tuple[int, ...], settings: tuple[tuple[str, str], ...]
) -> tuple[str, tuple[int, ...], list[tuple[tuple[str, str], ...]]]:
    """The scenario, the seeds and the settings of random missions; of a building its first mission becomes a file."""
    from harvey.campaign.random_missions import draw_missions, format_mission
    from sim.scenario import parse_scenario
    from world_models.files.toml.mission import named_file
    from world_models.files.toml.source import WORLDS

    if len(seeds) != 1 or args.random < 1 or args.check or bool(args.scenario) == (args.world is not None):
        raise BadInput("--random: expected N from 1, either a SCENARIO or --world FILE, one --seed, and no --check")
    seeds = tuple(range(seeds[0], seeds[0] + args.random))
    if args.scenario:
        drawn = draw_missions(Task(args.scenario, settings, seeds[0]).load(), seeds)
    else:
        world = named_file(args.world, WORLDS, Path())
        drawn = draw_missions(parse_scenario(format_mission(world), world.stem), seeds)
        args.out = args.out or str(RUNS / f"random-{world.stem}")
        mission = Path(args.out) / f"random-{world.stem}.toml"
        mission.parent.mkdir(parents=True, exist_ok=True)
        mission.write_text(format_mission(world, drawn[0][0][1], drawn[0][1][1]), encoding="utf-8")
        args.scenario = str(mission)
    return args.scenario, seeds, [(*settings, *pairs) for pairs in drawn]


def _out(args: Namespace, seed: int, many: bool) -> Path:
    name = Path(args.scenario).stem
    if args.out:
        return check_vacant(Path(args.out) / str(seed) if many else Path(args.out))
    return check_vacant(RUNS / name / str(seed) if many else RUNS / f"{name}-{seed}")


def _check(task: Task) -> int:
    stage = task.stage()
    from harvey.agent_settings import build_settings
    from harvey.dry_run import dry_run, format_previews, summarize_dry_run
    from harvey.replay.what_if import WhatIf
    from harvey.simulation.simulated_run import build_robot_model
    from world_models.files.world_files import load_world

    scenario = stage.scenario
    world = load_world(scenario.world)
    robot = build_robot_model(scenario, world)
    pairs = task.agent_settings
    ahead, outcome = dry_run(world, robot, scenario.command, build_settings(pairs), WhatIf(pairs=pairs))
    print(format_previews(ahead))
    said, bodes_well = summarize_dry_run(ahead, outcome)
    print(f"\nthe dry run of {scenario.name} {said}")
    return 0 if bodes_well else 1


def _one(task: Task, args: Namespace) -> int:
    from harvey.campaign.mission_task import run_task
    from harvey.campaign.summary import format_result
    from logs.explain.story import first_lines
    from logs.explain.web import printing

    sinks = (printing(sys.stdout),) if args.trace else ()
    task.load()  # what is wrong with it is said first
    print(f"{task.label}: setting the stage", file=sys.stderr, flush=True)
    result = run_task(task, sinks=sinks, progress=None if args.trace else sys.stderr, live=args.live)
    print(format_result(result, task.out, first_lines(task.out)))
    return 0 if result.outcome == "reached" else 1


def _several(tasks: tuple[Task, ...], keep: Keep) -> int:
    from harvey.campaign.mission_task import drive_missions
    from harvey.campaign.summary import format_results
    from harvey.runner.result import MissionResult

    folder = tasks[0].out.parent if tasks[0].out else RUNS
    try:
        done = drive_missions(tasks, folder, sys.stderr, keep)
    except (KeyboardInterrupt, Terminated) as stop:
        stop.add_note("what was recorded is kept; the same command with --go-on goes on")
        raise
    results = [result for task in tasks if isinstance(result := done[task], MissionResult)]
    if results:
        print(format_results(results))
    for task in tasks:
        if not isinstance(lost := done[task], MissionResult):
            print(f"seed {task.seed}: {lost.text}")
        elif lost.outcome != "reached" and tasks[0].settings != tasks[-1].settings:
            print(f"seed {task.seed}: {lost.reason}; {' '.join(f'{key}={value}' for key, value in task.settings)}")
    kept = {"all": "the runs are in", "failures": "the results, and the runs that did not reach the goal, are in",
            "none": "the results are in"}
    print(f"{kept[keep]} {folder}")
    return 0 if len(results) == len(tasks) and all(r.outcome == "reached" for r in results) else 1


RUN = CliCommand(
    "run", "drive a mission in the simulator",
    (
        ("harvey run lab-to-allens-office", "Figure 17's mission"),
        ("harvey run lab-to-allens-office --seed 0..19", "twenty of them, and a table"),
        ("harvey run lab-to-allens-office --seed 0..19 --go-on", "those that are still to be done, after a crash"),
        ("harvey run lab-to-allens-office --seed 0..999 --keep failures --no-recording",
         "a thousand; only those that fail stay, to be drawn when somebody looks"),
        ("harvey run --random 20 --world house.toml", "twenty missions between random places, and a table"),
        ("harvey run lab-to-allens-office --seed 0..19 --cluster local:4", "on a Dask cluster of this machine"),
        ("harvey run lab-to-allens-office --check", "which milestones it will have, and how well each tells the place"),
        ("harvey run hallway-kidnap --seed 3 --trace", "print who acts in each cycle, and what comes of it"),
        ("harvey run shut-door", "told on the way that a door is shut ([[told]] in its file)"),
        ("harvey run lab-to-allens-office --tell 'Visit the library and the mail room'", "with harvey-words: a task"),
        ("harvey run bump --set servo.action=off", "without correcting on the move"),
        ("harvey run bump --set plan.max_leg_m=2", "with another number of harvey settings"),
        ("harvey run lab-to-allens-office --body serial:p2os", "the body behind an emulated Pioneer's serial line"),
        ("harvey run my_mission.toml --set start.heading_deg=80 --out runs/try", "a mission of your own"),
    ),
    _add_run_arguments, _run_run,
    "Exit code 0: the goal was reached; 1: it was not; 2: the input cannot be used.\n"
    "With --check, 0: the dry run reaches the goal, and no milestone is worse than weak; 1: it is not reached, or a\n"
    "milestone is ambiguous (another place looks like it) or not testable (hardly anything of it would be seen).",
)


def _add_campaign_arguments(parser: ArgumentParser) -> None:
    verbs = parser.add_subparsers(title="verbs", metavar="VERB", required=True)

    def add(name: str, what: str, epilog: str) -> ArgumentParser:
        verb: ArgumentParser = verbs.add_parser(name, help=what, description=f"{what[0].upper()}{what[1:]}.",
                                                epilog=epilog, formatter_class=RawDescriptionHelpFormatter)
        return verb

    show = add("show", "progress, rate, remaining time and outcomes, also while it runs",
               "examples:\n  harvey campaign show runs/lab-to-allens-office\n"
               "  harvey campaign show runs/experiments/missions/full-0")
    show.add_argument("campaign", metavar="DIR", help="its directory, as runs/bump")
    show.add_argument("--no-picture", action="store_true", help="do not draw progress.png in it")
    show.set_defaults(verb=_show)
    compare = add("compare", "judge two campaigns by the cases that both have",
                  "examples:\n  harvey campaign compare runs/before runs/after\n"
                  "  harvey campaign compare runs/before runs/after --success 'final_error_m<0.0254'\n"
                  "exit code 0: the second is not worse beyond chance (5 %); 1: it is; 2: the input cannot be used.")
    compare.add_argument("first", metavar="A", help="directory of a campaign")
    compare.add_argument("second", metavar="B", help="directory of another with the same seeds")
    compare.add_argument("--success", metavar="TEST", default="outcome=reached",
                         help="what counts as success: FIELD=VALUE, FIELD<NUMBER or FIELD>NUMBER (outcome=reached)")
    compare.set_defaults(verb=_compare)
    worker = add("worker", "work for the campaigns of a Dask scheduler (needs harvey-cluster)",
                 "examples:\n  dask scheduler --port 8786\n  harvey campaign worker tcp://host:8786 --workers 8\n"
                 "  harvey run lab-to-allens-office --seed 0..999 --cluster tcp://host:8786\n"
                 "Every worker needs the same program; one with other code or arithmetic is refused.")
    worker.add_argument("scheduler", metavar="WHERE", help="tcp://host:port, or the scheduler's file")
    worker.add_argument("--workers", metavar="N", help="processes, or all: one a processor (all)")
    worker.set_defaults(verb=_worker, cluster=None)


def _run_campaign(args: Namespace) -> int:
    code: int = args.verb(args)
    return code


def _show(args: Namespace) -> int:
    from harvey.campaign.show import draw_progress, find_campaign, format_progress, read_progress

    progress = read_progress(find_campaign(args.campaign))
    print(format_progress(progress))
    if progress.times and not args.no_picture:
        print(f"\nas a picture: {draw_progress(progress)}")
    return 0


def _compare(args: Namespace) -> int:
    from harvey.campaign.show import compare, find_campaign, format_comparison, parse_success, read_progress

    succeeds = parse_success(args.success)
    first, second = (read_progress(find_campaign(text)) for text in (args.first, args.second))
    found = compare(first.results, second.results, succeeds)
    print(format_comparison(found, args.success, (args.first, args.second)))
    for name, progress in ((args.first, first), (args.second, second)):
        if progress.given_up:
            print(f"{name}: left out, as given up: {', '.join(map(str, progress.given_up))}")
    return 1 if found.is_worse else 0


def _worker(args: Namespace) -> int:
    """Becomes Dask's own worker, in an environment in which the libraries calculate as ours do."""
    workers = replace(parse_workers(args), cluster=None)
    if "://" not in args.scheduler and not os.path.isfile(args.scheduler):
        raise BadInput(f"expected tcp://host:port or the file of a scheduler, got {args.scheduler!r}")
    command = find_cluster("campaign worker").worker_command(args.scheduler, workers.number or count_processors())
    os.execv(sys.executable, [sys.executable, *command])


CAMPAIGN = CliCommand(
    "campaign", "how far a campaign is, whether one is better than another, and workers for a cluster",
    (
        ("harvey campaign show runs/lab-to-allens-office", "progress, rate, remaining time, outcomes"),
        ("harvey campaign compare runs/before runs/after", "the same seeds of both: better, worse, or by chance?"),
        ("harvey campaign worker tcp://host:8786", "the processors of this machine work for that scheduler"),
    ),
    _add_campaign_arguments, _run_campaign,
    "A campaign is what harvey run with several seeds, or harvey experiment, makes: its directory has results.jsonl.\n"
    "Exit code 0: done; 1: compare finds the second worse, beyond chance; 2: the input cannot be used.",
)


SHOWN = "hallway-kidnap"
FIRST_WORDS = """\
The robot drives to an office that it knows from a model only. In the hallway somebody moves it by a metre and
turns it by 20 degrees. Nobody tells it. See it refute what it believed, be lost, look round, and know where it is."""


def _add_demo_arguments(parser: ArgumentParser) -> None:
    parser.add_argument("--out", metavar="DIR", help="directory for the run's files and the page (runs/demo)")
    parser.add_argument("--no-page", action="store_true", help="write the page, but do not open it")


def _run_demo(args: Namespace) -> int:
    from harvey.campaign.mission_task import Task, run_task
    from harvey.commands.report import build_run_page, write_page
    from logs.explain.story import first_lines

    out = check_vacant(Path(args.out or RUNS / "demo"))
    task = Task(SHOWN, (), 0, out)
    task.load()
    print(f"{FIRST_WORDS}\n", flush=True)
    result = run_task(task, progress=sys.stderr)
    page = out / "report.html"
    write_page(page, build_run_page(RunDirectory(out)))
    print("", *first_lines(out), "", f"{page}: the whole run; opens in any browser", "", sep="\n")
    print(f"ask it      harvey why {out} 'when was it lost?'\nlook at it  harvey view {out}\n"
          "then        harvey run lab-to-allens-office")
    if not args.no_page:
        webbrowser.open(page.resolve().as_uri())
    return 0 if result.outcome == "reached" else 1


DEMO = CliCommand(
    "demo", "see it kidnapped, lost and found, in a minute; a page opens at the end",
    (
        ("harvey demo", "drive, tell what happened, and open the page"),
        ("harvey demo --no-page", "without opening it, as on a machine without a screen"),
    ),
    _add_demo_arguments, _run_demo,
)
