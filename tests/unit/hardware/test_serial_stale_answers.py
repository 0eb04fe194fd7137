"""Answers of right checksum that are stale, late, doubled or another's: a driver reports what the base really did.

A line may keep a frame in a buffer and deliver it after newer ones, or twice; a checksum does not tell. Denning answers
carry the session, the command's number and the question's number.
"""

from __future__ import annotations

import zlib
from collections.abc import Callable

import pytest

from harvey.hardware.drivers.denning import DenningBase
from tests.serial_bench import COMMANDS, check_what_is_reported_is_what_was_done


@pytest.mark.parametrize("how", ["doubled", "stale before", "stale after", "late"])
@pytest.mark.parametrize("seed", range(4))
def test_what_is_reported_is_what_was_done(how: str, seed: int) -> None:
    check_what_is_reported_is_what_was_done("denning", how, seed)


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
