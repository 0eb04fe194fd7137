"""What anything that is added by an entry point must keep: each check takes an implementation, whoever wrote it."""

from __future__ import annotations

import shlex
from argparse import ArgumentParser

from harvey.commands.command import Command, add_parser


def check_command(command: Command, of: str = "") -> None:
    """A command, or a verb of the command ``of``: it says what it is for, and its examples are parsed."""
    words = ["harvey", *of.split(), command.name]
    parser = ArgumentParser(prog=" ".join(words[:-1]), exit_on_error=False)
    add_parser(parser.add_subparsers(required=True), command)
    assert command.summary and command.summary[0].islower() and not command.summary.endswith(".")
    own = [shlex.split(line.partition("|")[0]) for line, what in command.examples if what]
    own = [given for given in own if given[:len(words)] == words]
    assert own, command.examples
    for given in own:
        _, unknown = parser.parse_known_args(given[len(words) - 1:])
        assert command.open_ended or not unknown, given
