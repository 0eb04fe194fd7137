"""``harvey replay``: decide a recorded run again, without simulator or robot."""

from __future__ import annotations

import sys
from argparse import ArgumentParser, Namespace
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING

from harvey.campaign.campaign import parse_pairs
from harvey.commands.command import Command
from harvey.errors import BadInput
from logs.run_directory import RunDirectory, check_vacant, open_run
from world_models.words import count

if TYPE_CHECKING:
    from harvey.runner.replay import ReplayedDecision
    from logs.run_head import RunHead


def _arguments(parser: ArgumentParser) -> None:
    parser.add_argument("run", metavar="RUN", help="a run directory")
    what_if = parser.add_argument_group("what would it have done")
    what_if.add_argument("--without", metavar="NAME", action="append", default=[],
                         help="without a knowledge source, a landmark or face of its model, or one segment, as"
                              " 'Frame-9 segment 12'; may be repeated. Of a thing, as allens-office/desk, only the"
                              " landmark goes: nothing of it is expected to be seen, and it stays in the way")
    what_if.add_argument("--set", metavar="KEY=VALUE", action="append", default=[], dest="settings",
                         help="with a servo level off, as servo.plan=off, or another number of harvey settings, as"
                              " action.min_tolerance_px=8, or camera.tilt_deg=1 for what the robot believes of itself;"
                              " may be repeated")
    what_if.add_argument("--record-only", action="store_true",
                         help="end where the record no longer answers, instead of going on in the simulator")
    what_if.add_argument("--out", metavar="DIR", help="keep what would have been as a run, for diff, why and view")


def _run(args: Namespace) -> int:
    run, settings = open_run(args.run), parse_pairs(args.settings)
    if args.without or settings:
        return _otherwise(run, args, settings)
    if args.out or args.record_only:
        raise BadInput("--out and --record-only: expected --without or --set beside them, got neither")
    return _again(run)


def _otherwise(run: RunDirectory, args: Namespace, settings: tuple[tuple[str, str], ...]) -> int:
    """Decide it again with a changed agent."""
    from harvey.counterfactual import what_if
    from harvey.counterfactual_words import describe_answer
    from logs.run_head import RunHead

    out = RunDirectory(check_vacant(Path(args.out))) if args.out else None
    if out is not None and out.path.resolve() == run.path.resolve():
        raise BadInput(f"--out {args.out}: expected another directory than that of the run, got the same")
    elsewhere = RunHead.read(run.path).decided_elsewhere()
    answer = what_if(run, args.without, settings, out=out, go_on=not args.record_only)
    print("\n".join(describe_answer(answer, run, [*(f"without {name}" for name in args.without),
                                       *(f"with {key} = {value}" for key, value in settings)])))
    if elsewhere:
        print(f"\nnote: the run {elsewhere}, so what differs may come of that as well: harvey replay {run.path} tells")
    if out is not None:
        print(f"\nit is kept in {out.path}; compare with    harvey diff {run.path} {out.path}")
    return 0


def _again(run: RunDirectory) -> int:
    """Decide it again as it was."""
    from harvey.agent import build_agent
    from harvey.runner.replay import replay
    from logs.pictures import open_pictures
    from logs.records import Originals
    from logs.run_head import RunHead

    agreed, head = 0, RunHead.read(run.path)
    elsewhere = head.decided_elsewhere()
    pictures = open_pictures(run)  # what is wrong with the journal is said first
    agent = build_agent(head)
    originals = Originals(pictures, agent.store)
    try:
        for decision in with_progress(replay(run, originals, agent.scheduler())):
            if not decision.same:
                print(f"{_perhaps(head, elsewhere)}\n\n{_difference(agreed, decision)}")
                return 1
            agreed += 1
    except BadInput as error:
        raise BadInput(f"{error}; the run {elsewhere}" if elsewhere else str(error)) from None
    if not agreed:
        raise BadInput(f"{run.journal}: expected at least one decision, got none")
    frames = count(len(originals.pictures), "frame")
    print(f"{count(agreed, 'decision')} decided again from {frames}: all the same, byte for byte")
    if elsewhere:
        print(f"note: the run {elsewhere}")
    return 0


def _perhaps(head: RunHead, elsewhere: str) -> str:
    """What a difference may come from, as far as the run tells who decided it."""
    if elsewhere:
        return (f"The run {elsewhere}: that may be why. It takes the program that made the run, and a processor like"
                " its own, to decide it as it was.")
    if not head.code:
        return ("The program may have changed since the run was made, whose run.json does not say by which code it was "
                "decided.")
    return "The run was decided by the same code as this, so its files were changed since, or the libraries are others."


def _difference(agreed: int, decision: ReplayedDecision) -> str:
    from blackboard.journal import decision_record
    from logs.explain.diff import describe
    from logs.records import decision_of

    now = None if decision.now is None else decision_of(decision_record(decision.now))
    return "\n".join(["first: as recorded; second: as decided now", *describe(agreed, decision.recorded, now)])


def with_progress(decisions: Iterable[ReplayedDecision]) -> Iterator[ReplayedDecision]:
    """The decisions, with a bar on a terminal."""
    from tqdm import tqdm

    yield from tqdm(decisions, unit=" decisions", file=sys.stderr, disable=not sys.stderr.isatty(), leave=False)


COMMAND = Command(
    "replay", "decide a recorded run again and compare, byte for byte",
    (
        ("harvey replay runs/lab-to-allens-office-0", "from its camera frames and odometry"),
        ("harvey replay runs/bump-0 --without plan_adjuster", "what it would have done without a knowledge source"),
        ("harvey replay runs/bump-0 --without fire-door", "without a landmark of its model"),
        ("harvey replay runs/bump-0 --without 'Frame-9 segment 12'", "had it not found one segment"),
        ("harvey replay runs/bump-0 --set servo.plan=off --out runs/bump-no-plan", "and keep it as a run"),
        ("harvey replay runs/bump-0 --set action.min_tolerance_px=8", "with another number of harvey settings"),
        ("harvey replay runs/bump-0 --set camera.tilt_deg=1", "had it believed its camera to be tilted"),
    ),
    _arguments, _run,
    "Neither simulator nor robot takes part. Exit code 0 where every decision is the same, 1 where one is not.\n\n"
    "With --without or --set it tells what would have been: a changed agent gets what was observed, as long as it\n"
    "requests the same of its body. From the first motion or picture that differs the record no longer answers; a\n"
    "run of the simulator then goes on by itself, in the same world with the same random numbers.",
)
