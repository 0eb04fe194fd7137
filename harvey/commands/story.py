"""``harvey story``: a run told in a page of text."""

from __future__ import annotations

import json
from argparse import ArgumentParser, Namespace

from harvey.commands.command import Command
from harvey.errors import BadInput
from logs.disk import is_being_written
from logs.run_directory import open_run


def _arguments(parser: ArgumentParser) -> None:
    parser.add_argument("run", metavar="RUN", help="a run directory")
    parser.add_argument("--json", action="store_true", help="for machines")


def _run(args: Namespace) -> int:
    from logs.explain.story import story_lines, tell_run
    from logs.records import read_records
    from logs.timeline import Timeline

    run = open_run(args.run)
    for _ in read_records(run.journal):
        pass  # a line that is no decision is said first, also where the story has no need of it
    history = Timeline(run.journal)
    story = tell_run(run, history)
    print(json.dumps(story.record(), indent=2) if args.json else "\n".join(story_lines(story)))
    if history.cut_off is not None and not is_being_written(run.journal):
        raise BadInput(
            f"{run.path}: the run was cut off in cycle {history.cut_off}, before it had an outcome; harvey"
            f" resume {run.path} goes on with it"
        )
    return 0


COMMAND = Command(
    "story",
    "a run told in a page of text: plans, lost and found, contacts, milestones, how it ended",
    (
        ("harvey story runs/hallway-kidnap-0", "what happened, in the order of subjects, with cycles and times"),
        ("harvey story runs/hallway-kidnap-0 | head -20", "its first lines: how it ended, and what went wrong"),
        ("harvey story runs/hallway-kidnap-0 --json", "the same for machines, each sentence with cycle and entries"),
    ),
    _arguments,
    _run,
    "From the journal, as the robot knew it; what only the simulator knows is from result.json, and is called that.\n"
    "Exit code 2 where the run was cut off before it had an outcome: what there is of it is told all the same.",
)
