"""The command line: ``harvey COMMAND ...``.

Exit codes: 0 reached, or success; 1 not reached; 2 bad input. A command that was stopped: 130 interrupted, 141 its
output was closed, 143 terminated.
"""

from __future__ import annotations

import atexit
import errno
import gc
import os
import re
import sys
from argparse import Action, ArgumentParser, Namespace, RawDescriptionHelpFormatter
from collections.abc import Sequence
from contextlib import redirect_stdout
from io import TextIOWrapper
from typing import Any

EPILOG = """examples:
  harvey list                                       what there is to run
  harvey run lab-to-allens-office                   drive a mission
  harvey view runs/lab-to-allens-office-0           look at its recording
  harvey story runs/lab-to-allens-office-0          have it told in a page
  harvey why runs/lab-to-allens-office-0 --at 88    ask why it did what it did

exit codes: 0 reached, or success; 1 not reached; 2 bad input; 130 interrupted.
harvey COMMAND --help tells more and gives examples."""

GC_THRESHOLDS = 50_000, 20, 100
"""A board's entries are many and form no reference cycles, so Python looks for them seldom: the robot waits for it."""
LACK = "llocate memory|failed to map segment|start new thread"
"""In what the system says where memory is short, whatever the kind of the error."""
INTERRUPTED, OUTPUT_CLOSED, TERMINATED = 130, 141, 143
"""Exit codes as a shell has them: 128 and the number of the signal."""


def main(argv: Sequence[str] | None = None) -> int:
    """Run one command; returns the exit code."""
    _occupy_streams()
    if isinstance(sys.stdout, TextIOWrapper):
        sys.stdout.reconfigure(errors="replace")  # a terminal may not know every letter
    thresholds = gc.get_threshold()
    gc.set_threshold(*GC_THRESHOLDS)
    atexit.register(gc.freeze)  # what is left then goes with the process: a third of a second to look through it
    try:
        return _run(argv)
    except KeyboardInterrupt as stop:
        _print_error("interrupted", stop)
        return INTERRUPTED
    finally:
        gc.set_threshold(*thresholds)  # a process that goes on needs its own


def _occupy_streams() -> None:
    """What is printed goes nowhere where nobody listens: else the first file of a run would be standard output."""
    for number, name in enumerate(("stdin", "stdout", "stderr")):
        try:
            os.fstat(number)
        except OSError:
            os.open(os.devnull, os.O_RDWR)  # takes the lowest number that is free
        if getattr(sys, name) is None:
            stream = open(number, "r+" if name == "stdin" else "w", encoding="utf-8", closefd=False)  # noqa: SIM115
            setattr(sys, name, stream)


class _PrintVersion(Action):
    """Looks the version up only when it is asked for."""

    def __call__(self, parser: ArgumentParser, *_: Any) -> None:
        from importlib.metadata import version

        print(f"harvey {version('harvey')}")
        parser.exit()


def parser(name: str | None = None) -> ArgumentParser:
    """The parser of all commands, or of the one of this name alone: the others need not be imported."""
    from harvey.commands import find_commands
    from harvey.commands.command import OneLineParser, add_parser

    top = OneLineParser(
        prog="harvey", epilog=EPILOG, formatter_class=RawDescriptionHelpFormatter,
        description="Model-directed mobile robot navigation on a blackboard, after the UMass Mobile Robot system.",
    )
    top.add_argument("--version", action=_PrintVersion, nargs=0, help="print the version, and exit")
    commands = top.add_subparsers(title="commands", metavar="COMMAND", required=True)
    for command in find_commands(name):
        add_parser(commands, command).set_defaults(command=command)
    return top


def _run(argv: Sequence[str] | None) -> int:
    """The imports are here, not at the top: Ctrl-C is answered while they go on."""
    from harvey.errors import PlainOutput, Terminated, terminable

    try:
        with terminable(), redirect_stdout(PlainOutput(sys.stdout)):
            return _answer(argv)
    except Terminated as stop:
        _print_error("terminated", stop)
        return TERMINATED


def _parse(argv: Sequence[str] | None) -> Namespace:
    """Raises SystemExit, as argparse does, after saying what is wrong."""
    given = list(sys.argv[1:] if argv is None else argv)
    args, unknown = parser(given[0] if given else None).parse_known_args(given)
    if unknown and not args.open_ended:
        args.parser.error(f"expected no {unknown[0]!r} here")
    return args


def _answer(argv: Sequence[str] | None) -> int:
    from harvey.errors import BadInput
    from logs.run_errors import RecordingError
    from world_models.files.toml.source import WorldError
    from world_models.plugins import PluginError

    try:
        try:
            args = _parse(argv)
        except SystemExit as stop:
            code = stop.code if isinstance(stop.code, int) else 2
        else:
            code = args.command.run(args)
        print(end="", flush=True)  # what is left; also of --help
        return code
    except BrokenPipeError as error:
        _discard_output()
        if hasattr(error, "__notes__"):  # a run was under way
            _print_error("the output was closed", error)
        return OUTPUT_CLOSED
    except OSError as error:
        name = error.filename
        if name is None and error.errno == errno.ENOSPC:  # our own files are named; what print writes to is not
            name = "standard output"
            _discard_output()
        _print_error(f"{name}: {error.strerror}" if name else str(error), error)
        return 2
    except (BadInput, WorldError, RecordingError, PluginError) as error:
        _print_error(str(error), error)
        return 2
    except (MemoryError, ImportError, RuntimeError) as error:
        if not (isinstance(error, MemoryError) or re.search(LACK, str(error))):
            raise
        _print_error(f"expected more memory than there is, got: {error or 'none'}", error)
        return 2


def _print_error(text: str, error: BaseException) -> None:
    """One line on standard error; notes of the error say what was recorded, and how to go on."""
    from harvey.errors import in_one_line

    print("; ".join([in_one_line(f"harvey: {text}"), *getattr(error, "__notes__", ())]), file=sys.stderr)


def _discard_output() -> None:
    """What is still to be printed goes nowhere: standard output takes no more."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


if __name__ == "__main__":
    sys.exit(main())
