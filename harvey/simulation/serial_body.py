"""The simulated body behind a serial line: the mission reaches it through a driver and an emulated base only.

The bytes go through a pseudo-terminal as they go through a cable; pictures come from the simulator's camera. The truth
stays with the simulated body.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

from harvey.errors import BadInput
from harvey.hardware.body import HardwareBody
from harvey.hardware.drivers.bases.base import Base
from harvey.hardware.drivers.bases.create2 import Create2Base
from harvey.hardware.drivers.bases.denning import DenningBase
from harvey.hardware.drivers.bases.link import Link
from harvey.hardware.drivers.bases.p2os import P2osBase
from harvey.runner.ports import Body
from sim.body.faulty_body import FaultyBody
from sim.body.simulated_body import SimulatedBody
from sim.emulators.create2 import Create2Emulator
from sim.emulators.denning import DenningEmulator
from sim.emulators.denning_motion import InstantMotion
from sim.emulators.emulator import Emulator
from sim.emulators.faulty_line import FaultyLine
from sim.emulators.ground import SimulatedGround
from sim.emulators.p2os import P2osEmulator
from sim.emulators.pseudo_terminal_link import PseudoTerminalLink

KINDS = ("denning", "p2os", "create2")
IN_PROCESS = "simulated"
NONCE = "5E551057"
"""The same greeting in every run, so that two runs say the same bytes."""


def body_kind(text: str) -> str:
    """``simulated``, or one of :data:`KINDS` from ``serial:denning``. Raises BadInput."""
    head, _, kind = text.partition(":")
    if text == IN_PROCESS or (head == "serial" and kind in KINDS):
        return text if text == IN_PROCESS else kind
    expected = ", ".join([IN_PROCESS, *(f"serial:{kind}" for kind in KINDS)])
    raise BadInput(f"--body: expected one of {expected}, got {text!r}")


@contextmanager
def open_body(body: SimulatedBody, kind: str) -> Iterator[Body]:
    """The body as the mission reaches it: at once, or over the protocol of a kind of base."""
    if kind == IN_PROCESS:
        yield FaultyBody(body)
        return
    clock = None if kind == "denning" else lambda: body.truth.time_s
    base = _base(kind, PseudoTerminalLink(FaultyLine(_emulator(kind, body), body), clock))
    try:
        yield HardwareBody(base, FaultyBody(body), clock=lambda: body.truth.time_s, pause=body.wait,
                           carried=body.ride)
    finally:
        base.close()


def _emulator(kind: str, body: SimulatedBody) -> Emulator:
    if kind == "denning":
        return DenningEmulator(InstantMotion(body))
    return P2osEmulator(SimulatedGround(body)) if kind == "p2os" else Create2Emulator(SimulatedGround(body))


def _base(kind: str, link: Link) -> Base:
    if kind == "denning":
        return DenningBase(link, nonce=NONCE)
    return P2osBase(link) if kind == "p2os" else Create2Base(link)
