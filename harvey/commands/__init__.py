"""The commands, one a module, in the order in which ``harvey --help`` lists them.

Only the one that is asked for is imported, and it imports what it needs when it runs.
"""

from __future__ import annotations

import importlib
from collections.abc import Mapping

from harvey.commands.command import Command

MODULES: Mapping[str, str] = {
    "list": "listing",
    **{name: name for name in (
        "run", "serve", "view", "story", "why", "replay", "diff", "report", "export", "resume", "repair", "world",
        "settings", "experiment", "campaign", "drive", "calibrate", "emulate", "completion")},
}
"""The module of each command."""


def find_commands(name: str | None = None) -> tuple[Command, ...]:
    """The command of this name alone; all of them where there is none of it."""
    names = (name,) if name in MODULES else tuple(MODULES)
    return tuple(importlib.import_module(f"{__name__}.{MODULES[one]}").COMMAND for one in names if one is not None)
