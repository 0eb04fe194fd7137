"""``harvey repair``: draw the recording of a run anew."""

from __future__ import annotations

import sys
from argparse import ArgumentParser, Namespace

from harvey.commands.command import Command
from logs.run_directory import open_run
from world_models.words import count


def _arguments(parser: ArgumentParser) -> None:
    parser.add_argument("run", metavar="RUN", help="a run directory")


def _run(args: Namespace) -> int:
    from tqdm import tqdm

    from harvey.repair import redraw

    run = open_run(args.run)
    with tqdm(unit=" decisions", file=sys.stderr, disable=not sys.stderr.isatty(), leave=False) as bar:
        decisions = redraw(run, (lambda _decision: bar.update(),))
    print(f"{run.recording} was drawn anew from {count(decisions, 'decision')} of the journal")
    return 0


COMMAND = Command(
    "repair", "draw the recording of a run anew, where it is damaged or missing",
    (("harvey repair runs/lab-to-allens-office-0", "from its journal and its camera's pictures"),), _arguments, _run,
    "The run is decided again from what was observed; nothing else of it is touched. A run that was cut off is\n"
    "drawn as far as it came: harvey resume goes on with it.",
)
