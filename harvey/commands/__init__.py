"""The commands, one a module, in the order in which ``harvey --help`` lists them.

They import what they need when they run, so that ``harvey --help`` answers at once.
"""

from __future__ import annotations

from harvey.commands import (
    calibrate,
    campaign,
    diff,
    drive,
    emulate,
    experiment,
    export,
    listing,
    repair,
    replay,
    report,
    resume,
    run,
    settings,
    story,
    view,
    why,
    world,
)
from harvey.commands.command import Command

COMMANDS: tuple[Command, ...] = (
    listing.COMMAND, run.COMMAND, view.COMMAND, story.COMMAND, why.COMMAND, replay.COMMAND, diff.COMMAND,
    report.COMMAND, export.COMMAND, resume.COMMAND, repair.COMMAND, world.COMMAND, settings.COMMAND,
    experiment.COMMAND, campaign.COMMAND, drive.COMMAND, calibrate.COMMAND, emulate.COMMAND,
)
