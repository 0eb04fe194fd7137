"""The commands, those that belong together in one module, in the order in which ``harvey --help`` lists them.

Only the module of the one that is asked for is imported, and it imports what it needs when it runs.
"""

from __future__ import annotations

import importlib
from argparse import Namespace
from collections.abc import Mapping
from dataclasses import replace

from harvey.commands.command import CliCommand
from harvey.errors import BadInput
from world_models.plugins import COMMANDS_GROUP, list_absent, list_plugins, load_plugins

MODULES: Mapping[str, str] = {
    "demo": "run_command", "list": "listing", "run": "run_command", "view": "view",
    "story": "explain", "why": "explain", "replay": "again",
    "diff": "explain", "report": "report", "export": "report", "resume": "again", "repair": "again",
    "world": "world_command", "settings": "listing", "experiment": "listing", "campaign": "run_command",
    "drive": "drive", "tell": "drive", "emulate": "emulate", "completion": "listing",
}
"""The module of each command; there it stands under its name in capitals."""


def find_commands(name: str | None = None) -> tuple[CliCommand, ...]:
    """The command of this name alone; all of them, with those of other packages, where there is none of it here."""
    if name is not None and name in MODULES:
        return (_import(name),)
    return (*map(_import, MODULES), *find_added_commands())


def find_added_commands(of: str = "") -> tuple[CliCommand, ...]:
    """The commands that other packages add, or the verbs that they add to a command.

    In the place of one whose extra is absent stands one that says what to install.
    """
    prefix = f"{of}." if of else ""
    names = [name for name in list_plugins(COMMANDS_GROUP) if _is_of(name, prefix)]
    present = load_plugins(COMMANDS_GROUP, CliCommand, *names) if names else {}
    return (*(replace(command, name=name.removeprefix(prefix)) for name, command in present.items()),
            *(_absent(name, needs) for name, needs in list_absent(COMMANDS_GROUP).items() if _is_of(name, prefix)))


def _is_of(name: str, prefix: str) -> bool:
    return name.startswith(prefix) and "." not in name.removeprefix(prefix)


def _import(name: str) -> CliCommand:
    command: CliCommand = getattr(importlib.import_module(f"{__name__}.{MODULES[name]}"), name.upper())
    return command


def _absent(name: str, needs: str) -> CliCommand:
    def refuse(_: Namespace) -> int:
        raise BadInput(f"{name.replace('.', ' ')} needs {needs}")

    return CliCommand(name.rpartition(".")[2], f"needs {needs}", ((needs.partition(": ")[2], "adds it"),),
                      lambda _: None, refuse, open_ended=True)
