"""The commands, one a module, in the order in which ``harvey --help`` lists them.

They import what they need when they run, so that ``harvey --help`` answers at once.
"""

from __future__ import annotations

from harvey.commands import diff, experiment, listing, replay, run, view, why, world
from harvey.commands.command import Command
from harvey.commands.not_yet import NOT_YET

COMMANDS: tuple[Command, ...] = (
    listing.COMMAND, run.COMMAND, view.COMMAND, why.COMMAND, replay.COMMAND, diff.COMMAND, world.COMMAND,
    experiment.COMMAND, *NOT_YET,
)
