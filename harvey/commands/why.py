"""``harvey why``: what a decision rests on, down to goal, model and pixels."""

from __future__ import annotations

from argparse import ArgumentParser, Namespace

from harvey.commands.command import Command, whole
from harvey.records import read_records
from harvey.run_directory import open_run
from harvey.trace import trace_of
from harvey.why import DEPTH, History, explain


def _arguments(parser: ArgumentParser) -> None:
    parser.add_argument("run", metavar="RUN", help="a run directory")
    which = parser.add_mutually_exclusive_group()
    which.add_argument("entry", metavar="ENTRY", nargs="?",
                       help="as MotorCommand-12 (its last revision) or Leg-3.2; without one: how the mission ended")
    which.add_argument("--at", metavar="CYCLE", type=whole, help="explain what this cycle did")
    parser.add_argument("--depth", metavar="N", type=whole, default=DEPTH, help=f"how many steps down to go ({DEPTH})")


def _run(args: Namespace) -> int:
    decisions = list(read_records(open_run(args.run).journal))
    history = History(decisions)
    if args.at is None:
        refs = [history.named(args.entry) if args.entry else history.outcome()]
    else:
        decision = history.decision(args.at)
        print("\n".join(trace_of(decisions, args.at)))
        refs = [record.ref for record in decision.made]
        print()
    print("\n".join(explain(history, refs, args.depth)))
    return 0


COMMAND = Command(
    "why", "why Harvey did what it did, in sentences",
    (
        ("harvey why runs/lab-to-allens-office-0", "how the mission ended, and why"),
        ("harvey why runs/lab-to-allens-office-0 MotorCommand-12", "why it turned there"),
        ("harvey why runs/lab-to-allens-office-0 --at 88", "what cycle 88 did, and why"),
        ("harvey why runs/lab-to-allens-office-0 --depth 12", "go further down"),
    ),
    _arguments, _run,
    "Walks from an entry to the entries it rests on. What several share is told once.",
)
