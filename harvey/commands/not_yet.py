"""Commands that are part of the contract but not built yet: they say so."""

from __future__ import annotations

import sys
from argparse import SUPPRESS, ArgumentParser, Namespace
from functools import partial

from harvey.commands.command import Command

PLANNED = (
    ("resume", "go on with a run that was cut off", "harvey resume runs/lab-to-allens-office-3"),
    ("drive", "drive a real Denning platform", "harvey drive lab-to-allens-office --port /dev/ttyUSB0"),
    ("calibrate", "measure camera and actuator of a real platform", "harvey calibrate --port /dev/ttyUSB0"),
    ("emulate", "answer on a serial line as the platform would", "harvey emulate --port /dev/pts/3"),
)


def _arguments(parser: ArgumentParser) -> None:
    parser.add_argument("anything", nargs="*", help=SUPPRESS)


def _run(name: str, summary: str, _args: Namespace) -> int:
    print(f"harvey {name}: not yet available; it will {summary}", file=sys.stderr)
    return 2


NOT_YET = tuple(
    Command(name, f"{summary} (not yet)", ((example, "not yet available"),), _arguments,
            partial(_run, name, summary), open_ended=True)
    for name, summary, example in PLANNED
)
