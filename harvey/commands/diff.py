"""``harvey diff``: the first decision in which two runs differ."""

from __future__ import annotations

from argparse import ArgumentParser, Namespace

from harvey.commands.command import Command
from harvey.diff import describe, first_difference
from harvey.records import read_records
from harvey.run_directory import RunDirectory, open_run


def _arguments(parser: ArgumentParser) -> None:
    parser.add_argument("first", metavar="RUN", help="a run directory")
    parser.add_argument("second", metavar="RUN", help="another")


def _run(args: Namespace) -> int:
    first, second = open_run(args.first), open_run(args.second)
    print(f"first:  {_title(first)}\nsecond: {_title(second)}")
    agreed, one, other = first_difference(read_records(first.journal), read_records(second.journal))
    print("\n".join(describe(agreed, one, other)))
    return 0 if one is None and other is None else 1


def _title(run: RunDirectory) -> str:
    result = run.read_result()
    named = [f"{key} {result[key]}" for key in ("scenario", "seed") if key in result]
    return ", ".join([str(run.path), *named])


COMMAND = Command(
    "diff", "the first decision in which two runs differ, and in what",
    (("harvey diff runs/lab-to-allens-office-0 runs/lab-to-allens-office-1", "two seeds of one scenario"),),
    _arguments, _run,
    "Exit code 0 where all decisions agree, 1 where they do not.",
)
