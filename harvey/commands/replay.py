"""``harvey replay``: decide a recorded run again, without simulator or robot."""

from __future__ import annotations

import sys
from argparse import ArgumentParser, Namespace

from harvey.commands.command import Command
from harvey.run_directory import open_run


def _arguments(parser: ArgumentParser) -> None:
    parser.add_argument("run", metavar="RUN", help="a run directory")


def _run(args: Namespace) -> int:
    open_run(args.run)
    print("harvey replay: not yet available", file=sys.stderr)
    return 2


COMMAND = Command(
    "replay", "decide a recorded run again and compare, byte for byte",
    (("harvey replay runs/lab-to-allens-office-0", "from its camera frames and odometry"),), _arguments, _run,
)
