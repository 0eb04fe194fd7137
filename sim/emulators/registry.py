"""The emulated bases by the name of their protocol: the project's, and those of other installed packages."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cache

from sim.body.simulated_body import SimulatedBody
from sim.emulators.create2 import Create2Emulator
from sim.emulators.denning import DenningEmulator
from sim.emulators.denning_motion import ConstantSpeedMotion, InstantMotion
from sim.emulators.emulator import Emulator
from sim.emulators.ground import Ground, SimulatedGround
from sim.emulators.p2os import P2osEmulator
from world_models.plugins import load_plugins


@dataclass(frozen=True, slots=True)
class EmulatorKind:
    """A kind of emulated base.

    Attributes:
        name: of its protocol, as its driver's ``BaseKind`` has it.
        on_ground: one whose wheels roll on a ground in real time, for ``harvey emulate``.
        on_body: one under which a simulated body moves, for missions over ``--body serial:NAME``.
        keeps_time: whether its driver waits by the base's time; else a motion is over at once.
    """

    name: str
    on_ground: Callable[[Ground], Emulator]
    on_body: Callable[[SimulatedBody], Emulator]
    keeps_time: bool = True


BUILT_IN = (
    EmulatorKind("denning", lambda ground: DenningEmulator(ConstantSpeedMotion(ground)),
                 lambda body: DenningEmulator(InstantMotion(body)), keeps_time=False),
    EmulatorKind("p2os", P2osEmulator, lambda body: P2osEmulator(SimulatedGround(body))),
    EmulatorKind("create2", Create2Emulator, lambda body: Create2Emulator(SimulatedGround(body))),
)


@cache
def emulator_kinds() -> Mapping[str, EmulatorKind]:
    """Every kind of emulated base by its name. Raises PluginError where one of another package cannot be loaded."""
    return {kind.name: kind for kind in BUILT_IN} | dict(load_plugins("harvey.emulators", EmulatorKind))
