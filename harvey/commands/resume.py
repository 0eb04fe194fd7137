"""``harvey resume``: go on with a run that was cut off."""

from __future__ import annotations

import os
import sys
import time
from argparse import ArgumentParser, Namespace
from collections.abc import Mapping
from typing import TYPE_CHECKING

from harvey.commands.command import Command
from harvey.errors import BadInput
from logs.run_directory import RunDirectory, open_run
from world_models.words import count

if TYPE_CHECKING:
    from harvey.runner.resume import Remains
    from logs.run_head import RunHead


def _arguments(parser: ArgumentParser) -> None:
    parser.add_argument("run", metavar="RUN", help="a run directory")
    for name, example in (("base", "denning:/dev/ttyUSB1"), ("camera", "1")):
        parser.add_argument(f"--{name}", metavar=name.upper(),
                            help=f"on hardware: where the {name} is now, as {example}, if not where it was")
    parser.add_argument("--live", action="store_true", help="send the recording to an open viewer as well")


def _run(args: Namespace) -> int:
    run = open_run(args.run, "run.json")
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
    from harvey.simulation.run import resume_mission
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
    from harvey.hardware.mission import rebuild_mission
    from harvey.hardware.preflight import Preflight
    from harvey.hardware.run import resume, time_of_last_observation
    from harvey.what_if import WhatIf

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
    told = count(remains.decisions, "decision")
    print(f"{run.path}: {told} replayed, then it goes on", file=sys.stderr, flush=True)


COMMAND = Command(
    "resume", "go on with a run that was cut off",
    (
        ("harvey resume runs/lab-to-allens-office-3", "after a crash, kill -9, a power cut or a full disk"),
        ("harvey why runs/lab-to-allens-office-3 resumed-1", "what it was told then"),
        ("harvey resume runs/mission-drive --base create2:/dev/ttyUSB1", "on hardware, the base on another port now"),
    ),
    _arguments, _run,
    "Its decisions are replayed from what was observed, the simulated robot does the same again, and it goes on\n"
    "from the last one. A motor command of which nobody heard how far it was carried out is not carried out again:\n"
    "the robot was stopped in it, and the wheels are asked. On hardware everything is checked as harvey drive does,\n"
    "and a milestone has to hold before the robot moves on. Exit code 0: the goal was reached; 1: it was not; 2: the\n"
    "input cannot be used.",
)
