"""``harvey resume``: go on with a run that was cut off."""

from __future__ import annotations

import sys
from argparse import ArgumentParser, Namespace
from typing import TYPE_CHECKING

from harvey.commands.command import Command
from harvey.run_directory import RunDirectory, open_run
from harvey.units import count

if TYPE_CHECKING:
    from harvey.again.resume import Remains


def _arguments(parser: ArgumentParser) -> None:
    parser.add_argument("run", metavar="RUN", help="a run directory")
    parser.add_argument("--live", action="store_true", help="send the recording to an open viewer as well")


def _run(args: Namespace) -> int:
    run = open_run(args.run, "run.json")
    from harvey.again.resume import remains_of, resume
    from harvey.summary import one

    remains = remains_of(run)
    if remains.outcome is not None and run.read_result().get("outcome") == remains.outcome.kind:
        print(f"{run.path} was not cut off: it ended with {remains.outcome.kind}, {remains.outcome.reason}")
        return 0 if remains.outcome.kind == "reached" else 1
    _tell(run, remains)
    result = resume(run, remains, live=args.live)
    print(one(result, run.path))
    return 0 if result.outcome == "reached" else 1


def _tell(run: RunDirectory, remains: Remains) -> None:
    for what in remains.dropped:
        print(f"dropped: {what}", file=sys.stderr)
    told = count(remains.decisions, "decision")
    print(f"{run.path}: {told} told again, then it goes on", file=sys.stderr, flush=True)


COMMAND = Command(
    "resume", "go on with a run that was cut off",
    (
        ("harvey resume runs/lab-to-allens-office-3", "after a crash, kill -9, a power cut or a full disk"),
        ("harvey why runs/lab-to-allens-office-3 resumed-1", "what it was told then"),
    ),
    _arguments, _run,
    "Its decisions are told again from what was observed, the simulated robot lives through them, and it goes on\n"
    "from the last one. A motor command of which nobody heard how far it was carried out is not carried out again:\n"
    "the robot was stopped in it, and the wheels are asked. Exit code 0: the goal was reached; 1: it was not; 2: the\n"
    "input cannot be used.",
)
