"""``harvey replay``: decide a recorded run again, without simulator or robot."""

from __future__ import annotations

import sys
from argparse import ArgumentParser, Namespace
from collections.abc import Iterator

from harvey.commands.command import Command
from harvey.diff import describe
from harvey.errors import BadInput
from harvey.records import DecisionRecord, decision_of, read_records
from harvey.run_directory import RunDirectory, open_run
from harvey.units import count


def _arguments(parser: ArgumentParser) -> None:
    parser.add_argument("run", metavar="RUN", help="a run directory")


def _run(args: Namespace) -> int:
    run = open_run(args.run, "recording.rrd")
    from blackboard.journal import decision_line, decision_record
    from harvey.replay import replayed, scenario_of, scheduler_of
    from logs.reader import read_frames

    frames = read_frames(run.recording)
    agreed = 0
    for pair, line in zip(replayed(_shown(run), frames, scheduler_of(scenario_of(run))), _lines(run), strict=False):
        if pair.now is None or decision_line(pair.now).encode() != line:
            print("first: as recorded; second: as decided now")
            now = None if pair.now is None else decision_of(decision_record(pair.now))
            print("\n".join(describe(agreed, pair.recorded, now)))
            return 1
        agreed += 1
    if not agreed:
        raise BadInput(f"{run.journal}: expected at least one decision, got none")
    print(f"{count(agreed, 'decision')} decided again from {count(len(frames), 'frame')}: all the same, byte for byte")
    return 0


def _lines(run: RunDirectory) -> Iterator[bytes]:
    with run.journal.open("rb") as lines:
        yield from (line.removesuffix(b"\n") for line in lines)


def _shown(run: RunDirectory) -> Iterator[DecisionRecord]:
    from tqdm import tqdm

    yield from tqdm(read_records(run.journal), unit=" decisions", file=sys.stderr, disable=not sys.stderr.isatty(),
                    leave=False)


COMMAND = Command(
    "replay", "decide a recorded run again and compare, byte for byte",
    (("harvey replay runs/lab-to-allens-office-0", "from its camera frames and odometry"),), _arguments, _run,
    "Neither simulator nor robot takes part. Exit code 0 where every decision is the same, 1 where one is not.",
)
