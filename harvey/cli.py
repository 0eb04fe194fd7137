"""The command line: ``harvey COMMAND ...``.

Exit codes: 0 reached, or success; 1 not reached; 2 bad input; 130 interrupted; 143 terminated.
"""

from __future__ import annotations

import gc
import os
import sys
from argparse import ArgumentParser, Namespace, RawDescriptionHelpFormatter
from collections.abc import Sequence

from harvey.commands import COMMANDS
from harvey.errors import BadInput, Terminated, terminable
from logs.errors import RecordingError
from world_models.files.toml.source import WorldError

EPILOG = """examples:
  harvey list                                       what there is to run
  harvey run lab-to-allens-office                   drive a mission
  harvey view runs/lab-to-allens-office-0           look at its recording
  harvey why runs/lab-to-allens-office-0 --at 88    ask why it did what it did

exit codes: 0 reached, or success; 1 not reached; 2 bad input.
harvey COMMAND --help tells more and gives examples."""

COLLECT_AFTER = 50_000, 20, 100
"""Python's search for rings of references goes by how many objects there are more than before. A board's entries are
many and are in no rings; so it is searched seldom, lest a robot stand still meanwhile."""


def main(argv: Sequence[str] | None = None) -> int:
    """Run one command; returns the exit code."""
    gc.set_threshold(*COLLECT_AFTER)
    try:
        args = _parsed(argv)
    except SystemExit as stop:
        return stop.code if isinstance(stop.code, int) else 2
    try:
        with terminable():
            return _answer(args)
    except KeyboardInterrupt:
        print("harvey: interrupted; what was recorded so far is kept", file=sys.stderr)
        return 130
    except Terminated:
        print("harvey: terminated; what was recorded so far is kept", file=sys.stderr)
        return 143


def parser() -> ArgumentParser:
    """The parser of all commands."""
    top = ArgumentParser(
        prog="harvey", epilog=EPILOG, formatter_class=RawDescriptionHelpFormatter,
        description="Model-directed mobile robot navigation on a blackboard, after the UMass Mobile Robot system.",
    )
    commands = top.add_subparsers(title="commands", metavar="COMMAND", required=True)
    for command in COMMANDS:
        sub = commands.add_parser(
            command.name, help=command.summary, epilog=command.epilog, formatter_class=RawDescriptionHelpFormatter,
            description=f"{command.summary[0].upper()}{command.summary[1:]}.\n{command.details}".rstrip(),
        )
        command.arguments(sub)
        sub.set_defaults(command=command, parser=sub)
    return top


def _parsed(argv: Sequence[str] | None) -> Namespace:
    """Raises SystemExit, as argparse does, after telling what is wrong."""
    args, unknown = parser().parse_known_args(argv)
    if unknown and not args.command.open_ended:
        args.parser.error(f"expected no {unknown[0]!r} here")
    return args


def _answer(args: Namespace) -> int:
    try:
        code: int = args.command.run(args)
        sys.stdout.flush()
        return code
    except BrokenPipeError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 0
    except OSError as error:
        print(f"harvey: {error.filename or 'a file'}: {error.strerror or error}", file=sys.stderr)
        return 2
    except (BadInput, WorldError, RecordingError) as error:
        print(f"harvey: {error}", file=sys.stderr)
        return 2


if __name__ == "__main__":
    sys.exit(main())
