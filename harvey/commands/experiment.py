"""``harvey experiment``: measure, and print paper, peer and ours."""

from __future__ import annotations

import json
from argparse import ArgumentParser, Namespace
from textwrap import fill

from experiments import EXPERIMENTS
from harvey.campaign.workers import add_worker_arguments, choose_workers, parse_workers
from harvey.commands.command import Command, whole


def _arguments(parser: ArgumentParser) -> None:
    parser.add_argument("experiment", metavar="NAME", help="which one; harvey list names them")
    parser.add_argument("--quick", action="store_true",
                        help="a small version, of seconds to two minutes; it claims only what it can show")
    parser.add_argument("--json", action="store_true", help="print JSON instead of a table")
    parser.add_argument("--seed", metavar="N", type=whole, default=0, help="of all random numbers (0)")
    add_worker_arguments(parser)
    parser.add_argument("--missions", metavar="N", type=whole, help="how many, for the experiments that say so")


def _run(args: Namespace) -> int:
    import experiments

    with choose_workers(parse_workers(args)):
        report = experiments.run(args.experiment, quick=args.quick, seed=args.seed, missions=args.missions or None)
    print(json.dumps(report.record(), indent=2) if args.json else report.text())
    return 0 if report.holds else 1


COMMAND = Command(
    "experiment", "measure something and print the paper's figure, a peer's and ours",
    (
        ("harvey experiment levels --quick", "what the three servo levels do"),
        ("harvey experiment render-speed", "the simulator's frames per second and edge accuracy"),
        ("harvey experiment obstacles --missions 200", "a fifth of its missions"),
        ("harvey experiment missions --workers 4", "on four processors"),
        ("harvey experiment levels --json", "for further use"),
    ),
    _arguments, _run,
    "It prints a table, notes (assumptions, and what the columns mean) and claims, each with 'holds' or 'FAILS'.\n"
    "Exit code 0 if all claims hold, 1 if one does not. With --json one object is printed: title, rows (the cells by\n"
    "their columns; beside them paper, peer and ours: a figure, several by name, or null), notes and claims.\n\n"
    "Long ones keep their results and pictures in runs/experiments/NAME/; one that was interrupted continues there.\n"
    "Peers (PoseLib, CLIPS, py_trees) are installed by pip install '.[peers]'; buildings of other programs need\n"
    "pip install ./extras/harvey-buildings. Photographs and buildings by\n"
    "others are not shipped: HARVEY_DATA=FOLDER names a folder with corridor/ and buildings/.\n\n"
    "Names, by what is asked (harvey list says more):\n"
    + "\n".join(fill(", ".join(group), 100, initial_indent=f"  {folder:<12}", subsequent_indent=" " * 14,
                     break_on_hyphens=False)
                for folder, group in EXPERIMENTS.items()),
)
