"""What a command of the command line is made of."""

from __future__ import annotations

import re
import sys
from argparse import ArgumentParser, ArgumentTypeError, Namespace, RawDescriptionHelpFormatter
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, NoReturn

from harvey.campaign.workers import Workers, find_cluster
from harvey.errors import BadInput, in_one_line

MAX_SEEDS = 10_000


@dataclass(frozen=True, slots=True)
class CliCommand:
    """One command.

    Attributes:
        name: as typed.
        summary: one line, for the list of commands.
        examples: lines of ``command  what it does``.
        arguments: adds its arguments to a parser.
        run: does it; returns the exit code.
        details: more about it, below the summary.
        open_ended: whether it takes arguments that it does not know.
    """

    name: str
    summary: str
    examples: tuple[tuple[str, str], ...]
    arguments: Callable[[ArgumentParser], None]
    run: Callable[[Namespace], int]
    details: str = ""
    open_ended: bool = False

    @property
    def epilog(self) -> str:
        width = max(len(command) for command, _ in self.examples)
        return "examples:\n" + "\n".join(f"  {command.ljust(width)}   {what}" for command, what in self.examples)


class OneLineParser(ArgumentParser):
    """Says what is wrong in one line, as all other errors are said, and where the usage stands."""

    def error(self, message: str) -> NoReturn:
        """Raises SystemExit(2)."""
        print(in_one_line(f"{self.prog}: {message}; see {self.prog} --help"), file=sys.stderr)
        raise SystemExit(2)


def add_parser(commands: Any, command: CliCommand) -> ArgumentParser:
    """The parser of a command, with its help and examples, among those of argparse's ``add_subparsers``."""
    parser: ArgumentParser = commands.add_parser(
        command.name, help=command.summary, epilog=command.epilog, formatter_class=RawDescriptionHelpFormatter,
        description=f"{command.summary[0].upper()}{command.summary[1:]}.\n{command.details}".rstrip())
    command.arguments(parser)
    parser.set_defaults(parser=parser, open_ended=command.open_ended)
    return parser


def whole(text: str) -> int:
    """An argument that is a whole number from 0."""
    if not (text.isascii() and text.isdecimal()):
        raise ArgumentTypeError(f"expected a whole number from 0, got {text!r}")
    return int(text)


def parse_seeds(text: str) -> tuple[int, ...]:
    """``3``, ``0..19`` (both included) or ``1,4,9``. Raises BadInput."""
    seeds: list[int] = []
    for part in text.split(","):
        match = re.fullmatch(r"(\d{1,9})(?:\.\.(\d{1,9}))?", part.strip(), re.ASCII)
        first, last = (int(match[1]), int(match[2] or match[1])) if match else (1, 0)
        if last < first or last - first >= MAX_SEEDS:
            raise BadInput("--seed: expected a number from 0 to 999999999, a range as 0..19 or a list as 1,4,9,"
                           f" of {MAX_SEEDS} at most, got {text!r}")
        seeds += range(first, last + 1)
    return tuple(dict.fromkeys(seeds))


def parse_pairs(texts: Sequence[str]) -> tuple[tuple[str, str], ...]:
    """``key=value`` pairs. Raises BadInput."""
    for text in texts:
        if not text.partition("=")[0] or "=" not in text:
            raise BadInput(f"--set: expected key=value, as servo.action=off, got {text!r}")
    pairs = (text.partition("=") for text in texts)
    return tuple((key.strip(), value.strip()) for key, _, value in pairs)


def add_worker_arguments(parser: ArgumentParser) -> None:
    """``--workers`` and ``--cluster``."""
    parser.add_argument("--workers", metavar="N", help="processes of this machine, or all: one a processor (all)")
    parser.add_argument("--cluster", metavar="WHERE",
                        help="let a Dask cluster work: local:N, tcp://host:port of a scheduler, or its scheduler file"
                             "; needs harvey-cluster")


def parse_workers(args: Namespace) -> Workers:
    """What :func:`add_worker_arguments` added. Raises BadInput."""
    number, cluster = args.workers, args.cluster
    if number is not None and cluster is not None:
        raise BadInput(f"--workers: expected it without --cluster, which has its own workers, got {number!r}")
    if number not in (None, "all") and not (number.isascii() and number.isdecimal() and 0 < int(number) <= 4096):
        raise BadInput(f"--workers: expected a number from 1 to 4096, or all, got {number!r}")
    if cluster is not None:
        find_cluster("--cluster")  # where it is absent that is said before anything is begun
    return Workers(None if number in (None, "all") else int(number), cluster)
