"""The emulated base for ``counting_base``: it shares no code with the driver."""

from __future__ import annotations

from sim.emulators.emulator import EmulatorKind, Ground

TURN_RAD_PER_S, SPEED_M_PER_S = 0.6, 0.4


class CountingEmulator:
    """Carries out one line after the other and answers with what the wheels counted of it."""

    def __init__(self, ground: Ground) -> None:
        self._ground = ground
        self._line, self._answers = b"", b""
        self._turn_rad = self._move_m = 0.0
        self._counted = (0.0, 0.0, 0.0)
        self._is_answer_due = False

    def receive(self, data: bytes) -> None:
        """Take bytes from the line; a whole line is a command."""
        *lines, self._line = (self._line + data).split(b"\n")
        for line in lines:
            self._begin(line.decode("ascii", "replace"))

    def advance(self, duration_s: float) -> None:
        """Roll on; answer when the motion is over."""
        turn = max(-TURN_RAD_PER_S * duration_s, min(TURN_RAD_PER_S * duration_s, self._turn_rad))
        move = min(SPEED_M_PER_S * duration_s, self._move_m)
        turned, moved = self._ground.roll(turn, move, duration_s)
        self._turn_rad, self._move_m = self._turn_rad - turn, self._move_m - move
        self._counted = (self._counted[0] + turned, self._counted[1] + moved, self._counted[2] + duration_s)
        if self._is_answer_due and not self.moving:
            self._answers += "{:.9f} {:.9f} {:.9f}\n".format(*self._counted).encode()
            self._is_answer_due = False

    def take(self) -> bytes:
        """The answers since the last call."""
        answers, self._answers = self._answers, b""
        return answers

    @property
    def moving(self) -> bool:
        """Whether the motors run."""
        return self._turn_rad != 0.0 or self._move_m != 0.0

    def _begin(self, line: str) -> None:
        verb, _, number = line.partition(" ")
        if verb in ("t", "m"):
            self._counted = (0.0, 0.0, 0.0)
        if verb != "?":
            self._turn_rad = float(number) if verb == "t" else 0.0
            self._move_m = float(number) if verb == "m" else 0.0
        self._is_answer_due = True


KIND = EmulatorKind("counting", CountingEmulator)
