"""Answers of right checksum that are stale, late, doubled or another's: a driver reports what the base really did.

A line may keep a frame in a buffer and deliver it after newer ones, or twice; a checksum does not tell. Denning answers
carry the session, the command's number and the question's number. P2OS and the Create 2 number nothing: there an old
status is one that no wheel can have come back to.
"""

from __future__ import annotations

import math
import zlib
from collections.abc import Callable

import numpy as np
import pytest

from experiments.robustness.serial.line_noise import Noise
from experiments.robustness.serial.noisy_line import NoisyLine
from harvey.hardware.drivers.bases.base import Base
from harvey.hardware.drivers.bases.create2 import Create2Base
from harvey.hardware.drivers.bases.denning import DenningBase
from harvey.hardware.drivers.bases.p2os import P2osBase
from sim.emulators.create2 import Create2Emulator
from sim.emulators.denning import DenningEmulator
from sim.emulators.denning_motion import ConstantSpeedMotion
from sim.emulators.ground import IdealGround
from sim.emulators.p2os import P2osEmulator
from world_models.entries.body import MotorCommand

KINDS: dict[str, tuple[Callable[[IdealGround], object], Callable[..., Base]]] = {
    "denning": (lambda floor: DenningEmulator(ConstantSpeedMotion(floor)), DenningBase),
    "p2os": (P2osEmulator, P2osBase),
    "create2": (Create2Emulator, Create2Base),
}
COMMANDS = (MotorCommand(0.4, 0.5), MotorCommand(0.0, 0.2), MotorCommand(-0.7, 0.0), MotorCommand(0.2, 0.7))
NEAR_M, NEAR_RAD = 0.015, math.radians(1.2)


class MuddledLine:
    """A good line that also delivers what it delivered before, or delivers it later than what came after."""

    def __init__(self, line: NoisyLine, how: str, seed: int) -> None:
        self._line, self._how, self._rng = line, how, np.random.default_rng(seed)
        self._heard: list[bytes] = []
        self._held = b""
        self.muddled, self._since, self.is_good = 0, 0, True
        self.write, self.now, self.reopen, self.close = line.write, line.now, line.reopen, line.close

    def read(self, timeout_s: float) -> bytes:
        data = self._line.read(timeout_s)
        if not data:
            return data
        self._heard.append(data)
        if self.is_good:
            return data
        if self._how == "doubled":
            self.muddled += 1
            return data + data
        if self._how == "one of the beginning":  # further away than a wheel can go, once in a while
            self._since += 1
            if self._since < 12:
                return data
            self._since, self.muddled = int(self._rng.integers(4)), self.muddled + 1
            return self._heard[self._rng.integers(3)] + data
        if self._rng.random() > 0.3:
            return data
        self.muddled += 1
        if self._how == "late":
            self._held, out = data, self._held
            return out
        old = self._heard[int(self._rng.integers(len(self._heard)))]
        return old + data if self._how == "stale before" else data + old


@pytest.mark.parametrize(("kind", "how"), [
    *(("denning", how) for how in ("doubled", "stale before", "stale after", "late")),
    ("p2os", "doubled"), ("p2os", "one of the beginning"), ("create2", "doubled"), ("create2", "one of the beginning"),
])
@pytest.mark.parametrize("seed", range(4))
def test_what_is_reported_is_what_was_done(kind: str, how: str, seed: int) -> None:
    """Each command is carried out once, and its report is the ground's."""
    build_emulator, build_driver = KINDS[kind]
    floor, rng = IdealGround(), np.random.default_rng(0)
    end = build_emulator(floor)
    line = MuddledLine(NoisyLine(end, Noise(rng, 0.0), Noise(rng, 0.0), tick_s=0.01), how, seed)
    base = build_driver(line)
    base.odometry()
    if how == "one of the beginning":
        base.execute(MotorCommand(0.0, 1.0))
    line.is_good = False
    for command in COMMANDS:
        turned_rad, moved_m = floor.turned_rad, floor.moved_m
        report = base.execute(command)
        assert report.turn_rad == pytest.approx(floor.turned_rad - turned_rad, abs=NEAR_RAD)
        assert report.move_m == pytest.approx(floor.moved_m - moved_m, abs=NEAR_M)
        assert report.turn_rad == pytest.approx(command.turn_rad, abs=2.0 * NEAR_RAD)
        assert report.move_m == pytest.approx(command.move_m, abs=2.0 * NEAR_M)
    there, pose = base.odometry(), floor.pose
    assert math.hypot(there.x_m, there.y_m) == pytest.approx(math.hypot(pose.x_m, pose.y_m), abs=0.05)
    assert line.muddled >= 3


TOKEN, OTHER = "0000002A", "0000002B"


def say(body: str) -> bytes:
    """A frame by the protocol's document: the CRC-32 of what stands between # and *."""
    return f"#{body}*{zlib.crc32(body.encode()):08X}\n".encode()


class HandMadeDenning:
    """A base whose every byte is written here: it answers each command rightly, after wrong ones of right checksum."""

    def __init__(self, wrong: Callable[[str, int, str, list[str]], list[bytes]]) -> None:
        self._wrong, self._said, self._time_s = wrong, b"", 0.0
        self.verbs: list[str] = []

    def write(self, data: bytes) -> None:
        for line in data.decode().splitlines():
            token, seq, verb, *words = line[1:-9].split(" ")
            self.verbs.append(verb)
            asked = token, int(seq), verb, words
            self._said += b"".join(self._wrong(*asked)) + self._answer(*asked)

    def _answer(self, token: str, seq: int, verb: str, words: list[str]) -> bytes:
        if verb == "HELLO":
            return say(f"{TOKEN} 0 HI {words[0]} 0.5 1.0 0.5")
        if token != TOKEN:
            return say(f"{token} {seq} NO session")
        if verb == "GO":
            return say(f"{token} {seq} DONE ok {words[0]} {words[1]} 1.5 2.5")
        if verb == "STOP":
            return say(f"{token} {seq} DONE ok 0.0 0.0 0.0 0.0")
        return say(f"{token} {seq} HERE {words[0]} 1.0 2.0 3.0 4.0")

    def read(self, timeout_s: float) -> bytes:
        self._time_s += max(timeout_s, 1e-3)
        data, self._said = self._said, b""
        return data

    def now(self) -> float:
        return self._time_s

    def reopen(self) -> None:
        """Nothing was closed."""

    def close(self) -> None:
        """Nothing is open."""


WRONG: dict[str, Callable[[str, int, str, list[str]], list[bytes]]] = {
    "none": lambda token, seq, verb, words: [],
    "DONE of the command before": lambda token, seq, verb, words:
        [say(f"{token} {seq - 1} DONE ok 0.9 0.9 9.0 9.0")] if verb == "GO" else [],
    "DONE of a command to come": lambda token, seq, verb, words:
        [say(f"{token} {seq + 1} DONE ok 0.9 0.9 9.0 9.0")] if verb == "GO" else [],
    "DONE of another session": lambda token, seq, verb, words:
        [say(f"{OTHER} {seq} DONE ok 0.9 0.9 9.0 9.0")] if verb == "GO" else [],
    "RUN of the command before": lambda token, seq, verb, words:
        [say(f"{token} {seq - 1} RUN 0.9 0.9 9.0 9.0")] if verb == "GO" else [],
    "refusal of the command before": lambda token, seq, verb, words:
        [say(f"{token} {seq - 1} NO range")] if verb == "GO" else [],
    "refusal of another session": lambda token, seq, verb, words: [say(f"{OTHER} {seq} NO session")],
    "stall of the command before": lambda token, seq, verb, words:
        [say(f"{token} {seq - 1} DONE stalled 0.0 0.0 9.0 9.0")] if verb == "GO" else [],
    "HERE of the question before": lambda token, seq, verb, words:
        [say(f"{token} {seq} HERE {int(words[0]) - 1} 9.0 9.0 9.0 9.0")] if verb == "BEAT" else [],
    "HERE of another session": lambda token, seq, verb, words:
        [say(f"{OTHER} {seq} HERE {words[0]} 9.0 9.0 9.0 9.0")] if verb == "BEAT" else [],
    "HERE of the command before": lambda token, seq, verb, words:
        [say(f"{token} {seq - 1} HERE {words[0]} 9.0 9.0 9.0 9.0")] if verb == "BEAT" and seq else [],
    "HI to another greeting": lambda token, seq, verb, words:
        [say(f"{OTHER} 0 HI 99999999 0.5 9.0 9.0")] if verb == "HELLO" else [],
}


@pytest.mark.parametrize("wrong", list(WRONG))
def test_an_answer_to_something_else_is_none(wrong: str) -> None:
    line = HandMadeDenning(WRONG[wrong])
    base = DenningBase(line, nonce="12345678")
    for command in COMMANDS:
        report = base.execute(command)
        assert (report.turn_rad, report.move_m) == (command.turn_rad, command.move_m)
        assert (report.duration_s, report.sim_time_s) == (1.5, 2.5)
        there = base.odometry()
        assert (there.x_m, there.y_m, there.heading_rad, there.time_s) == (1.0, 2.0, 3.0, 4.0)
    assert line.verbs.count("HELLO") == 1 and line.verbs.count("GO") == len(COMMANDS)
