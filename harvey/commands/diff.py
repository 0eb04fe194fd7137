"""``harvey diff``: the first decision in which two runs differ, and why."""

from __future__ import annotations

from argparse import ArgumentParser, Namespace
from itertools import islice

from harvey.commands.command import Command
from logs.explain.diff import agreement, apart, because, describe, first_difference, settings
from logs.run_directory import RunDirectory, open_run
from logs.timeline import Timeline


def _arguments(parser: ArgumentParser) -> None:
    parser.add_argument("first", metavar="RUN", help="a run directory")
    parser.add_argument("second", metavar="RUN", help="another")
    parser.add_argument("--fields", action="store_true", help="list the first decision that differs field by field")


def _run(args: Namespace) -> int:
    from logs.run_head import RunHead

    first, second = open_run(args.first), open_run(args.second)
    heads = RunHead.read(first.path), RunHead.read(second.path)
    ours, theirs = Timeline(first.journal), Timeline(second.journal)
    print(f"first:  {_title(first)}\nsecond: {_title(second)}")
    for name, head in zip(("first", "second"), heads, strict=True):
        if elsewhere := head.decided_elsewhere():
            print(f"note: the {name} run {elsewhere}")
    set_differently = tuple(settings(*heads))
    if set_differently:
        print(f"set differently: {'; '.join(set_differently)}")
    alike = ours.lines_alike(theirs)
    more, one, other = first_difference(*(islice(h.decisions(), alike, None) for h in (ours, theirs)))
    agreed = alike + more
    if one is None or other is None or args.fields:
        print("\n".join(describe(agreed, one, other)))
    else:
        print("\n".join([agreement(agreed), "", *because(ours, theirs, agreed, set_differently)]))
    if one is None and other is None:
        return 0
    print(f"\nHow they went:\n{apart(first, second, ours, theirs)}")
    return 1


def _title(run: RunDirectory) -> str:
    result = run.read_result()
    named = [f"{key} {result[key]}" for key in ("scenario", "seed", "outcome") if key in result]
    return ", ".join([str(run.path), *named])


COMMAND = Command(
    "diff", "the first decision in which two runs differ, and why",
    (
        ("harvey diff runs/lab-to-allens-office-0 runs/lab-to-allens-office-1", "two seeds of one scenario"),
        ("harvey diff runs/bump-0 runs/without-door", "a run and what would have been (harvey replay --without)"),
        ("harvey diff runs/bump-0 runs/bump-1 --fields", "the first difference field by field"),
    ),
    _arguments, _run,
    "Goes down from the first decision that differs to the observation or the setting that it comes from.\n"
    "Exit code 0 where all decisions agree, 1 where they do not, 2 where an input cannot be used.",
)
