"""``harvey replay``, ``resume`` and ``repair``: decide a run again, go on with it, draw its recording again."""

from __future__ import annotations

import os
import sys
import time
from argparse import ArgumentParser, Namespace
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING

from harvey.commands.command import CliCommand, parse_pairs
from harvey.errors import BadInput
from logs.run_directory import RunDirectory, check_vacant, expect_unwritten, open_run
from world_models.words import count

if TYPE_CHECKING:
    from harvey.runner.replay import ReplayedDecision
    from harvey.runner.resume import Remains
    from logs.run_head import RunHead

def _add_replay_arguments(parser: ArgumentParser) -> None:
    parser.add_argument("run", metavar="RUN", help="a run directory")
    what_if = parser.add_argument_group("what would it have done")
    what_if.add_argument("--without", metavar="NAME", action="append", default=[],
                         help="without a knowledge source, a landmark or face of its model, or one segment, as"
                              " 'CameraPicture-9 segment 12'; may be repeated. Of a thing, as allens-office/desk, only"
                              " the landmark goes: nothing of it is expected to be seen, and it stays in the way")
    what_if.add_argument("--set", metavar="KEY=VALUE", action="append", default=[], dest="settings",
                         help="with a servo level off, as servo.plan=off, or another number of harvey settings, as"
                              " action.min_tolerance_px=8, or camera.tilt_deg=1 for what the robot believes of itself;"
                              " may be repeated")
    what_if.add_argument("--record-only", action="store_true",
                         help="end where the record no longer answers, instead of going on in the simulator")
    what_if.add_argument("--out", metavar="DIR", help="keep what would have been as a run, for diff, why and view")


def _run_replay(args: Namespace) -> int:
    run, settings = open_run(args.run), parse_pairs(args.settings)
    if args.without or settings:
        return _otherwise(run, args, settings)
    if args.out or args.record_only:
        raise BadInput("--out and --record-only: expected --without or --set beside them, got neither")
    return _again(run)


def _otherwise(run: RunDirectory, args: Namespace, settings: tuple[tuple[str, str], ...]) -> int:
    """Decide it again with a changed agent."""
    from harvey.replay.counterfactual import describe_answer, what_if
    from logs.run_head import RunHead

    out = RunDirectory(check_vacant(Path(args.out))) if args.out else None
    if out is not None and out.path.resolve() == run.path.resolve():
        raise BadInput(f"--out {args.out}: expected another directory than that of the run, got the same")
    elsewhere = RunHead.read(run.path).decided_elsewhere()
    answer = what_if(run, args.without, settings, out=out, go_on=not args.record_only)
    if out is not None:
        _draw_ways(run, out)
    print("\n".join(describe_answer(answer, run, [*(f"without {name}" for name in args.without),
                                       *(f"with {key} = {value}" for key, value in settings)])))
    if elsewhere:
        print(f"\nnote: the run {elsewhere}, so what differs may come of that as well: harvey replay {run.path} tells")
    if out is not None:
        print(f"\nit is kept in {out.path}; compare with    harvey diff {run.path} {out.path}")
    return 0


def _draw_ways(run: RunDirectory, other: RunDirectory) -> None:
    """A picture of where the robot believed to be in both; none where the world's file is not as it was."""
    from harvey.commands.plan_picture import draw_ways

    picture = other.path / "ways.png"
    try:
        draw_ways({"as recorded": run, "as it would have been": other}, picture)
    except BadInput:
        return
    print(f"{picture}: both ways on the plan\n")


def _again(run: RunDirectory) -> int:
    """Decide it again as it was."""
    from harvey.agent import build_agent
    from harvey.runner.replay import replay
    from logs.pictures import open_pictures
    from logs.records import Originals
    from logs.run_head import RunHead

    agreed, head = 0, RunHead.read(run.path)
    elsewhere = head.decided_elsewhere()
    pictures = open_pictures(run)  # what is wrong with the journal is said first
    agent = build_agent(head)
    originals = Originals(pictures, agent.store)
    try:
        for decision in with_progress(replay(run, originals, agent.scheduler())):
            if not decision.same:
                print(f"{_perhaps(head, elsewhere)}\n\n{_difference(agreed, decision)}")
                return 1
            agreed += 1
    except BadInput as error:
        raise BadInput(f"{error}; the run {elsewhere}" if elsewhere else str(error)) from None
    if not agreed:
        raise BadInput(f"{run.journal}: expected at least one decision, got none")
    frames = count(len(originals.pictures), "frame")
    print(f"{count(agreed, 'decision')} decided again from {frames}: all the same, byte for byte")
    if elsewhere:
        print(f"note: the run {elsewhere}")
    return 0


def _perhaps(head: RunHead, elsewhere: str) -> str:
    """What a difference may come from, as far as the run tells who decided it."""
    if elsewhere:
        return (f"The run {elsewhere}: that may be why. It takes the program that made the run, and a processor like"
                " its own, to decide it as it was.")
    if not head.code:
        return ("The program may have changed since the run was made, whose run.json does not say by which code it was "
                "decided.")
    return "The run was decided by the same code as this, so its files were changed since, or the libraries are others."


def _difference(agreed: int, decision: ReplayedDecision) -> str:
    from blackboard import decision_record
    from logs.explain.diff import describe
    from logs.records import decision_of

    now = None if decision.now is None else decision_of(decision_record(decision.now))
    return "\n".join(["first: as recorded; second: as decided now", *describe(agreed, decision.recorded, now)])


def with_progress(decisions: Iterable[ReplayedDecision]) -> Iterator[ReplayedDecision]:
    """The decisions, with a bar on a terminal."""
    from tqdm import tqdm

    yield from tqdm(decisions, unit=" decisions", file=sys.stderr, disable=not sys.stderr.isatty(), leave=False)


REPLAY = CliCommand(
    "replay", "decide a recorded run again and compare, byte for byte",
    (
        ("harvey replay runs/lab-to-allens-office-0", "from its camera frames and odometry"),
        ("harvey replay runs/bump-0 --without plan_adjuster", "what it would have done without a knowledge source"),
        ("harvey replay runs/bump-0 --without fire-door", "without a landmark of its model"),
        ("harvey replay runs/bump-0 --without 'CameraPicture-9 segment 12'", "had it not found one segment"),
        ("harvey replay runs/bump-0 --set servo.plan=off --out runs/bump-no-plan", "and keep it as a run"),
        ("harvey replay runs/bump-0 --set action.min_tolerance_px=8", "with another number of harvey settings"),
        ("harvey replay runs/bump-0 --set camera.tilt_deg=1", "had it believed its camera to be tilted"),
    ),
    _add_replay_arguments, _run_replay,
    "Neither simulator nor robot takes part. Exit code 0 where every decision is the same, 1 where one is not.\n\n"
    "With --without or --set it tells what would have been: a changed agent gets what was observed, as long as it\n"
    "requests the same of its body. From the first motion or picture that differs the record no longer answers; a\n"
    "run of the simulator then goes on by itself, in the same world with the same random numbers.",
)


def _add_resume_arguments(parser: ArgumentParser) -> None:
    parser.add_argument("run", metavar="RUN", help="a run directory")
    for name, example in (("base", "denning:/dev/ttyUSB1"), ("camera", "1")):
        parser.add_argument(f"--{name}", metavar=name.upper(),
                            help=f"on hardware: where the {name} is now, as {example}, if not where it was")
    parser.add_argument("--live", action="store_true", help="send the recording to an open viewer as well")


def _run_resume(args: Namespace) -> int:
    run = open_run(args.run, "run.json")
    expect_unwritten(run.path)
    from harvey.campaign.summary import format_result
    from harvey.runner.resume import find_remains
    from logs.run_head import HARDWARE, RunHead

    remains = find_remains(run)
    if remains.outcome is not None and run.read_result().get("outcome") == remains.outcome.kind:
        print(f"{run.path} was not cut off: it ended with {remains.outcome.kind}, {remains.outcome.reason}")
        return 0 if remains.outcome.kind == "reached" else 1
    head = RunHead.read(run.path)
    moved = {key: value for key, value in (("base.port", args.base), ("camera.source", args.camera)) if value}
    if head.kind == HARDWARE:
        return _on_hardware(run, head, remains, moved, args.live)
    if moved:
        raise BadInput(f"--base and --camera: expected a run on hardware, and {run.path} is one of the simulator")
    _print_start(run, remains, head)
    from harvey.simulation.simulated_run import resume_mission
    from logs.explain.story import first_lines

    result = resume_mission(run, remains, live=args.live)
    print(format_result(result, run.path, first_lines(run.path)))
    return 0 if result.outcome == "reached" else 1


def _on_hardware(
    run: RunDirectory, head: RunHead, remains: Remains, moved: Mapping[str, str], live: bool
) -> int:
    """Everything is checked as before a first move; then the mission goes on."""
    os.environ.setdefault("OPENCV_FFMPEG_LOGLEVEL", "-8")  # what is wrong with a camera is said by us
    from harvey.agent import settings_of
    from harvey.commands.drive import follow, run_checks, summary, tell_how_to_stop
    from harvey.hardware.hardware_mission import rebuild_mission
    from harvey.hardware.hardware_run import resume, time_of_last_observation
    from harvey.hardware.preflight import Preflight
    from harvey.replay.what_if import WhatIf

    mission, began_s = rebuild_mission(head, moved), time.monotonic() - time_of_last_observation(run)

    def clock() -> float:
        return time.monotonic() - began_s

    with Preflight(mission, run.path, clock, settings_of(head), WhatIf(pairs=head.constants)) as dry:
        if not run_checks(dry) or dry.base is None or dry.camera is None:
            return 2
        _print_start(run, remains, head)
        tell_how_to_stop()
        result = resume(mission, run, remains, dry.base, dry.camera, clock, sinks=[follow], live=live)
    print(summary(result, run.path))
    return 0 if result.outcome == "reached" else 1


def _print_start(run: RunDirectory, remains: Remains, head: RunHead) -> None:
    if elsewhere := head.decided_elsewhere():
        print(f"note: the run {elsewhere}; it goes on only if it is decided again as it was", file=sys.stderr)
    for what in remains.dropped:
        print(f"dropped: {what}", file=sys.stderr)
    done = count(remains.decisions, "decision")
    print(f"{run.path}: {done} replayed, then it goes on", file=sys.stderr, flush=True)


RESUME = CliCommand(
    "resume", "go on with a run that was cut off",
    (
        ("harvey resume runs/lab-to-allens-office-3", "after a crash, kill -9, a power cut or a full disk"),
        ("harvey why runs/lab-to-allens-office-3 resumed-1", "what it was told then"),
        ("harvey resume runs/mission-drive --base create2:/dev/ttyUSB1", "on hardware, the base on another port now"),
    ),
    _add_resume_arguments, _run_resume,
    "Its decisions are replayed from what was observed, the simulated robot does the same again, and it goes on\n"
    "from the last one. A motor command of which nobody heard how far it was carried out is not carried out again:\n"
    "the robot was stopped in it, and the wheels are asked. On hardware everything is checked as harvey drive does,\n"
    "and a milestone has to hold before the robot moves on. Exit code 0: the goal was reached; 1: it was not; 2: the\n"
    "input cannot be used.",
)


def _add_repair_arguments(parser: ArgumentParser) -> None:
    parser.add_argument("run", metavar="RUN", help="a run directory")


def _run_repair(args: Namespace) -> int:
    from tqdm import tqdm

    from harvey.simulation.simulated_run import redraw

    run = open_run(args.run)
    expect_unwritten(run.path)
    with tqdm(unit=" decisions", file=sys.stderr, disable=not sys.stderr.isatty(), leave=False) as bar:
        decisions = redraw(run, (lambda _decision: bar.update(),))
    print(f"{run.recording} was drawn again from {count(decisions, 'decision')} of the journal")
    return 0


REPAIR = CliCommand(
    "repair", "draw the recording of a run again, where it is damaged or missing",
    (("harvey repair runs/lab-to-allens-office-0", "from its journal and its camera's pictures"),),
    _add_repair_arguments, _run_repair,
    "The run is decided again from what was observed; nothing else of it is touched. A run that was cut off is\n"
    "drawn as far as it came: harvey resume goes on with it.",
)
