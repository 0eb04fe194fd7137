"""What a command of the command line is made of."""

from __future__ import annotations

from argparse import ArgumentParser, ArgumentTypeError, Namespace
from collections.abc import Callable
from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Command:
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


def whole(text: str) -> int:
    """An argument that is a whole number from 0."""
    if not (text.isascii() and text.isdecimal()):
        raise ArgumentTypeError(f"expected a whole number from 0, got {text!r}")
    return int(text)
