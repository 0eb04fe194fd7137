"""``harvey why``, ``story`` and ``diff``: what a decision rests on, a run in a page of text, where two runs part."""

from __future__ import annotations

import json
import sys
from argparse import ArgumentParser, Namespace
from collections.abc import Iterator
from dataclasses import asdict
from typing import TYPE_CHECKING

from harvey.commands.command import CliCommand, whole
from harvey.errors import BadInput
from logs.disk import is_being_written
from logs.run_directory import RunDirectory, open_run

if TYPE_CHECKING:
    from logs.explain.phrases import Story
    from logs.timeline import Timeline


def _add_why_arguments(parser: ArgumentParser) -> None:
    parser.add_argument("run", metavar="RUN", help="a run directory")
    parser.add_argument("entry", metavar="NAME", nargs="?",
                        help="as MotorCommand-12 (its last revision) or Leg-3.2, or a landmark, door or room as"
                             " allens-office/desk, or a question as 'what is in the way?'; without one: how the"
                             " mission ended")
    parser.add_argument("--at", metavar="CYCLE", type=whole, help="explain what this cycle did")
    parser.add_argument("--milestone", metavar="NAME", help="tell a milestone's story: Milestone-3, or M1 of hallway")
    parser.add_argument("--not", metavar="KS|ENTRY", dest="not_",
                        help="why this knowledge source did not act (--at CYCLE: then), or why this entry did not stay")
    parser.add_argument("--check", action="store_true",
                        help="walk every decision of the run, and name those that rest on nothing")
    parser.add_argument("--depth", metavar="N", type=whole,
                        help="also list what it rests on, entry by entry, N steps down")
    parser.add_argument("--json", action="store_true", help="for machines")


def _run_why(args: Namespace) -> int:
    from logs.explain.in_short import tell_end
    from logs.explain.questions_in_words import is_question
    from logs.explain.story import opening
    from logs.explain.web import cycle_lines, explain
    from logs.explain.why import LEGEND, lines_of
    from logs.timeline import Timeline

    asked = [name for name in ("entry", "milestone", "not_") if getattr(args, name) is not None]
    asked += ["--check"] * args.check
    with_at = args.not_ or (args.entry is not None and is_question(args.entry))
    if len(asked) + (args.at is not None and not with_at) > 1:
        raise BadInput("expected one of NAME, --at, --milestone, --not and --check; --not and a question also go with"
                       " --at")
    run = open_run(args.run)
    history, of_the_end = Timeline(run.journal), not asked and args.at is None
    if args.check:
        return _print_check(history, args.json)
    if args.not_ is not None:
        return _print_not(run, history, args)
    if of_the_end and history.cut_off is None and args.depth is None and not args.json:
        print("\n\n".join(["\n".join(opening(run, history, is_short=True)), "\n".join(lines_of(tell_end(run, history))),
                           LEGEND]))
        return 0
    stories = list(_stories(run, history, args))
    if of_the_end and history.cut_off is not None:
        print(_describe_unfinished(run, history.cut_off), file=sys.stderr if args.json else sys.stdout)
    if args.json:
        print(json.dumps([asdict(one) for one in stories], indent=2))
        return 0
    parts = [[*opening(run, history)]] * of_the_end
    if args.at is not None and args.entry is None:
        parts.append([*cycle_lines(history.decision(args.at), history.candidates(args.at))])
    parts += [[*lines_of(one)] for one in stories] or [[]]
    refs = [one.ref for one in stories if args.milestone is None and one.ref and history.find(one.ref) is not None]
    if args.depth is not None and refs:
        parts.append(["Entry by entry:", *explain(history, refs, args.depth)])
    parts += [[LEGEND]] * of_the_end
    print("\n\n".join("\n".join(lines) for lines in parts))
    return 0


def _describe_unfinished(run: RunDirectory, cycle: int) -> str:
    """What to say first of a run that has no outcome."""
    what = (f"The run is still going on, in cycle {cycle} or later." if is_being_written(run.journal) else f"The run"
            f" was cut off in cycle {cycle}, before it had an outcome: harvey resume {run.path} goes on with it.")
    return f"{what}\nThe last thing that its journal tells of:\n"


def _stories(run: RunDirectory, history: Timeline, args: Namespace) -> Iterator[Story]:
    from logs.explain.model import WorldFile
    from logs.explain.questions_in_words import answers, is_question
    from logs.explain.subjects import milestone_story, milestones, stories_of

    world = WorldFile(run)
    if args.entry is not None and is_question(args.entry):
        yield from answers(history, args.entry, args.at, run)
    elif args.milestone is not None:
        yield from (milestone_story(history, id, world) for id in milestones(history, args.milestone))
    else:
        yield from stories_of(history, args.entry if args.at is None else args.at, world)


def _print_check(history: Timeline, as_json: bool) -> int:
    from logs.explain.web import check

    history.expect_decisions()
    found = check(history)
    if as_json:
        print(json.dumps({"decisions": found.decisions, "acts": found.acts, "reached": found.reached, **found.by_kind,
                          "failing": list(found.failing)}, indent=2))
    else:
        goal, model, sensor = found.by_kind.values()
        print(f"{found.reached} of {found.decisions} decisions rest on something ({goal} reach the goal, {model} the"
              f" model, {sensor} a camera frame).")
        for cycle, lacking in found.failing.items():
            print(f"  cycle {cycle}: nothing is below {', '.join(lacking)}")
    return 0 if not found.failing else 1


def _print_not(run: RunDirectory, history: Timeline, args: Namespace) -> int:
    from harvey.replay.why_not_again import answers

    lines = list(answers(run, history, args.not_, args.at))
    print(json.dumps({"not": args.not_, "at": args.at, "because": lines}, indent=2) if args.json else "\n".join(lines))
    return 0


WHY = CliCommand(
    "why", "why Harvey did what it did, in sentences; and why not something else",
    (
        ("harvey why runs/lab-to-allens-office-0", "how the mission ended, and what decided it"),
        ("harvey why runs/lab-to-allens-office-0 MotorCommand-12", "why it turned there"),
        ("harvey why runs/lab-to-allens-office-0 allens-office/desk", "who expected it, from which frame and line"),
        ("harvey why runs/lab-to-allens-office-0 --at 88", "what cycle 88 did, and why"),
        ("harvey why runs/lab-to-allens-office-0 --milestone 'M1 of hallway'", "what was expected, seen and judged"),
        ("harvey why runs/lab-to-allens-office-0 --not prober --at 88", "why a knowledge source did not act then"),
        ("harvey why runs/lab-to-allens-office-0 --not Hypothesis-1.20", "what came of an entry, and what instead"),
        ("harvey why runs/hallway-kidnap-0 'when was it lost?'", "where and why too, and how it was found"),
        ("harvey why runs/hallway-kidnap-0 'where did it touch anything?'", "what it felt, and what the simulator saw"),
        ("harvey why runs/hallway-kidnap-0 'how far off was it?' --at 350", "belief against truth, from the recording"),
        ("harvey why runs/box-in-the-way-0 'what is in the way?'", "each thing that the model lacks, down to pixels"),
        ("harvey why runs/box-in-the-way-0 'why did you stop?' --at 120", "the last stop up to cycle 120"),
        ("harvey why runs/box-in-the-way-0 'why not round it?'", "how much room there was, and how much it needs"),
        ("harvey why runs/hallway-kidnap-0 'how sure was it?' --at 380", "by its own reckoning, and in truth"),
        ("harvey why runs/box-in-the-way-0 'why that detour?'", "the plan before and after, and what lay between"),
        ("harvey why runs/door-found-shut-0 'is the door shut?'", "what pictures show in its opening"),
        ("harvey why runs/lab-to-allens-office-0 --check", "whether every decision rests on something"),
        ("harvey why runs/lab-to-allens-office-0 --depth 12", "the whole web of reasons, twelve steps down"),
    ),
    _add_why_arguments, _run_why,
    "Follows the main reasons from an entry down to goal, model and pixels. With --check, exit code 1 where a\n"
    "decision rests on nothing. Without NAME the answer is short; with --depth all is told that the end rests on.",
)


def _add_story_arguments(parser: ArgumentParser) -> None:
    parser.add_argument("run", metavar="RUN", help="a run directory")
    parser.add_argument("--json", action="store_true", help="for machines")


def _run_story(args: Namespace) -> int:
    from logs.explain.story import story_lines, tell_run
    from logs.timeline import Timeline

    run = open_run(args.run)
    history = Timeline(run.journal)
    history.verify()  # a line that is no decision is said first, also where the story has no need of it
    story = tell_run(run, history)
    print(json.dumps(asdict(story), indent=2) if args.json else "\n".join(story_lines(story)))
    if history.cut_off is not None and not is_being_written(run.journal):
        raise BadInput(f"{run.path}: the run was cut off in cycle {history.cut_off}, before it had an outcome; harvey"
                       f" resume {run.path} goes on with it")
    return 0


STORY = CliCommand(
    "story", "a run told in a page of text: plans, lost and found, contacts, milestones, how it ended",
    (
        ("harvey story runs/hallway-kidnap-0", "what happened, in the order of subjects, with cycles and times"),
        ("harvey story runs/hallway-kidnap-0 | head -20", "its first lines: how it ended, and what went wrong"),
        ("harvey story runs/hallway-kidnap-0 --json", "the same for machines, each sentence with cycle and entries"),
    ),
    _add_story_arguments, _run_story,
    "From the journal, as the robot knew it; what only the simulator knows is from result.json, and is called that.\n"
    "Exit code 2 where the run was cut off before it had an outcome: what there is of it is told all the same.",
)


def _add_diff_arguments(parser: ArgumentParser) -> None:
    parser.add_argument("first", metavar="RUN", help="a run directory")
    parser.add_argument("second", metavar="RUN", help="another")


def _run_diff(args: Namespace) -> int:
    from logs.explain.diff import apart, because, describe, first_difference, settings
    from logs.run_head import RunHead
    from logs.timeline import Timeline

    first, second = open_run(args.first), open_run(args.second)
    heads = RunHead.read(first.path), RunHead.read(second.path)
    ours, theirs = Timeline(first.journal), Timeline(second.journal)
    for history in (ours, theirs):
        history.verify()
    print(f"first:  {_title(first)}\nsecond: {_title(second)}")
    for name, head in zip(("first", "second"), heads, strict=True):
        if elsewhere := head.decided_elsewhere():
            print(f"note: the {name} run {elsewhere}")
    set_differently = tuple(settings(*heads))
    if set_differently:
        print(f"set differently: {'; '.join(set_differently)}")
    agreed, one, other = first_difference(ours, theirs)
    if one is None or other is None:
        print("\n".join(describe(agreed, one, other)))
    else:
        print("\n".join([next(describe(agreed, one, other)), "", *because(ours, theirs, agreed, set_differently)]))
    if one is None and other is None:
        return 0
    print(f"\nHow they went:\n{apart(first, second, ours, theirs)}")
    return 1


def _title(run: RunDirectory) -> str:
    result = run.read_result()
    named = [f"{key} {result[key]}" for key in ("scenario", "seed", "outcome") if key in result]
    return ", ".join([str(run.path), *named])


DIFF = CliCommand(
    "diff", "the first decision in which two runs differ, and why",
    (
        ("harvey diff runs/lab-to-allens-office-0 runs/lab-to-allens-office-1", "two seeds of one scenario"),
        ("harvey diff runs/bump-0 runs/without-door", "a run and what would have been (harvey replay --without)"),
    ),
    _add_diff_arguments, _run_diff,
    "Goes down from the first decision that differs to the observation or the setting that it comes from.\n"
    "Exit code 0 where all decisions agree, 1 where they do not, 2 where an input cannot be used.",
)
