"""The simulated body behind a serial line: the mission reaches it through a driver and an emulated base only.

The bytes go through memory as they go through a cable; pictures come from the simulator's camera. The truth stays with
the simulated body.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from functools import cache
from typing import TYPE_CHECKING

from harvey.errors import BadInput
from harvey.runner.ports import Body
from sim.body.faulty_body import FaultyBody
from sim.body.simulated_body import SimulatedBody
from world_models.plugins import load_plugins

if TYPE_CHECKING:
    from sim.emulators.emulator import EmulatorKind

IN_PROCESS = "simulated"


@cache
def emulator_kinds() -> Mapping[str, EmulatorKind]:
    """Every kind of emulated base by the name of its protocol: the project's, then those of other installed packages.

    Raises:
        PluginError: one of another package cannot be loaded.
    """
    from sim.emulators.denning_emulator import KIND
    from sim.emulators.emulator import EmulatorKind

    return {KIND.name: KIND} | dict(load_plugins("harvey.emulators", EmulatorKind))


def body_kinds() -> tuple[str, ...]:
    """The kinds of base that have a driver and an emulator too."""
    from harvey.hardware.bases import base_kinds

    return tuple(name for name in base_kinds() if name in emulator_kinds())


def body_kind(text: str) -> str:
    """``simulated``, or one of :func:`body_kinds` from ``serial:denning``. Raises BadInput."""
    head, _, kind = text.partition(":")
    if text == IN_PROCESS or (head == "serial" and kind in body_kinds()):
        return text if text == IN_PROCESS else kind
    from harvey.hardware.bases import say_what_to_install

    expected = ", ".join([IN_PROCESS, *(f"serial:{kind}" for kind in body_kinds())])
    raise BadInput(f"--body: expected one of {expected}, got {text!r}{say_what_to_install(kind)}")


@contextmanager
def open_body(body: SimulatedBody, kind: str) -> Iterator[Body]:
    """The body as the mission reaches it: at once, or over the protocol of a kind of base."""
    if kind == IN_PROCESS:
        yield FaultyBody(body)
        return
    # Drivers and emulators are loaded when they are asked for: most missions have neither.
    from harvey.hardware.bases import base_kinds
    from harvey.hardware.hardware_body import HardwareBody
    from sim.emulators.line import EmulatedLine, FaultyLine

    found = emulator_kinds()[kind]
    emulator, clock = ((found.on_ground(body), lambda: body.time_s) if found.on_body is None
                       else (found.on_body(body), None))
    base = base_kinds()[kind].connect_to_emulator(EmulatedLine(FaultyLine(emulator, body), clock))
    try:
        yield HardwareBody(base, FaultyBody(body), clock=lambda: body.time_s, pause=body.wait,
                           carried=body.ride, ranges=body.has_ranges)
    finally:
        base.close()
