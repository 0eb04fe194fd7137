"""A lock-step link to an emulated base through a pseudo-terminal that pyserial opens."""

from __future__ import annotations

from collections.abc import Callable

import serial

from sim.emulators.emulator import Emulator
from sim.emulators.lockstep_link import LockstepLink
from sim.emulators.pseudo_terminal import PseudoTerminal


class PseudoTerminalLink(LockstepLink):
    """A lock-step link that owns both ends of its pseudo-terminal.

    Attributes:
        name: of the pseudo-terminal, as /dev/pts/7.
    """

    def __init__(self, emulator: Emulator, clock: Callable[[], float] | None = None) -> None:
        """``clock``: see :class:`LockstepLink`."""
        terminal = PseudoTerminal(emulator)
        super().__init__(serial.serial_for_url(terminal.name), terminal, emulator, clock=clock)
        self.name = terminal.name
        self._open: PseudoTerminal | None = terminal

    def close(self) -> None:
        """Close both ends."""
        super().close()
        if self._open is not None:
            self._open.close()
            self._open = None
