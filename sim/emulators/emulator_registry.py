"""The emulated bases by the name of their protocol: the project's, and those of other installed packages."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache

from sim.emulators import denning_emulator
from sim.emulators.emulator import EmulatorKind
from world_models.plugins import load_plugins


@cache
def emulator_kinds() -> Mapping[str, EmulatorKind]:
    """Every kind of emulated base by its name. Raises PluginError where one of another package cannot be loaded."""
    return {denning_emulator.KIND.name: denning_emulator.KIND} | dict(load_plugins("harvey.emulators", EmulatorKind))
