"""``harvey experiment``: measure, and print paper, peer and ours."""

from __future__ import annotations

import json
from argparse import ArgumentParser, Namespace

from harvey.commands.command import Command, whole


def _arguments(parser: ArgumentParser) -> None:
    parser.add_argument("name", metavar="NAME", help="which one; harvey list names them")
    parser.add_argument("--quick", action="store_true", help="a small version")
    parser.add_argument("--json", action="store_true", help="print JSON instead of a table")
    parser.add_argument("--seed", metavar="N", type=whole, default=0, help="of all chance (0)")


def _run(args: Namespace) -> int:
    import experiments

    report = experiments.run(args.name, quick=args.quick, seed=args.seed)
    print(json.dumps(report.record(), indent=2) if args.json else report.text())
    return 0 if report.holds else 1


COMMAND = Command(
    "experiment", "measure something and print the paper's figure, a peer's and ours",
    (
        ("harvey experiment levels --quick", "what the three servo levels do"),
        ("harvey experiment render-speed", "the simulator's frames per second and edge accuracy"),
        ("harvey experiment levels --json", "for further use"),
    ),
    _arguments, _run,
    "Exit code 0 where the experiment's claims hold, 1 where they do not. With --json one object is printed: title,\n"
    "rows (the cells by their columns; beside them paper, peer and ours: a figure, several by name, or null), notes\n"
    "and claims.",
)
