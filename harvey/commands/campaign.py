"""``harvey campaign``: how far a campaign is, and whether one is better than another."""

from __future__ import annotations

import os
import sys
from argparse import ArgumentParser, Namespace, RawDescriptionHelpFormatter
from dataclasses import replace

from harvey.commands.command import Command
from harvey.errors import BadInput


def _arguments(parser: ArgumentParser) -> None:
    verbs = parser.add_subparsers(title="verbs", metavar="VERB", required=True)

    def add(name: str, what: str, epilog: str) -> ArgumentParser:
        verb: ArgumentParser = verbs.add_parser(name, help=what, description=f"{what[0].upper()}{what[1:]}.",
                                                epilog=epilog, formatter_class=RawDescriptionHelpFormatter)
        return verb

    show = add("show", "progress, rate, remaining time and outcomes, also while it runs",
               "examples:\n  harvey campaign show runs/lab-to-allens-office\n"
               "  harvey campaign show runs/experiments/missions/full-0")
    show.add_argument("campaign", metavar="DIR", help="its directory, as runs/bump")
    show.add_argument("--no-picture", action="store_true", help="do not draw progress.png in it")
    show.set_defaults(verb=_show)
    compare = add("compare", "judge two campaigns by the cases that both have",
                  "examples:\n  harvey campaign compare runs/before runs/after\n"
                  "  harvey campaign compare runs/before runs/after --success 'final_error_m<0.0254'\n"
                  "exit code 0: the second is not worse beyond chance (5 %); 1: it is; 2: the input cannot be used.")
    compare.add_argument("first", metavar="A", help="directory of a campaign")
    compare.add_argument("second", metavar="B", help="directory of another with the same seeds")
    compare.add_argument("--success", metavar="TEST", default="outcome=reached",
                         help="what counts as success: FIELD=VALUE, FIELD<NUMBER or FIELD>NUMBER (outcome=reached)")
    compare.set_defaults(verb=_compare)
    worker = add("worker", "work for the campaigns of a Dask scheduler",
                 "examples:\n  dask scheduler --port 8786\n  harvey campaign worker tcp://host:8786 --workers 8\n"
                 "  harvey run lab-to-allens-office --seed 0..999 --cluster tcp://host:8786\n"
                 "Every worker needs the same program; one with other code or arithmetic is refused.")
    worker.add_argument("scheduler", metavar="WHERE", help="tcp://host:port, or the scheduler's file")
    worker.add_argument("--workers", metavar="N", help="processes, or all: one a processor (all)")
    worker.set_defaults(verb=_worker, cluster=None)


def _run(args: Namespace) -> int:
    code: int = args.verb(args)
    return code


def _show(args: Namespace) -> int:
    from harvey.campaign.show import draw_progress, find_campaign, format_progress, read_progress

    progress = read_progress(find_campaign(args.campaign))
    print(format_progress(progress))
    if progress.times and not args.no_picture:
        print(f"\nas a picture: {draw_progress(progress)}")
    return 0


def _compare(args: Namespace) -> int:
    from harvey.campaign.compare import compare, format_comparison, parse_success
    from harvey.campaign.show import find_campaign, read_progress

    succeeds = parse_success(args.success)
    first, second = (read_progress(find_campaign(text)) for text in (args.first, args.second))
    found = compare(first.results, second.results, succeeds)
    print(format_comparison(found, args.success, (args.first, args.second)))
    for name, progress in ((args.first, first), (args.second, second)):
        if progress.given_up:
            print(f"{name}: left out, as given up: {', '.join(map(str, progress.given_up))}")
    return 1 if found.is_worse else 0


def _worker(args: Namespace) -> int:
    """Becomes Dask's own worker, in an environment in which the libraries calculate as ours do."""
    from harvey.campaign.dask_workers import worker_command
    from harvey.campaign.workers import count_processors, parse_workers

    workers = replace(parse_workers(args), cluster=None)
    if "://" not in args.scheduler and not os.path.isfile(args.scheduler):
        raise BadInput(f"expected tcp://host:port or the file of a scheduler, got {args.scheduler!r}")
    command = worker_command(args.scheduler, workers.number or count_processors())
    os.execv(sys.executable, [sys.executable, *command])


COMMAND = Command(
    "campaign", "how far a campaign is, whether one is better than another, and workers for a cluster",
    (
        ("harvey campaign show runs/lab-to-allens-office", "progress, rate, remaining time, outcomes"),
        ("harvey campaign compare runs/before runs/after", "the same seeds of both: better, worse, or by chance?"),
        ("harvey campaign worker tcp://host:8786", "the processors of this machine work for that scheduler"),
    ),
    _arguments, _run,
    "A campaign is what harvey run with several seeds, or harvey experiment, makes: its directory has results.jsonl.\n"
    "Exit code 0: done; 1: compare finds the second worse, beyond chance; 2: the input cannot be used.",
)
